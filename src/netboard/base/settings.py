"""Read and write tables of settings (frozen dataclasses) as TOML.

Every field is annotated with `about`: its description, unit and limits. The validation, the error messages, the
commented template and the tables of the documentation all follow from it. A problem is reported as one line with
source, table, key, what was found and what was expected, and all problems of a text are reported together.

This module contains no particular setting; they are in `netboard.base.tables`.
"""

import dataclasses
import functools
import json
import re
import tomllib
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import AllowInfNan, ConfigDict, Field, Strict, StrictInt, StrictStr, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from netboard.base.errors import ConfigError
from netboard.base.nearest import did_you_mean, nearest

FORBID_UNKNOWN_KEYS = ConfigDict(extra="forbid")
"""Configuration of every table: an unknown key is an error."""

Number = Annotated[float, Strict(), AllowInfNan(False)]
"""A finite number within a list, where `about` cannot refuse texts, true and false."""

T = TypeVar("T")
Path = tuple[str, ...]
"""Names of nested tables, outermost first."""

_KINDS: dict[Any, str] = {
    float: "a number",
    int: "a whole number",
    StrictInt: "a whole number",
    bool: "true or false",
    str: "text",
}
_DEEP_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){100}""")
"""A dotted key, of which `tomllib` needs memory with the square of its parts."""

_CHOICE = re.compile('"([^"]*)"')
"""A word among the values that a key takes."""

_SIGNS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}


class TextForm(NamedTuple):
    """Form of a text.

    Attributes
    ----------
    pattern : str
        Regular expression that the whole text matches.
    words : str
        The form for people, with an example; it follows the word "text".
    """

    pattern: str
    words: str


MAX_LABEL = 80
"""Largest length of a name; two of them fit the name of a recording [1]."""

LABEL = TextForm("^[A-Za-z0-9_-]+$", f"of at most {MAX_LABEL} letters, digits, - and _, such as D03")
"""Form of a name that is part of the names of files and columns; in an old recording it may be longer."""


def about(text: str, unit: str = "", *, form: TextForm | None = None, **limits: Any) -> FieldInfo:
    """Describe one key.

    Parameters
    ----------
    text : str
        One-line description for users.
    unit : str
        SI unit symbol, "1" for a pure number, "" if it is not a quantity.
    form : Form or None
        Form of a text; None for any.
    **limits
        pydantic constraints: ``gt``, ``ge``, ``lt``, ``le``, ``min_length``.

    Returns
    -------
    FieldInfo
        The annotation. A quantity must be finite; the only conversion is from a whole number to a float.
    """
    words = _in_words(limits)
    if form is not None:
        words, limits["pattern"] = form.words, form.pattern
    if unit:
        limits.update(strict=True, allow_inf_nan=False)
    info: FieldInfo = Field(description=text, json_schema_extra={"unit": unit, "limits": words}, **limits)
    return info


def _in_words(limits: dict[str, Any]) -> str:
    """Limits as text: ``> 0 and <= 10``."""
    words = [f"{sign} {limits[name]:.10g}" for name, sign in _SIGNS.items() if name in limits]
    if "min_length" in limits:
        words.append("of at least one character")
    return " and ".join(words)


@dataclasses.dataclass(frozen=True, slots=True)
class Key:
    """One key of a table, as the documentation and the error messages need it.

    Attributes
    ----------
    name : str
        Key as written in TOML.
    kind : str
        Values that it takes, in words, such as "a number" or "left or right".
    unit : str
        SI unit symbol, "1" for a pure number, "" if it is not a quantity.
    limits : str
        Limits in words, empty if there are none.
    text : str
        One-line description for users.
    default : object
        Value of a missing key.
    plain_text : bool
        True if it takes text of any form.
    """

    name: str
    kind: str
    unit: str
    limits: str
    text: str
    default: Any
    plain_text: bool

    @property
    def expected(self) -> str:
        """Kind, limits and unit in one phrase."""
        unit = f" [{self.unit}]" if self.unit not in ("", "1") else ""
        return " ".join(part for part in (self.kind, self.limits) if part) + unit


@dataclasses.dataclass(frozen=True, slots=True)
class SettingsTable:
    """One table of settings.

    Attributes
    ----------
    path : tuple of str
        Name in TOML, one item per dot; empty for the whole.
    text : str
        Docstring of the dataclass.
    keys : tuple of Key
        Keys of the table itself, in the order of its fields.
    tables : tuple of str
        Names of the tables within it.
    """

    path: Path
    text: str
    keys: tuple[Key, ...]
    tables: tuple[str, ...]

    @property
    def name(self) -> str:
        """The name as written in TOML."""
        return ".".join(self.path)


def tables(cls: type[Any], path: Path = ()) -> tuple[SettingsTable, ...]:
    """Return the tables of a dataclass of dataclasses, each before the tables within it."""
    return _tables(cls, path)  # type: ignore[arg-type]  # mypy doubts that a class can be hashed


@functools.cache
def _tables(cls: type[Any], path: Path) -> tuple[SettingsTable, ...]:
    hints = get_type_hints(cls, include_extras=True)
    fields = dataclasses.fields(cls)
    inner = [f.name for f in fields if dataclasses.is_dataclass(hints[f.name])]
    keys = tuple(_key(f, hints[f.name]) for f in fields if f.name not in inner)
    table = SettingsTable(path, (cls.__doc__ or "").strip(), keys, tuple(inner))
    return (table, *(one for name in inner for one in tables(hints[name], (*path, name))))


def _key(field: dataclasses.Field[Any], hint: object) -> Key:
    """Describe one annotated field, which may take a word instead: ``Annotated[float, about(...)] | Literal["x"]``."""
    others = [part for part in get_args(hint) if get_origin(part) is Literal] if get_origin(hint) is Union else []
    (hint,) = (part for part in get_args(hint) if part not in others) if others else (hint,)
    kind, *_, info = get_args(hint) or (hint, None)
    if get_origin(hint) is not Annotated or not isinstance(info, FieldInfo):
        raise TypeError(f"{field.name}: a setting is annotated with about(...)")
    extra = info.json_schema_extra
    assert isinstance(extra, dict)
    words = " or ".join(_kind_words(part) for part in (*others, kind))
    if field.default_factory is not dataclasses.MISSING:
        default = field.default_factory()
    else:
        default = field.default
    text = info.description or ""
    return Key(field.name, words, str(extra["unit"]), str(extra["limits"]), text, default, kind is str)


def _kind_words(kind: Any) -> str:
    """Describe the values that a type takes."""
    if get_origin(kind) is Literal:
        return " or ".join(f'"{choice}"' for choice in get_args(kind))
    if get_origin(kind) is tuple:
        return f"a list of {_many(get_args(kind)[0])}"
    if get_origin(kind) is dict:
        return _kind_words(get_args(kind)[1])
    if kind is Any or dataclasses.is_dataclass(kind):
        return "a table"
    return _KINDS.get(kind, "text, a number, true or false")


def _many(kind: Any) -> str:
    """Describe several values of a type."""
    if get_origin(kind) is Literal:
        return ", ".join(f'"{choice}"' for choice in get_args(kind))
    return {str: "texts", StrictStr: "texts", float: "numbers", Number: "numbers"}.get(kind, "whole numbers")


# --- reading -----------------------------------------------------------------------------------------------------


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """Parse a TOML text.

    Raises
    ------
    ConfigError
        If it is not TOML, or its lists and tables are nested too deeply.
    """
    try:
        if _DEEP_KEY.search(text):
            raise RecursionError
        return tomllib.loads(text)
    except ValueError as error:
        raise ConfigError(f"{source}: not valid TOML: {error}") from None
    except RecursionError:
        raise ConfigError(f"{source}: lists or tables are nested too deeply") from None


def parse_json(text: str | bytes) -> Any:
    """Parse a JSON text.

    Raises
    ------
    ValueError
        If it is not JSON, or its lists and objects are nested too deeply.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("lists or objects are nested too deeply") from None


