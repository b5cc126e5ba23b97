"""Apache Parquet export: typed, compressed columns; texts as dictionaries. Values are bit-exact, NaN payloads included.

Unit and meaning of each column are in its metadata.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from netboard.recording.export.dictionary import Described
from netboard.recording.export.formats import Progress, library
from netboard.recording.export.layout import Sheet, write_sheets
from netboard.recording.export.tables import Rows


def write(recordings: Sequence[Path], folder: Path, progress: Progress) -> None:
    """Write recordings as Parquet files."""
    library("pyarrow.parquet", "parquet")
    write_sheets(recordings, folder, progress, open_sheet, ".parquet")


@contextmanager
def open_sheet(path: Path, table: Described) -> Iterator[Sheet]:
    """Open a Parquet file; its columns are typed even without rows."""
    arrow, parquet = library("pyarrow", "parquet"), library("pyarrow.parquet", "parquet")
    schema = _schema(arrow, table)
    texts = [field.name for field in table.fields if field.kind == "string"]
    counts = {field.name: "DELTA_BINARY_PACKED" for field in table.fields if field.kind == "integer"}
    packing = {"compression": "zstd", "use_dictionary": texts, "column_encoding": counts}
    with parquet.ParquetWriter(path, schema, **packing) as writer:

        def put(rows: Rows) -> None:
            writer.write_table(arrow.table(dict(rows), schema))

        yield put


def _schema(arrow: Any, table: Described) -> Any:
    kinds = {"integer": arrow.int64(), "number": arrow.float64(), "string": arrow.string()}
    columns = [
        arrow.field(field.name, kinds[field.kind], nullable=False, metadata={"unit": field.unit, "about": field.text})
        for field in table.fields
    ]
    return arrow.schema(columns, {"about": table.about})
