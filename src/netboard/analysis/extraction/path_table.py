"""Paths of a study, on disk: by far the longest table, and never needed for two recordings at once.

Recordings are read one after the other, so memory hardly grows with the length of a study.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

import pandas as pd

from netboard.analysis.extraction.recordings import FIELDS, Measured
from netboard.analysis.extraction.streams import Streams
from netboard.base.errors import RecordingError


class PathTable(Mapping[str, pd.DataFrame]):
    """Paths of each recording by its name, read on each access."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._streams = folder, Streams(None)
        self._places: dict[str, Path] = {}

    def put(self, measured: Measured) -> None:
        """Store the paths of a recording."""
        place = self._folder / f"{len(self._places)}.paths"
        try:
            with place.open("wb") as file:
                self._streams.write(file, measured.paths, FIELDS["paths"])
        except OSError as error:
            raise RecordingError(f"{place}: cannot be written: {error.strerror or error}") from error
        self._places[measured.blocks["recording"][0]] = place

    def __getitem__(self, recording: str) -> pd.DataFrame:
        """Return the paths of a recording."""
        content = memoryview(self._places[recording].read_bytes())
        return pd.DataFrame(self._streams.read(self._streams.source(content), FIELDS["paths"]), copy=False)

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the recordings."""
        return iter(self._places)

    def __len__(self) -> int:
        """Return the number of recordings."""
        return len(self._places)
