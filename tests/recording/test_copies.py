"""Recordings of the same ticks are found: copies, and blocks that two loggers recorded as different parts."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from netboard.base.errors import RecordingError
from netboard.base.tables.rig import RecordingSettings as Settings
from netboard.recording.files.copies import Conflict, Copy, each_recording_once, repeats_among
from netboard.recording.files.reader import Recording
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.integrity.checking import check
from netboard.recording.recovery.recover import recover
from samples import CONFIG_TEXT, OPENED_NS, fill, metadata, random_rows

ROWS = random_rows(60, seed=5)
ROWS["tick"], ROWS["theta"] = np.arange(60), np.linspace(0.0, 0.1, 60)


def write_part(path: Path, part: int, ticks: Sequence[int], rows: NDArray[Any] = ROWS) -> Path:
    """Write a part of the block with these ticks."""
    writer = RecordingWriter(path, metadata() | {"part": str(part)}, CONFIG_TEXT, Settings(), OPENED_NS)
    writer.finish(fill(writer, rows[list(ticks)]))
    return path


def test_part_whose_ticks_are_all_in_another_part_is_a_copy(tmp_path: Path) -> None:
    whole = write_part(tmp_path / "a.mcap", 1, range(60))
    for name, ticks in (("all.mcap", range(60)), ("some.mcap", range(20, 41))):
        inner = write_part(tmp_path / name, 2, ticks)
        copy = Copy(inner, whole, "two loggers recorded the same ticks")
        assert repeats_among([whole, inner]) == ((copy,), ())
    assert repeats_among([inner, whole]) == ((copy,), ())


def test_parts_with_ticks_of_their_own_are_no_copies(tmp_path: Path) -> None:
    first = write_part(tmp_path / "a.mcap", 1, [*range(20), *range(30, 45)])
    after = write_part(tmp_path / "b.mcap", 2, range(40, 60))  # begins before the first part's unacknowledged end
    between = write_part(tmp_path / "c.mcap", 3, range(20, 30))
    empty = write_part(tmp_path / "d.mcap", 4, [])
    assert not any(repeats_among([first, after, between, empty]))


def test_recordings_of_the_same_part_with_other_ticks_are_in_conflict(tmp_path: Path) -> None:
    first, other = (write_part(tmp_path / name, 1, range(60)) for name in ("a.mcap", "b.mcap"))
    assert repeats_among([first, other]).copies
    other.unlink()
    changed = ROWS.copy()
    changed["theta"][7] += 0.5
    write_part(other, 1, range(60), changed)
    conflict = Conflict(first, other, "claim to be the same part of a block, and differ at tick 7")
    assert repeats_among([first, other]) == ((), (conflict,))
    with pytest.raises(RecordingError, match="differ at tick 7; keep the right one and move the other away"):
        each_recording_once([first, other])


def test_parts_with_the_same_numbers_but_other_ticks_are_no_copies(tmp_path: Path) -> None:
    changed = ROWS.copy()
    changed["theta"][7] += 0.5
    parts = [write_part(tmp_path / "a.mcap", 1, range(60)), write_part(tmp_path / "b.mcap", 2, range(60), changed)]
    assert not any(repeats_among(parts))


def test_pieces_of_one_part_with_common_ticks_are_in_conflict(tmp_path: Path) -> None:
    one, other = write_part(tmp_path / "a.mcap", 1, range(40)), write_part(tmp_path / "b.mcap", 1, range(20, 60))
    (conflict,) = repeats_among([one, other]).conflicts
    assert "have 20 ticks of the same part of a block in common, and each has others" in str(conflict)


def test_file_under_two_names_is_a_copy(tmp_path: Path) -> None:
    whole = write_part(tmp_path / "a.mcap", 1, range(60))
    (tmp_path / "sub").mkdir()
    link, other = tmp_path / "sub" / "b.mcap", tmp_path / "sub" / "c.mcap"
    link.symlink_to(whole)
    other.hardlink_to(whole)
    found = repeats_among([whole, link, other])
    assert [(copy.path, copy.of, copy.why) for copy in found.copies] == [
        (link, whole, "the same file under another name"),
        (other, whole, "the same file under another name"),
    ]


def test_recovered_file_beside_its_original_is_a_copy(tmp_path: Path) -> None:
    whole = write_part(tmp_path / "a.mcap", 1, range(60))
    cut = tmp_path / "b.mcap.part"
    cut.write_bytes(whole.read_bytes()[:-2000])
    recovered = recover(cut).output
    assert repeats_among([recovered, whole]).copies == (Copy(recovered, whole, "recovered, with the same ticks"),)


def test_check_names_the_finished_file_of_an_unfinished_one(tmp_path: Path) -> None:
    whole = write_part(tmp_path / "a.mcap", 1, range(60))
    left = tmp_path / "a.mcap.part"
    left.write_bytes(whole.read_bytes()[:-2000])
    assert check(left).findings[-1].text.endswith(f"; {whole} has all of these ticks")
    whole.unlink()
    assert "has all of these ticks" not in check(left).findings[-1].text


def test_same_ticks_of_another_session_are_no_copy_unless_they_were_imported(tmp_path: Path) -> None:
    """Two original recordings are never the same by chance, but an import gets a session of its own."""
    whole = write_part(tmp_path / "a.mcap", 1, range(60))
    other = CONFIG_TEXT.replace("S01", "S02")
    about = metadata(other) | {"session": "77aa000000000000"}
    for imported in ({}, {"imported": "ticks", "imported_from": "a.csv"}):
        path = tmp_path / f"{len(imported)}.mcap"
        writer = RecordingWriter(path, about | imported, other, Settings(), OPENED_NS)
        writer.finish(fill(writer, ROWS))
        copies = repeats_among([path, whole]).copies
        assert copies == ((Copy(path, whole, "imported from a.csv, with the same ticks"),) if imported else ())


def test_imported_ticks_that_were_changed_are_in_conflict(tmp_path: Path) -> None:
    whole = write_part(tmp_path / "a.mcap", 1, range(60))
    changed = ROWS.copy()
    changed["theta"][7] += 0.5
    about = metadata() | {"session": "77aa000000000000", "imported": "ticks", "imported_from": "a.csv"}
    writer = RecordingWriter(tmp_path / "b.mcap", about, CONFIG_TEXT, Settings(), OPENED_NS)
    writer.finish(fill(writer, changed))
    (conflict,) = repeats_among([whole, tmp_path / "b.mcap"]).conflicts
    assert conflict.why == "have 59 ticks in common, and others differ, from tick 7 on"


def test_not_a_number_of_a_text_table_is_the_same(tmp_path: Path) -> None:
    rows = ROWS.copy()
    rows["left_x"][5:9] = np.nan
    whole = write_part(tmp_path / "a.mcap", 1, range(60), rows)
    rows["left_x"].view(np.int64)[5:9] += 1
    assert len(repeats_among([whole, write_part(tmp_path / "b.mcap", 1, range(60), rows)]).copies) == 1


def test_damaged_part_is_left_to_the_check_of_its_ticks(tmp_path: Path) -> None:
    parts = [write_part(tmp_path / f"{part}.mcap", part, range(60)) for part in (1, 2)]
    assert any(repeats_among(parts))
    content = bytearray(parts[1].read_bytes())
    for place in range(1000, len(content) // 2):
        content[place] ^= 1
    parts[1].write_bytes(content)
    with pytest.raises(RecordingError), Recording(parts[1]) as recording:
        recording.ticks()
    assert not any(repeats_among(parts))
