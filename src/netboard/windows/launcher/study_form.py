"""Forms for a study, made from the declarations of its parts: the study, orders, kinds, levels, questions. Pure: no Qt.

A form changes one key in the study's text and keeps all other lines, with their comments. What is written in a way that
one line cannot change is refused in words: the text is the study, and the form a way to edit it.
"""

import copy
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from netboard.base.errors import ConfigError
from netboard.base.settings import Key, Path, parse_toml, tables, to_toml
from netboard.task.studies.parts import CHANGED, PLANNED, Changes
from netboard.task.studies.study import Study, parse_study
from netboard.windows.launcher.settings_form import FormField, as_text

OWN = "its own keys"
"""Name of the form of a part's own keys, beside those of the configuration's tables that it changes."""

HEADER = re.compile(r"^\s*\[([^\[\]]+)\]\s*(?:#.*)?$")
"""A line that begins a table."""

ENTRY = re.compile(r"""^(\s*)((?:[\w.-]|"[^"]*"|\s(?=[\w."=]))+?)\s*=""")
"""A line that begins with a key."""

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
            kind = "blocks of this order, such as 4 bimanual, 6 dyadic"
            yield from ((Key(name, "text", "", "", kind, "", True), text) for name, text in self.part.items())
        else:
            own = (key for key in tables(type(self.part))[0].keys if _single(key))
            yield from ((key, getattr(self.part, key.name)) for key in own)


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
    lines = _with_line(text.splitlines(), path, to_toml(_frozen(value)))
    made = "\n".join(lines) + "\n"
    try:
        found: object = tomllib.loads(made)
    except ValueError:
        found = None
    if found != expected:
        raise ConfigError(f"{'.'.join(path)}: is written over several lines, or in one with others; use the text")
    parse_study(made, "this entry")
    return made


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
    words = (step if re.fullmatch(r"[\w-]+", step) else to_toml(step) for step in path[max(depth, 0) :])
    return [*lines[:closest], f"{'.'.join(words)} = {value}", *lines[closest:]]


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
