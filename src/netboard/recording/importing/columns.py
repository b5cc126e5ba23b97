"""Columns of an imported table: names, units and meanings, and the mapping from the table's own names.

All columns are in SI units; up and right are positive. Options map other names and units: ``left_z=Height1`` (`mapped`)
and ``left_z=mm`` or, for an inverted axis, ``left_z=-mm`` (`scales`).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from netboard.base.errors import ConfigError
from netboard.base.nearest import did_you_mean


@dataclass(frozen=True, slots=True)
class ImportColumn:
    """Definition of a column."""

    name: str
    kind: Literal["number", "integer", "word"]
    unit: str
    text: str
    needed: bool = False


COLUMNS: dict[str, ImportColumn] = {
    column.name: column
    for column in (
        ImportColumn("time", "number", "s", "time of the row, increasing, from any origin", needed=True),
        ImportColumn(
            "left_z", "number", "m", "height of the left stylus above its end of the level board", needed=True
        ),
        ImportColumn(
            "right_z", "number", "m", "height of the right stylus above its end of the level board", needed=True
        ),
        ImportColumn("left_vz", "number", "m/s", "rate of left_z; computed if missing"),
        ImportColumn("right_vz", "number", "m/s", "rate of right_z; computed if missing"),
        ImportColumn("left_x", "number", "m", "left stylus, out of the screen"),
        ImportColumn("left_y", "number", "m", "left stylus, to the right"),
        ImportColumn("right_x", "number", "m", "right stylus, out of the screen"),
        ImportColumn("right_y", "number", "m", "right stylus, to the right"),
        ImportColumn("z", "number", "m", "height of the board's centre"),
        ImportColumn("vz", "number", "m/s", "rate of z; computed if missing"),
        ImportColumn("theta", "number", "rad", "tilt of the board, + = right end up"),
        ImportColumn("omega", "number", "rad/s", "rate of theta; computed if missing"),
        ImportColumn("p", "number", "m", "ball along the board, + = right"),
        ImportColumn("vp", "number", "m/s", "rate of p; computed if missing"),
        ImportColumn("left_force", "number", "N", "force on the left hand, + = up"),
        ImportColumn("right_force", "number", "N", "force on the right hand, + = up"),
        ImportColumn("left_coupling", "number", "N", "force of the left hand on the board, + = up"),
        ImportColumn("right_coupling", "number", "N", "force of the right hand on the board, + = up"),
        ImportColumn("trial", "integer", "1", "number of the trial, from 1; 0 or empty between trials"),
        ImportColumn("attempt", "integer", "1", "number of the attempt at it, from 1; 1 if missing"),
        ImportColumn("target", "integer", "1", "side of the target: -1 left, +1 right; 0 if missing"),
        ImportColumn(
            "phase", "word", "", "idle, levelling, running (ball free), holding (in the target), or netboard's numbers"
        ),
        ImportColumn("outcome", "word", "", "success, fell, timed_out, abort, skip or pause, in any row of an attempt"),
        ImportColumn("completion", "number", "s", "completion time of a success, in any row of an attempt"),
    )
}

RATES = {"left_z": "left_vz", "right_z": "right_vz", "z": "vz", "theta": "omega", "p": "vp"}
"""The velocity column of each position that has one."""

OF_ATTEMPT = ("outcome", "completion")
"""Columns with one value for an attempt, in any of its rows."""

TASK = ("z", "theta", "p", "trial", "phase")
"""Columns of which a table with task data has at least one."""

UNITS: dict[str, dict[str, tuple[float, float]]] = {
    "s": {"s": (1, 1), "ms": (1, 1e3), "us": (1, 1e6), "ns": (1, 1e9), "min": (60, 1)},
    "m": {"m": (1, 1), "cm": (1, 100), "mm": (1, 1e3), "um": (1, 1e6)},
    "m/s": {"m/s": (1, 1), "cm/s": (1, 100), "mm/s": (1, 1e3)},
    "rad": {"rad": (1, 1), "mrad": (1, 1e3), "deg": (math.pi, 180)},
    "rad/s": {"rad/s": (1, 1), "mrad/s": (1, 1e3), "deg/s": (math.pi, 180)},
    "N": {"N": (1, 1), "mN": (1, 1e3)},
    "1": {"1": (1, 1)},
}
"""Accepted units for each SI unit: multiply by the first factor, divide by the second."""


def _pairs(option: str, words: Sequence[str], example: str) -> dict[str, str]:
    """Parse options such as ``left_z=mm``."""
    pairs: dict[str, str] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not (equals and name and value):
            raise ConfigError(f"{option} {word}: expected COLUMN=..., as in {option} {example}")
        if name not in COLUMNS:
            meant = did_you_mean(name, COLUMNS) or f", expected one of {', '.join(COLUMNS)}"
            raise ConfigError(f"{option} {word}: netboard has no column {name}{meant}")
        if name in pairs:
            raise ConfigError(f"{option}: {name} is given twice")
        pairs[name] = value
    return pairs


def mapped(source: str, names: Sequence[str], words: Sequence[str], known: Sequence[str] = ()) -> dict[str, str]:
    """Map netboard's column names to those of a table.

    ``words``: names of columns in the table, as ``column=theirs``; the other columns have netboard's names. Returns the
    table's name of each column found, by netboard's name. Raises `ConfigError` if a named column or a required one is
    missing, or two columns have the same name.
    """
    given = _pairs("--map", words, "left_z=Height1")
    for name, theirs in given.items():
        if theirs not in names:
            raise ConfigError(f"--map {name}={theirs}: {source} has no column {theirs}; it has {', '.join(names)}")
    taken = set(given.values())
    found = {name: given.get(name, name) for name in COLUMNS if name in given or (name in names and name not in taken)}
    twice = sorted({name for name in found.values() if names.count(name) > 1})
    if twice:
        raise ConfigError(f"{source}: {', '.join(twice)} is there twice")
    missing = [column for column in COLUMNS.values() if column.needed and column.name not in (*found, *known)]
    if missing:
        those = ", ".join(f"{column.name} [{column.unit}]" for column in missing)
        raise ConfigError(
            f"{source}: missing: {those}; it has {', '.join(names)}. Say which is which: --map {missing[0].name}=THEIRS"
        )
    return found


def scales(words: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the unit conversions.

    ``words``: units of columns, as ``column=unit`` or ``column=-unit``; the other columns are in SI units. Returns a
    multiplier and a divisor for each column.
    """
    found: dict[str, tuple[float, float]] = dict.fromkeys(COLUMNS, (1.0, 1.0))
    for name, unit in _pairs("--unit", words, "left_z=mm").items():
        known: Mapping[str, tuple[float, float]] = UNITS.get(COLUMNS[name].unit, {})
        if unit.removeprefix("-") not in known:
            expected = ", ".join(known) or "none: it is words"
            raise ConfigError(f"--unit {name}={unit}: expected one of {expected}, with - if its axis is inverted")
        times, over = known[unit.removeprefix("-")]
        found[name] = (-times if unit.startswith("-") else times, over)
    return found
