"""Response to pushes of a study: made courses with a known deviation, and perturbation trials in environments."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from made_study import Block, Row, made_study
from netboard.analysis.extraction.recordings import measure
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.topics.pushes import LEAST, picture, pushes
from netboard.base.config import parse
from netboard.recording.export.runs import runs_of
from netboard.recording.files.offline_writer import BlockWriter
from netboard.services.cli import app

ONSET, TAU = 0.5, 0.3
HEIGHTS = {"full": 0.02, "none": 0.05}


def bump(time: np.ndarray) -> np.ndarray:
    """A deviation of height 1 that begins at the onset and has its peak after `TAU`."""
    after = np.clip(time - ONSET, 0.0, None)
    return after / TAU * np.exp(1.0 - after / TAU)


def trial_of(number: int, place: str = "ball") -> Row:
    """Every second trial is pushed, in one direction and in the other."""
    push = (0.05 if number % 4 == 0 else -0.05) if number % 2 == 0 else 0.0
    return {
        "completion": 3.0,
        "duration": 4.5,
        "target": 1 if number % 3 else -1,
        "perturbation": push,
        "pushed": place,
        "push_onset": ONSET,
    }


def pushed_study(place: str = "ball", trials: int = 12, dyads: int = 3) -> StudyData:
    """A study whose deviations are those of `HEIGHTS`, a little more from dyad to dyad."""
    blocks = [
        Block(f"D{d}", f"D{d}", "dyadic", force, [trial_of(k, place) for k in range(1, trials + 1)], right_by=f"D{d}B")
        for d in range(1, dyads + 1)
        for force in HEIGHTS
    ]
    study = made_study(blocks)
    time, paths = np.arange(0.0, 4.5, 0.02), {}
    for (recording, force), rows in study.trials.groupby(["recording", "force"]):
        height = HEIGHTS[force] * (1.0 + 0.1 * int(str(recording)[1:2]))
        paths[recording] = pd.concat([_path(row, time, height) for _, row in rows.iterrows()])
    return replace(study, paths=paths)


def _path(row: pd.Series, time: np.ndarray, height: float) -> pd.DataFrame:
    deviation = np.sign(row["perturbation"]) * height * bump(time)
    usual, at = 0.05 * np.sin(time), {"ball": "p", "left": "left_z"}.get(row["pushed"], "")
    columns = {name: usual.copy() for name in ("left_z", "right_z")} | {"p": row["target"] * (0.2 * time - 0.15)}
    for name in [at] if at else ["left_z", "right_z"]:
        columns[name] += deviation * (row["target"] if name == "p" else 1.0)
    place = {name: row[name] for name in ("recording", "trial", "attempt")}
    return pd.DataFrame({**place, "time": time, **columns})


@pytest.mark.parametrize("place", ["ball", "board", "left"])
def test_deviation_of_the_pushed_trials_is_found(place: str) -> None:
    found = {one.condition.force: one for one in pushes(pushed_study(place)).parts}
    assert set(found) == {"none", "full"}
    for force, one in found.items():
        assert (one.place, one.trials) == (place, 18)
        assert one.estimate("peak displacement").value == pytest.approx(1.2 * HEIGHTS[force], rel=1e-3)
        assert one.estimate("time of the peak displacement").value == pytest.approx(TAU)
        assert one.estimate("time until half-way back").value == pytest.approx(2.678 * TAU, abs=2e-3)


def test_haptics_on_and_off_are_compared_within_dyads() -> None:
    results = pushes(pushed_study()).results
    (found,) = (one for one in results if one.quantity == "peak displacement after a push at the ball: difference")
    assert found.group == "dyadic, haptics on vs off"
    assert found.value == pytest.approx(1.2 * (HEIGHTS["full"] - HEIGHTS["none"]), rel=1e-3)
    assert (found.n, found.unit, found.interval) == (3, "m", "95 % t")


@pytest.mark.parametrize(
    "change",
    [
        lambda study: replace(study, paths={name: path.iloc[:0] for name, path in study.paths.items()}),
        lambda study: replace(study, trials=study.trials.assign(duration=ONSET + 0.5)),
        lambda study: replace(study, trials=study.trials.assign(push_onset=np.nan)),
        lambda study: replace(study, exclusions=study.exclusions.assign(why="quality: lost_samples")),
    ],
    ids=["no paths", "too short", "no onset", "excluded for another reason"],
)
def test_without_enough_trials_there_is_no_response(change: Callable[[StudyData], StudyData]) -> None:
    study = change(pushed_study())
    assert pushes(study).results == ()
    drawn = picture(study)
    assert drawn.figure is None
    assert f"No performer has {LEAST} perturbation trials" in drawn.caption


def test_figure_has_a_curve_for_each_condition() -> None:
    drawn = picture(pushed_study())
    assert drawn.figure is not None
    assert len(drawn.figure.axes[0].lines) == 3, "two conditions and the line of no effect"
    assert "of 3 dyads" in drawn.caption


PUSH = '[block]\nfirst_target = "right"\nforce = "full"\n[perturbation]\nforce = {force}\nduration = 0.05\n'


def episode_of(text: str, folder: Path) -> Path:
    """Write the first episode of an environment, in which a competent brain holds both hands, as a recording."""
    pytest.importorskip("gymnasium", reason="needs netboard[environments]")
    from netboard.participants.environments.vector import BoardVectorEnv

    many = BoardVectorEnv(1, seat="both", truth=True, record=True, max_seconds=30.0, config=parse(text))
    many.reset(seed=4)
    while not many.scenes.finished:
        many.step(np.zeros((1, 2), np.float32))
    ((config, rows), *_) = many.scenes.finished
    writer = BlockWriter(folder, config, f"{0:032x}", 0)
    writer.take(rows)
    writer.finish()
    return writer.path


@pytest.mark.slow
@pytest.mark.parametrize("place", ["ball", "board", "left", "right"])
def test_push_in_an_environment_is_recorded_verifies_and_is_measured(place: str, tmp_path: Path) -> None:
    force = 0.02 if place == "ball" else 0.5
    text = PUSH.format(force=force) + f'at = "{place}"\ntime = 0.1\ntrials = [1]\n'
    path = episode_of(text, tmp_path)
    result = CliRunner().invoke(app, ["check", "--verify", str(path)])
    assert "identical to the bit" in result.output
    trials = measure(runs_of([path])[0], Readings()).trials
    assert (trials["pushed"][0], trials["perturbation"][0]) == (place, force)
    assert trials["push_onset"][0] == trials["perturbed_at"][0] == pytest.approx(0.1, abs=0.0011)


@pytest.mark.slow
@pytest.mark.parametrize(("onset", "when"), [("time", 0.1), ("ball", 0.0)])
def test_trial_without_a_push_has_the_onset_that_it_would_have_had(onset: str, when: float, tmp_path: Path) -> None:
    rest = f'at = "ball"\nonset = "{onset}"\ntime = 0.1\nposition = -0.5\ntrials = [7]\n'
    path = episode_of(PUSH.format(force=0.02) + rest, tmp_path)
    trials = measure(runs_of([path])[0], Readings()).trials
    assert np.isnan(trials["perturbed_at"][0])
    assert (trials["pushed"][0], trials["perturbation"][0]) == ("ball", 0.0)
    assert trials["push_onset"][0] == pytest.approx(when)
