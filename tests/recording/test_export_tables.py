"""Exported attempts and times of known rows, and a dictionary of every column."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from made_recordings import recorded, two_trials
from netboard.base.config import Config, parse
from netboard.base.errors import RecordingError
from netboard.base.tick import TICK
from netboard.recording.export.survey import Survey
from netboard.recording.export.tables import (
    CLOCKS,
    EVENTS,
    FRAMES,
    RECORDINGS,
    REMARKS,
    TABLES,
    TICKS,
    TRIALS,
    OpenRecording,
)
from netboard.recording.export.tabular import write_dictionary
from netboard.recording.files.reader import Recording
from netboard.recording.format.channels import CHANNELS
from netboard.recording.format.summary import attempts_along, find_attempts
from netboard.testing.difficult_recording import ATTEMPTS, ODD, START_NS, make_rows, same_bits, write


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("made") / "S01.mcap", make_rows())


def whole(path: Path, table) -> dict[str, np.ndarray]:
    with Recording(path) as recording:
        portions = list(table.portions(OpenRecording(recording)))
    return {field.name: np.concatenate([rows[field.name] for rows in portions]) for field in table.fields}


def test_tick_table_has_the_recorded_ticks_with_time_and_attempt(path: Path) -> None:
    rows, found = make_rows(), whole(path, TICKS)
    assert all(same_bits(found[name], rows[name]) for name in TICK.names)
    assert set(found["recording"]) == {"S01"}
    assert found["time"].tolist() == [tick / 1000 for tick in rows["tick"].tolist()]
    for row, number, since in zip(rows, found["number"], found["since_release"], strict=True):
        of = [k for k, (began, _, stop, *_) in enumerate(ATTEMPTS) if began <= row["tick"] < stop]
        assert number == (of[0] + 1 if of else 0)
        release = ATTEMPTS[of[0]][1] if of else 300
        assert since == (row["tick"] - release) / 1000 if row["tick"] >= release else np.isnan(since)


def test_trial_table_has_every_attempt_and_its_condition(tmp_path: Path) -> None:
    config = parse('[session]\ndyad = "D07"\n[block]\nforce = "none"\nforce_delay_ms = 3\ncatch = [2]')
    found = whole(write(tmp_path / "S01.mcap", make_rows(), config), TRIALS)
    assert found["outcome"].tolist() == ["fell", "success", "timed_out", "abort", "unfinished"]
    assert found["number"].tolist() == [1, 2, 3, 4, 5]
    places = zip(*(found[name].tolist() for name in ("began", "tick", "stop")), strict=True)
    assert list(places) == [attempt[:3] for attempt in ATTEMPTS]
    assert found["completion"][1] == 0.04
    assert np.isnan(found["completion"][[0, 2, 3, 4]]).all()
    assert found["catch_trial"].tolist() == [0, 0, 1, 1, 1]
    assert found["doubtful"][4] == -1
    assert set(found["doubtful"][:4]) <= {0, 1}
    assert set(found["session_dyad"]) == {"D07"}
    assert set(found["block_force"]) == {"none"}
    assert (found["block_force_delay_ms"].dtype, set(found["block_force_delay_ms"])) == (np.int64, {3})


def test_tables_of_the_other_channels_are_complete(path: Path) -> None:
    events, clocks, frames = (whole(path, table) for table in (EVENTS, CLOCKS, FRAMES))
    assert [json.loads(text) for text in events["details"]] == [{"text": ODD}, {}]
    assert events["time"].tolist() == [-0.001, 0.25]
    assert (clocks["time"][0], int(clocks["offset_ns"][0])) == (0.0015, 2**62 + 1)
    assert np.isnan(clocks["drift_ppm"][0])
    assert int(frames["painted_ns"][0]) == 2**61 + 3
    assert whole(path, REMARKS)["seq"].size == 0
    recordings = whole(path, RECORDINGS)
    assert (recordings["recording"][0], recordings["file"][0], int(recordings["origin_ns"][0])) == (
        "S01",
        "S01.mcap",
        START_NS,
    )
    assert json.loads(recordings["metadata"][0])["dyad"] == "D01"


def test_recording_without_ticks_has_empty_tables(tmp_path: Path) -> None:
    path = write(tmp_path / "S01.mcap", make_rows()[:0])
    with Recording(path) as recording:
        assert list(TICKS.portions(OpenRecording(recording))) == []
    assert whole(path, TRIALS)["number"].dtype == np.int64
    assert whole(path, TRIALS)["number"].size == 0


@given(st.lists(st.tuples(st.integers(0, 7), st.integers(0, 2), st.integers(0, 17)), max_size=40), st.integers(1, 7))
def test_attempts_found_in_portions_equal_those_of_all_ticks(values: list[tuple[int, int, int]], size: int) -> None:
    rows = np.zeros(len(values), TICK)
    rows["tick"] = np.arange(len(values))
    for name, column in zip(("phase", "trial", "event"), np.array(values, np.int64).reshape(-1, 3).T, strict=True):
        rows[name] = column
    portions = [rows[first : first + size] for first in range(0, len(rows), size)]
    assert repr(attempts_along(portions)) == repr(find_attempts(rows))  # repr, because NaN != NaN


def test_dictionary_describes_every_column_once_as_defined(tmp_path: Path) -> None:
    write_dictionary(tmp_path, TABLES, "somewhere")
    tables = json.loads((tmp_path / "dictionary.json").read_text(encoding="utf-8"))["tables"]
    assert list(tables) == [table.name for table in TABLES]
    for field in CHANNELS[0].columns:
        kind = "int64" if field.kind == "integer" else "float64"
        assert tables["ticks"]["columns"][field.name] == {"type": kind, "unit": field.unit, "description": field.text}
    with (tmp_path / "dictionary.csv").open(encoding="utf-8", newline="") as file:
        listed = [(row["table"], row["column"], row["unit"]) for row in csv.DictReader(file)]
    assert listed == [(table.name, field.name, field.unit) for table in TABLES for field in table.fields]
    assert len(set(listed)) == len(listed)
    numbers = [field for table in TABLES for field in table.fields if field.kind != "string"]
    assert all(field.unit and field.text for field in numbers)


def test_no_column_name_is_a_matlab_keyword() -> None:
    words = "break case catch classdef continue else elseif end for function global if otherwise parfor persistent"
    reserved = {*words.split(), "return", "spmd", "switch", "try", "while"}
    assert not reserved & {field.name for table in TABLES for field in table.fields}


def test_file_that_is_not_mcap_is_refused_with_its_name(tmp_path: Path) -> None:
    path = tmp_path / "S01.mcap"
    path.write_bytes(b"nothing")
    with pytest.raises(RecordingError, match=r"S01\.mcap: not an MCAP file"):
        whole(path, TICKS)


def test_condition_columns_come_from_the_configuration(path: Path) -> None:
    found, block = whole(path, TRIALS), Config().block
    assert set(found["block_force_scale"]) == {block.force_scale}
    assert set(found["block_left"]) == {"person"}


def test_attempt_with_a_missing_release_begins_with_it(tmp_path: Path) -> None:
    rows = two_trials()
    hole = slice(5990, 6300)
    ticks, trials = (whole(recorded(tmp_path, rows), table) for table in (TICKS, TRIALS))
    path = recorded(tmp_path, np.delete(rows, hole))
    holed_ticks, holed_trials = (whole(path, table) for table in (TICKS, TRIALS))
    np.testing.assert_array_equal(holed_ticks["since_release"], np.delete(ticks["since_release"], hole))
    for name in ("tick", "duration", "completion"):
        np.testing.assert_array_equal(holed_trials[name], trials[name])


@pytest.mark.parametrize("hole", [slice(5990, 6300), slice(0, 1500)])
def test_survey_of_a_recording_without_a_release_has_its_time(tmp_path: Path, hole: slice) -> None:
    """The survey is what Motion-BIDS and NWB write of an attempt."""
    rows = two_trials()
    with Recording(recorded(tmp_path, rows)) as recording:
        whole_one = Survey(recording)
    with Recording(recorded(tmp_path, np.delete(rows, hole))) as recording:
        holed = Survey(recording)
    late = (holed.origin_ns - whole_one.origin_ns) / 1e9
    for one, same in zip(holed.attempts, whole_one.attempts, strict=True):
        assert (one.tick, one.duration) == (same.tick, same.duration)
        assert holed.seconds(one.tick) == pytest.approx(whole_one.seconds(same.tick) - late, abs=1e-12)
        assert set(whole_one.flags[same.tick]) <= set(holed.flags[one.tick])
