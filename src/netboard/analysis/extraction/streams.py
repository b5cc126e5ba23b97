"""Reading and writing of tables of measures as Arrow streams."""

from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.extraction.tables import Columns
from netboard.recording.export.formats import library
from netboard.recording.format.channels import Field


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
    """Turn a column into an array."""
    if kind == "string":
        texts = np.array([*column.dictionary.to_pylist(), None], object)[:-1]
        return np.asarray(texts[column.indices.to_numpy()])
    return np.array(column.to_numpy())