def read(adapter: TypeAdapter[T], cls: type[T], text: str, source: str, overrides: Sequence[str] = ()) -> T:
    """Check a TOML text and turn it into a dataclass of settings.

    Parameters
    ----------
    adapter : TypeAdapter
        pydantic's validator of the dataclass.
    overrides : sequence of str
        Settings as ``table.key=value`` that override those of the text.

    Raises
    ------
    ConfigError
        If the text is not TOML, or a key is unknown, of the wrong type or out of range.
    """
    known = {table.path: table for table in tables(cls)}
    values, given = parse_toml(text, source), parse_toml(text, source)
    overridden = [_override(values, word, known) for word in overrides]

    def source_of(path: Path) -> str:
        within = any(one[: len(path)] == path for one in overridden)
        return "--set" if path in overridden or (within and not _has(given, path)) else source

    return _checked(adapter, values, known, source_of)


def _has(values: object, path: Path) -> bool:
    """Return whether a table or key was given."""
    return not path or (isinstance(values, dict) and path[0] in values and _has(values[path[0]], path[1:]))


def check(cls: type[T], values: dict[str, Any], path: Path) -> T:
    """Check one table that has been read already and turn it into a dataclass, which has no tables within it.

    Parameters
    ----------
    values : dict
        Keys and values; missing keys take their defaults.

    Raises
    ------
    ConfigError
        If a key is unknown, of the wrong type or out of range.
    """
    adapter: TypeAdapter[T] = _adapter(cls)  # type: ignore[arg-type]  # mypy doubts that a class can be hashed
    return _checked(adapter, values, {table.path: table for table in tables(cls, path)}, None, path)


