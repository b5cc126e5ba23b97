"""Tests that every export format must pass; each format's test class derives from `ExportFormatContract`."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from netboard.base.errors import ConfigError, RecordingError
from netboard.recording.export.formats import export, names
from netboard.testing.difficult_recording import make_rows, same_bits, without_payloads, write

Columns = Mapping[str, NDArray[Any]]
"""Columns of the table of ticks, by the names of a recording."""


def ignored(what: str, done: int, total: int) -> None:
    """Take the progress of an export."""


class ExportFormatContract(ABC):
    """Derive ``class TestMine(ExportFormatContract)``, name the format, and define how its files are read."""

    name: str
    """Name of the format, as registered."""
    keeps_payloads = True
    """Whether a not-a-number keeps its bits; no text does."""

    @abstractmethod
    def read(self, folder: Path, recording: str) -> Columns:
        """Return what the files have of the ticks of a recording, named without its suffix, in their own types.

        Read them by another library than the one that wrote them, if there is one.
        """

    @pytest.fixture
    def recordings(self, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
        """Two recordings of the same session."""
        folder = tmp_path_factory.mktemp("recordings")
        return [write(folder / "S01.mcap", make_rows(1)), write(folder / "S02.mcap", make_rows(2), part=2)]

    def test_format_is_registered(self) -> None:
        assert self.name in names()

    def test_every_column_keeps_its_bits(self, recordings: list[Path], tmp_path: Path) -> None:
        export(recordings, self.name, tmp_path / "out", ignored)
        for seed, recording in enumerate(recordings, 1):
            rows = make_rows(seed) if self.keeps_payloads else without_payloads(make_rows(seed))
            columns = self.read(tmp_path / "out", recording.stem)
            assert len(columns) >= 2, "the tilt of the board and the height of a stylus at least"
            wrong = [name for name, column in columns.items() if not same_bits(np.asarray(column), rows[name])]
            assert wrong == []

    def test_failed_export_leaves_no_files(self, recordings: list[Path], tmp_path: Path) -> None:
        cut = tmp_path / "cut.mcap"
        cut.write_bytes(recordings[0].read_bytes()[:-20])
        with pytest.raises(RecordingError, match=r"cut\.mcap"):
            export([recordings[0], cut], self.name, tmp_path / "out", ignored)
        assert list(tmp_path.iterdir()) == [cut]

    def test_progress_is_that_of_all_recordings(self, recordings: list[Path], tmp_path: Path) -> None:
        shares: list[float] = []
        export(recordings, self.name, tmp_path / "out", lambda what, done, total: shares.append(done / total))
        assert shares == sorted(shares)
        assert (shares[0], shares[-1]) == (0.0, 1.0)

    def test_existing_output_is_refused(self, recordings: list[Path], tmp_path: Path) -> None:
        (tmp_path / "out").mkdir()
        with pytest.raises(ConfigError, match="out: already exists"):
            export(recordings, self.name, tmp_path / "out", ignored)
        assert list((tmp_path / "out").iterdir()) == []
