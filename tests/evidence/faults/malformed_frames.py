"""Malformed frames for fuzz tests.

`MalformedFrames` mutates valid frames in two ways. Byte mutations cut, flip, insert, remove, repeat and splice bytes.
Structural mutations change the decoded message (wrong types, too many items, another message type, deep nesting), and
`FaultyWriter` encodes it again, sometimes with wrong lengths or unusual MessagePack types. The seed determines the
frames. A few of them are still valid messages.
"""

import copy
import math
import random
import struct
import types
import typing
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields
from typing import Any

import msgpack

from netboard.base.errors import WireError
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.messages import CHOICES, KINDS, Message

MAX_FRAME = 2**20
"""Largest size of a malformed frame; sockets refuse larger ones [bytes]."""

NESTING_DEPTH = 1200
"""Deepest nesting, beyond the recursion limits of Python and of the MessagePack reader [1]."""

ITEM_HEADERS = bytes(range(0x80, 0x100, 5)) + bytes.fromhex("c0c1c2c3c4c5c6c7c8c9cacbcccdcecfd0d1d2d3d8d9dadbdcdddedf")
"""Bytes that start a MessagePack item, or that are invalid."""

REPETITIONS = (9,) * 17 + (300, 300, 5000)
"""Numbers of copies that one item is replaced by; 5000 exceeds the limit of every array [1]."""

WRONG_LENGTHS = (0, 1, 15, 16, 31, 32, 255, 256, 65_535, 65_536, 2**31 - 1, 2**31, 2**32 - 1)
"""Lengths at the limits of the MessagePack formats, written in place of the true length [1]."""


class Raw(bytes):
    """Encoded bytes that `FaultyWriter` writes unchanged in place of a value."""


UNUSUAL_VALUES: tuple[Any, ...] = (
    *(None, False, True),
    *(0, -1, 127, 128, -129, 2**31, 2**63 - 1, 2**63, 2**64 - 1, -(2**63)),
    *(0.0, -0.0, 5e-324, 1.7976931348623157e308, math.nan, math.inf, -math.inf),
    *("", "left", "end", "\0", "ä" * 40, b"", b"\xff" * 40),
    *([], [[]], [None] * 20, {}, {"": ""}, {1: 2}, {b"k": "v"}),
    Raw(b"\xc1"),  # the type byte that MessagePack never uses
    Raw(b"\xa2\xff\xfe"),  # a string that is not UTF-8
    Raw(b"\xa3\xed\xa0\x80"),  # an unpaired surrogate
    Raw(b"\xca\x7f\xc0\x00\x00"),  # NaN of 32 bits
    Raw(b"\xcb\x7f\xf0\x00\x00\x00\x00\x00\x01"),  # a signalling NaN
    Raw(b"\xd6\xff\x00\x00\x00\x00"),  # a timestamp
    Raw(b"\xc7\x04\x2a\x00\x00\x00\x00"),  # an extension
    Raw(b"\xdb\xff\xff\xff\xff"),  # a string of 4 GiB
    Raw(b"\xdd\xff\xff\xff\xff"),  # an array of 2**32 - 1 items
    Raw(b"\xdf\xff\xff\xff\xff"),  # a map of 2**32 - 1 items
)
"""Values that replace a field or an item."""


def valid_frames(seed: int) -> list[bytes]:
    """Return three valid frames of every message type."""
    rng = random.Random(seed)
    return [encode(_message(kind.message, rng)) for kind in KINDS.values() for _ in range(3)]


def decode_or_none(frame: bytes) -> Message | None:
    """Decode a frame; return None if the codec refuses it."""
    try:
        return decode(frame)
    except WireError:
        return None


def _message(kind: type[Message], rng: random.Random) -> Message:
    hints = typing.get_type_hints(kind)
    values = [
        rng.choice(CHOICES[kind, field.name]) if (kind, field.name) in CHOICES else _value(hints[field.name], rng)
        for field in fields(kind)
    ]
    build: Callable[..., Message] = kind
    return build(*values)


