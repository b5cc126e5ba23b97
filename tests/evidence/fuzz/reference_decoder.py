"""A slow and simple decoder, written from PROTOCOL.md: the test oracle for the codec.

It reads the values that a message's type hints require, byte by byte, and refuses the frame at the first other byte. It
shares only the limits of `KINDS` and the strings of `CHOICES` with the codec.
"""

import dataclasses
import struct
import types
import typing
from typing import Any

from netboard.base.errors import WireError
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Refusal
from netboard.network.protocol.messages import CHOICES, KINDS, Message

MAX_REFUSAL = 2048
"""Largest refusal, which is sent back to the sender of a frame [bytes]."""


class Refused(Exception):
    """The bytes are not a valid message."""


def decode_with_both(frame: bytes) -> Message | None:
    """Decode a frame with the codec, None for a refusal, and assert that the reference decoder agrees."""
    try:
        expected = read_message(frame)
    except Refused:
        expected = None
    message, refusal = None, ""
    try:
        message = decode(frame)
    except WireError as error:
        refusal = str(error)
    assert len(encode(Refusal(refusal))) <= MAX_REFUSAL
    assert bits(message) == bits(expected), refusal
    assert message is None or bits(decode(encode(message))) == bits(message)
    return message


def bits(message: Message | None) -> str:
    """Return a text that is equal for identical messages: NaN equals NaN, and -0.0 differs from 0.0."""
    return repr(message)


def read_message(frame: bytes) -> Message:
    """Decode a frame that is exactly one message."""
    reader = Reader(frame)
    length = reader.array((0xDC,))
    number = reader.byte()
    if number not in KINDS:
        raise Refused("kind")
    kind = KINDS[number]
    hints = typing.get_type_hints(kind.message)
    names = [field.name for field in dataclasses.fields(kind.message)]
    if length != 1 + len(names) or len(frame) > kind.most_bytes:
        raise Refused("length")
    values = []
    for name in names:
        value = reader.value(hints[name], kind.most_items)
        if value not in CHOICES.get((kind.message, name), (value,)):
            raise Refused(name)
        values.append(value)
    if reader.at != len(frame):
        raise Refused("trailing bytes")
    message: Message = kind.message(*values)
    return message


class Reader:
    """Reads the values of a frame one after the other."""

    def __init__(self, frame: bytes) -> None:
        self.frame = frame
        self.at = 0

    def take(self, count: int) -> bytes:
        if self.at + count > len(self.frame):
            raise Refused("too short")
        self.at += count
        return self.frame[self.at - count : self.at]

    def byte(self) -> int:
        return self.take(1)[0]

    def number(self, form: str) -> Any:
        return struct.unpack(form, self.take(struct.calcsize(form)))[0]

    def value(self, hint: Any, most_items: int) -> Any:
        """Read a value of the type of a field."""
        origin, arguments = typing.get_origin(hint), typing.get_args(hint)
        if hasattr(hint, "_fields"):  # a NamedTuple is on the wire a tuple of the types of its fields
            parts: Any = tuple
            return hint(*self.value(parts[*typing.get_type_hints(hint).values()], most_items))
        if origin is types.UnionType:
            if self.frame[self.at : self.at + 1] == b"\xc0":
                self.at += 1
                return None
            return self.value(arguments[0], most_items)
        if origin is dict:
            return {self.text(): self.text() for _ in range(self.count(0x80, 16, {0xDE: ">H", 0xDF: ">I"}))}
        if origin is tuple:
            count = self.array((0xDC, 0xDD))
            if arguments[-1] is not Ellipsis:
                if count != len(arguments):
                    raise Refused("items")
                return tuple(self.value(argument, most_items) for argument in arguments)
            if count > most_items:
                raise Refused("too many")
            return tuple(self.value(arguments[0], most_items) for _ in range(count))
        return {int: self.integer, float: self.real, bool: self.truth, str: self.text, bytes: self.data}[hint]()

    def array(self, wide: tuple[int, ...]) -> int:
        return self.count(0x90, 16, {code: form for code, form in {0xDC: ">H", 0xDD: ">I"}.items() if code in wide})

    def count(self, short: int, most: int, wide: dict[int, str]) -> int:
        """Read a header's length: in its low bits, or in the bytes after it."""
        head = self.byte()
        if short <= head < short + most:
            return head - short
        if head not in wide:
            raise Refused(f"head {head:#x}")
        count: int = self.number(wide[head])
        return count

    def integer(self) -> int:
        head = self.byte()
        if head < 0x80 or head >= 0xE0:
            return head - 256 * (head >= 0xE0)
        forms = {0xCC: ">B", 0xCD: ">H", 0xCE: ">I", 0xCF: ">Q", 0xD0: ">b", 0xD1: ">h", 0xD2: ">i", 0xD3: ">q"}
        if head not in forms:
            raise Refused("not an integer")
        value: int = self.number(forms[head])
        if value >= 2**63:
            raise Refused("larger than a signed 64-bit integer")
        return value

    def real(self) -> float:
        head = self.byte()
        if head not in (0xCA, 0xCB):
            raise Refused("not a float")
        value: float = self.number(">f" if head == 0xCA else ">d")
        return value

    def truth(self) -> bool:
        head = self.byte()
        if head not in (0xC2, 0xC3):
            raise Refused("not a boolean")
        return head == 0xC3

    def text(self) -> str:
        data = self.take(self.count(0xA0, 32, {0xD9: ">B", 0xDA: ">H", 0xDB: ">I"}))
        try:
            return data.decode("utf-8", "strict")
        except UnicodeDecodeError as error:
            raise Refused("not UTF-8") from error

    def data(self) -> bytes:
        return self.take(self.count(0, 0, {0xC4: ">B", 0xC5: ">H", 0xC6: ">I"}))
