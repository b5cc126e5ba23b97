"""Reads an imported table as validated columns in SI units, or an exported table of ticks as the original ticks.

Files are CSV or Parquet and are read in batches of rows; errors name file, line and column. CSV columns are separated
by commas, semicolons or tabs; numbers have a decimal point. An empty cell is a missing number (NaN) or an empty string.
"""

import csv
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.errors import ConfigError, unreadable
from netboard.base.files.cells import QUOTE, text_of_cell
from netboard.base.files.text import open_text
from netboard.base.tick import TICK, TICK_NS
from netboard.recording.export.formats import library
from netboard.recording.importing.cells import Rule, WrongCell, numbers_in, plain_rows, whole_numbers_in
from netboard.recording.importing.columns import COLUMNS, mapped, scales

ROWS = 1000
"""Rows per batch, which fit the cache of a processor as text [1]."""

MAX_MAGNITUDES = {"m": (1.0, "mm"), "rad": (1.6, "deg"), "N": (1000.0, "mN")}
"""Largest plausible magnitudes of positions, angles and forces, and the unit to suggest for larger values [SI]."""

SHORTENED = re.compile(r"[+-]?[0-9]+(?:\.[0-9]*)?[eE][+-]?[0-9]+")
"""A number as a spreadsheet writes one of many digits."""

UNSAVED = "import the table as netboard exported it, without saving it in a spreadsheet, which rounds numbers"

BLOCK = 2**18
"""Characters of a table that are read at once if it has numbers only [1]."""

_REPLACEABLE = ("time",)
"""Columns that a table may lack if its sample rate is known."""

_RATE_ERROR = 0.05
"""Relative tolerance of the median sample interval [1]."""


# --- files of rows ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Portion:
    """A batch of rows, as stored in the file."""

    source: str
    what: str
    places: Sequence[int]
    cells: dict[str, Any]  # columns of text, or of any type in a Parquet file

    def numbers(self, name: str, unit: str = "", rule: Rule = "measured") -> NDArray[np.float64]:
        """Return a column of numbers. ``unit``: shown in the error if a cell is none."""
        try:
            return numbers_in(self.cells[name], rule)
        except WrongCell as wrong:
            comma = isinstance(cell := self.cells[name][wrong.place], str) and "," in cell
            expected = "a number" + f" [{unit}]" * bool(unit) + " with a decimal point" * comma
            raise ConfigError(self.wrong(wrong.place, name, expected)) from None

    def whole_numbers(self, name: str, rule: Rule = "measured") -> NDArray[np.int64]:
        """Return a column of whole numbers."""
        try:
            return whole_numbers_in(self.cells[name], rule)
        except WrongCell as wrong:
            expected = "a whole number in digits"
            if rule == "exported" and SHORTENED.fullmatch(str(self.cells[name][wrong.place])):
                expected += f", all of them; {UNSAVED}"
            raise ConfigError(self.wrong(wrong.place, name, expected)) from None

    def wrong(self, place: int, name: str, expected: str) -> str:
        """Return an error: where a cell is, what it is, and what was expected."""
        cell = self.cells[name][place]
        found = "nothing" if cell is None or not str(cell).strip() else f'"{cell}"'
        return f"{self.at(place)}, column {name}: found {found}, expected {expected}"

    def words(self, name: str) -> list[str]:
        """Return a column of strings."""
        cells = ("" if cell is None else str(cell) for cell in self.cells[name])
        return [
            text_of_cell(cell) if self.what == "line" and cell.startswith(QUOTE) else cell.strip() for cell in cells
        ]

    def at(self, place: int) -> str:
        """Format the location of a row."""
        return f"{self.source}: {self.what} {self.places[place]}"


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
        except OSError as error:
            raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from error

    def portions(self, names: Sequence[str]) -> Iterator[Portion]:
        """Yield the rows in batches."""
        assert self._read is not None
        try:
            yield from self._read(list(dict.fromkeys(names)))
        except csv.Error as error:
            raise ConfigError(f"{self.path}: is not a table: {error}") from error
        except OSError as error:
            raise unreadable(self.path, error) from error

    def plain_numbers(self, names: Sequence[str]) -> NDArray[np.float64] | None:
        """Return columns of a text table that has numbers only, several times faster than `portions`.

        None for a file that has, or may have, anything else: `portions` then says where.
        """
        if self._read != self._csv:
            return None
        places = [self.names.index(name) for name in names]
        parts = [np.empty((0, len(self.names)))]
        with open_text(self.path) as file:
            file.readline()
            while lines := file.readlines(BLOCK):
                rows = plain_rows(lines, self.separator) if any(map(str.strip, lines)) else parts[0][:0]
                if rows is None or rows.shape[1] != len(self.names):
                    return None
                parts.append(rows)
        return np.concatenate(parts)[:, places]

    def _csv_names(self) -> list[str]:
        with open_text(self.path) as file:
            head = file.readline()
        self.separator = max(",;\t", key=head.count)
        names = [text_of_cell(name.strip()) for name in next(csv.reader([head], delimiter=self.separator), [])]
        if not any(names):
            raise ConfigError(f"{self.path}: line 1: found nothing, expected the names of columns")
        return names

    def _csv(self, names: list[str]) -> Iterator[Portion]:
        places = [self.names.index(name) for name in names]
        with open_text(self.path) as file:
            reader = csv.reader(file, delimiter=self.separator)
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