def _value(hint: Any, rng: random.Random) -> Any:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is types.UnionType:
        return None if rng.random() < 0.5 else _value(arguments[0], rng)
    if origin is dict:
        return {_value(arguments[0], rng): _value(arguments[1], rng) for _ in range(rng.randrange(4))}
    if origin is tuple and arguments[-1] is Ellipsis:
        return tuple(_value(arguments[0], rng) for _ in range(rng.randrange(5)))
    if origin is tuple:
        return tuple(_value(argument, rng) for argument in arguments)
    if hasattr(hint, "_fields"):  # a NamedTuple
        return hint(*(_value(part, rng) for part in typing.get_type_hints(hint).values()))
    simple: dict[Any, Callable[[], Any]] = {
        int: lambda: rng.choice((0, 1, -1, 200, 70_000, 10**12, -(10**12))),
        float: lambda: rng.choice((0.0, -0.5, 1e-3, 250.0)),
        bool: lambda: rng.random() < 0.5,
        str: lambda: "x" * rng.choice((0, 1, 8, 40)),
        bytes: lambda: rng.randbytes(rng.choice((0, 1, 8, 300))),
    }
    return simple[hint]()


class MalformedFrames:
    """Endless iterator over malformed frames, mutated from valid ones."""

    def __init__(self, frames: Sequence[bytes], seed: int) -> None:
        self._frames = list(frames)
        self._messages = [msgpack.unpackb(frame, strict_map_key=False) for frame in frames]
        self._rng = random.Random(seed)
        self._writer = FaultyWriter(self._rng)

    def __iter__(self) -> Iterator[bytes]:
        return self

    def __next__(self) -> bytes:
        rng = self._rng
        if rng.random() < 0.6:
            frame = self._writer.write(self._mutated_tree())
            times = rng.choice((0, 0, 0, 1))
        else:
            frame = rng.choice(self._frames)
            times = rng.choice((1, 1, 2, 4))
        for _ in range(times):
            at = 0 if rng.random() < 0.1 else 2  # mostly after the kind byte, so that the codec reads further
            number = rng.randrange(BYTE_MUTATIONS)
            frame = frame[:at] + mutated_bytes(number, rng, frame[at:], rng.choice(self._frames)[at:])
        return frame[:MAX_FRAME]

    def _mutated_tree(self) -> Any:
        """Return a message as a list of its kind and fields, corrupted in one or more places."""
        rng = self._rng
        tree = copy.deepcopy(rng.choice(self._messages))
        if rng.random() < 0.1:
            tree[0] = rng.choice((*KINDS, rng.randrange(256)))
        for _ in range(rng.choice((1, 1, 1, 2, 3))):
            holder = tree
            while rng.random() < 0.4 and (inner := [item for item in _children(holder) if _children(item)]):
                holder = rng.choice(inner)
            self._mutate_item(holder)
        return tree

    def _mutate_item(self, holder: Any) -> None:
        """Corrupt a list or a map in one place."""
        rng = self._rng
        sources = (*[self._unusual_value] * 3, self._from_another_message, self._nested, self._oversized)
        unusual = rng.choice(sources)()
        if isinstance(holder, dict):
            holder[rng.choice(("", "x", 1, *holder))] = unusual
            return
        # Item 0 is drawn less often: it may be the kind of the message, and the codec stops at an unknown kind.
        at = rng.randrange(len(holder) + 1) or rng.randrange(len(holder) + 1)
        match rng.randrange(16):
            case 0:
                holder.insert(at, unusual)
            case 1:
                del holder[at : at + 1]
            case 2:
                holder[at : at + 1] *= rng.choice((2, 3, 20))
            case 3 if len(holder) < 40:
                simple = [item for item in holder[at : at + 1] if not _children(item)]
                holder += simple * rng.choice(REPETITIONS)
            case 4:
                holder[1:] = rng.sample(holder[1:], len(holder[1:]))
            case _:
                holder[at : at + 1] = [unusual]

    def _unusual_value(self) -> Any:
        return copy.deepcopy(self._rng.choice(UNUSUAL_VALUES))

    def _from_another_message(self) -> Any:
        tree = self._rng.choice(self._messages)
        return copy.deepcopy(self._rng.choice([tree, *tree]))

    def _nested(self) -> Raw:
        rng = self._rng
        opening = rng.choice((b"\x91", b"\x81\xa0", b"\xdc\x00\x01", b"\xdc\x0f\xff", b"\xdd\x00\x00\x00\x01"))
        return Raw(opening * rng.choice((2, 30, 400, NESTING_DEPTH)) + rng.choice((b"", b"\xc0")))

    def _oversized(self) -> Any:
        """Return a value about as large as the size limit of a message type, mostly of a small limit."""
        rng = self._rng
        limit = rng.choice([kind.most_bytes for kind in KINDS.values()])
        size = max(0, (limit if rng.random() < 0.01 else min(limit, 4096)) + rng.choice((-16, -1, 0, 1)))
        return rng.choice((b"\xaa" * size, "y" * size, Raw(b"\xc0" * size)))


