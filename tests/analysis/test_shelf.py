"""Paths are stored on disk to the bit, and a study that reads them from disk is the same."""

from pathlib import Path

import pandas as pd
import pytest

from netboard.analysis.extraction.cache import PathTable
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import study_of
from netboard.analysis.report.trials import sparklines
from netboard.analysis.topics.influence import influences
from netboard.analysis.topics.paths import courses
from netboard.base.errors import RecordingError
from report_studies import block

BLOCKS = [block("one", block=1), block("two", block=2)]


def shelved(folder: Path) -> PathTable:
    shelf = PathTable(folder)
    for one in BLOCKS[::-1]:
        shelf.put(one)
    return shelf


def test_paths_are_read_as_they_were(tmp_path: Path) -> None:
    shelf = shelved(tmp_path)
    assert sorted(shelf) == ["one", "two"]
    for one in BLOCKS:
        paths = shelf[one.blocks["recording"][0]]
        assert len(paths) > 100
        pd.testing.assert_frame_equal(paths, pd.DataFrame(one.paths), check_exact=True)


def test_a_study_that_reads_them_there_is_the_same(tmp_path: Path) -> None:
    held = study_of(BLOCKS, Readings())
    read = study_of(BLOCKS, Readings(), shelved(tmp_path))
    assert len(courses(held).results) > 1
    assert courses(read).results == courses(held).results
    assert influences(read).results == influences(held).results
    assert len(sparklines(held)) == len(held.trials)
    assert sparklines(read) == sparklines(held)


def test_a_recording_without_attempts_has_no_paths(tmp_path: Path) -> None:
    shelf = PathTable(tmp_path)
    nothing = block("none")
    for values in (nothing.trials, nothing.movements, nothing.paths):
        values.update({name: column[:0] for name, column in values.items()})
    shelf.put(nothing)
    study = study_of([nothing], Readings(), shelf)
    assert list(shelf["none"]) == list(nothing.paths)
    assert sparklines(study) == {}
    assert courses(study).courses == ()


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"0.paths: cannot be written: No such file or directory"):
        PathTable(tmp_path / "gone").put(BLOCKS[0])
