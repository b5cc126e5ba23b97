"""Forms for a study, made from the declarations of its parts: the study, orders, kinds, levels, questions. Pure: no Qt.

A form changes one key in the study's text, or adds or removes one part, and keeps all other lines, with their comments.
What is written in a way that this cannot change is refused in words: the text is the study, and the form a way to edit
it.
"""

import copy
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, get_args, get_origin, get_type_hints

from netboard.base.errors import ConfigError
from netboard.base.settings import Key, Path, parse_toml, tables, to_toml
from netboard.base.tables.questionnaires import FormQuestion
from netboard.task.studies.parts import CHANGED, PLANNED, Changes, Factor, Kind, Level, Questionnaire
from netboard.task.studies.study import Study, parse_study
from netboard.windows.launcher.settings_form import FormField, as_text

OWN = "its own keys"
"""Name of the form of a part's own keys, beside those of the configuration's tables that it changes."""

HEADER = re.compile(r"^\s*\[([^\[\]]+)\]\s*(?:#.*)?$")
"""A line that begins a table."""

ENTRY = re.compile(r"""^(\s*)((?:[\w.-]|"[^"]*"|\s(?=[\w."=]))+?)\s*=""")
"""A line that begins with a key."""

ORDERS = "orders"
"""Collection whose parts are texts, not tables: its form has a field for each."""

LEVELS = "levels"
"""Collection in a factor, of which a new one has two."""

FIRST: dict[type[Any], Mapping[str, Any]] = {
    Factor: {LEVELS: {"first": {}, "second": {}}},
    Questionnaire: {"text": "?"},
    FormQuestion: {"text": "?"},
}
"""What a new part has where there is none to copy, or a copy would contradict the other: so the study stays valid."""

COPIED = (Level, Kind, FormQuestion)
"""Declarations of parts of which a new one begins as a copy of the last."""

COMMENT = re.compile(r"\s+#[^\"']*$")


@dataclass(frozen=True, slots=True)
class StudyPart:
    """A part of a study that has a form: its path in the text, and its object."""

    path: Path
    part: Any

    @property
    def name(self) -> str:
        """The name by which it is chosen."""
        return ".".join(self.path) or "study"

    @property
    def forms(self) -> tuple[str, ...]:
        """Its forms: of its own keys, and of the tables of the configuration that it may change."""
        return (OWN, *CHANGED) if isinstance(self.part, Changes) else (OWN,)

    def fields(self, form: str) -> tuple[FormField, ...]:
        """Return the fields of one of its forms, with their present values."""
        if form == OWN:
            return tuple(FormField(self.path, key, _text(value)) for key, value in self._own())
        changed, planned = getattr(self.part, form), PLANNED.get(form, ())
        keys = (key for key in tables(CHANGED[form])[0].keys if key.name not in planned and _single(key))
        path = (*self.path, form)
        return tuple(FormField(path, key, _text(changed.get(key.name, key.default))) for key in keys)

    def _own(self) -> Iterator[tuple[Key, Any]]:
        if isinstance(self.part, dict):
            kind = "blocks of this order, such as 4 bimanual, 6 dyadic; empty: removes it"
            yield from ((Key(name, "text", "", "", kind, "", True), text) for name, text in self.part.items())
        else:
            own = (key for key in tables(type(self.part))[0].keys if _single(key))
            yield from ((key, getattr(self.part, key.name)) for key in own)


@dataclass(frozen=True, slots=True)
class Collection:
    """A table of a study that holds parts by name, and the declaration of these parts; a text for an order."""

    path: Path
    holds: type[Any]
    names: tuple[str, ...]

    @property
    def name(self) -> str:
        """The name by which it is chosen."""
        return ".".join(self.path)


def collections_of(study: Study) -> tuple[Collection, ...]:
    """Return the tables to which a part can be added, by the declarations of the study and of its parts."""
    return tuple(_collections(study, ()))


