"""Messages to bytes and back. `encode` and `decode` are the only way in and out.

A frame is one MessagePack array ``[kind, field, field, ...]``, with the fields in the order of the message's dataclass.

Rule 1: for any bytes, `decode` returns a message that fits its dataclass or raises `WireError`.
Rule 2: its work is bounded in advance: each kind has a largest frame, a longest array and a largest map.
Rule 3: types are exact. A boolean is no integer and an integer is no float; `encode` converts, `decode` refuses.
Rule 4: `netboard.network.protocol.messages.KINDS` only grows. A number is never used for another message.

NaN and infinities are legal on the wire; code that uses a quantity must guard against them. The checks of each class
are built once, at import, from its type hints.
"""

import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import partial
from itertools import chain
from operator import attrgetter, index
from reprlib import repr as short
from typing import Any

import msgpack

from netboard.base.errors import WireError
from netboard.network.protocol.messages import CHOICES, KINDS, Message, MessageKind

Check = Callable[[Any], Any]
M = typing.TypeVar("M", bound=Message)


def encode(message: Message) -> bytes:
    """Convert a message to a frame.

    Parameters
    ----------
    message : Message
        Any message. Numeric stand-ins (an `IntFlag`, a numpy scalar, an int for a float) are converted.

    Raises
    ------
    TypeError, ValueError
        If the message breaks the protocol: our own mistake.
    """
    plan = _PLANS_BY_CLASS[type(message)]
    values = zip(plan.ready_types, plan.writers, plan.values(message), strict=True)
    frame: bytes = msgpack.packb([plan.number, *(v if type(v) is ready else write(v) for ready, write, v in values)])
    if len(frame) > plan.most_bytes:
        raise ValueError(f"{plan.name}: {len(frame)} bytes, at most {plan.most_bytes} are allowed")
    return frame


def kind_of(frame: bytes) -> type[Message]:
    """Return the class of message that a frame claims to be, before anything is unpacked.

    Raises
    ------
    WireError
        If it is no message of this protocol.
    """
    return KINDS[_plan_of(frame).number].message


def decode(frame: bytes) -> Message:
    """Convert a frame to a message.

    Raises
    ------
    WireError
        If it is not exactly one message of this protocol.
    """
    plan = _plan_of(frame)
    if len(frame) > plan.most_bytes:
        raise WireError(f"{plan.name}: {len(frame)} bytes, at most {plan.most_bytes} are allowed")
    try:
        parts = plan.unpack(frame)
    except (ValueError, msgpack.UnpackException) as error:
        raise WireError(f"{plan.name}: not MessagePack within the limits: {error!s:.100}") from error
    if type(parts) is not tuple or len(parts) != plan.length:  # `_plan_of` has read the kind itself
        raise WireError(f"{plan.name}: not an array of {plan.length}")
    try:
        return plan.message(*map(_call, plan.readers, parts[1:]))
    except ValueError as error:
        raise WireError(f"{plan.name}: {_blame(plan, parts[1:])}") from error


def message_of(kind: type[M], values: Mapping[str, Any]) -> M:
    """Make a message from its fields by name, as a recording stores them.

    Parameters
    ----------
    kind : type
        One of the classes in `netboard.network.protocol.messages.Message`.
    values : mapping of str
        The fields, all of them and no other.

    Returns
    -------
    Message
        The message, with fields of exactly the declared types.

    Raises
    ------
    WireError
        If a field is missing, unknown or of another type.
    """
    plan = _PLANS[_NUMBERS[kind]]
    if values.keys() != set(plan.names):
        raise WireError(f"{plan.name}: found the fields {short(sorted(map(str, values)))}, expected {list(plan.names)}")
    fields_in_order = tuple(values[name] for name in plan.names)
    try:
        return kind(*map(_call, plan.readers, fields_in_order))
    except ValueError as error:
        raise WireError(f"{plan.name}: {_blame(plan, fields_in_order)}") from error