@functools.cache
def _adapter(cls: type[T]) -> TypeAdapter[Any]:
    """Make pydantic's validator of a dataclass, which takes some milliseconds, once."""
    return TypeAdapter(cls)


def _checked(
    adapter: TypeAdapter[T],
    values: dict[str, Any],
    known: dict[Path, SettingsTable],
    source_of: Callable[[Path], str] | None,
    base: Path = (),
) -> T:
    """Validate a table; all its problems in one error, each with its source if there is one."""
    try:
        return adapter.validate_python(values)
    except ValidationError as error:
        problems: dict[Path, str] = {}
        for detail in error.errors(include_url=False):
            path, problem = _explain(detail, known, base)
            problems.setdefault(path, f"{source_of(path)}: {problem}" if source_of else problem)
        raise ConfigError("\n".join(problems.values())) from None


def _override(values: dict[str, Any], word: str, known: dict[Path, SettingsTable]) -> Path:
    """Put one ``table.key=value`` into the values read from the file; give the path of the key."""
    if not word.isascii() and word != word.encode(errors="replace").decode():
        raise ConfigError(f"--set {word.encode(errors='replace').decode()}: expected text in UTF-8")
    name, equals, value = (part.strip() for part in word.partition("="))
    path = tuple(name.split("."))
    if not equals or len(path) < 2 or not all(path):
        raise ConfigError(f"--set {word}: write table.key=value, such as block.trials=6")
    table = values
    for step in path[:-1]:
        table = table.setdefault(step, {})
        if not isinstance(table, dict):
            return path  # the file gives a value where a table belongs, which validation reports
    key = _find(known.get(path[:-1]), path[-1])
    table[path[-1]] = value.strip("\"'") if key is not None and key.plain_text else _value_of(value)
    return path


def _value_of(word: str) -> Any:
    """Read a TOML value; anything else is taken as text, so that a shell needs no nested quotes."""
    try:
        return tomllib.loads(f"value = {word}")["value"]
    except (ValueError, RecursionError):
        return word


def _find(table: SettingsTable | None, name: str) -> Key | None:
    """Find the key of that name, if there is one."""
    return next((key for key in table.keys if key.name == name), None) if table else None


def _explain(detail: ErrorDetails, known: dict[Path, SettingsTable], base: Path) -> tuple[Path, str]:
    """Put one of pydantic's errors into words: the path it is about, and the problem."""
    path = (*base, *(str(step) for step in detail["loc"]))
    found = detail["input"]
    if detail["type"] == "unexpected_keyword_argument":
        return path, _unknown(path, found, known)
    for cut in range(len(path) - 1, -1, -1):
        key = _find(known.get(path[:cut]), path[cut])
        if key is not None:
            name = ".".join(path[cut : cut + 2]) if isinstance(key.default, dict) else key.name
            where = _where(path[:cut], name)
            meant = did_you_mean(found, _CHOICE.findall(key.kind)) if isinstance(found, str) else ""
            return path[: cut + 1], f"{where}: found {_show(found)}, expected {key.expected} ({key.text}){meant}"
    return path, f"[{'.'.join(path)}]: found {_show(found)}, expected a table"