# --- columns in SI units ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Samples:
    """Measured samples."""

    time: NDArray[np.float64]  # sample times, increasing [s]
    columns: dict[str, NDArray[Any]]  # other columns by netboard's names: float64, int64, or strings [SI]
    left_out: tuple[str, ...]


def read_samples(
    path: Path, names: Sequence[str] = (), units: Sequence[str] = (), rate: float | None = None
) -> Samples:
    """Read a table. ``rate``: sample rate that times must match; a table without times gets them from it [Hz]."""
    table = TableFile(path)
    parts: dict[str, list[NDArray[Any]]] = {}
    for portion in _portions(table, names, units, rate):
        for name, values in portion.items():
            parts.setdefault(name, []).append(values)
    columns = {name: np.concatenate(values) for name, values in parts.items()}
    time = columns.pop("time", np.empty(0))
    _require_rate(path, time, rate)
    taken = mapped(str(path), table.names, names, _REPLACEABLE if rate else ()).values()
    return Samples(time, columns, tuple(name for name in table.names if name not in taken))


def probe(path: Path, names: Sequence[str], units: Sequence[str], rate: float | None) -> Collection[str]:
    """Validate the first rows of a table and return its columns; raise the same errors as reading all of it."""
    first = next(_portions(TableFile(path), names, units, rate), {})
    _require_rate(path, first.get("time", np.empty(0)), rate)
    return first.keys()


def _portions(
    table: TableFile, names: Sequence[str], units: Sequence[str], rate: float | None
) -> Iterator[dict[str, NDArray[Any]]]:
    """Yield the rows in validated batches, in SI units."""
    found, factors = mapped(str(table.path), table.names, names, _REPLACEABLE if rate else ()), scales(units)
    if unknown := [word for word in units if word.partition("=")[0] not in found]:
        raise ConfigError(f"--unit {unknown[0]}: {table.path} has no such column")
    newest, done = -np.inf, 0
    for portion in table.portions(list(found.values())):
        columns = {name: _column(portion, name, theirs, factors[name]) for name, theirs in found.items()}
        if rate and "time" not in found:
            columns["time"] = np.arange(done, done + len(portion.places)) / rate
        newest = _check(portion, columns, newest)
        done += len(portion.places)
        yield columns


def _require_rate(path: Path, time: NDArray[np.float64], rate: float | None) -> None:
    """Raise an error if there are too few times or they do not match the sample rate."""
    if time.size < 2:
        raise ConfigError(f"{path}: rows: found {time.size}, expected at least 2")
    usual = 1 / float(np.median(np.diff(time)))
    if rate and not abs(usual / rate - 1) <= _RATE_ERROR:
        raise ConfigError(
            f"{path}: column time: found {usual:.6g} samples a second, expected rate = {rate:.6g}; is time in another "
            "unit?"
        )


