"""Manifest of a study import: a TOML file that lists tables and describes each of them.

The top-level keys apply to every table; a ``[[recording]]`` extends or overrides them. Besides `KEYS`, both accept
every table of the configuration (``session``, ``block``, ``physics``, ...). All errors are found before anything is
written, each with file, line and key.
"""

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import chain
from math import inf
from pathlib import Path
from typing import Any

from netboard.base.config import Config, parse
from netboard.base.errors import ConfigError
from netboard.base.files.text import read_text
from netboard.base.nearest import one_of
from netboard.base.settings import parse_toml, to_toml
from netboard.recording.importing.columns import COLUMNS, scales
from netboard.recording.importing.table_import import ImportOptions

KEYS = {
    "columns": 'a table such as columns.left_z = { name = "Height1", unit = "mm" }',
    "rate": "samples a second, at least 0.1 [Hz]",
    "gap": "the longest time between two samples that belong together, at least 0.002 [s]",
    "interpolation": '"cubic" or "linear"',
    "simulate": "true or false",
}
"""Top-level and recording keys, with the expected values in words."""

LEAST = {"rate": 0.1, "gap": 0.002}
"""Minimum of the numeric keys [Hz, s]."""

HEAD = ("config", "recording")
TABLES = tuple(field.name for field in fields(Config))
HEADER = re.compile(r"^\s*\[\[\s*recording\s*\]\]")


@dataclass(frozen=True, slots=True)
class ListedTable:
    """A listed table: its location in the manifest, file, configuration and import options."""

    where: str
    path: Path
    config: Config
    options: ImportOptions


class Manifest:
    """A manifest after reading. Table names are relative to its folder."""

    def __init__(self, path: Path) -> None:
        self.path = path
        text = read_text(path)
        values = parse_toml(text, str(path))
        self._lines = text.splitlines()
        self._starts = [number for number, line in enumerate(self._lines) if HEADER.match(line)]
        self.listed: list[ListedTable] = []
        self.problems: list[str] = []
        head = {key: value for key, value in values.items() if key not in HEAD}
        recordings = values.get("recording", [])
        if not isinstance(recordings, list) or not recordings or not all(isinstance(one, dict) for one in recordings):
            raise ConfigError(f'{path}: found no recording, expected [[recording]] with file = "..." for each table')
        self.problems += self._key_problems(head, None)
        base = self._base(values.get("config"))
        whole = not self.problems
        problems_of = [list(self._key_problems(one, place)) for place, one in enumerate(recordings)]
        self.problems += chain.from_iterable(problems_of)
        if whole:
            places = [place for place, problems in enumerate(problems_of) if not problems]
            own = [_merged(head, recordings[place]) for place in places]
            for place, one in zip(places, _with_block_counts(base, own), strict=True):
                self._add(one, place)

    def _base(self, name: object) -> dict[str, Any]:
        """Read the base configuration of all recordings."""
        if name is None:
            return {}
        if not isinstance(name, str):
            self.problems.append(f"{self._at(None, 'config')}: found {name!r}, expected the name of a TOML file")
            return {}
        place = self.path.parent / name
        try:
            text = read_text(place)
            parse(text, str(place))
        except ConfigError as error:
            self.problems += [f"{self._at(None, 'config')}: {line}" for line in str(error).splitlines()]
            return {}
        return tomllib.loads(text)

    def _key_problems(self, values: Mapping[str, Any], place: int | None) -> Iterator[str]:
        """Yield errors for unknown keys and values of the wrong type."""
        file: Any = values.get("file")
        if place is not None and not isinstance(file, str):
            yield f"{self._at(place, 'file')}: found {file!r}, expected the name of a .csv or .parquet file"
        elif place is not None and not (self.path.parent / file).is_file():
            yield f"{self._at(place, 'file')}: {self.path.parent / file}: no such file"
        known = (*KEYS, *TABLES, *(HEAD if place is None else ("file",)))
        for key, value in values.items():
            if key not in known:
                yield f"{self._at(place, key)}: unknown key, expected {one_of(key, known)}"
            elif key in TABLES and not isinstance(value, dict):
                yield f"{self._at(place, key)}: found {value!r}, expected a table of the configuration"
            elif key in KEYS and not _fits(key, value):
                yield f"{self._at(place, key)}: found {value!r}, expected {KEYS[key]}"
            elif key == "columns":
                for name, problem in _column_problems(value):
                    yield f"{self._at(place, f'{key}.{name}')}: {problem}"

    def _add(self, values: dict[str, Any], place: int) -> None:
        path = self.path.parent / values["file"]
        where = f"{self._at(place)} ({values['file']})"
        try:
            config = parse(_toml_of(values), where)
        except ConfigError as error:
            self.problems += str(error).splitlines()
            return
        self.listed.append(ListedTable(where, path, config, _options(values)))

    def _at(self, place: int | None, key: str = "") -> str:
        """Format a location in the file: recording or top level, and the line of a key if found."""
        first = 0 if place is None else self._starts[place] if place < len(self._starts) else None
        if first is None:  # the recordings are written as an array
            return f"{self.path}: recording {(place or 0) + 1}" + (f", key {key}" if key else "")
        stop = next((start for start in self._starts if start > first), len(self._lines))
        if place is None:
            stop = self._starts[0] if self._starts else len(self._lines)
        pattern = re.compile(rf'^\s*\[?\s*(recording\.)?"?{re.escape(key)}"?\s*[.=\]]')
        found = next((n for n in range(first, stop) if key and pattern.match(self._lines[n])), None)
        line = "" if found is None and place is None else f", line {(first if found is None else found) + 1}"
        return f"{self.path}{line}" + (f", key {key}" if key else "")