def _unknown(path: Path, found: object, known: dict[Path, SettingsTable]) -> str:
    """Report an unknown key, with the most similar known one."""
    *parent, name = path
    table = known[tuple(parent)]
    names = [*table.tables, *(key.name for key in table.keys)]
    kind = "table" if isinstance(found, dict) or not table.keys else "key"
    where = f"[{'.'.join(path)}]" if isinstance(found, dict) else _where(table.path, name)
    owners = [other.name for other in known.values() if _find(other, name)]
    if described := _described(table, name):
        meanings = " or ".join(f"{key.name} ({key.text}; {key.expected})" for key in described)
        hint = f"did you mean {meanings}?"
    elif meant := nearest(name, names):
        key = _find(table, meant)
        hint = f"did you mean {meant} ({key.expected})?" if key else f"did you mean [{'.'.join((*parent, meant))}]?"
    elif owners:
        hint = f"it belongs in [{owners[0]}]"
    else:
        hint = f"there are {', '.join(names)}"
    return f"{where}: unknown {kind}; {hint}"


def _described(table: SettingsTable, name: str) -> list[Key]:
    """Find the keys that a name describes, as ``mass`` and ``board_mass`` do M, the mass of the board."""
    words = set(name.casefold().split("_"))
    texts = [(key, re.findall(r"[a-z]+", key.text.casefold())) for key in table.keys]
    return [key for key, text in texts if text and text[0] in words and words <= {*text}]


def _where(path: Path, name: str) -> str:
    """Name a key with its table, as in the file."""
    return f"[{'.'.join(path)}] {name}" if path else name


def _show(value: object) -> str:
    """Show a value found in a file as it would be written there."""
    if isinstance(value, str | bool | int | float):
        return to_toml(value)
    return "a table" if isinstance(value, dict) else f"a {type(value).__name__}"


# --- writing -----------------------------------------------------------------------------------------------------


def to_toml(
    value: str | bool | int | float | tuple[int | float | str, ...] | dict[str, str | bool | int | float],
) -> str:
    """Write a TOML value that reads back as the same value, to the last bit.

    Parameters
    ----------
    value : str, bool, int, float, tuple or dict of these
        Value of a key.
    """
    if isinstance(value, dict):
        return f"{{{', '.join(f'{to_toml(name)} = {to_toml(one)}' for name, one in value.items())}}}"
    if isinstance(value, tuple):
        return f"[{', '.join(map(to_toml, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):  # JSON's escapes are TOML's, but for DEL
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)


def write(settings: object) -> str:
    """Write every key of a dataclass of dataclasses as TOML, which reads back as equal settings.

    Parameters
    ----------
    settings : dataclass
        The whole configuration, a study or a profile.
    """
    lines: list[str] = []
    for table in tables(type(settings)):
        node = settings
        for step in table.path:
            node = getattr(node, step)
        lines += _table_lines(table, {key.name: getattr(node, key.name) for key in table.keys}, comments=False)
    return "\n".join(lines).lstrip("\n") + "\n"


def write_template(cls: type[Any]) -> str:
    """Write the defaults as TOML, with the description, unit and limits of every key as comments."""
    lines: list[str] = []
    for table in tables(cls):
        lines += _table_lines(table, {key.name: key.default for key in table.keys}, comments=True)
    return "\n".join(lines).lstrip("\n") + "\n"


def _table_lines(table: SettingsTable, values: dict[str, Any], *, comments: bool) -> list[str]:
    """Write one table, with a further table for each key whose value is one."""
    if not values:
        return []
    plain = [(key, f"{key.name} = {to_toml(values[key.name])}") for key in table.keys if not _is_table(values, key)]
    width = max((len(line) for _, line in plain), default=0)
    lines = ["", f"[{table.name}]"]
    if comments:
        lines.insert(1, f"# {table.text.splitlines()[0]}")
    lines += [f"{line:<{width}}  # {_comment(key)}" if comments else line for key, line in plain]
    for key in table.keys:
        if _is_table(values, key):
            lines += ["", f"[{table.name}.{key.name}]" + (f"  # {key.text}" if comments else "")]
            lines += [f"{to_toml(name)} = {to_toml(value)}" for name, value in values[key.name].items()]
    return lines


def _is_table(values: dict[str, Any], key: Key) -> bool:
    """Return whether the value of this key is a table."""
    return isinstance(values[key.name], dict)


def _comment(key: Key) -> str:
    """Return description, unit and limits (or choices) of a key."""
    unit = f" [{key.unit}]" if key.unit else ""
    limits = f"{key.kind} {key.limits}".strip() if key.kind.startswith('"') else key.limits
    return f"{key.text}{unit}" + (f"; {limits}" if limits else "")
