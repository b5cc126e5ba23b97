"""CSV: UTF-8, commas, one line of names, a line feed at the end of each line; texts in quotes where they need them.

A number is written with the fewest digits that read back as the same float64, so all bits come back; only the payload
of a NaN, which is written ``nan``, does not.
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
    """Begin a file with the line of names."""
    with path.open("x", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(field.name for field in table.fields)

        def put(rows: Rows) -> None:
            # As Python's own numbers: csv writes those with repr, which reads back to the bit.
            writer.writerows(zip(*(column.tolist() for column in rows.values()), strict=True))

        yield put
