"""Extracted tables on disk, as Arrow streams: the cache of recordings, and the paths of a study.

The cache is keyed by the recording's bytes, the settings and the extracting code. A change of a byte of the recording,
its name, a setting that affects the measures, or the extracting code gives another key, and the recording is measured
again. The settings for summaries and exclusions are not part of the key.

Paths are by far the longest table, and never needed for two recordings at once. They are read one recording after the
other, so memory hardly grows with the length of a study.
"""

import hashlib
from collections.abc import Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.extraction.fingerprint import fingerprint
from netboard.analysis.extraction.recordings import FIELDS, Measured
from netboard.analysis.extraction.settings import Readings, measured_with
from netboard.analysis.extraction.store import LIMIT, TABLES, Store
from netboard.analysis.extraction.tables import Columns
from netboard.base.errors import writing
from netboard.recording.export.formats import library
from netboard.recording.format.channels import Field


class Cache:
    """Cached tables in a folder, created if missing, or an open store; above `limit` bytes unused ones are evicted."""

    def __init__(self, folder: Path | Store, limit: int = LIMIT) -> None:
        self._streams = Streams("zstd")
        self._store = folder if isinstance(folder, Store) else Store(folder, limit)
        self.trim = self._store.trim

    def get(self, key: str) -> Measured | None:
        """Return the cached tables; None if there are none or the entry is damaged."""
        content = self._store.get(f"{key}{TABLES}")
        if content is None:
            return None
        source = self._streams.source(content)
        return Measured(**{name: self._streams.read(source, fields) for name, fields in FIELDS.items()})

    def put(self, key: str, measured: Measured) -> None:
        """Store the tables of a recording."""
        sink = BytesIO()
        for name, fields in FIELDS.items():
            self._streams.write(sink, getattr(measured, name), fields)
        self._store.put(f"{key}{TABLES}", sink.getvalue())


def key_of(name: str, sha256: str, readings: Readings) -> str:
    """Return the cache key of a recording."""
    parts = (name, sha256, measured_with(readings), fingerprint())
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


class Streams:
    """Writer and reader of tables, each in its own stream."""

    def __init__(self, compression: str | None) -> None:
        self._arrow, self._ipc = library("pyarrow", "analysis"), library("pyarrow.ipc", "analysis")
        self._options = self._ipc.IpcWriteOptions(compression=compression)

    def write(self, sink: BinaryIO, columns: Columns, fields: tuple[Field, ...]) -> None:
        """Write a table to a file."""
        arrow = self._arrow
        text = arrow.dictionary(arrow.int32(), arrow.string())
        kinds = {"integer": arrow.int64(), "number": arrow.float64(), "string": text}
        schema = arrow.schema([arrow.field(field.name, kinds[field.kind]) for field in fields])
        table = arrow.table({field.name: columns[field.name] for field in fields}, schema)
        with self._ipc.new_stream(sink, schema, options=self._options) as stream:
            stream.write_table(table)

    def source(self, content: memoryview) -> Any:
        """Return a source from which `read` takes one table after the other."""
        return self._arrow.BufferReader(content)

    def read(self, source: Any, fields: tuple[Field, ...]) -> Columns:
        """Read the next table.

        Returns
        -------
        dict of ndarray, shape (n,)
            The columns; equal texts share one object, because a recording's path repeats the same text.
        """
        with self._ipc.open_stream(source) as stream:
            table = stream.read_all()
        return {field.name: _values(table[field.name].combine_chunks(), field.kind) for field in fields}


def _values(column: Any, kind: str) -> NDArray[Any]:
    if kind == "string":
        texts = np.array([*column.dictionary.to_pylist(), None], object)[:-1]
        return np.asarray(texts[column.indices.to_numpy()])
    return np.array(column.to_numpy())


class PathTable(Mapping[str, pd.DataFrame]):
    """Paths of each recording by its name, read on each access; another process can read them, too."""

    def __init__(self, folder: Path, places: Mapping[str, Path] | None = None) -> None:
        self._folder, self._streams = folder, Streams(None)
        self._places = dict(places or {})

    def __reduce__(self) -> tuple[type["PathTable"], tuple[Path, dict[str, Path]]]:
        """Return what another process needs to read the paths."""
        return PathTable, (self._folder, self._places)

    def put(self, measured: Measured) -> None:
        """Store the paths of a recording."""
        place = self._folder / f"{len(self._places)}.paths"
        with writing(place), place.open("wb") as file:
            self._streams.write(file, measured.paths, FIELDS["paths"])
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
