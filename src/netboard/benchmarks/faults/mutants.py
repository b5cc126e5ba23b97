"""Malformed frames: what a broken, a mistaken or a hostile peer may send.

`Mutants` takes true frames and spoils them: some as bytes (cut, flipped, spliced, doubled, grown), some as what they
mean (a value of another type, too many of them, another kind, a nest), written again by a writer of MessagePack that
lies about lengths, wastes bytes, or uses what no message uses. The same seed gives the same frames. A few of them are
messages still: whether one is, only the codec says.
"""

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

LARGEST = 2**20
"""Largest size of a frame; a socket refuses larger ones [bytes]."""

NESTED = 1200
"""Deepest nesting, beyond the recursion limits of Python and of the MessagePack reader [1]."""

HEADERS = bytes(range(0x80, 0x100, 5)) + bytes.fromhex("c0c1c2c3c4c5c6c7c8c9cacbcccdcecfd0d1d2d3d8d9dadbdcdddedf")
"""Bytes that start a MessagePack item, or that are invalid."""

MANY = (9,) * 17 + (300, 300, 5000)
"""Item counts that replace one item: mostly small, sometimes above the limit of any array [1]."""

_LENGTHS = (0, 1, 15, 16, 31, 32, 255, 256, 65_535, 65_536, 2**31 - 1, 2**31, 2**32 - 1)


class Raw(bytes):
    """Bytes that are written unchanged in place of a value."""


ODD: tuple[Any, ...] = (
    None,
    False,
    True,
    0,
    -1,
    127,
    128,
    -129,
    2**31,
    2**63 - 1,
    2**63,
    2**64 - 1,
    -(2**63),
    0.0,
    -0.0,
    5e-324,
    1.7976931348623157e308,
    math.nan,
    math.inf,
    -math.inf,
    "",
    "left",
    "end",
    "\0",
    "ä" * 40,
    b"",
    b"\xff" * 40,
    [],
    [[]],
    [None] * 20,
    {},
    {"": ""},
    {1: 2},
    {b"k": "v"},
    Raw(b"\xc1"),  # what MessagePack never uses
    Raw(b"\xa2\xff\xfe"),  # a string that is not UTF-8
    Raw(b"\xa3\xed\xa0\x80"),  # half of a surrogate pair
    Raw(b"\xca\x7f\xc0\x00\x00"),  # NaN of 32 bits
    Raw(b"\xcb\x7f\xf0\x00\x00\x00\x00\x00\x01"),  # a signalling NaN
    Raw(b"\xd6\xff\x00\x00\x00\x00"),  # a time stamp
    Raw(b"\xc7\x04\x2a\x00\x00\x00\x00"),  # an extension
    Raw(b"\xdb\xff\xff\xff\xff"),  # 4 GiB of text
    Raw(b"\xdd\xff\xff\xff\xff"),  # as many items
    Raw(b"\xdf\xff\xff\xff\xff"),  # and a map of them
)
"""Values to put where others belong."""


def true_frames(seed: int, of_each: int = 3) -> list[bytes]:
    """Return some valid frames of every message type."""
    chance = random.Random(seed)
    return [encode(_message(kind.message, chance)) for kind in KINDS.values() for _ in range(of_each)]


def parse(frame: bytes) -> Message | None:
    """Decode a frame; return None if it is not a message."""
    try:
        return decode(frame)
    except WireError:
        return None


def _message(kind: type[Message], chance: random.Random) -> Message:
    hints = typing.get_type_hints(kind)
    values = [
        chance.choice(CHOICES[kind, field.name]) if (kind, field.name) in CHOICES else _value(hints[field.name], chance)
        for field in fields(kind)
    ]
    make: Callable[..., Message] = kind
    return make(*values)


