"""The agent's endpoint of the motion channel: says hello until welcomed, sends samples, keeps the newest answer.

Compiled code (`netboard.network.transport.fastpath`) handles the frames that come a thousand times a second; all others
are decoded as messages. Nothing here waits longer than its timeout, and nothing knows the device.
"""

import logging
from typing import Any

import numpy as np

from netboard.base.clock import Pacer, now_ns
from netboard.base.compiled import kernel
from netboard.base.errors import WireError
from netboard.base.process import Seldom
from netboard.base.tick import TICK_NS
from netboard.network.protocol import fixed
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Goodbye, Hello, Refusal, Welcome
from netboard.network.protocol.motion import Backfill, BackfillRequest, Beat, Force, Point
from netboard.network.transport import fastpath, poller, sockets

log = logging.getLogger(__name__)

HELLO_NS = 500_000_000
"""Silence of the server after which `Hello` is sent again [ns]."""

REMEMBERED = 256
"""Samples whose stamps are remembered [1]."""

PARTING_TRIES = 50
"""Attempts to send the goodbye after a lost device, one each millisecond [1]."""

_FORCE, _POINT = fixed.packer_of(Force), fixed.packer_of(Point)

FORCE_CAME, POINT_CAME = -4, -5
"""Results of `hear` for a fixed-form force or point, beside those of `fastpath.hear` [1]."""


@kernel
def hear(fast: Any, frame: Any, head: Any, markers: Any, words: Any, point: Any) -> int:
    """Receive one frame; return `FORCE_CAME` or `POINT_CAME` if it has the fixed form and its words have been read.

    Parameters
    ----------
    point : tuple of ndarray
        Head, markers and word buffer of a `Point`.
    """
    size = fastpath.hear(fast, frame)
    if size >= 0:
        if fixed.read(frame[:size], head, markers, words):
            return FORCE_CAME
        if fixed.read(frame[:size], point[0], point[1], point[2]):
            return POINT_CAME
    return size


@kernel
def say(fast: Any, frame: Any, head: Any, markers: Any, words: Any) -> int:
    """Send a sample, as `netboard.network.transport.fastpath.say` does."""
    fixed.write(frame, head, markers, words)
    return fastpath.say(fast, frame)


