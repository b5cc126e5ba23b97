"""Reads tables in CSV and Parquet files in batches of rows; errors name file, line and column.

CSV columns are separated by commas, semicolons or tabs; numbers have a decimal point. An empty cell is a missing number
(NaN) or an empty string.
"""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.errors import ConfigError, RecordingError
from netboard.recording.export.formats import library

ROWS = 20_000
"""Rows per batch [1]."""


@dataclass(frozen=True, slots=True)
class Portion:
    """A batch of rows, as stored in the file."""

    source: str
    what: str
    places: Sequence[int]
    cells: dict[str, Any]  # columns of text, or of any type in a Parquet file

    def numbers(self, name: str, kind: type[np.generic] = np.float64) -> NDArray[Any]:
        """Return a column of numbers."""
        cells = self.cells[name]
        if isinstance(cells, np.ndarray) and cells.dtype == kind:
            return cells
        try:
            return np.array([_number(cell, kind) for cell in cells], kind)
        except (TypeError, ValueError, OverflowError):
            place = next(k for k, cell in enumerate(cells) if not _is_number(cell, kind))
        words = "a whole number" if kind is np.int64 else "a number"
        raise ConfigError(f'{self.at(place)}, column {name}: found "{cells[place]}", expected {words}') from None

    def words(self, name: str) -> list[str]:
        """Return a column of strings."""
        return ["" if cell is None else str(cell).strip() for cell in self.cells[name]]

    def at(self, place: int) -> str:
        """Format the location of a row."""
        return f"{self.source}: {self.what} {self.places[place]}"


def _number(cell: Any, kind: type[np.generic]) -> float | int:
    """Parse a cell; an empty one is NaN, or 0 for integers."""
    if cell is None or (isinstance(cell, str) and not cell.strip()):
        return 0 if kind is np.int64 else float("nan")
    if kind is not np.int64:
        return float(cell)
    if isinstance(cell, str):
        try:
            return int(cell)
        except ValueError:
            cell = float(cell)
    if np.isnan(cell):  # some programs write a missing integer as NaN
        return 0
    if int(cell) != cell:
        raise ValueError
    return int(cell)


def _is_number(cell: Any, kind: type[np.generic]) -> bool:
    try:
        kind(_number(cell, kind))
    except (TypeError, ValueError, OverflowError):
        return False
    return True


class TableFile:
    """A table in a file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._read = {".csv": self._csv, ".tsv": self._csv, ".txt": self._csv, ".parquet": self._parquet}.get(
            path.suffix.lower()
        )
        if self._read is None:
            raise ConfigError(f"{path}: expected the name of a .csv or .parquet file")
        try:
            self.names = self._parquet_names() if self._read == self._parquet else self._csv_names()
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error

    def portions(self, names: Sequence[str]) -> Iterator[Portion]:
        """Yield the rows in batches."""
        assert self._read is not None
        try:
            yield from self._read(list(dict.fromkeys(names)))
        except UnicodeDecodeError as error:
            raise ConfigError(f"{self.path}: is not text in UTF-8: {error}") from error
        except OSError as error:
            raise RecordingError(f"{self.path}: cannot be read: {error.strerror or error}") from error

    def _csv_names(self) -> list[str]:
        with self.path.open(encoding="utf-8-sig", newline="") as file:
            head = file.readline()
        self._separator = max(",;\t", key=head.count)
        names = [name.strip() for name in next(csv.reader([head], delimiter=self._separator), [])]
        if not any(names):
            raise ConfigError(f"{self.path}: line 1: found nothing, expected the names of columns")
        return names

    def _csv(self, names: list[str]) -> Iterator[Portion]:
        places = [self.names.index(name) for name in names]
        with self.path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, delimiter=self._separator)
            next(reader)
            numbered = ((reader.line_num, row) for row in reader if row)
            while some := list(islice(numbered, ROWS)):
                for line, row in some:
                    if len(row) != len(self.names):
                        raise ConfigError(
                            f"{self.path}: line {line}: found {len(row)} columns, expected {len(self.names)}"
                        )
                cells = {name: [row[place] for _, row in some] for name, place in zip(names, places, strict=True)}
                yield Portion(str(self.path), "line", [line for line, _ in some], cells)

    def _open_parquet(self) -> Any:
        arrow, parquet = library("pyarrow", "parquet"), library("pyarrow.parquet", "parquet")
        try:
            return parquet.ParquetFile(self.path)
        except arrow.ArrowInvalid as error:
            raise ConfigError(f"{self.path}: not a Parquet file: {str(error).partition('. ')[0]}") from None

    def _parquet_names(self) -> list[str]:
        with self._open_parquet() as file:
            return list(file.schema_arrow.names)

    def _parquet(self, names: list[str]) -> Iterator[Portion]:
        done = 0
        with self._open_parquet() as file:
            for batch in file.iter_batches(ROWS, columns=names):
                cells = {name: _cells(batch.column(name)) for name in names}
                yield Portion(str(self.path), "row", range(done + 1, done + 1 + batch.num_rows), cells)
                done += batch.num_rows


def _cells(column: Any) -> Any:
    """Return a Parquet column; an all-numeric one is an array with its bits unchanged."""
    values = column.to_numpy(zero_copy_only=False)
    return values if values.dtype.kind in "if" and not column.null_count else list(column.to_pylist())
