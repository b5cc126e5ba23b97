"""Tabular exports (CSV and Parquet): one file of ticks per recording, and one per short table over all recordings.

The data dictionary lies beside them, and the configuration of each recording in ``configurations``.

CSV files are UTF-8 with commas, a header line and line feeds; texts are quoted where necessary, and marked where a
spreadsheet would run them (`netboard.base.files.cells`). Numbers have the fewest
digits that read back as the same float64, so values survive bit for bit. The exception is the payload of a NaN, which
is written as ``nan``. Parquet files have typed, compressed columns with texts as dictionaries, and unit and meaning of
each column in its metadata. Their values are bit-exact, NaN payloads included.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import Any, Protocol

from netboard.base.files.cells import IN_WORDS, CsvWriter
from netboard.recording.export.formats import Progress, library, reporting
from netboard.recording.export.tables import MISSING, TICKS, ExportTable, OpenRecording, Rows, small_tables
from netboard.recording.files.reader import Recording
from netboard.recording.format.channels import Field


class Described(Protocol):
    """A kind of table with name, row meaning and columns."""

    @property
    def name(self) -> str:
        """Name of the table."""

    @property
    def about(self) -> str:
        """Meaning of a row."""

    @property
    def fields(self) -> tuple[Field, ...]:
        """Columns, of the kinds ``integer``, ``number`` and ``string``."""


_TYPES = {"integer": "int64", "number": "float64", "string": "text"}


def write_dictionary(folder: Path, tables: Sequence[Described], places: str) -> None:
    """Write ``dictionary.json`` and ``dictionary.csv``.

    ``places``: sentence on the arrangement of the tables in files.
    """
    described = {
        table.name: {
            "about": table.about,
            "columns": {
                field.name: {"type": _TYPES[field.kind], "unit": field.unit, "description": field.text}
                for field in table.fields
            },
        }
        for table in tables
    }
    whole = {"files": places, "missing": MISSING, "texts": f"In CSV files: {IN_WORDS}", "tables": described}
    text = json.dumps(whole, indent=1, ensure_ascii=False) + "\n"
    (folder / "dictionary.json").write_text(text, encoding="utf-8")
    with (folder / "dictionary.csv").open("x", encoding="utf-8", newline="") as file:
        writer = CsvWriter(file)
        writer.row(("table", "column", "type", "unit", "description"))
        for table in tables:
            writer.rows((table.name, field.name, _TYPES[field.kind], field.unit, field.text) for field in table.fields)


Sheet = Callable[[Rows], None]
"""Callback that writes the next rows of a table."""

OpenSheet = Callable[[Path, ExportTable], AbstractContextManager[Sheet]]
"""Function that opens a new file for a table."""


def opened(recordings: Sequence[Path], folder: Path) -> Iterator[OpenRecording]:
    """Open the recordings one by one and write their configurations. These go to the subfolder ``configurations``."""
    texts = folder / "configurations"
    texts.mkdir()
    for path in recordings:
        with Recording(path) as recording:
            source = OpenRecording(recording)
            (texts / f"{source.name}.toml").write_text(recording.config_text, encoding="utf-8")
            yield source


def tick_portions(source: OpenRecording, progress: Progress) -> Iterator[Rows]:
    """Return the ticks of a recording in batches that report progress."""
    return reporting(TICKS.portions(source), source.name, source.ticks, progress)


def write_sheets(
    recordings: Sequence[Path], folder: Path, progress: Progress, open_sheet: OpenSheet, ending: str
) -> None:
    """Write all tables of the recordings."""
    places = f"ticks/RECORDING{ending}: the ticks of each recording; NAME{ending}: another table, of all recordings"
    tables = small_tables(recordings)
    write_dictionary(folder, (TICKS, *tables), places)
    (folder / "ticks").mkdir()
    with ExitStack() as stack:
        small = {table: stack.enter_context(open_sheet(folder / f"{table.name}{ending}", table)) for table in tables}
        for source in opened(recordings, folder):
            with open_sheet(folder / "ticks" / f"{source.name}{ending}", TICKS) as put:
                for rows in tick_portions(source, progress):
                    put(rows)
            for table, put in small.items():
                for rows in table.portions(source):
                    put(rows)


def write_csv(recordings: Sequence[Path], folder: Path, progress: Progress) -> None:
    """Write recordings as CSV files."""
    write_sheets(recordings, folder, progress, open_csv, ".csv")


@contextmanager
def open_csv(path: Path, table: Described) -> Iterator[Sheet]:
    """Open a CSV file and write its header line."""
    with path.open("x", encoding="utf-8", newline="") as file:
        writer = CsvWriter(file)
        writer.row(field.name for field in table.fields)
        texts = [field.kind == "string" for field in table.fields]

        def put(rows: Rows) -> None:
            # Convert to Python numbers: csv writes those with repr, which reads back bit for bit.
            writer.columns([column.tolist() for column in rows.values()], texts)

        yield put


def write_parquet(recordings: Sequence[Path], folder: Path, progress: Progress) -> None:
    """Write recordings as Parquet files."""
    library("pyarrow.parquet", "parquet")
    write_sheets(recordings, folder, progress, open_parquet, ".parquet")


@contextmanager
def open_parquet(path: Path, table: Described) -> Iterator[Sheet]:
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