class FaultyWriter:
    """MessagePack writer that sometimes writes wrong lengths or valid but unusual types."""

    def __init__(self, rng: random.Random) -> None:
        self._rng = rng
        self._error_rate = 0.0

    def write(self, value: Any) -> bytes:
        """Encode a value: three quarters of the calls without errors."""
        self._error_rate = self._rng.choice((0.0, 0.0, 0.0, 0.1))  # probability that a header is unusual
        parts: list[bytes] = []
        self._put(value, parts)
        return b"".join(parts)

    def _put(self, value: Any, parts: list[bytes]) -> None:
        match value:
            case Raw():
                parts.append(value)
            case list():
                parts.append(self._head(len(value), 0x90, 16, (None, 0xDC, 0xDD)))
                for item in value:
                    self._put(item, parts)
            case dict():
                parts.append(self._head(len(value), 0x80, 16, (None, 0xDE, 0xDF)))
                for key, item in value.items():
                    self._put(key, parts)
                    self._put(item, parts)
            case str():
                text = value.encode()
                parts += self._head(len(text), 0xA0, 32, (0xD9, 0xDA, 0xDB)), text
            case bytes():
                parts += self._head(len(value), 0, 0, (0xC4, 0xC5, 0xC6)), value
            case int() if not isinstance(value, bool) and self._rng.random() < self._error_rate:
                parts.append(struct.pack(">Bq", 0xD3, value % 2**64 - 2**64 * (value % 2**64 >= 2**63)))
            case float() if self._rng.random() < self._error_rate:
                parts.append(b"\xca" + struct.pack(">d", value)[:4])
            case _:
                parts.append(msgpack.packb(value))

    def _head(self, length: int, short: int, most: int, wide: tuple[int | None, int, int]) -> bytes:
        """Return the header of `length` items: the short form, or a length of 1, 2 or 4 bytes, which may be wrong."""
        rng = self._rng
        width = 0 if length < most else 1 if length < 256 and wide[0] else 2 if length < 2**16 else 4
        if rng.random() < self._error_rate:
            length = rng.choice((length + 1, max(length - 1, 0), rng.choice(WRONG_LENGTHS)))
            width = rng.choice((0, 1, 2, 4))
        if width == 0 and most:
            return bytes([short | length % most])
        if width <= 1 and wide[0]:
            return bytes([wide[0], length % 256])
        return struct.pack(">BH", wide[1], length % 2**16) if width <= 2 else struct.pack(">BI", wide[2], length)


def _children(value: Any) -> list[Any]:
    return list(value.values()) if isinstance(value, dict) else value if isinstance(value, list) else []


BYTE_MUTATIONS = 11
"""Number of the byte mutations in `mutated_bytes` [1]."""


def mutated_bytes(number: int, rng: random.Random, frame: bytes, other: bytes) -> bytes:
    """Mutate the bytes of a frame, in some ways with bytes of another frame.

    - `number`: which mutation, below `BYTE_MUTATIONS` [1].
    """
    if number == 9:  # lengthen
        return frame + rng.choice((b"\0", b"\xc0", other, rng.randbytes(20), bytes(4096)))
    if number == 10:
        return rng.randbytes(rng.choice((0, 1, 2, 3, 10, 60, 300)))
    at = rng.randrange(len(frame) + 1)
    before, after = frame[:at], frame[at:]
    match number:
        case 0:  # cut
            return before
        case 1 | 2:  # flip a bit
            return before + bytes(byte ^ 1 << rng.randrange(8) for byte in after[:1]) + after[1:]
        case 3 | 4:  # overwrite
            return before + bytes([rng.choice(ITEM_HEADERS)]) + after[1:]
        case 5:  # insert
            return before + rng.randbytes(rng.choice((1, 1, 2, 4, 9))) + after
        case 6:  # remove
            return before + after[rng.choice((1, 1, 2, 4, 9)) :]
        case 7:  # repeat
            piece = after[: rng.choice((1, 4, 40))]
            return before + piece * rng.choice((2, 10, 100)) + after
    return before + other[rng.randrange(len(other) + 1) :]  # splice