def _collections(part: Any, path: Path) -> Iterator[Collection]:
    """Yield the collections in a part, each before those in its own parts."""
    hints = get_type_hints(type(part))
    for item in fields(part):
        own = (*path, item.name)
        if get_origin(hints[item.name]) is not dict:
            continue
        holds = get_args(hints[item.name])[1]
        held = getattr(part, item.name)
        if own == (ORDERS,) or is_dataclass(holds):
            yield Collection(own, holds, tuple(held))
        for name, inner in held.items() if is_dataclass(holds) else ():
            yield from _collections(inner, (*own, name))


def parts_of(study: Study) -> tuple[StudyPart, ...]:
    """Return the parts of a study that have forms."""
    return tuple(_parts(study))


def _parts(study: Study) -> Iterator[StudyPart]:
    yield StudyPart((), study)
    yield StudyPart(("orders",), study.orders)
    yield StudyPart(("analysis",), study.analysis)
    for name, kind in study.kinds.items():
        yield StudyPart(("kinds", name), kind)
    for name, factor in study.factors.items():
        yield StudyPart(("factors", name), factor)
        for level, changes in factor.levels.items():
            yield StudyPart(("factors", name, "levels", level), changes)
    for name, questionnaire in study.questionnaires.items():
        yield StudyPart(("questionnaires", name), questionnaire)
        for label, question in questionnaire.questions.items():
            yield StudyPart(("questionnaires", name, "questions", label), question)


def changed_study(text: str, field: FormField, entry: str) -> str:
    """Return a study's text with a key changed; raise `ConfigError` if its value or notation forbids that."""
    value = _value(field, entry)
    expected = copy.deepcopy(parse_toml(text, "study"))
    table = expected
    for step in field.path:
        table = table.setdefault(step, {})
    table[field.key.name] = value
    path = (*field.path, field.key.name)
    return _checked(_with_line(text.splitlines(), path, to_toml(_frozen(value))), (expected,), path)


def with_part(text: str, collection: Collection, name: str) -> str:
    """Return a study's text with a new part; raise `ConfigError` if its name or the notation forbids that."""
    if name in collection.names:
        raise ConfigError(f"{collection.name}: found {name} already, expected another name")
    path = (*collection.path, name)
    expected = copy.deepcopy(parse_toml(text, "study"))
    if collection.path == (ORDERS,):
        order = Key(name, "text", "", "", "", "", True)
        return changed_study(text, FormField(collection.path, order, ""), next(iter(expected.get("kinds", {})), ""))
    table = expected
    for step in collection.path:
        table = table.setdefault(step, {})
    copies = collection.holds in COPIED and table
    table[name] = copy.deepcopy(list(table.values())[-1] if copies else FIRST.get(collection.holds, {}))
    lines = text.splitlines()
    place = _end_of(lines, collection.path)
    return _checked([*lines[:place], *_tables_of(table[name], path), *lines[place:]], (expected,), path)


def _tables_of(values: Mapping[str, Any], path: Path) -> Iterator[str]:
    """Yield the lines of a new part: its keys, and the tables of its own parts."""
    yield from ("", f"[{_dotted(path)}]")
    own = {name: value for name, value in values.items() if name != LEVELS}
    yield from (f"{_dotted(steps)} = {to_toml(_frozen(value))}" for steps, value in _leaves(own))
    for name, level in values.get(LEVELS, {}).items():
        yield from _tables_of(level, (*path, LEVELS, name))