def _column(portion: Portion, name: str, theirs: str, factor: tuple[float, float]) -> NDArray[Any]:
    """Return a column of a batch in SI units."""
    if COLUMNS[name].kind == "word":
        return np.array(portion.words(theirs), object)
    if COLUMNS[name].kind == "integer":
        return portion.whole_numbers(theirs)
    times, over = factor
    return portion.numbers(theirs) * times / over


def _check(portion: Portion, columns: Mapping[str, NDArray[Any]], newest: float) -> float:
    """Raise an error for decreasing times and missing or implausible positions; return the last time."""
    for name in (column.name for column in COLUMNS.values() if column.needed):
        lost = np.flatnonzero(~np.isfinite(columns[name]))
        if lost.size:
            raise ConfigError(
                f"{portion.at(lost[0])}, column {name}: found {columns[name][lost[0]]}, expected a number"
            )
    time = columns["time"]
    back = np.flatnonzero(np.diff(time, prepend=newest) <= 0)
    if back.size:
        before = time[back[0] - 1] if back[0] else newest
        raise ConfigError(
            f"{portion.at(back[0])}, column time: found {time[back[0]]:.12g} s after {before:.12g} s, expected "
            "increasing times: one time axis over all trials"
        )
    for name, values in columns.items():
        largest, meant = MAX_MAGNITUDES.get(COLUMNS[name].unit, (np.inf, ""))
        far = np.flatnonzero(np.abs(values) > largest) if values.dtype.kind == "f" else np.empty(0, np.int64)
        if far.size:
            raise ConfigError(
                f"{portion.at(far[0])}, column {name}: found {values[far[0]]:g} {COLUMNS[name].unit}, expected at most "
                f"{largest:g} in either direction; is it in another unit? (--unit {name}={meant})"
            )
    return float(time[-1])


def is_tick_table(path: Path) -> bool:
    """Return True if a table has all columns of netboard's exported ticks."""
    return set(TICK.names or ()) <= set(TableFile(path).names)


def read_ticks(path: Path) -> Iterator[tuple[NDArray[Any], Portion]]:
    """Read an exported table of ticks, in batches: the ticks, and where they come from.

    The file is a .csv or .parquet file with all tick columns. Rows are bit for bit (except NaN payloads in CSV).
    """
    last = np.zeros(0, TICK)
    for portion in TableFile(path).portions(TICK.names or ()):
        rows = np.empty(len(portion.places), TICK)
        for name in TICK.names or ():
            if TICK[name].kind == "i":
                rows[name] = portion.whole_numbers(name, "exported")
            else:
                rows[name] = portion.numbers(name, rule="exported")
        _refuse_other_times(portion, np.concatenate([last, rows]), len(last))
        last = rows[-1:]
        yield rows, portion


def _refuse_other_times(portion: Portion, rows: NDArray[Any], before: int) -> None:
    """Refuse ticks out of order, and times other than a recording's; ``before``: rows of the batch before."""
    ticks, times = rows["tick"], rows["time_ns"]
    if back := np.flatnonzero(np.diff(ticks, prepend=-1) <= 0).tolist():
        expected = f"increasing numbers after {ticks[back[0] - 1]}: the ticks of one recording"
        raise ConfigError(portion.wrong(back[0] - before, "tick", expected))
    late_ns = np.diff(times) - np.diff(ticks) * TICK_NS
    if wrong := (np.flatnonzero((late_ns < 0) | (late_ns % TICK_NS != 0)) + 1).tolist():
        due_ns = times[wrong[0]] - late_ns[wrong[0] - 1]
        expected = f"{due_ns}, as ticks are 1 ms apart, or whole milliseconds more after a stall; {UNSAVED}"
        raise ConfigError(portion.wrong(wrong[0] - before, "time_ns", expected))
