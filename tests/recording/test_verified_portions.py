"""Verification in portions of any size gives the result of all ticks at once."""

from pathlib import Path

import numpy as np
import pytest

import rehearsed
from netboard.base.errors import RecordingError
from netboard.recording.files.reader import Recording
from netboard.recording.format.summary import Gap, find_attempts
from netboard.recording.integrity.verification import SLICE, verify, verify_portions, verify_recording
from netboard.recording.integrity.walk import walk
from netboard.stage.stage import make_stage
from samples import random_rows

pytestmark = pytest.mark.slow


def test_damage_anywhere_in_the_file_is_no_success(tmp_path: Path) -> None:
    path = rehearsed.write(tmp_path / "a.mcap", rehearsed.rows())
    with Recording(path) as recording:
        assert verify_recording(recording).identical
    data = bytearray(path.read_bytes())
    data[data.index(b"opened_utc") + 20] ^= 1
    path.write_bytes(data)
    with Recording(path) as recording, pytest.raises(RecordingError, match="checksum of the file is wrong"):
        verify_recording(recording)


@pytest.mark.parametrize("most", [1, 7, 999, SLICE + 1, 10**6])
def test_portions_of_any_size_give_the_same_verdict(most: int) -> None:
    rows = np.delete(rehearsed.rows(), slice(3000, 3010))[: 40 * min(most, 10**4)]
    portions = [rows[k : k + most] for k in range(0, len(rows), most)]
    verdict = verify_portions(make_stage(rehearsed.config()), portions)
    assert verdict == verify(make_stage(rehearsed.config()), rows)
    assert (verdict.identical, verdict.checked, verdict.gaps) == (True, len(rows), int(len(rows) > 3000))


def test_difference_is_located_by_tick_and_field() -> None:
    rows = rehearsed.rows()
    rows["omega"][SLICE + 5] = np.nextafter(rows["omega"][SLICE + 5], 1.0)
    verdict = verify_portions(make_stage(rehearsed.config()), [rows[:1000], rows[1000:]])
    assert (verdict.tick, verdict.field, verdict.checked) == (SLICE + 5, "omega", SLICE + 6)
    assert verdict.recorded == rows["omega"][SLICE + 5] != verdict.computed


@pytest.mark.parametrize("most", [1, 13, 4000, 10**6])
def test_walk_finds_the_same_attempts_as_all_ticks_at_once(most: int) -> None:
    rows = np.delete(rehearsed.rows(), slice(3000, 3010))
    seen = walk([rows[k : k + most] for k in range(0, len(rows), most)], rehearsed.config().block)
    assert repr(seen.attempts()) == repr(find_attempts(rows))
    assert (seen.count, seen.missing, seen.gaps) == (len(rows), 10, [Gap(3000, 10)])
    assert (seen.first["tick"][0], seen.last["tick"][0]) == (0, rows["tick"][-1])
    assert (seen.jumps, seen.force_where_none) == ([], 0)
    assert sum(len(turn) for turn in seen.turns) < 60


def test_walk_accepts_any_bits() -> None:
    rows = random_rows(500, seed=9)
    assert walk([rows[:77], rows[77:77], rows[77:]], None).count == 500
