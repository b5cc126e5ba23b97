"""Selection of the recordings that a command names."""

from pathlib import Path

import pytest

from netboard.base.errors import RecordingError
from netboard.recording.files.locate import files_below, find_recordings, find_unfinished, require_file


def test_recordings_of_files_and_folders_are_listed_once_in_order(tmp_path: Path) -> None:
    for name in ("b.mcap", "a.mcap", "c.mcap.part", "notes.txt", "._a.mcap"):  # the last as macOS writes it
        (tmp_path / name).touch()
    a, b = tmp_path / "a.mcap", tmp_path / "b.mcap"
    assert find_recordings([b, tmp_path]) == (b, a)
    assert find_recordings([tmp_path]) == (a, b)
    assert files_below(tmp_path, (".mcap",)) == [a, b]


def test_empty_folder_and_equal_names_are_refused(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match="empty: there is no recording"):
        find_recordings([tmp_path / "empty"])
    (tmp_path / "empty" / "a.mcap.part").touch()
    with pytest.raises(RecordingError, match=r"in this folder; a\.mcap\.part is unfinished; netboard recover makes"):
        find_recordings([tmp_path / "empty"])
    with pytest.raises(RecordingError, match="have the same name"):
        find_recordings([tmp_path / "x" / "a.mcap", tmp_path / "y" / "a.mcap"])


def test_path_that_no_table_can_contain_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "gr\udcf6\udcdfe.mcap"  # Latin-1, as a disk of another system has it
    with pytest.raises(RecordingError, match="not valid UTF-8, so no table can contain it; rename it"):
        find_recordings([path])


def test_unfinished_recordings_are_those_not_recovered(tmp_path: Path) -> None:
    recovered = ("c.mcap.part", "c.recovered.mcap", "d.spill", "d.recovered.mcap")
    blocks = ("e.spill", "e_block02.recovered.mcap")
    for name in ("a.mcap", "b.mcap.part", "b.spill", *recovered, *blocks):
        (tmp_path / name).touch()
    found = find_unfinished([tmp_path, tmp_path / "a.mcap"])
    assert found == (tmp_path / "b.mcap.part", tmp_path / "b.spill")


def test_folder_in_place_of_a_recording_is_refused_with_the_command_that_lists_it(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"is a folder, expected a recording; netboard sessions .* lists those"):
        require_file(tmp_path)
