"""Hypothesis strategies for every message, made from its type hints, independent of the codec."""

import dataclasses
import types
import typing
from typing import Any

from hypothesis import strategies as st

from netboard.network.protocol.messages import CHOICES, Message

CLASSES: tuple[type[Message], ...] = typing.get_args(Message)

_SCALARS: dict[Any, st.SearchStrategy[Any]] = {
    int: st.integers(-(2**63), 2**63 - 1),
    float: st.floats(),
    bool: st.booleans(),
    str: st.text(st.characters(exclude_categories=["Cs"]), max_size=12),
    bytes: st.binary(max_size=40),
}


def _of(hint: Any) -> st.SearchStrategy[Any]:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint in _SCALARS:
        return _SCALARS[hint]
    if origin is None:  # a NamedTuple
        return st.builds(hint, *map(_of, typing.get_type_hints(hint).values()))
    if origin is types.UnionType:
        return st.none() | _of(arguments[0])
    if origin is dict:
        return st.dictionaries(_of(arguments[0]), _of(arguments[1]), max_size=3)
    if arguments[-1] is Ellipsis:
        return st.lists(_of(arguments[0]), max_size=4).map(tuple)
    return st.tuples(*map(_of, arguments))


def messages_of(message: type[Message]) -> st.SearchStrategy[Message]:
    """Any instance of one message class that the protocol allows."""
    hints = typing.get_type_hints(message)
    parts = {}
    for field in dataclasses.fields(message):
        choices = CHOICES.get((message, field.name))
        parts[field.name] = st.sampled_from(choices) if choices else _of(hints[field.name])
    built: st.SearchStrategy[Message] = st.builds(message, **parts)
    return built


def messages() -> st.SearchStrategy[Message]:
    """Any message the protocol allows."""
    return st.one_of(*map(messages_of, CLASSES))
