"""Reads files of hand movements, and writes the simulated results: CSV and Parquet.

A file of hand movements has the columns `HAND_COLUMNS`, in any order and at any rate. An invalid file raises an error
with file, line and column, what was found and what was expected; nothing is repaired silently. Results are written
under a temporary name and then renamed, so they are never partial. Existing files are kept unless overwriting is
requested. Numbers are written so that they read back bit for bit.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from netboard.base.errors import ConfigError
from netboard.base.files.cells import CsvWriter
from netboard.base.files.new import new_file, refuse_existing
from netboard.base.nearest import nearest
from netboard.physics.hands.sampled import GAP_RATIO, Hands, find_gaps
from netboard.recording.export.formats import library
from netboard.recording.importing.tables import ROWS, TableFile
from netboard.stage.styluses import MAX_STYLUS_HEIGHT

HAND_COLUMNS = ("t", "z_left", "v_left", "z_right", "v_right")
"""Time of the sample [s], height [m] and velocity [m/s] of each stylus."""

UNITS = {"t": "s", "z_left": "m", "v_left": "m/s", "z_right": "m", "v_right": "m/s"}
KINDS = (".csv", ".parquet")

MAX_SPEED = 50.0
"""Largest plausible velocity of a hand [m/s]."""

MAX_INTERVAL = 0.25
"""Longest sample interval that is not a gap [s]."""


# --- reading -----------------------------------------------------------------------------------------------------


def read_hands(path: Path, gaps: str = "refuse") -> Hands:
    """Read a file of hand movements.

    ``gaps``: "refuse" raises an error at gaps; "hold" extrapolates the last sample before each, as between any two
    samples.
    """
    table = _read(TableFile(path))
    _check(table, path)
    t = np.ascontiguousarray(table[:, 0])
    if gaps == "refuse":
        _refuse_gaps(t, path)
    return Hands(t, np.ascontiguousarray(table[:, (1, 3)]), np.ascontiguousarray(table[:, (2, 4)]))


def _read(file: TableFile) -> NDArray[np.float64]:
    _require_columns(file)
    if (plain := file.plain_numbers(HAND_COLUMNS)) is not None:
        return plain
    parts = [np.empty((0, len(HAND_COLUMNS)))]
    for portion in file.portions(HAND_COLUMNS):
        parts.append(np.stack([portion.numbers(name, UNITS[name], "complete") for name in HAND_COLUMNS], axis=1))
    return np.concatenate(parts)


def _at(path: Path, row: int, column: int) -> str:
    """Return where a number stands, for error messages: file, line or row, and column."""
    for portion in TableFile(path).portions(HAND_COLUMNS):
        if row < len(portion.places):
            return f"{portion.at(row)}, column {HAND_COLUMNS[column]}"
        row -= len(portion.places)
    raise ValueError(f"{path}: has no row {row}")


def _require_columns(file: TableFile) -> None:
    """Raise an error unless there are exactly the columns `HAND_COLUMNS`."""
    path, names = file.path, file.names
    expected = ",".join(HAND_COLUMNS)
    missing = [name for name in HAND_COLUMNS if name not in names]
    unknown = [name for name in names if name not in HAND_COLUMNS]
    twice = sorted({name for name in names if names.count(name) > 1})
    if len(missing) == len(HAND_COLUMNS):
        raise ConfigError(f'{path}: line 1: found "{", ".join(names)}", expected the names of the columns: {expected}')
    near = {name: nearest(name, missing) for name in unknown}
    meant = [f"is {name} meant to be {match}?" for name, match in near.items() if match]
    found = (("missing", missing), ("unknown", unknown), ("there twice", twice))
    problems = [f"{', '.join(those)} {'is' if len(those) == 1 else 'are'} {what}" for what, those in found if those]
    if problems:
        raise ConfigError(f"{path}: columns: {'; '.join([*problems, *meant])}; expected {expected}")


def _check(table: NDArray[np.float64], path: Path) -> None:
    """Raise an error for implausible samples."""
    if len(table) < 2:
        raise ConfigError(f"{path}: rows of numbers: found {len(table)}, expected at least 2")
    t = table[:, 0]
    back = np.flatnonzero(np.diff(t) <= 0)
    if len(back):
        row = int(back[0]) + 1
        raise ConfigError(
            f"{_at(path, row, 0)}: found {t[row]:.12g} after {t[row - 1]:.12g}, expected increasing times"
            + (f"; there are {len(back)} such" if len(back) > 1 else "")
        )
    usual = float(np.median(np.diff(t)))
    if usual > MAX_INTERVAL:
        raise ConfigError(
            f"{path}: found samples {usual:.6g} s apart (column t), expected at most {MAX_INTERVAL:g} s: is t in ms?"
        )
    for column, limit in ((1, MAX_STYLUS_HEIGHT), (3, MAX_STYLUS_HEIGHT), (2, MAX_SPEED), (4, MAX_SPEED)):
        far = np.flatnonzero(np.abs(table[:, column]) > limit)
        if len(far):
            row, name = int(far[0]), HAND_COLUMNS[column]
            raise ConfigError(
                f"{_at(path, row, column)}: found {table[row, column]:g}, expected at most {limit:g} "
                f"{UNITS[name]} in each direction: are these m{UNITS[name]}?"
            )


def _refuse_gaps(t: NDArray[np.float64], path: Path) -> None:
    gaps = find_gaps(t)
    if len(gaps):
        row = int(gaps[0])
        usual = float(np.median(np.diff(t)))
        raise ConfigError(
            f"{_at(path, row + 1, 0)}: found a gap of {t[row + 1] - t[row]:.6g} s after t = {t[row]:.10g} s, expected "
            f"at most {GAP_RATIO:g} times the usual {usual:.6g} s; there {_are(len(gaps))} in all "
            "(--gaps hold goes on across them)"
        )


def _are(count: int) -> str:
    """Format a count with its verb."""
    return "is 1" if count == 1 else f"are {count}"


def velocity_warnings(hands: Hands) -> list[str]:
    """Return warnings about velocities that do not match their heights."""
    found = []
    # Compare over a tenth of a second, so that noise and filter delay have no effect.
    every = max(1, round(0.1 / float(np.median(np.diff(hands.t)))))
    areas = 0.5 * (hands.vz[1:] + hands.vz[:-1]) * np.diff(hands.t)[:, None]
    for column, side in enumerate(("left", "right")):
        moved = np.diff(hands.z[::every, column])
        integrated = np.diff(np.concatenate(([0.0], np.cumsum(areas[:, column])))[::every])
        size = float(np.sqrt(moved @ moved))
        if np.sqrt((integrated - moved) @ (integrated - moved)) > 0.5 * size and size > 1e-3:
            found.append(
                f"v_{side} is not the rate of z_{side}: it makes {integrated @ moved / size**2:.3g} times the movement "
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
        if not force:
            refuse_existing(result, ", or overwrite it with --force")
        plan[path] = result
        taken[result] = path
    return plan


# --- writing -----------------------------------------------------------------------------------------------------


def write_table(
    path: Path, columns: Mapping[str, NDArray[np.float64]], about: Mapping[str, str], force: bool = False
) -> None:
    """Write a table, complete or not at all.

    ``about``: provenance of the table; a Parquet file stores it in its metadata, under "netboard", as JSON. ``force``:
    replace an existing file.
    """
    write = _write_parquet if path.suffix.lower() == ".parquet" else _write_csv
    with new_file(path, force=force) as part:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(part, columns, about)


def _write_csv(path: Path, columns: Mapping[str, NDArray[np.float64]], about: Mapping[str, str]) -> None:
    """Write a CSV file in batches of rows; csv writes floats with the fewest digits that read back as the same."""
    table = np.stack(list(columns.values()), axis=1)
    with path.open("w", encoding="ascii", newline="") as file:
        writer = CsvWriter(file)
        writer.row(columns)
        for first in range(0, len(table), ROWS):
            writer.rows(table[first : first + ROWS].tolist())


def _write_parquet(path: Path, columns: Mapping[str, NDArray[np.float64]], about: Mapping[str, str]) -> None:
    arrow, parquet = library("pyarrow", "parquet"), library("pyarrow.parquet", "parquet")
    table = arrow.table(dict(columns))
    parquet.write_table(table.replace_schema_metadata({"netboard": json.dumps(dict(about))}), path)