def _leaves(values: Mapping[str, Any], path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Yield the values in nested tables, with their paths."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _leaves(value, (*path, name))
        else:
            yield (*path, name), value


def without_part(text: str, path: Path) -> str:
    """Return a study's text without a part; raise `ConfigError` if the study or the notation forbids that."""
    expected = copy.deepcopy(parse_toml(text, "study"))
    table = expected
    for step in path[:-1]:
        table = table[step]
    del table[path[-1]]
    return _checked(_without(text.splitlines(), path), (expected, _pruned(expected, path[:-1])), path)


def _pruned(values: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return values without the tables of a path that are empty."""
    values = copy.deepcopy(values)
    for depth in range(len(path), 0, -1):
        table = values
        for step in path[: depth - 1]:
            table = table[step]
        if not table[path[depth - 1]]:
            del table[path[depth - 1]]
    return values


def _checked(lines: list[str], expected: tuple[dict[str, Any], ...], path: Path) -> str:
    """Return the text of lines that has expected values; refuse one that has others, or is no valid study."""
    made = "\n".join(lines) + "\n"
    try:
        found: object = tomllib.loads(made)
    except ValueError:
        found = None
    if found not in expected:
        raise ConfigError(f"{'.'.join(path)}: is written over several lines, or in one with others; use the text")
    parse_study(made, "this entry")
    return made


def _end_of(lines: list[str], path: Path) -> int:
    """Return the line before which a part of a table is put: after the last table there, else after all lines."""
    table: Path = ()
    ends = dict.fromkeys(range(1, len(path) + 1), 0)
    for place, line in enumerate(lines):
        if header := HEADER.match(line):
            table = _steps(header[1])
        if line.strip() and not line.lstrip().startswith("#"):  # a comment may belong to what follows
            ends |= {depth: place + 1 for depth in ends if table[:depth] == path[:depth]}
    return next((ends[depth] for depth in range(len(path), 0, -1) if ends[depth]), len(lines))


def _without(lines: list[str], path: Path) -> list[str]:
    """Return lines without those of a part, and without the comment right above each of them."""
    kept: list[str] = []
    above: list[str] = []  # empty lines and comments before the line that they belong to
    table: Path = ()
    for line in lines:
        if not line.strip() or line.lstrip().startswith("#"):
            above.append(line)
            continue
        header = HEADER.match(line)
        table = _steps(header[1]) if header else table
        entry = None if header else ENTRY.match(line)
        own = (*table, *_steps(entry[2])) if entry else table
        if own[: len(path)] != path:
            kept += [*above, line]
        else:
            while above and above.pop().strip():
                pass
            kept += above
        above = []
    return [*kept, *above]


def _with_line(lines: list[str], path: Path, value: str) -> list[str]:
    """Return lines in which a key has a value: in its line, or in a new one at the end of the closest table."""
    table: Path = ()
    closest, depth = 0, -1  # line before which a new one is put, and how many steps of the path its table has
    for place, line in enumerate(lines):
        if header := HEADER.match(line):
            table = _steps(header[1])
        elif (entry := ENTRY.match(line)) and (*table, *_steps(entry[2])) == path:
            comment = COMMENT.search(line)
            return [*lines[:place], f"{entry[0]} {value}{comment[0] if comment else ''}", *lines[place + 1 :]]
        own = table == path[: len(table)] and len(table) >= depth and len(table) < len(path)
        if own and line.strip() and not line.lstrip().startswith("#"):  # a comment may belong to what follows
            closest, depth = place + 1, len(table)
    return [*lines[:closest], f"{_dotted(path[max(depth, 0) :])} = {value}", *lines[closest:]]


def _dotted(path: Path) -> str:
    """Return a path as a dotted key."""
    return ".".join(step if re.fullmatch(r"[\w-]+", step) else to_toml(step) for step in path)


def _steps(dotted: str) -> Path:
    """Return the steps of a dotted key."""
    return tuple(quoted or bare for quoted, bare in re.findall(r'"([^"]*)"|([\w-]+)', dotted))


def _value(field: FormField, entry: str) -> Any:
    """Return the TOML value of what was entered."""
    if field.key.plain_text:
        return entry
    try:
        return tomllib.loads(f"value = {entry}")["value"]
    except ValueError:
        return entry


def _single(key: Key) -> bool:
    """Return whether a key has one value, and no table."""
    return not isinstance(key.default, dict)


def _frozen(value: object) -> Any:
    """Return a value of TOML as it is written: lists as tuples."""
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


def _text(value: object) -> str:
    return as_text(_frozen(value))
