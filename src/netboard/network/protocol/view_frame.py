"""The frame of a view, written by compiled code straight from the row of a tick.

The server sends each station a view every few ticks. To make a `View` and encode it in Python takes a loop that sleeps
most of the time 50 us, and more than all else that it does meanwhile. `write_view` writes the same message with each
number in its widest form; `netboard.network.protocol.codec` decodes it like any other.
"""

from dataclasses import fields

import numpy as np

from netboard.base.compiled import Bytes, Records, Words, inlined, kernel
from netboard.base.config import SIDES
from netboard.network.protocol.fixed import WIDE
from netboard.network.protocol.messages import KINDS
from netboard.stage.curtain import AGAIN, AWAY, NO_PHASE, PAUSE_NOTICES, PHASE_NAMES, TICK_NUMBER, Shown, shown_of
from netboard.stage.view import View

CONTENT = 15
"""Numbers that make a view a new one [1]."""

_ARRAY, _NIL, _TEXT, _INTEGER, _FLOAT = 0xDC, 0xC0, 0xA0, 0xD3, 0xCB  # MessagePack: array 16 to float 64
_KIND = next(number for number, kind in KINDS.items() if kind.message is View)
_LENGTH = 1 + len(fields(View))

_TEXTS = (*SIDES, AWAY, AGAIN, *PAUSE_NOTICES, *PHASE_NAMES.values())
_STATION, _AWAY, _AGAIN, _PAUSE = 0, *(_TEXTS.index(text) for text in (AWAY, AGAIN, PAUSE_NOTICES[0]))
_PHASE = _PAUSE + len(PAUSE_NOTICES)
_PHASES = len(PHASE_NAMES)
assert list(PHASE_NAMES) == list(range(_PHASES))

_SIZES = np.array([len(text) for text in _TEXTS])
_LETTERS = np.zeros((len(_TEXTS), 31), np.uint8)  # a text of more bytes has another form
for _row, _text in zip(_LETTERS, _TEXTS, strict=True):
    _row[: len(_text)] = np.frombuffer(_text.encode(), np.uint8)

MAX_SIZE = 4 + len(fields(View)) * (1 + _LETTERS.shape[1])
"""Length of the longest frame of a view [bytes]."""


@inlined
def _put_text(frame: Bytes, at: int, place: int) -> int:
    """Write one of the texts; return where the next field begins."""
    size = int(_SIZES[place])
    frame[at] = _TEXT | size
    for k in range(size):
        frame[at + 1 + k] = _LETTERS[place, k]
    return at + 1 + size


@inlined
def _put_word(frame: Bytes, at: int, marker: int, word: int) -> int:
    """Write a number in its widest form; return where the next field begins."""
    frame[at] = marker
    for byte in range(8, 0, -1):
        frame[at + byte] = word & 255
        word >>= 8
    return at + WIDE


@inlined
def _put_integer(frame: Bytes, at: int, value: int) -> int:
    return _put_word(frame, at, _INTEGER, value)


@inlined
def _put_number(frame: Bytes, at: int, value: float) -> int:
    """Write a number, or nil for NaN; return where the next field begins."""
    if np.isnan(value):
        frame[at] = _NIL
        return at + 1
    return _put_word(frame, at, _FLOAT, int(np.float64(value).view(np.int64)))


@inlined
def _is_new(content: Words, shown: Shown) -> bool:
    """Store what a view shows; return whether it differs from what the last one has shown."""
    values = np.empty(CONTENT)
    values[0], values[1], values[2], values[3] = shown.phase, shown.z, shown.theta, shown.p
    values[4], values[5], values[6], values[7] = shown.target, shown.left, shown.right, shown.trial
    values[8], values[9], values[10], values[11] = shown.trials, shown.failures, shown.completion, shown.again
    values[12], values[13], values[14] = shown.share, shown.best, shown.pause
    # As words, because NaN, which stands for what is hidden, does not equal itself.
    words, new = values.view(np.int64), False
    for k in range(CONTENT):
        new |= content[k] != words[k]
        content[k] = words[k]
    return new


@kernel
def write_view(
    frame: Bytes,
    curtains: Records,
    words: Words,
    content: Words,
    at_any_rate: bool,
    best: float,
    sent_ns: int,
    seq: int,
    rest: float,
    pause: int,
) -> int:
    """Write the view of one station if it shows anything new.

    Parameters
    ----------
    frame : ndarray of uint8, shape (MAX_SIZE,)
        Output: the frame, at its beginning; the rest keeps its bytes.
    curtains : ndarray of netboard.stage.curtain.CURTAIN, shape (1,)
        What the station may see.
    words : ndarray of int64, shape (n,)
        The row of the tick as words.
    content : ndarray of int64, shape (CONTENT,)
        What the last view has shown, changed in place.
    at_any_rate : bool
        Whether to write a view that shows nothing new.
    best : float
        Best completion time of the block so far, NaN for none [s].
    sent_ns : int
        Server time at which the view is sent [ns].
    seq : int
        Number of the view at its station [1].
    rest : float
        Remaining rest before the block, NaN for none; a change of it is nothing new, because it counts in seconds [s].
    pause : int
        What is said of a pause: a `netboard.stage.curtain.Pause` [1].

    Returns
    -------
    int
        Length of the frame in bytes, or 0 if nothing new is shown [1].

    Raises
    ------
    ValueError
        If the phase of the tick is unknown.
    """
    curtain = curtains[0]
    shown = shown_of(curtain, words, words.view(np.float64), best, pause)
    if shown.phase < NO_PHASE or shown.phase >= _PHASES:
        raise ValueError("a row has an unknown phase")
    if not (_is_new(content, shown) or at_any_rate):
        return 0
    frame[0], frame[1], frame[2], frame[3] = _ARRAY, 0, _LENGTH, _KIND
    at = _put_text(frame, 4, _STATION + curtain["station"])
    at = _put_integer(frame, at, words[TICK_NUMBER])
    at = _put_integer(frame, at, sent_ns)
    at = _put_text(frame, at, _AWAY if shown.phase == NO_PHASE else _PHASE + shown.phase)
    for value in (shown.z, shown.theta, shown.p, shown.target, shown.left, shown.right):
        at = _put_number(frame, at, value)
    for count in (shown.trial, shown.trials, shown.failures):
        at = _put_integer(frame, at, count)
    at = _put_number(frame, at, shown.completion)
    at = _put_number(frame, at, shown.best)
    at = _put_text(frame, at, _AGAIN if shown.again else _PAUSE + shown.pause)
    at = _put_integer(frame, at, seq)
    at = _put_number(frame, at, shown.share)
    at = _put_integer(frame, at, curtain["block"])
    at = _put_integer(frame, at, curtain["blocks"])
    return _put_number(frame, at, rest)
