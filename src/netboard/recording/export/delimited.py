"""CSV export: UTF-8, commas, a header line, line feeds; texts are quoted where necessary.

Numbers have the fewest digits that read back as the same float64, so values survive bit for bit. The exception is the
payload of a NaN, which is written as ``nan``.
"""

import csv
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from netboard.recording.export.dictionary import Described
from netboard.recording.export.formats import Progress
from netboard.recording.export.layout import Sheet, write_sheets
from netboard.recording.export.tables import Rows


def write(recordings: Sequence[Path], folder: Path, progress: Progress) -> None:
    """Write recordings as CSV files."""
    write_sheets(recordings, folder, progress, open_sheet, ".csv")


@contextmanager
def open_sheet(path: Path, table: Described) -> Iterator[Sheet]:
    """Open a CSV file and write its header line."""
    with path.open("x", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(field.name for field in table.fields)

        def put(rows: Rows) -> None:
            # Convert to Python numbers: csv writes those with repr, which reads back bit for bit.
            writer.writerows(zip(*(column.tolist() for column in rows.values()), strict=True))

        yield put
