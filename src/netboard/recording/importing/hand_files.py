"""Reads files of hand movements, and writes the simulated results: CSV and Parquet.

A file of hand movements has the columns `HAND_COLUMNS`, in any order and at any rate. An invalid file raises an error
with file, line and column, what was found and what was expected; nothing is repaired silently. Results are written
under a temporary name and then renamed, so they are never partial. Existing files are kept unless overwriting is
requested. Numbers are written so that they read back bit for bit.
"""

import contextlib
import csv
import difflib
import importlib
import json
import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.errors import ConfigError, NetboardError
from netboard.physics.hands.sampled import GAP_RATIO, Hands, find_gaps

HAND_COLUMNS = ("t", "z_left", "v_left", "z_right", "v_right")
"""Time of the sample [s], height [m] and velocity [m/s] of each stylus."""

UNITS = {"t": "s", "z_left": "m", "v_left": "m/s", "z_right": "m", "v_right": "m/s"}
KINDS = (".csv", ".parquet")

HIGHEST = 1.0
"""Largest plausible height of a stylus, up or down [m]."""

QUICKEST = 50.0
"""Largest plausible velocity of a hand [m/s]."""

SLOWEST = 0.25
"""Longest sample interval that is not a gap [s]."""

_ROWS_AT_ONCE = 20_000


# --- reading -----------------------------------------------------------------------------------------------------


def read_hands(path: Path, gaps: str = "refuse") -> Hands:
    """Read a file of hand movements.

    ``gaps``: "refuse" raises an error at gaps; "hold" extrapolates the last sample before each, as between any two
    samples.
    """
    try:
        table = _read_parquet(path) if path.suffix.lower() == ".parquet" else _read_csv(path)
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error
    where = _Where(path)
    _check(table, where)
    t = np.ascontiguousarray(table[:, 0])
    if gaps == "refuse":
        _refuse_gaps(t, where)
    return Hands(t, np.ascontiguousarray(table[:, (1, 3)]), np.ascontiguousarray(table[:, (2, 4)]))


def _read_csv(path: Path) -> NDArray[np.float64]:
    """Read the columns of a CSV file, in the order of `HAND_COLUMNS`."""
    with path.open(encoding="utf-8-sig", newline="") as file:
        header = file.readline()
        places = _places(path, [name.strip() for name in next(csv.reader([header]), [])])
        try:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", "loadtxt: input contained no data")
                table = np.loadtxt(file, delimiter=",", comments=None, quotechar='"', ndmin=2)
        except UnicodeDecodeError:
            raise
        except ValueError as error:
            raise ConfigError(f"{path}: {_first_fault(path) or error}") from None
    if len(table) and table.shape[1] != len(places):
        raise ConfigError(f"{path}: {_first_fault(path)}")
    return table[:, places] if len(table) else np.empty((0, len(places)))


def _first_fault(path: Path) -> str:
    """Describe the first line of a CSV file that is not a row of numbers."""
    with path.open(encoding="utf-8-sig", newline="") as file:
        reader = csv.reader(file)
        names = [name.strip() for name in next(reader)]
        for row in reader:
            if row and len(row) != len(names):
                return f"line {reader.line_num}: found {len(row)} columns, expected {len(names)}"
            for name, word in zip(names, row, strict=False):
                try:
                    float(word)
                except ValueError:
                    found = f'"{word}"' if word.strip() else "nothing"
                    return f"line {reader.line_num}, column {name}: found {found}, expected a number [{UNITS[name]}]"
    return ""


def _read_parquet(path: Path) -> NDArray[np.float64]:
    """Read the columns of a Parquet file, in the order of `HAND_COLUMNS`."""
    parquet = _parquet(path, "reading")
    with path.open("rb") as file:
        try:
            found = parquet.read_table(file)
        except ValueError as error:  # the base class of Arrow's errors
            raise ConfigError(f"{path}: not a Parquet file: {str(error).partition('. ')[0]}") from None
    _places(path, found.column_names)
    columns = []
    for name in HAND_COLUMNS:
        column = found.column(name)
        if column.null_count:
            row = column.is_null().to_pylist().index(True) + 1
            raise ConfigError(f"{path}: row {row}, column {name}: found nothing, expected a number [{UNITS[name]}]")
        try:
            columns.append(np.asarray(column.to_numpy(), np.float64))
        except (TypeError, ValueError):
            raise ConfigError(f"{path}: column {name}: found {column.type}, expected numbers [{UNITS[name]}]") from None
    return np.stack(columns, axis=1)


def _parquet(path: Path, what: str) -> Any:
    """Import the Parquet library."""
    try:
        return importlib.import_module("pyarrow.parquet")
    except ImportError:
        raise ConfigError(
            f"{path}: {what} Parquet needs pyarrow, which is not installed: pip install 'netboard[parquet]'"
        ) from None


