"""Completion times: the hold equals that of the trial state machine; recorded successes are used or reported."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from made_study import Block, made_study, times
from netboard.analysis.extraction.recordings import Measured, measure
from netboard.analysis.extraction.settings import Readings, parse
from netboard.analysis.extraction.study import notes, study_of
from netboard.analysis.measures.motion import find_completion
from netboard.base.config import Config
from netboard.base.tick import STATE
from netboard.recording.export.runs import runs_of
from netboard.recording.importing.table_import import ImportOptions, import_table
from netboard.stage.trial_steps import decide
from netboard.task.trials.state_machine import Cause, Phase, pack_rules

RATE = 1000.0


def ticks_to_entry(p: np.ndarray, hold: float) -> int | None:
    """Run the trial state machine over a ball's path from its release; return the ticks to the entry, or None."""
    config = Config()
    rules = pack_rules(replace(config.task, hold_time=hold), config.geometry, config.block)[0]
    state = np.zeros(1, STATE)
    s: Any = state[0]
    s["phase"], s["target"], s["trial"], s["attempt"] = Phase.RUNNING, 1, 1, 1
    for place in p:
        s["p"] = place
        if decide(s, Cause.NONE, rules) == Cause.HELD:
            return int(s["mark_ticks"])
    return None


@given(st.lists(st.tuples(st.booleans(), st.integers(1, 24)), min_size=1, max_size=12), st.integers(1, 20))
def test_hold_equals_that_of_the_trial_state_machine(stays: list[tuple[bool, int]], hold_ticks: int) -> None:
    p = np.concatenate([np.full(length, 0.15 if inside else 0.0) for inside, length in stays])
    found = find_completion(p, RATE, 0.15, hold=hold_ticks / RATE)
    live = ticks_to_entry(p, hold_ticks / RATE)
    assert (found.sample is None) == (live is None)
    if found.sample is not None:
        assert live == found.sample + 1, "the state machine also counts the tick in which the ball enters"


def imported(folder: Path, inside: int, recorded_time: float | None, outcome: str = "success") -> Measured:
    """Import one trial whose ball is in the target for its last `inside` samples."""
    before, rest = 2000, 500
    count = before + inside + rest
    time = np.arange(count) / RATE
    p = np.where((np.arange(count) >= before) & (np.arange(count) < before + inside), 0.15, -0.1)
    running = np.arange(count) < before + inside
    lines = ["time,left_z,right_z,left_vz,right_vz,theta,p,trial,target,outcome,completion"]
    for k in range(count):
        last = k == before + inside - 1
        words = (outcome, "" if recorded_time is None else f"{recorded_time}") if last else ("", "")
        hand = 1e-3 * np.sin(3.0 * time[k])
        place = f"{time[k]:.3f},{hand},{-hand},0,0,0,{p[k]},{int(running[k])},{int(running[k])}"
        lines.append(f"{place},{words[0]},{words[1]}")
    table = folder / f"t{inside}_{recorded_time}_{outcome}.csv"
    table.write_text("\n".join(lines) + "\n")
    done = import_table(table, folder / table.stem, Config(), ImportOptions(), 0, lambda *progress: None)
    return measure(runs_of([done.path])[0], Readings())


@pytest.mark.parametrize(
    ("inside", "recorded_time", "source", "time"),
    [
        (1501, 2.0, "samples", 2.0),
        (1500, 2.0, "recording", 2.0),
        (1200, 2.0, "recording", 2.0),
        (1501, 1.7, "samples", 2.0),
    ],
)
def test_imported_success_keeps_its_completion_time(
    tmp_path: Path, inside: int, recorded_time: float, source: str, time: float
) -> None:
    one = imported(tmp_path, inside, recorded_time)
    assert one.trials["completion"] == pytest.approx([time])
    assert list(one.trials["completion_source"]) == [source]
    assert one.trials["recorded_completion"] == pytest.approx([recorded_time])
    study = study_of([one], Readings())
    assert (len(study.counted), len(study.exclusions)) == (1, 0)
    assert len(notes(study)) == (source == "recording" or time != recorded_time)


def test_attempt_recorded_as_failed_has_no_completion_time(tmp_path: Path) -> None:
    one = imported(tmp_path, 1501, None, "fell")
    assert np.isnan(one.trials["completion"]).all()
    assert list(one.trials["outcome"]) == ["fell"]


def test_aborted_attempt_is_listed_with_its_reason(tmp_path: Path) -> None:
    one = imported(tmp_path, 300, None, "abort")
    study = study_of([one], Readings())
    assert (int(study.blocks["attempts"][0]), len(study.trials)) == (1, 0)
    assert list(study.exclusions["why"]) == ["ended without success, fall or timeout: abort"]


def test_success_without_a_completion_time_is_excluded() -> None:
    rows = [*times(1.0, 2.0), {"completion": np.nan}]
    study = made_study([Block("D01", "D01", "dyadic", "full", rows)])
    assert list(study.trials["counts"]) == [1, 1, 0]
    assert len(study.exclusions) == 1
    assert parse("").completion.inside == "centre"
