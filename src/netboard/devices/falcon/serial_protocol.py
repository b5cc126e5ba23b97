"""What is said between us and a Novint Falcon that runs its program: one frame there, one frame back.

Both have 16 bytes: ``<``, three signed 16-bit numbers in nibbles from low to high, a byte of flags, a spare one, ``>``.
0x41 is added to everything within, so the two brackets occur nowhere else and a reader who has lost his place finds it
again. Commands for the motors go there, encoder counts come back; nothing comes that was not asked for by a frame.

A frame is sent and its answer is collected at the next reading, a millisecond later. So no one waits for the bus, and
nothing is answered later than a force is applied.
"""

from collections.abc import Iterator
from time import monotonic_ns
from typing import NamedTuple

from netboard.base.errors import DeviceTimeout
from netboard.devices.falcon import ftdi

SIZE = 16
OFFSET = 0x41
BEGIN, END = 0x3C, 0x3E

HOME = 0x01
"""Flag of a frame: the encoders shall find their zero."""

GREEN, BLUE, RED = 0x02, 0x04, 0x08
"""Flags of a frame: lamps."""

HOMED, BUTTONS = 0x70, 0x0F
"""Flags of an answer: which encoders know their zero, and which of the grip's buttons are pressed."""

NUMBERS = range(OFFSET, OFFSET + 0x10)
"""What a byte of a number may be."""

FLAGS_LOW, FLAGS_HIGH = OFFSET, OFFSET + 0x7F
"""What the byte of flags of an answer may be."""

LATENCY_MS = 1
"""Latency timer of the chip: an empty packet comes so often [ms]."""

BAUD = 0x2
"""Divisor of 3 MHz for 1.5 Mbaud."""

PATIENCE_MS = 5
"""Longest wait for a packet [ms]."""

QUIET = 8
"""Empty packets in a row after which a frame, or its answer, counts as lost [1]."""

MOST = 100
"""Packets, of whatever, after which it does [1]."""

ATTEMPTS = 4
"""Frames that may be lost in a row before the Falcon counts as silent [1]."""


class Answer(NamedTuple):
    """What the Falcon says of itself.

    Attributes
    ----------
    buttons : int
        Bit mask of the grip's buttons: plus, forward, centre, minus [1].
    """

    encoders: tuple[int, int, int]
    homed: bool
    buttons: int


def frame_of(commands: tuple[int, int, int], flags: int) -> bytes:
    """Write what the Falcon is told."""
    nibbles = [(command >> shift & 0xF) + OFFSET for command in commands for shift in (0, 4, 8, 12)]
    return bytes((BEGIN, *nibbles, flags + OFFSET, OFFSET, END))


def answer_in(frame: bytes) -> Answer | None:
    """Read what the Falcon says."""
    if frame[-1] != END or not FLAGS_LOW <= frame[13] <= FLAGS_HIGH or not all(byte in NUMBERS for byte in frame[1:13]):
        return None
    flags = frame[13] - OFFSET
    encoders = (_number(frame[1:5]), _number(frame[5:9]), _number(frame[9:13]))
    return Answer(encoders, flags & HOMED == HOMED, flags & BUTTONS)


def _number(nibbles: bytes) -> int:
    """Read a signed number from four nibbles, low to high."""
    a, b, c, d = nibbles
    value = (a - OFFSET) | (b - OFFSET) << 4 | (c - OFFSET) << 8 | (d - OFFSET) << 12
    return value - 0x10000 if value & 0x8000 else value


class Link:
    """The line to a Falcon's program.

    Attributes
    ----------
    sent_ns : int
        When the last frame was sent, on the monotonic clock [ns].
    """

    def __init__(self, chip: ftdi.Chip) -> None:
        self._chip = chip
        self._heard = bytearray()
        self._frame = frame_of((0, 0, 0), 0)
        self.sent_ns = 0
        self.awaited = 0

    def begin(self) -> None:
        """Set the chip up for talking to the program."""
        self._chip.request(ftdi.LATENCY, LATENCY_MS)
        self._chip.request(ftdi.BAUD, BAUD)
        self._forget()

    def send(self, commands: tuple[int, int, int], flags: int) -> None:
        """Tell the Falcon something, which it answers."""
        self._frame = frame_of(commands, flags)
        self._send()

    def answer(self) -> Answer:
        """Collect the newest answer; a frame that is not answered is sent again."""
        for _ in range(ATTEMPTS):
            if not self.awaited:
                self._send()
            found = self._collect()
            if found is not None:
                return found
            self._forget()
        raise DeviceTimeout("the Falcon does not answer any more: is its power supply plugged in?")

    def is_answered(self) -> bool:
        """Whether there is a program at the other end: with no force, whether a frame is answered."""
        self._frame = frame_of((0, 0, 0), 0)
        try:
            self.answer()
        except DeviceTimeout:
            return False
        return True

    def _send(self) -> None:
        self._chip.send(self._frame, PATIENCE_MS)
        self.sent_ns = monotonic_ns()
        self.awaited += 1

    def _forget(self) -> None:
        """Forget all that was said, so that the next answer belongs to the next frame."""
        self._chip.purge()
        self._heard.clear()
        self.awaited = 0

    def _collect(self) -> Answer | None:
        """Receive until as many answers have come as are awaited; the last one."""
        newest, quiet = None, 0
        for _ in range(MOST):
            more = self._chip.receive(PATIENCE_MS)
            self._heard += more
            quiet = 0 if more else quiet + 1
            for found in self._frames():
                newest = found
                self.awaited -= 1
            if self.awaited <= 0 or quiet == QUIET:
                break
        self.awaited = max(self.awaited, 0)
        return newest

    def _frames(self) -> Iterator[Answer]:
        """Take the whole frames out of what was heard; what cannot be part of one is dropped."""
        heard = self._heard
        while True:
            begin = heard.find(BEGIN)
            del heard[: begin if begin >= 0 else len(heard)]
            if len(heard) < SIZE:
                return
            found = answer_in(bytes(heard[:SIZE]))
            if found is None:
                del heard[0]
            else:
                del heard[:SIZE]
                yield found
