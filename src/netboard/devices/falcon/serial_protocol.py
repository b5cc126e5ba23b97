"""Serial protocol of a Novint Falcon with running firmware: one frame out, one frame back.

Both frames have 16 bytes: ``<``, three signed 16-bit numbers as nibbles from low to high, a byte of flags, a spare
byte, ``>``. 0x41 is added to every byte inside, so the brackets occur nowhere else and a receiver can resynchronise.
Motor commands go out, encoder counts come back; the Falcon sends only in response to a frame.

A frame is sent, and its answer is read at the next reading, a millisecond later. So no call waits for the bus, and the
encoder counts arrive no later than the force is applied.
"""

from collections.abc import Iterator
from typing import NamedTuple

from netboard.base.errors import DeviceTimeout
from netboard.base.system.monotonic import monotonic_ns
from netboard.devices.falcon import ftdi

SIZE = 16
OFFSET = 0x41
BEGIN, END = 0x3C, 0x3E

HOME = 0x01
"""Frame flag: home the encoders."""

GREEN, BLUE, RED = 0x02, 0x04, 0x08
"""Frame flags: lamps."""

HOMED, BUTTONS = 0x70, 0x0F
"""Answer flags: homed encoders, and pressed buttons of the grip."""

NUMBERS = range(OFFSET, OFFSET + 0x10)
"""Valid bytes of a number."""

FLAGS_LOW, FLAGS_HIGH = OFFSET, OFFSET + 0x7F
"""Valid range of the flags byte in an answer."""

LATENCY_MS = 1
"""Latency timer of the chip: interval of empty packets [ms]."""

BAUD = 0x2
"""Divisor of 3 MHz for 1.5 Mbaud."""

PACKET_TIMEOUT_MS = 5
"""Timeout of a packet [ms]."""

QUIET = 8
"""Number of consecutive empty packets after which a frame or its answer counts as lost [1]."""

MOST = 100
"""Number of packets of any kind after which a frame or its answer counts as lost [1]."""

ATTEMPTS = 4
"""Number of consecutive lost frames after which the Falcon counts as silent [1]."""


class FalconReply(NamedTuple):
    """Decoded answer of the Falcon."""

    encoders: tuple[int, int, int]
    homed: bool
    buttons: int  # bit mask of the grip's buttons: plus, forward, centre, minus


def frame_of(commands: tuple[int, int, int], flags: int) -> bytes:
    """Encode a frame for the Falcon."""
    nibbles = [(command >> shift & 0xF) + OFFSET for command in commands for shift in (0, 4, 8, 12)]
    return bytes((BEGIN, *nibbles, flags + OFFSET, OFFSET, END))


def answer_in(frame: bytes) -> FalconReply | None:
    """Decode an answer; None if it is invalid."""
    if frame[-1] != END or not FLAGS_LOW <= frame[13] <= FLAGS_HIGH or not all(byte in NUMBERS for byte in frame[1:13]):
        return None
    flags = frame[13] - OFFSET
    encoders = (_number(frame[1:5]), _number(frame[5:9]), _number(frame[9:13]))
    return FalconReply(encoders, flags & HOMED == HOMED, flags & BUTTONS)


def _number(nibbles: bytes) -> int:
    """Decode a signed number from four nibbles, low to high."""
    a, b, c, d = nibbles
    value = (a - OFFSET) | (b - OFFSET) << 4 | (c - OFFSET) << 8 | (d - OFFSET) << 12
    return value - 0x10000 if value & 0x8000 else value


class FalconLine:
    """The serial line to a running Falcon."""

    def __init__(self, chip: ftdi.Chip) -> None:
        self._chip = chip
        self._received = bytearray()
        self._frame = frame_of((0, 0, 0), 0)
        self.sent_ns = 0  # time at which the last frame was sent, on the monotonic clock [ns]
        self.awaited = 0

    def begin(self) -> None:
        """Configure the chip for the running firmware."""
        self._chip.request(ftdi.LATENCY, LATENCY_MS)
        self._chip.request(ftdi.BAUD, BAUD)
        self._forget()

    def send(self, commands: tuple[int, int, int], flags: int) -> None:
        """Send a frame, which the Falcon answers."""
        self._frame = frame_of(commands, flags)
        self._send()

    def answer(self) -> FalconReply:
        """Return the newest answer; resend a frame that was not answered."""
        for _ in range(ATTEMPTS):
            if not self.awaited:
                self._send()
            found = self._collect()
            if found is not None:
                return found
            self._forget()
        raise DeviceTimeout("the Falcon no longer answers: is its power supply plugged in?")

    def is_answered(self) -> bool:
        """Return True if the firmware answers a frame with zero force."""
        self._frame = frame_of((0, 0, 0), 0)
        try:
            self.answer()
        except DeviceTimeout:
            return False
        return True

    def _send(self) -> None:
        self._chip.send(self._frame, PACKET_TIMEOUT_MS)
        self.sent_ns = monotonic_ns()
        self.awaited += 1

    def _forget(self) -> None:
        """Discard all previous data, so that the next answer belongs to the next frame."""
        self._chip.purge()
        self._received.clear()
        self.awaited = 0

    def _collect(self) -> FalconReply | None:
        """Receive until all expected answers have arrived; return the last one."""
        newest, quiet = None, 0
        for _ in range(MOST):
            more = self._chip.receive(PACKET_TIMEOUT_MS)
            self._received += more
            quiet = 0 if more else quiet + 1
            for found in self._frames():
                newest = found
                self.awaited -= 1
            if self.awaited <= 0 or quiet == QUIET:
                break
        self.awaited = max(self.awaited, 0)
        return newest

    def _frames(self) -> Iterator[FalconReply]:
        """Extract complete frames from the received bytes; drop bytes that belong to none."""
        received = self._received
        while True:
            begin = received.find(BEGIN)
            del received[: begin if begin >= 0 else len(received)]
            if len(received) < SIZE:
                return
            found = answer_in(bytes(received[:SIZE]))
            if found is None:
                del received[0]
            else:
                del received[:SIZE]
                yield found
