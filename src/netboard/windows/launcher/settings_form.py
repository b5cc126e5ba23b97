"""Forms made from declarations: a field for each key of a table, with its unit, limits and help. Pure: no Qt.

`netboard.base.settings` declares the keys; nothing about a single key is written here. A form yields a TOML text with
the keys that differ from the defaults.
"""

import re
import tomllib
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import TypeAdapter

from netboard.base.config import SIDES, Config, parse
from netboard.base.errors import ConfigError
from netboard.base.settings import Key, Path, SettingsTable, read, tables, to_toml
from netboard.devices.contract import registry
from netboard.task.studies import library

T = TypeVar("T")

CHOICE = re.compile('"([^"]*)"')
"""A word among the values that a key takes."""

ONLY_WORDS = re.compile('"[^"]*"( or "[^"]*")*')
"""The values of a key that takes words only."""

DEVICES = {(("agents", side), "device") for side in SIDES}
"""Keys that name a device backend: the registry of backends has the choices."""

STUDY = (("session",), "study")
"""The key that names a study: a built-in one, or a file."""


@dataclass(frozen=True, slots=True)
class FormField:
    """A field of a form."""

    path: Path
    key: Key
    text: str  # the value, as the form shows it

    @property
    def choices(self) -> tuple[str, ...]:
        """The words that the key takes; empty if it takes others."""
        if (self.path, self.key.name) in DEVICES:
            return registry.names()
        if self.key.kind == "true or false":
            return ("false", "true")
        return tuple(CHOICE.findall(self.key.kind)) if ONLY_WORDS.fullmatch(self.key.kind) else ()

    @property
    def suggestions(self) -> tuple[str, ...]:
        """Words to choose from where others are allowed, too."""
        return library.names() if (self.path, self.key.name) == STUDY else ()

    @property
    def unit(self) -> str:
        """Unit of the value; empty for a pure number or a text."""
        return "" if self.key.unit == "1" else self.key.unit

    @property
    def help(self) -> str:
        """Description, and what is expected."""
        free = self.key.kind == "text" and not self.key.limits
        return self.key.text if free or self.choices else f"{self.key.text}; {self.key.expected}"

    @property
    def usual(self) -> bool:
        """Whether the value is the default."""
        return self.text == as_text(self.key.default)


def form_tables(cls: type[Any] = Config) -> tuple[SettingsTable, ...]:
    """Return the tables that have keys."""
    return tuple(table for table in tables(cls) if table.keys)


def fields_of(settings: object, table: SettingsTable) -> tuple[FormField, ...]:
    """Return the fields of a table with their present values."""
    node = settings
    for step in table.path:
        node = getattr(node, step)
    return tuple(FormField(table.path, key, as_text(getattr(node, key.name))) for key in table.keys)


def as_text(value: Any) -> str:
    """Return a value as a form shows it: texts without quotes, tables in TOML's braces."""
    return value if isinstance(value, str) else to_toml(value)


def changed_text(text: str, field: FormField, entry: str) -> str:
    """Return the TOML text of a configuration with one key changed.

    Raises `ConfigError`, in the words of `netboard.base.settings`, if the value is not valid.
    """
    override = f"{'.'.join((*field.path, field.key.name))}={entry}"
    return text_of(parse(text, "the form", (override,), "this entry"))


def text_of(settings: Any) -> str:
    """Return the keys that differ from the defaults as TOML; reading it gives equal settings."""
    lines: list[str] = []
    for table in form_tables(type(settings)):
        changed = [field for field in fields_of(settings, table) if not field.usual]
        if changed:
            lines += ["", f"[{table.name}]"] if table.path else []
            lines += [f"{field.key.name} = {_toml(settings, field)}" for field in changed]
    return "\n".join(lines).strip() + "\n"


def _toml(settings: Any, field: FormField) -> str:
    node = settings
    for step in (*field.path, field.key.name):
        node = getattr(node, step)
    return to_toml(node)


def checked(cls: type[T], text: str, source: str, overrides: tuple[str, ...] = ()) -> T:
    """Read settings of a class; raise `ConfigError` with a line for each problem."""
    return read(TypeAdapter(cls), cls, text, source, overrides)


def keeps_all(text: str, source: str, backup: str) -> str:
    """Return what is lost if a form rewrites a file: its comments; empty if nothing is."""
    try:
        comments = len(re.findall(r"^\s*#|\s#\s", text, re.MULTILINE))
        tomllib.loads(text)
    except ValueError as error:
        raise ConfigError(f"{source}: not valid TOML: {error}") from None
    return f"{source} had comments, which stay only in {backup}" if comments else ""