# --- one field ---------------------------------------------------------------------------------------------------


def _call(check: Check, value: object) -> Any:
    return check(value)


def _read_int(value: object) -> int:
    if type(value) is not int or value >= 2**63:  # MessagePack itself has nothing below -2**63
        raise ValueError(f"expected an integer of 64 bits, got {short(value)}")
    return value


def _write_int(value: Any) -> int:
    whole = int(index(value))
    if not -(2**63) <= whole < 2**63:
        raise ValueError(f"expected an integer of 64 bits, got {whole}")
    return whole


def _write_float(value: Any) -> float:
    if isinstance(value, str | bytes):  # float() would parse them
        raise TypeError(f"expected a number, got {short(value)}")
    return float(value)


def _exactly(expected: type, value: object) -> Any:
    if type(value) is not expected:
        raise ValueError(f"expected {expected.__name__}, got {short(value)}")
    return value


def _one_of(allowed: tuple[str, ...], value: object) -> Any:
    if type(value) is not str or value not in allowed:
        raise ValueError(f"expected one of {allowed}, got {short(value)}")
    return value


def _optional(check: Check, value: object) -> Any:
    return None if value is None else check(value)


def _mapping(key: Check, item: Check, most_pairs: int, value: Any) -> Any:
    if len(_exactly(dict, value)) > most_pairs:
        raise ValueError(f"expected at most {most_pairs} pairs, got {len(value)}")
    return {key(k): item(v) for k, v in value.items()}


def _sequence(check: Check, most_items: int, value: Any) -> Any:
    if len(_exactly(tuple, value)) > most_items:
        raise ValueError(f"expected at most {most_items} items, got {len(value)}")
    return tuple(map(check, value))


def _rows_of_integers(item_by_item: Check, width: int, most_items: int, value: object) -> Any:
    """Read an array of records of integers, with each check applied to all of them at once.

    An array that fails is checked item by item, so that the error names the item.
    """
    if type(value) is tuple and len(value) <= most_items and {*map(type, value)} <= {tuple}:
        numbers = tuple(chain.from_iterable(value))
        if {*map(len, value)} <= {width} and {*map(type, numbers)} <= {int} and max(numbers, default=0) < 2**63:
            return value
    return item_by_item(value)


def _record(make: Check, checks: tuple[Check, ...], value: object) -> Any:
    if not isinstance(value, tuple):
        raise ValueError(f"expected tuple, got {short(value)}")
    if len(value) != len(checks):
        raise ValueError(f"expected {len(checks)} items, got {len(value)}")
    return make(map(_call, checks, value))


_PLAIN: Mapping[type, Check] = {kind: partial(_exactly, kind) for kind in (str, bytes, bool)}
_READ: Mapping[type, Check] = {**_PLAIN, int: _read_int, float: partial(_exactly, float)}
_WRITE: Mapping[type, Check] = {**_PLAIN, int: _write_int, float: _write_float}


def _compile(hint: Any, scalars: Mapping[type, Check], kind: MessageKind) -> Check:
    """Make the check of one type hint of a kind of message; `scalars` has the checks of its leaves."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint in scalars:
        return scalars[hint]
    if origin is None:  # a NamedTuple
        named = typing.get_type_hints(hint).values()
        return partial(_record, hint._make, tuple(_compile(part, scalars, kind) for part in named))
    inner = tuple(_compile(part, scalars, kind) for part in arguments if part not in (type(None), Ellipsis))
    if origin is types.UnionType:
        return partial(_optional, *inner)
    if origin is dict:
        return partial(_mapping, inner[0], inner[1], kind.most_pairs)
    if arguments[-1] is Ellipsis:
        item_by_item = partial(_sequence, inner[0], kind.most_items)
        parts = typing.get_args(arguments[0])
        if scalars is _READ and parts and set(parts) == {int}:
            return partial(_rows_of_integers, item_by_item, len(parts), kind.most_items)
        return item_by_item
    return partial(_record, tuple, inner)


# --- one message -------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Plan:
    """The limits and checks of one kind of message, built once."""

    number: int
    name: str
    message: Callable[..., Message]
    length: int  # of the array: kind and fields [1]
    most_bytes: int
    names: tuple[str, ...]
    values: Callable[[Message], tuple[Any, ...]]
    readers: tuple[Check, ...]
    writers: tuple[Check, ...]
    ready_types: tuple[type | None, ...]  # of each field: the type of values that need no writer
    unpack: Callable[[bytes], Any]


def _getter(names: tuple[str, ...]) -> Callable[[Message], tuple[Any, ...]]:
    """Return a getter like `attrgetter`'s that returns a tuple for any number of names."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda message: tuple(getattr(message, name) for name in names)


