"""Paths are stored on disk to the bit, and a study that reads them from disk is the same."""

from pathlib import Path

import pandas as pd
import pytest

from netboard.analysis.extraction.cache import PathTable
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import study_of
from netboard.analysis.report.trials import sparklines
from netboard.analysis.topics.influence import influences
from netboard.analysis.topics.paths import mean_paths
from netboard.base.errors import RecordingError
from report_studies import block

BLOCKS = [block("one", block=1), block("two", block=2)]


def stored(folder: Path) -> PathTable:
    table = PathTable(folder)
    for one in BLOCKS[::-1]:
        table.put(one)
    return table


def test_stored_paths_are_read_back_exactly(tmp_path: Path) -> None:
    table = stored(tmp_path)
    assert sorted(table) == ["one", "two"]
    for one in BLOCKS:
        paths = table[one.blocks["recording"][0]]
        assert len(paths) > 100
        pd.testing.assert_frame_equal(paths, pd.DataFrame(one.paths), check_exact=True)


def test_study_with_stored_paths_has_the_same_results(tmp_path: Path) -> None:
    held = study_of(BLOCKS, Readings())
    read = study_of(BLOCKS, Readings(), stored(tmp_path))
    assert len(mean_paths(held).results) > 1
    # As text: a number that is unknown, NaN, does not equal itself.
    assert repr(mean_paths(read).results) == repr(mean_paths(held).results)
    assert repr(influences(read).results) == repr(influences(held).results)
    assert len(sparklines(held)) == len(held.trials)
    assert sparklines(read) == sparklines(held)


def test_recording_without_attempts_has_no_paths(tmp_path: Path) -> None:
    table = PathTable(tmp_path)
    nothing = block("none")
    for values in (nothing.trials, nothing.movements, nothing.paths):
        values.update({name: column[:0] for name, column in values.items()})
    table.put(nothing)
    study = study_of([nothing], Readings(), table)
    assert list(table["none"]) == list(nothing.paths)
    assert sparklines(study) == {}
    assert mean_paths(study).parts == ()


def test_unwritable_folder_is_reported(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"0.paths: cannot be written: No such file or directory"):
        PathTable(tmp_path / "gone").put(BLOCKS[0])