def _fits(key: str, value: Any) -> bool:
    match key:
        case "columns":
            return isinstance(value, dict)
        case "simulate":
            return isinstance(value, bool)
        case "interpolation":
            return value in ("cubic", "linear")
        case _:  # numeric keys
            return type(value) in (int, float) and LEAST[key] <= value < inf


def _column_problems(columns: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield unknown columns and units."""
    for name, theirs in columns.items():
        parts = {"name": theirs} if isinstance(theirs, str) else theirs
        if name not in COLUMNS:
            yield name, f"unknown column, expected {one_of(name, COLUMNS)}"
        elif not isinstance(parts, dict) or not all(isinstance(one, str) for one in parts.values()):
            yield name, f'found {theirs!r}, expected a name, or {{ name = "...", unit = "..." }}'
        elif not set(parts) <= {"name", "unit"}:
            yield name, f"found {', '.join(parts)}, expected name and unit"
        elif "unit" in parts:
            try:
                scales([f"{name}={parts['unit']}"])
            except ConfigError as error:
                yield name, f"unit: {str(error).partition(': ')[2]}, found {parts['unit']}"


def _options(values: Mapping[str, Any]) -> ImportOptions:
    columns = {name: {"name": one} if isinstance(one, str) else one for name, one in values.get("columns", {}).items()}
    return ImportOptions(
        names=tuple(f"{name}={one['name']}" for name, one in columns.items() if "name" in one),
        units=tuple(f"{name}={one['unit']}" for name, one in columns.items() if "unit" in one),
        simulate=values.get("simulate", False),
        interpolation=values.get("interpolation", "cubic"),
        gap=float(values.get("gap", 0.1)),
        rate=float(values["rate"]) if "rate" in values else None,
    )


def _merged(under: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Merge two tables recursively; the second one takes precedence."""
    merged = dict(under)
    for key, value in over.items():
        below = merged.get(key)
        merged[key] = _merged(below, value) if isinstance(below, dict) and isinstance(value, dict) else value
    return merged


def _with_block_counts(base: dict[str, Any], recordings: Sequence[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Add the base, and the number of blocks of a session from its highest block number, unless a recording has it."""
    most: dict[tuple[str, str], int] = {}
    for one in (_merged(base, own) for own in recordings):
        session, number = one.get("session", {}), one.get("block", {}).get("number", 1)
        key = str(session.get("dyad")), str(session.get("name"))
        most[key] = max(most.get(key, 1), number if isinstance(number, int) else 1)
    for own in recordings:
        session = _merged(base, own).get("session", {})
        blocks = most[str(session.get("dyad")), str(session.get("name"))]
        yield _merged(_merged(base, {"block": {"blocks": blocks}}), own)


def _toml_of(values: Mapping[str, Any]) -> str:
    """Format the tables of the configuration as TOML."""
    return "\n".join(f"{table} = {_inline(values[table])}" for table in TABLES if table in values)


def _inline(value: Any) -> str:
    """Format a value or an inline table."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{to_toml(key)} = {_inline(one)}" for key, one in value.items()) + "}"
    return f"[{', '.join(map(_inline, value))}]" if isinstance(value, list) else to_toml(value)