class Link:
    """The agent's endpoint of the motion channel.

    Parameters
    ----------
    timeout_ns : int
        Age of a sample from which an answer to it is not fresh [ns].

    Attributes
    ----------
    heard_ns : int
        When the newest answer was received, 0 for never [ns].
    received_ns : int or None
        When the server's last fresh message was received [ns].
    block : str
        Configuration of the block that has begun; the reader empties it.
    asked : BackfillRequest or None
        The server's open request about an interruption; see `answer`.
    """

    def __init__(self, socket: sockets.Socket, hello: Hello, timeout_ns: int) -> None:
        self.newest: Force | Point | Beat | None = None
        self.received_ns: int | None = None
        self.block = ""
        self.asked: BackfillRequest | None = None
        self._timeout_ns = timeout_ns
        self.heard_ns = self._sent = 0
        self.loop_ns = 0
        self._socket = socket
        self._fast = fastpath.FastPath(socket)
        self._heard = np.zeros(sockets.LARGEST_FRAME, np.uint8)
        self._force = np.zeros(len(fixed.FORCE.markers), np.int64)
        self._point = (*fixed.POINT[:2], np.zeros(len(fixed.POINT.markers), np.int64))
        self._said = np.zeros(fixed.STYLUS.size, np.uint8)
        self.sample = np.zeros(len(fixed.STYLUS.markers), np.int64)
        self.introduce(hello)
        self._said_hello_ns = -HELLO_NS
        self._stamps = [0] * REMEMBERED
        self._looped = -1
        self._refused = ""
        self._nonsense = Seldom(log)

    def introduce(self, hello: Hello) -> None:
        """Leave the session, and use this `Hello` from now on."""
        self._hello = encode(hello)
        self._session, self.newest = "", None

    def warm(self) -> None:
        """Compile or load the kernels, so that the first tick is not late."""
        nowhere = fastpath.FastPath(None).record
        hear(nowhere, self._heard, *fixed.FORCE[:2], self._force, self._point)
        say(nowhere, self._said, *fixed.STYLUS[:2], self.sample)

    def send(self, seq: int, stamp_ns: int) -> None:
        """Send the sample with this number and stamp, and a `Hello` first if the server is silent."""
        if stamp_ns - max(self.heard_ns, self._said_hello_ns) >= HELLO_NS:
            self._said_hello_ns = stamp_ns
            sockets.send_or_renew(self._socket, self._hello)
        self._stamps[seq % REMEMBERED], self._sent = stamp_ns, seq
        if self._session and say(self._fast.record, self._said, *fixed.STYLUS[:2], self.sample) == fastpath.FAILED:
            self._fast.fail("motion")

    def receive(self) -> bool:
        """Take one message if there is one; return True if it is a newer force, point or heartbeat."""
        came = hear(self._fast.record, self._heard, *fixed.FORCE[:2], self._force, self._point)
        if came == FORCE_CAME:
            return self._take(Force(*_FORCE.unpack(self._force.data)))
        if came == POINT_CAME:
            return self._take(Point(*_POINT.unpack(self._point[2].data)))
        if came == fastpath.FAILED:
            self._fast.fail("motion")
        return came != fastpath.NOTHING and self._understand(self._heard[:came].tobytes())

    def _understand(self, frame: bytes) -> bool:
        """Handle a message that is not a fixed-form force or point."""
        try:
            message = decode(frame)
        except WireError as error:
            self._nonsense.say(f"invalid message from the server: {error}")
            return False
        match message:
            case Force() | Point() | Beat():
                return self._take(message)
            case BackfillRequest():
                self.asked = message
            case Welcome(session=session, config=block):
                self._enter(session)
                self.block = block
            case Goodbye(reason=reason):
                log.info("the server ended the connection: %s", reason)
                self._session = ""
            case Refusal(reason=reason) if reason != self._refused:
                self._refused = reason
                log.warning("the server refused the connection: %s", reason)
        return False

    def answer(self, backfill: Backfill) -> None:
        """Answer the server's backfill request; if the queue is full, the server asks again."""
        self.asked = None
        sockets.send(self._socket, encode(backfill))

    def rendered(self, at_ns: int) -> None:
        """Note that the newest answer was rendered, which closes the loop of the sample it was computed from."""
        message = self.newest
        if isinstance(message, Force | Point) and message.stylus_seq > self._looped:
            self._looped = message.stylus_seq
            self.loop_ns = at_ns - self._stamps[message.stylus_seq % REMEMBERED]

    def wait(self, seconds: float) -> bool:
        """Wait for the server [s]; return whether a message may have arrived."""
        return poller.wait_signal(self._socket, seconds)

    def part(self, reason: str) -> None:
        """Leave the session with a goodbye, trying again while samples fill the queue."""
        for _ in range(PARTING_TRIES):
            if sockets.send(self._socket, encode(Goodbye(reason))):
                break
            Pacer(now_ns() + TICK_NS).wait()
        self._session, self.newest = "", None

    def leave(self, reason: str) -> None:
        """Say goodbye and close."""
        sockets.send(self._socket, encode(Goodbye(reason)))
        self._fast.close()
        sockets.close_after_goodbye(self._socket)

    def _take(self, message: Force | Point | Beat) -> bool:
        if not self._session or (self.newest is not None and message.tick <= self.newest.tick):
            return False
        self.newest, self.heard_ns = message, now_ns()
        if self._is_fresh(message.stylus_seq):
            self.received_ns = self.heard_ns
        return True

    def _is_fresh(self, seq: int) -> bool:
        """Return whether the message just received answers a recent sample, or says that there is none.

        Messages that arrived while the agent stalled thus do not count as fresh.
        """
        if seq < 0:
            return True
        return self._sent - seq < REMEMBERED and self.heard_ns - self._stamps[seq % REMEMBERED] < self._timeout_ns

    def _enter(self, session: str) -> None:
        """Enter a session; in a new one nothing of the old one counts."""
        self._refused = ""
        if session != self._session:
            log.info("in session %s", session[:8])
            self._session, self.newest = session, None