def _places(path: Path, names: Sequence[str]) -> list[int]:
    """Return the column index of each of `HAND_COLUMNS`."""
    expected = ",".join(HAND_COLUMNS)
    for separator in (";", "\t"):
        if any(separator in name for name in names):
            shown = "tabs" if separator == "\t" else separator
            raise ConfigError(f"{path}: line 1: found columns separated by {shown}, expected commas: {expected}")
    missing = [name for name in HAND_COLUMNS if name not in names]
    unknown = [name for name in names if name not in HAND_COLUMNS]
    twice = sorted({name for name in names if names.count(name) > 1})
    if len(missing) == len(HAND_COLUMNS):
        raise ConfigError(f'{path}: line 1: found "{", ".join(names)}", expected the names of the columns: {expected}')
    near = [difflib.get_close_matches(name, missing, 1) for name in unknown]
    meant = [f"is {name} meant to be {match[0]}?" for name, match in zip(unknown, near, strict=True) if match]
    found = (("missing", missing), ("unknown", unknown), ("there twice", twice))
    problems = [f"{', '.join(those)} {'is' if len(those) == 1 else 'are'} {what}" for what, those in found if those]
    if problems:
        raise ConfigError(f"{path}: columns: {'; '.join([*problems, *meant])}; expected {expected}")
    return [names.index(name) for name in HAND_COLUMNS]


