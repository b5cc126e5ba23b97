"""Recordings of the same ticks are found: copies, and blocks that two loggers recorded as different parts."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from netboard.base.errors import RecordingError
from netboard.base.tables.rig import Recording as Settings
from netboard.recording.files.copies import copies_among
from netboard.recording.files.reader import Recording
from netboard.recording.files.writer import RecordingWriter
from samples import CONFIG_TEXT, OPENED_NS, fill, metadata, random_rows

ROWS = random_rows(60, seed=5)
ROWS["tick"], ROWS["theta"] = np.arange(60), np.linspace(0.0, 0.1, 60)


def write_part(path: Path, part: int, ticks: Sequence[int], rows: NDArray[Any] = ROWS) -> Path:
    """Write a part of the block with these ticks."""
    writer = RecordingWriter(path, metadata() | {"part": str(part)}, CONFIG_TEXT, Settings(), OPENED_NS)
    writer.finish(fill(writer, rows[list(ticks)]))
    return path


def test_part_whose_ticks_are_all_in_another_part_is_to_be_left_out(tmp_path: Path) -> None:
    whole = write_part(tmp_path / "a.mcap", 1, range(60))
    for name, ticks in (("all.mcap", range(60)), ("some.mcap", range(20, 41))):
        inner = write_part(tmp_path / name, 2, ticks)
        words = f"two loggers recorded the same ticks of a block; leave out {inner}"
        assert list(copies_among([whole, inner])) == [f"{whole} and {inner}: {words}"]
    assert list(copies_among([inner, whole])) == [f"{inner} and {whole}: {words}"]


def test_parts_with_ticks_of_their_own_are_no_copies(tmp_path: Path) -> None:
    first = write_part(tmp_path / "a.mcap", 1, [*range(20), *range(30, 45)])
    after = write_part(tmp_path / "b.mcap", 2, range(40, 60))  # begins before the first part's unacknowledged end
    between = write_part(tmp_path / "c.mcap", 3, range(20, 30))
    empty = write_part(tmp_path / "d.mcap", 4, [])
    assert not list(copies_among([first, after, between, empty]))


def test_parts_with_the_same_numbers_but_other_ticks_are_no_copies(tmp_path: Path) -> None:
    first, other = (write_part(tmp_path / f"{part}.mcap", part, range(60)) for part in (1, 2))
    assert list(copies_among([first, other]))
    other.unlink()
    changed = ROWS.copy()
    changed["theta"][7] += 0.5
    assert not list(copies_among([first, write_part(other, 2, range(60), changed)]))


def test_damaged_part_is_left_to_the_check_of_its_ticks(tmp_path: Path) -> None:
    parts = [write_part(tmp_path / f"{part}.mcap", part, range(60)) for part in (1, 2)]
    assert list(copies_among(parts))
    content = bytearray(parts[1].read_bytes())
    for place in range(1000, len(content) // 2):
        content[place] ^= 1
    parts[1].write_bytes(content)
    with pytest.raises(RecordingError), Recording(parts[1]) as recording:
        recording.ticks()
    assert not list(copies_among(parts))