def _value(hint: Any, chance: random.Random) -> Any:
    """Return a random value of a field's type."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is types.UnionType:
        return None if chance.random() < 0.5 else _value(arguments[0], chance)
    if origin is dict:
        return {_value(arguments[0], chance): _value(arguments[1], chance) for _ in range(chance.randrange(4))}
    if origin is tuple and arguments[-1] is Ellipsis:
        return tuple(_value(arguments[0], chance) for _ in range(chance.randrange(5)))
    if origin is tuple:
        return tuple(_value(argument, chance) for argument in arguments)
    simple: dict[Any, Callable[[], Any]] = {
        int: lambda: chance.choice((0, 1, -1, 200, 70_000, 10**12, -(10**12))),
        float: lambda: chance.choice((0.0, -0.5, 1e-3, 250.0)),
        bool: lambda: chance.random() < 0.5,
        str: lambda: "x" * chance.choice((0, 1, 8, 40)),
        bytes: lambda: chance.randbytes(chance.choice((0, 1, 8, 300))),
    }
    return simple[hint]()


class Mutants:
    """An endless sequence of malformed frames."""

    def __init__(self, frames: Sequence[bytes], seed: int) -> None:
        self._frames = list(frames)
        self._trees = [msgpack.unpackb(frame, strict_map_key=False) for frame in frames]
        self._chance = random.Random(seed)
        self._writer = Liar(self._chance)

    def __iter__(self) -> Iterator[bytes]:
        return self

    def __next__(self) -> bytes:
        chance = self._chance
        if chance.random() < 0.6:
            frame = self._writer.write(self._spoiled_tree())
            times = chance.choice((0, 0, 0, 1))
        else:
            frame = chance.choice(self._frames)
            times = chance.choice((1, 1, 2, 4))
        for _ in range(times):
            at = 0 if chance.random() < 0.1 else 2  # mostly behind the kind, so that there is more to read
            spoil = chance.choice(_BYTEWISE)
            frame = frame[:at] + spoil(chance, frame[at:], chance.choice(self._frames)[at:])
        return frame[:LARGEST]

    def _spoiled_tree(self) -> Any:
        """Return a message as a list of its kind and fields, wrong in one or more places."""
        chance = self._chance
        tree = _copy(chance.choice(self._trees))
        if chance.random() < 0.1:
            tree[0] = chance.choice((*KINDS, chance.randrange(256)))
        for _ in range(chance.choice((1, 1, 1, 2, 3))):
            holder = tree
            while chance.random() < 0.4 and (inner := [item for item in _items(holder) if _items(item)]):
                holder = chance.choice(inner)
            self._spoil(holder)
        return tree

    def _spoil(self, holder: Any) -> None:
        """Corrupt a list or a map in one place."""
        chance = self._chance
        odd = chance.choice((self._odd, self._odd, self._odd, self._foreign, self._nest, self._huge))()
        if isinstance(holder, dict):
            holder[chance.choice(("", "x", 1, *holder))] = odd
            return
        at = chance.randrange(len(holder) + 1) or chance.randrange(len(holder) + 1)  # the first is often the kind
        match chance.randrange(16):
            case 0:
                holder.insert(at, odd)
            case 1:
                del holder[at : at + 1]
            case 2:
                holder[at : at + 1] *= chance.choice((2, 3, 20))
            case 3 if len(holder) < 40:
                holder += [_copy(item) for item in holder[at : at + 1] if not _items(item)] * chance.choice(MANY)
            case 4:
                holder[1:] = chance.sample(holder[1:], len(holder[1:]))
            case _:
                holder[at : at + 1] = [odd]

    def _odd(self) -> Any:
        return _copy(self._chance.choice(ODD))

    def _foreign(self) -> Any:
        """Return part or all of another message."""
        tree = self._chance.choice(self._trees)
        return _copy(self._chance.choice([tree, *tree]))

    def _nest(self) -> Raw:
        chance = self._chance
        opening = chance.choice((b"\x91", b"\x81\xa0", b"\xdc\x00\x01", b"\xdc\x0f\xff", b"\xdd\x00\x00\x00\x01"))
        return Raw(opening * chance.choice((2, 30, 400, NESTED)) + chance.choice((b"", b"\xc0")))

    def _huge(self) -> Any:
        """Return a value at a limit or slightly above it, mostly at one of the small limits."""
        chance = self._chance
        limit = chance.choice([kind.most_bytes for kind in KINDS.values()])
        size = max(0, (limit if chance.random() < 0.01 else min(limit, 4096)) + chance.choice((-16, -1, 0, 1)))
        return chance.choice((b"\xaa" * size, "y" * size, Raw(b"\xc0" * size)))


class Liar:
    """Writes MessagePack that is sometimes wrong and sometimes valid but unusual."""

    def __init__(self, chance: random.Random) -> None:
        self._chance = chance
        self._lies = 0.0

    def write(self, value: Any) -> bytes:
        """Write a value, in most cases correctly."""
        self._lies = self._chance.choice((0.0, 0.0, 0.0, 0.1))  # how often a header is not the usual one
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
            case int() if not isinstance(value, bool) and self._chance.random() < self._lies:
                parts.append(struct.pack(">Bq", 0xD3, value % 2**64 - 2**64 * (value % 2**64 >= 2**63)))
            case float() if self._chance.random() < self._lies:
                parts.append(b"\xca" + struct.pack(">d", value)[:4])
            case _:
                parts.append(msgpack.packb(value))

    def _head(self, length: int, short: int, most: int, wide: tuple[int | None, int, int]) -> bytes:
        """Return the head of `length` items, in short form or with a length of 1, 2 or 4 bytes, which may be wrong."""
        chance = self._chance
        width = 0 if length < most else 1 if length < 256 and wide[0] else 2 if length < 2**16 else 4
        if chance.random() < self._lies:
            length = chance.choice((length + 1, max(length - 1, 0), chance.choice(_LENGTHS)))
            width = chance.choice((0, 1, 2, 4))
        if width == 0 and most:
            return bytes([short | length % most])
        if width <= 1 and wide[0]:
            return bytes([wide[0], length % 256])
        return struct.pack(">BH", wide[1], length % 2**16) if width <= 2 else struct.pack(">BI", wide[2], length)


def _items(value: Any) -> list[Any]:
    """Return the items of a list or a map."""
    return list(value.values()) if isinstance(value, dict) else value if isinstance(value, list) else []


def _copy(value: Any) -> Any:
    """Return a deep copy."""
    if isinstance(value, list):
        return [_copy(item) for item in value]
    return {key: _copy(item) for key, item in value.items()} if isinstance(value, dict) else value


# --- as bytes: each takes a frame and another one ----------------------------------------------------------------


def _cut(chance: random.Random, frame: bytes, other: bytes) -> bytes:
    return frame[: chance.randrange(len(frame) + 1)]


def _flip(chance: random.Random, frame: bytes, other: bytes) -> bytes:
    at = chance.randrange(len(frame) + 1)
    return frame[:at] + bytes(byte ^ 1 << chance.randrange(8) for byte in frame[at : at + 1]) + frame[at + 1 :]


def _overwrite(chance: random.Random, frame: bytes, other: bytes) -> bytes:
    at = chance.randrange(len(frame) + 1)
    return frame[:at] + bytes([chance.choice(HEADERS)]) + frame[at + 1 :]


def _insert(chance: random.Random, frame: bytes, other: bytes) -> bytes:
    at = chance.randrange(len(frame) + 1)
    return frame[:at] + chance.randbytes(chance.choice((1, 1, 2, 4, 9))) + frame[at:]


def _remove(chance: random.Random, frame: bytes, other: bytes) -> bytes:
    at = chance.randrange(len(frame) + 1)
    return frame[:at] + frame[at + chance.choice((1, 1, 2, 4, 9)) :]


def _repeat(chance: random.Random, frame: bytes, other: bytes) -> bytes:
    at = chance.randrange(len(frame) + 1)
    piece = frame[at : at + chance.choice((1, 4, 40))]
    return frame[:at] + piece * chance.choice((2, 10, 100)) + frame[at:]


def _splice(chance: random.Random, frame: bytes, other: bytes) -> bytes:
    return frame[: chance.randrange(len(frame) + 1)] + other[chance.randrange(len(other) + 1) :]


def _lengthen(chance: random.Random, frame: bytes, other: bytes) -> bytes:
    return frame + chance.choice((b"\0", b"\xc0", other, chance.randbytes(20), bytes(4096)))


def _noise(chance: random.Random, frame: bytes, other: bytes) -> bytes:
    return chance.randbytes(chance.choice((0, 1, 2, 3, 10, 60, 300)))


_BYTEWISE = (
    _cut,
    _flip,
    _flip,
    _overwrite,
    _overwrite,
    _insert,
    _remove,
    _repeat,
    _splice,
    _lengthen,
    _noise,
)
