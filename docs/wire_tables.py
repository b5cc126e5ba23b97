"""The sections of the messages in PROTOCOL.md, made from their type hints and docstrings, for `docs/generate.py`."""

import dataclasses
import inspect
import re
import types
import typing
from typing import Any

from netboard.base.safeguards import Safeguard
from netboard.network.protocol.joining import ROLES
from netboard.network.protocol.messages import CHOICES, KINDS, MessageKind

_SCALARS = {int: "int", float: "float", str: "str", bytes: "bin", bool: "bool"}


def wire_type(hint: Any) -> str:
    """Name of a type as PROTOCOL.md defines it."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint in _SCALARS:
        return _SCALARS[hint]
    if origin is types.UnionType:
        return f"{wire_type(arguments[0])} or nil"
    if origin is dict:
        return f"map of {wire_type(arguments[0])} to {wire_type(arguments[1])}"
    if arguments and arguments[-1] is Ellipsis:
        return f"array of {wire_type(arguments[0])}"
    parts = arguments or typing.get_type_hints(hint).values()  # of a tuple, or of a NamedTuple
    return "[" + ", ".join(map(wire_type, parts)) + "]"


def described(documented: type, expected: list[str]) -> tuple[str, dict[str, str]]:
    """Summary of a docstring, and the meaning of each attribute, which must have the expected names."""
    text, _, attributes = inspect.getdoc(documented).partition("Attributes\n----------\n")  # type: ignore[union-attr]
    meanings: dict[str, str] = {}
    names: list[str] = []
    for line in attributes.splitlines():
        if line and not line[0].isspace():
            names = line.partition(" : ")[0].split(", ")
        elif line:
            meanings.update({name: f"{meanings.get(name, '')} {line.strip()}".strip() for name in names})
    missing = [name for name in expected if name not in meanings]
    assert not missing, f"the docstring of {documented.__name__} does not describe {', '.join(missing)}"
    return " ".join(text.split()), meanings


def _markdown(text: str) -> str:
    """A docstring's double and single backquotes as code, and None as it is on the wire."""
    text = re.sub(r"``?([^`]+)``?", r"`\1`", text).replace("|", "\\|")
    return re.sub(r"\bNone\b", "nil", text)


def _listed(roles: tuple[str, ...]) -> str:
    """Roles as words."""
    if set(roles) == set(ROLES):
        return "every peer"
    *others, last = (f"{role}s" for role in roles)
    return f"{', '.join(others)} and {last}" if others else last


def section(number: int, kind: MessageKind) -> str:
    """Section of one message."""
    names = [field.name for field in dataclasses.fields(kind.message)]
    text, meanings = described(kind.message, names)
    hints = typing.get_type_hints(kind.message)
    limits = f"at most {kind.most_bytes} bytes"
    if kind.most_items:
        limits += f", arrays of at most {kind.most_items} items"
    if kind.most_pairs:
        limits += f", maps of at most {kind.most_pairs} pairs"
    senders = [f"{_listed(kind.up)} to the server"] if kind.up else []
    senders += [f"the server to {_listed(kind.down)}"] if kind.down else []
    sent = f" From {' and from '.join(senders)}." if senders else ""
    lines = [
        f"### {kind.message.__name__}: kind {number}",
        "",
        f"{_markdown(text)}{sent} ({limits[0].upper()}{limits[1:]}.)",
        "",
    ]
    if names:
        lines += ["| # | field | type | meaning |", "| ---: | --- | --- | --- |"]
    for place, name in enumerate(names, start=1):
        allowed = CHOICES.get((kind.message, name), ())
        note = " One of " + ", ".join(f'`"{choice}"`' for choice in allowed) + "." if allowed else ""
        lines.append(f"| {place} | `{name}` | {wire_type(hints[name])} | {_markdown(meanings[name])}{note} |")
    return "\n".join(lines).rstrip() + "\n"


def safeguards() -> str:
    """The bits of `Stylus.safeguards`."""
    text, meanings = described(Safeguard, list(Safeguard.__members__))
    lines = [
        "### Bits of `safeguards`",
        "",
        _markdown(text),
        "",
        "| bit | value | name | meaning |",
        "| ---: | ---: | --- | --- |",
    ]
    for name, flag in Safeguard.__members__.items():
        bit = flag.value.bit_length() - 1
        lines.append(f"| {bit} | {flag.value} | `{name}` | {_markdown(meanings[name])} |")
    return "\n".join(lines) + "\n"


def messages() -> str:
    """The sections of all messages."""
    return "\n".join([*(section(number, kind) for number, kind in KINDS.items()), safeguards()]).rstrip()
