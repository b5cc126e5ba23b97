"""The paths of a study, on disk: they are by far the longest table, and nobody needs those of two recordings at once.

A study is looked through one recording after the other, so that the memory it takes hardly grows with its hours.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

import pandas as pd

from netboard.analysis.extraction.recordings import FIELDS, Measured
from netboard.analysis.extraction.streams import Streams
from netboard.base.errors import RecordingError


class Shelf(Mapping[str, pd.DataFrame]):
    """The paths of each recording by its name, read whenever they are asked for."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._streams = folder, Streams(None)
        self._places: dict[str, Path] = {}

    def put(self, measured: Measured) -> None:
        """Take the paths of a recording."""
        place = self._folder / f"{len(self._places)}.paths"
        try:
            with place.open("wb") as file:
                self._streams.write(file, measured.paths, FIELDS["paths"])
        except OSError as error:
            raise RecordingError(f"{place}: cannot be written: {error.strerror or error}") from error
        self._places[measured.blocks["recording"][0]] = place

    def __getitem__(self, recording: str) -> pd.DataFrame:
        """Read the paths of a recording."""
        content = memoryview(self._places[recording].read_bytes())
        return pd.DataFrame(self._streams.read(self._streams.source(content), FIELDS["paths"]), copy=False)

    def __iter__(self) -> Iterator[str]:
        """Go through the names of the recordings."""
        return iter(self._places)

    def __len__(self) -> int:
        """Count the recordings."""
        return len(self._places)