def _plan(number: int, kind: MessageKind) -> _Plan:
    message = kind.message
    hints = typing.get_type_hints(message)
    names = tuple(field.name for field in fields(message))

    def checks(scalars: Mapping[type, Check]) -> tuple[Check, ...]:
        return tuple(
            partial(_one_of, CHOICES[message, name])
            if (message, name) in CHOICES
            else _compile(hints[name], scalars, kind)
            for name in names
        )

    length = 1 + len(names)
    unpack = partial(
        msgpack.unpackb,
        use_list=False,
        max_array_len=max(length, kind.most_items),  # an array is allocated at its full claimed length
        max_map_len=kind.most_pairs,
        max_ext_len=0,
    )  # strings and bytes may claim no more than the frame has, which is msgpack's default
    if kind.most_items > length:
        unpack = partial(_unpack_whole, unpack)
    return _Plan(
        number,
        message.__name__,
        message,
        length,
        kind.most_bytes,
        names,
        _getter(names),
        checks(_READ),
        checks(_WRITE),
        tuple(_ready_type(hints[name], (message, name) in CHOICES) for name in names),
        unpack,
    )


def _ready_type(hint: object, has_choices: bool) -> type | None:
    """Return the type of those values of a field that are packed as they are; None if all need a writer."""
    if has_choices or typing.get_origin(hint) not in (None, types.UnionType):
        return None
    found = [kind for kind in (float, bool, str, bytes) if kind is hint or kind in typing.get_args(hint)]
    return found[0] if len(found) == 1 else None


def _unpack_whole(unpack: Callable[[bytes], Any], frame: bytes) -> Any:
    """Unpack a frame with long arrays, after checking that all their items are there.

    Otherwise 3 KB could claim a thousand nested arrays, each allocated at a full length that never comes.
    """
    whole = msgpack.Unpacker(read_size=64)
    whole.feed(frame)
    whole.skip()
    return unpack(frame)


_PLANS = {number: _plan(number, kind) for number, kind in KINDS.items()}
_NUMBERS: dict[type, int] = {kind.message: number for number, kind in KINDS.items()}
_PLANS_BY_CLASS = {KINDS[number].message: plan for number, plan in _PLANS.items()}


def _plan_of(frame: bytes) -> _Plan:
    """Return the plan of the kind that a frame claims to be, before anything is unpacked."""
    kind_at = 3 if frame[:1] == b"\xdc" else 1  # after the array's header of three bytes, or of one
    if len(frame) <= kind_at:
        raise WireError(f"{len(frame)} bytes are no message")
    plan = _PLANS.get(frame[kind_at])
    if plan is None:
        raise WireError(f"no message of kind {frame[kind_at]}")
    return plan


def _blame(plan: _Plan, values: tuple[Any, ...]) -> str:
    """Return which field was refused, and why."""
    for name, check, value in zip(plan.names, plan.readers, values, strict=True):
        try:
            check(value)
        except ValueError as error:
            return f"{name}: {error}"
    raise AssertionError("every field passed")
