"""Ticks without a sample are filled in from the agents' later reports, with every way of reading."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from netboard.base.errors import RecordingError
from netboard.base.tick import RENDERED, TICK
from netboard.network.protocol.records import BackfillRecord, TickRecord
from netboard.recording.files.reader import Recording
from netboard.recording.format.backfill import Backfilled, unknown_ticks
from netboard.recording.format.summary import summarise_side
from netboard.recording.integrity.checking import check_rendered
from netboard.recording.integrity.severity import Severity
from netboard.recording.recovery.recover import recover
from samples import OPENED_NS, new_writer

MS = 1_000_000
CLOCK_NS = 77 * 10**12
COUNT, BEGAN, CUT, BACK = 900, 100, 300, 800
"""Ticks; the agent's first; those between are without a sample of it."""
REPORTED = slice(350, BACK)


def ticks() -> Any:
    rows = np.zeros(COUNT, TICK)
    rows["tick"], rows["time_ns"] = np.arange(COUNT), 10**12 + MS * np.arange(COUNT)
    rows["phase"] = 2
    rows["left_rendered"], rows["left_safeguards"] = 0.43, 1
    rows["left_rendered"][:BEGAN] = rows["left_rendered"][CUT:BACK] = rows["right_rendered"][:] = np.nan
    rows["left_safeguards"][:BEGAN] = rows["left_safeguards"][CUT:BACK] = 0
    return rows


def backfilled() -> Any:
    rows = np.zeros(COUNT, RENDERED)[REPORTED]
    rows["seq"] = np.arange(COUNT)[REPORTED]
    rows["stamp_ns"] = 10**12 + MS * rows["seq"] - 300_000 + CLOCK_NS
    rows["rendered"], rows["safeguards"] = 1e-3 * rows["seq"], 16
    return rows


def records(rows: Any) -> list[BackfillRecord]:
    return [
        BackfillRecord(k, "left", CLOCK_NS, rows[64 * k : 64 * k + 64].tobytes()) for k in range(-(-len(rows) // 64))
    ]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("backfill") / "a.mcap"
    writer = new_writer(path)
    stream = [*(TickRecord(row.tobytes()) for row in ticks()), *records(backfilled())]
    for number, record in enumerate(stream):
        writer.write(record, number, OPENED_NS + MS * number)
    writer.finish(OPENED_NS + MS * len(stream))
    return path


def expected() -> Any:
    rows = ticks()
    rows["left_rendered"][REPORTED], rows["left_safeguards"][REPORTED] = 1e-3 * np.arange(COUNT)[REPORTED], 16
    return rows


def test_every_read_method_fills_in_backfilled_forces(path: Path) -> None:
    whole = expected()
    with Recording(path) as recording:
        assert recording.ticks().tobytes() == whole.tobytes()
        assert recording.ticks(400, 500).tobytes() == whole[400:500].tobytes()
        assert b"".join(rows.tobytes() for rows in recording.batches(100)) == whole.tobytes()
        some = np.concatenate(list(recording.batches(100, ["right_rendered", "left_rendered", "p"])))
        assert some.dtype.names == ("right_rendered", "left_rendered", "p")
        np.testing.assert_array_equal(some["left_rendered"], whole["left_rendered"])
        columns = recording.columns("left_safeguards", first=350)
        np.testing.assert_array_equal(columns["left_safeguards"], whole["left_safeguards"][350:])
        np.testing.assert_array_equal(recording.columns("left_rendered")["left_rendered"], whole["left_rendered"])
        assert recording.gaps() == {}


def test_ticks_as_sent_are_returned_bit_for_bit(path: Path) -> None:
    with Recording(path) as recording:
        assert recording.ticks(as_sent=True).tobytes() == ticks().tobytes()
        assert b"".join(rows.tobytes() for rows in recording.batches(as_sent=True)) == ticks().tobytes()


def test_recovered_recording_keeps_the_backfilled_forces(path: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap.part"
    cut.write_bytes(path.read_bytes()[:-500])
    with Recording(recover(cut).output) as recording:
        assert recording.ticks().tobytes() == expected().tobytes()


def test_number_of_ticks_with_unknown_force_is_reported(path: Path) -> None:
    with Recording(path) as recording:
        left, right = (summarise_side(recording.ticks(), side) for side in ("left", "right"))
        (finding,) = check_rendered(recording)
    assert left.unknown_ticks == 350 - CUT == unknown_ticks(expected()["left_rendered"])
    assert left.largest_force == pytest.approx(0.799)
    assert (right.unknown_ticks, np.isnan(right.largest_force)) == (0, True)
    assert finding.severity is Severity.LOSS
    assert finding.text == "the rendered force of the left device is unknown at 50 ticks, 50 of them in trials"


def test_unknown_force_outside_of_trials_is_not_counted() -> None:
    unknown = np.array([np.nan, 0.0, np.nan, np.nan, 1.0])
    assert unknown_ticks(unknown) == 2
    assert unknown_ticks(unknown, np.array([True, True, True, False, True])) == 1
    assert unknown_ticks(np.full(3, np.nan)) == 0


def test_force_held_by_a_stalled_agent_is_filled_in() -> None:
    rows, reports = ticks(), backfilled()
    kept = reports[(reports["seq"] < 400) | (reports["seq"] >= 430)].copy()
    kept["seq"][kept["seq"] >= 430] -= 30
    Backfilled(records(kept)).fill(rows)
    np.testing.assert_array_equal(rows["left_rendered"][399:430], 0.399)
    rows = ticks()
    Backfilled(records(reports[(reports["seq"] < 400) | (reports["seq"] >= 430)])).fill(rows)
    assert np.isnan(rows["left_rendered"][402:430]).all()


def test_safeguards_of_all_samples_of_a_tick_are_combined() -> None:
    rows, reports = ticks(), backfilled()
    reports["stamp_ns"] = 10**12 + CLOCK_NS + (MS * reports["seq"]) // 2
    reports["safeguards"] = 1 << (reports["seq"] % 8)
    Backfilled(records(reports)).fill(rows)
    assert rows["left_safeguards"][300] == (1 << (600 % 8)) | (1 << (599 % 8))


def test_truncated_backfill_record_is_refused() -> None:
    with pytest.raises(RecordingError, match="backfill record 3"):
        Backfilled([BackfillRecord(3, "left", 0, b"123")])
