"""The frames of the 1 kHz exchange in their fixed form, which compiled code reads and writes.

A message of numbers only has a frame of fixed length if every number takes its widest form: nine bytes, a marker and
the 64 bits of an integer or a float; a truth value takes one. netboard writes `Stylus`, `Force`, `Point` and
`Heartbeat` in this form, and reads such frames without making an object of each number.
`netboard.network.protocol.codec` reads them like any other form of the same message.

In memory such a message is a row of 64-bit words, one for each field, whatever its type; `fields_of` gives the record
that names them.
"""

import struct
from typing import NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Bytes, Words, kernel
from netboard.network.protocol.messages import KINDS, Message
from netboard.network.protocol.motion import Force, Heartbeat, Point, Stylus

WIDE = 9
"""Bytes of a number in its widest form [1]."""

_FALSE = 0xC2
"""A truth value is this byte or the next one."""

_MARKERS = {int: 0xD3, float: 0xCB, bool: _FALSE}  # MessagePack: int 64, float 64, false
_TYPES = {int: "<i8", float: "<f8", bool: "<i8"}


class FixedForm(NamedTuple):
    """The fixed form of a message.

    Attributes
    ----------
    head : ndarray of uint8
        The bytes before the first number.
    markers : ndarray of uint8, shape (n,)
        The marker of each number.
    size : int
        Length of the frame, in bytes [1].
    """

    head: NDArray[np.uint8]
    markers: NDArray[np.uint8]
    size: int


def form_of(message: type[Message]) -> FixedForm:
    """Return the fixed form of a message of numbers only."""
    number = next(number for number, kind in KINDS.items() if kind.message is message)
    markers = [_MARKERS[hint] for hint in get_type_hints(message).values()]
    length = len(markers) + 1
    head = [0x90 | length, number] if length < 16 else [0xDC, 0, length, number]
    size = len(head) + sum(1 if marker == _FALSE else WIDE for marker in markers)
    return FixedForm(np.array(head, np.uint8), np.array(markers, np.uint8), size)


def fields_of(message: type[Message]) -> list[tuple[str, str]]:
    """Return the names and types of a message's words, as for a structured array."""
    return [(name, _TYPES[hint]) for name, hint in get_type_hints(message).items()]


def places_of(message: type[Message], *names: str) -> tuple[int, ...]:
    """Return which words of a message are these fields, as integers that numba folds into kernels as constants [1].

    Parameters
    ----------
    names : str
        Fields of the message, in the order wanted.
    """
    every = [name for name, _ in fields_of(message)]
    return tuple(map(every.index, names))


def packer_of(message: type[Message]) -> struct.Struct:
    """Return a `struct.Struct` that packs and unpacks the words of a message."""
    return struct.Struct("<" + "".join("d" if kind == "<f8" else "q" for _, kind in fields_of(message)))


STYLUS, FORCE, POINT, HEARTBEAT = map(form_of, (Stylus, Force, Point, Heartbeat))


@kernel
def read(frame: Bytes, form: FixedForm, words: Words) -> bool:
    """Read a frame of a fixed form; return False, and leave the words undefined, if it has another form.

    Parameters
    ----------
    words : ndarray of int64, shape (n,)
        Output: the numbers as words.
    """
    place, size = len(form.head), len(frame)
    if size < place:
        return False
    for k in range(place):
        if frame[k] != form.head[k]:
            return False
    for k in range(len(form.markers)):
        width = 1 if form.markers[k] == _FALSE else WIDE
        if size < place + width:
            return False
        if width == 1:
            word = np.int64(frame[place]) - _FALSE
            if not 0 <= word <= 1:
                return False
        else:
            if frame[place] != form.markers[k]:
                return False
            word = np.int64(0)
            for byte in range(1, 9):
                word = (word << np.int64(8)) | np.int64(frame[place + byte])
        words[k] = word
        place += width
    return size == place


@kernel
def write(frame: Bytes, form: FixedForm, words: Words) -> None:
    """Write a frame of a fixed form.

    Parameters
    ----------
    frame : ndarray of uint8
        Output: the frame, of the form's size.
    words : ndarray of int64, shape (n,)
        The numbers in the order of the fields; a float by its bits.
    """
    place = len(form.head)
    for k in range(place):
        frame[k] = form.head[k]
    for k in range(len(form.markers)):
        word = words[k]
        if form.markers[k] == _FALSE:
            frame[place] = _FALSE + word
            place += 1
            continue
        frame[place] = form.markers[k]
        for byte in range(8, 0, -1):
            frame[place + byte] = word & 255
            word >>= 8
        place += WIDE
