"""Reads an imported table as validated columns in SI units, or an exported table of ticks as the original ticks."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.errors import ConfigError
from netboard.base.tick import TICK
from netboard.recording.importing.columns import COLUMNS, mapped, scales
from netboard.recording.importing.reading import Portion, TableFile

FARTHEST = {"m": (1.0, "mm"), "rad": (1.6, "deg"), "N": (1000.0, "mN")}
"""Largest plausible magnitudes of positions, angles and forces, and the unit to suggest for larger values [SI]."""

_GIVEN = ("time",)
"""Columns that a table may lack if its sample rate is known."""

_RATE_ERROR = 0.05
"""Relative tolerance of the median sample interval [1]."""


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
    taken = mapped(str(path), table.names, names, _GIVEN if rate else ()).values()
    return Samples(time, columns, tuple(name for name in table.names if name not in taken))


def probe(path: Path, names: Sequence[str], units: Sequence[str], rate: float | None) -> None:
    """Validate the first rows of a table; raise the same errors as reading all of it."""
    first = next(_portions(TableFile(path), names, units, rate), {})
    _require_rate(path, first.get("time", np.empty(0)), rate)


def _portions(
    table: TableFile, names: Sequence[str], units: Sequence[str], rate: float | None
) -> Iterator[dict[str, NDArray[Any]]]:
    """Yield the rows in validated batches, in SI units."""
    found, factors = mapped(str(table.path), table.names, names, _GIVEN if rate else ()), scales(units)
    if strangers := [word for word in units if word.partition("=")[0] not in found]:
        raise ConfigError(f"--unit {strangers[0]}: {table.path} has no such column")
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
        return portion.numbers(theirs, np.int64)
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
            f"{portion.at(back[0])}, column time: found {time[back[0]]:.12g} s after {before:.12g} s, expected times "
            "that increase: one line of time over all trials"
        )
    for name, values in columns.items():
        largest, meant = FARTHEST.get(COLUMNS[name].unit, (np.inf, ""))
        far = np.flatnonzero(np.abs(values) > largest) if values.dtype.kind == "f" else np.empty(0, np.int64)
        if far.size:
            raise ConfigError(
                f"{portion.at(far[0])}, column {name}: found {values[far[0]]:g} {COLUMNS[name].unit}, expected at most "
                f"{largest:g} either way; is it in another unit? (--unit {name}={meant})"
            )
    return float(time[-1])


def is_own(path: Path) -> bool:
    """Return True if a table has all columns of netboard's exported ticks."""
    return set(TICK.names or ()) <= set(TableFile(path).names)


def read_ticks(path: Path) -> Iterator[NDArray[Any]]:
    """Read an exported table of ticks.

    The file is a .csv or .parquet file with all tick columns. Rows are bit for bit (except NaN payloads in CSV).
    """
    newest = -1
    for portion in TableFile(path).portions(TICK.names or ()):
        rows = np.empty(len(portion.places), TICK)
        for name in TICK.names or ():
            rows[name] = portion.numbers(name, np.int64 if TICK[name].kind == "i" else np.float64)
        back = np.flatnonzero(np.diff(rows["tick"], prepend=newest) <= 0)
        if back.size:
            raise ConfigError(
                f"{portion.at(back[0])}, column tick: found {rows['tick'][back[0]]}, expected increasing numbers: "
                "the ticks of one recording"
            )
        newest = int(rows["tick"][-1])
        yield rows


def sha256_of(path: Path) -> str:
    """Return the SHA-256 hash of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