class _Where:
    """Formats the location of a row in a file, for error messages."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __call__(self, row: int, column: str = "") -> str:
        """Return file, line (for CSV, counting blank ones) or row, and column."""
        place = f"row {row + 1}" if self.path.suffix.lower() == ".parquet" else f"line {self._line(row)}"
        return f"{self.path}: {place}" + (f", column {column}" if column else "")

    def _line(self, row: int) -> int:
        with self.path.open(encoding="utf-8-sig", newline="") as file:
            full = (number for number, line in enumerate(file, start=1) if line.strip())
            return next(number for i, number in enumerate(full) if i == row + 1)


def _check(table: NDArray[np.float64], where: _Where) -> None:
    """Raise an error for implausible samples."""
    if len(table) < 2:
        raise ConfigError(f"{where.path}: rows of numbers: found {len(table)}, expected at least 2")
    bad = np.argwhere(~np.isfinite(table))
    if len(bad):
        row, column = (int(i) for i in bad[0])
        name = HAND_COLUMNS[column]
        raise ConfigError(
            f"{where(row, name)}: found {table[row, column]:g}, expected a finite number [{UNITS[name]}]"
            + (f"; there are {len(bad)} such" if len(bad) > 1 else "")
        )
    t = table[:, 0]
    back = np.flatnonzero(np.diff(t) <= 0)
    if len(back):
        row = int(back[0]) + 1
        raise ConfigError(
            f"{where(row, 't')}: found {t[row]:.12g} after {t[row - 1]:.12g}, expected increasing times"
            + (f"; there are {len(back)} such" if len(back) > 1 else "")
        )
    usual = float(np.median(np.diff(t)))
    if usual > SLOWEST:
        raise ConfigError(
            f"{where.path}: found samples {usual:.6g} s apart (column t), expected at most {SLOWEST:g} s: is t in ms?"
        )
    for column, limit, unit in ((1, HIGHEST, "mm"), (3, HIGHEST, "mm"), (2, QUICKEST, "mm/s"), (4, QUICKEST, "mm/s")):
        far = np.flatnonzero(np.abs(table[:, column]) > limit)
        if len(far):
            row, name = int(far[0]), HAND_COLUMNS[column]
            raise ConfigError(
                f"{where(row, name)}: found {table[row, column]:g}, expected at most {limit:g} {UNITS[name]} in each "
                f"direction: are these {unit}?"
            )


def _refuse_gaps(t: NDArray[np.float64], where: _Where) -> None:
    """Raise an error for gaps."""
    gaps = find_gaps(t)
    if len(gaps):
        row = int(gaps[0])
        usual = float(np.median(np.diff(t)))
        raise ConfigError(
            f"{where(row + 1, 't')}: found a gap of {t[row + 1] - t[row]:.6g} s after t = {t[row]:.10g} s, expected at "
            f"most {GAP_RATIO:g} times the usual {usual:.6g} s; there {_are(len(gaps))} in all "
            "(--gaps hold goes on across them)"
        )


def _are(count: int) -> str:
    """Format a count with its verb."""
    return "is 1" if count == 1 else f"are {count}"


def doubts(hands: Hands) -> list[str]:
    """Return warnings about velocities that do not match their heights."""
    found = []
    # Compare over a tenth of a second, so that noise and filter delay have no effect.
    every = max(1, round(0.1 / float(np.median(np.diff(hands.t)))))
    areas = 0.5 * (hands.vz[1:] + hands.vz[:-1]) * np.diff(hands.t)[:, None]
    for column, side in enumerate(("left", "right")):
        moved = np.diff(hands.z[::every, column])
        said = np.diff(np.concatenate(([0.0], np.cumsum(areas[:, column])))[::every])
        size = float(np.sqrt(moved @ moved))
        if np.sqrt((said - moved) @ (said - moved)) > 0.5 * size and size > 1e-3:
            found.append(
                f"v_{side} is not the rate of z_{side}: it makes {said @ moved / size**2:.3g} times the movement "
                "(a sign? a unit?)"
            )
    return found


# --- which files -------------------------------------------------------------------------------------------------


def find_inputs(words: Sequence[str]) -> list[Path]:
    """Return the input files.

    ``words``: files, folders (all their .csv and .parquet files) and patterns such as ``hands/*.csv``. Each file comes
    once, in the order of `words`, sorted by name within a folder or pattern.
    """
    paths: list[Path] = []
    for word in words:
        path = Path(word)
        if path.is_dir():
            found = sorted(child for child in path.iterdir() if child.suffix.lower() in KINDS)
        elif not path.exists() and any(mark in word for mark in "*?["):
            found = sorted(Path(path.anchor).glob(str(path.relative_to(path.anchor))))
        else:
            found = [path]
        if not found:
            raise ConfigError(f"{word}: there is no {' or '.join(KINDS)} file")
        paths += found
    for path in paths:
        if path.suffix.lower() not in KINDS:
            raise ConfigError(f"{path}: expected the name of a .csv or .parquet file")
    return list(dict.fromkeys(paths))


def plan_outputs(inputs: Sequence[Path], output: str, force: bool = False) -> dict[Path, Path]:
    """Determine the output file of each input, before the computation starts.

    ``output``: a file, for one input; a folder, where outputs have the names of their inputs; or a name with ``{}`` in
    place of the input's name without suffix.
    """
    folder = not output.lower().endswith(KINDS)
    if folder and Path(output).suffix and not (Path(output).is_dir() or output.endswith("/")):
        raise ConfigError(f"--output {output}: expected a .csv or .parquet file, or a folder, as {output}/")
    if not folder and len(inputs) > 1 and "{}" not in output:
        raise ConfigError(
            f"--output {output}: found one file for {len(inputs)} inputs, expected a folder, or a name with {{}} in it"
        )
    plan: dict[Path, Path] = {}
    taken: dict[Path, Path] = {}
    for path in inputs:
        named = Path(output.replace("{}", path.stem))
        result = named / path.name if folder else named
        if result in taken:
            raise ConfigError(f"{result}: would be the result of {taken[result]} and of {path}; rename one")
        if result.exists() and any(other.exists() and result.samefile(other) for other in inputs):
            raise ConfigError(f"{result}: is an input; name another --output")
        _refuse_existing(result, force)
        plan[path] = result
        taken[result] = path
    return plan


def _refuse_existing(path: Path, force: bool) -> None:
    """Raise an error if the file exists."""
    if path.exists() and not force:
        raise ConfigError(f"{path}: already exists; --force overwrites it")


# --- writing -----------------------------------------------------------------------------------------------------


def write_table(
    path: Path, columns: Mapping[str, NDArray[np.float64]], about: Mapping[str, str], force: bool = False
) -> None:
    """Write a table under a temporary name, then rename it.

    ``about``: provenance of the table; a Parquet file stores it in its metadata, under "netboard", as JSON. ``force``:
    replace an existing file.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    write = _write_parquet if path.suffix.lower() == ".parquet" else _write_csv
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(part, columns, about)
        _refuse_existing(path, force)
        part.replace(path)
    except OSError as error:
        raise NetboardError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def _write_csv(path: Path, columns: Mapping[str, NDArray[np.float64]], about: Mapping[str, str]) -> None:
    """Write a CSV file."""
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(",".join(columns) + "\n")
        for text in _csv_rows(np.stack(list(columns.values()), axis=1)):
            file.write(text)


def _csv_rows(table: NDArray[np.float64]) -> Iterator[str]:
    """Format rows in batches, with the fewest digits that read back as the same number."""
    line = ",".join(["%r"] * table.shape[1]) + "\n"
    for first in range(0, len(table), _ROWS_AT_ONCE):
        rows = table[first : first + _ROWS_AT_ONCE]
        yield (line * len(rows)) % tuple(rows.ravel().tolist())


def _write_parquet(path: Path, columns: Mapping[str, NDArray[np.float64]], about: Mapping[str, str]) -> None:
    """Write a Parquet file."""
    parquet = _parquet(path, "writing")
    table = importlib.import_module("pyarrow").table(dict(columns))
    parquet.write_table(table.replace_schema_metadata({"netboard": json.dumps(dict(about))}), path)
