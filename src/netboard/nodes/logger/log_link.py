"""The client's endpoint of the log channel, for loggers and subscribers: both join the server in the same way."""

import logging
from collections import deque
from collections.abc import Callable, Iterator
from importlib.metadata import version
from typing import Protocol

from netboard.base.errors import WireError
from netboard.base.process.resources import NAME
from netboard.base.tables.rig import Network
from netboard.base.terminal.logs import RateLimitedLog
from netboard.network import keys
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import HELLO_INTERVAL_NS, Hello, Ping, Pong, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.transport import channels, poller, sockets

log = logging.getLogger(__name__)

SILENCE_TIMEOUT_NS = 1_000_000_000
"""Silence after which the server may have been restarted and is sent another `Hello` [ns]."""

WAIT_SECONDS = 0.02
BURST = 16

ANSWERS = 64
"""Answers to the server's probes that are remembered: those of 10 s or more [1]."""


class LogEndpoint(Protocol):
    """The client's endpoint of the log channel."""

    def wait(self, seconds: float) -> bool:
        """Wait until a frame can be received, or until the timeout [s]."""

    def receive(self) -> bytes | None:
        """Return the next frame, or None if there is none now."""

    def send(self, frame: bytes) -> bool:
        """Send without waiting; return False if no peer is connected."""


class SocketLink:
    """The log channel over a ZeroMQ socket."""

    def __init__(self, network: Network, role: str, context: sockets.Context) -> None:
        endpoint = keys.reach(network, role).reach(channels.LOG)
        self._socket = sockets.log_client(context, endpoint, f"{role}@{NAME}")

    def wait(self, seconds: float) -> bool:
        """Wait until a frame can be received, or until the timeout [s]."""
        return poller.wait_readable(self._socket, seconds)

    def receive(self) -> bytes | None:
        """Return the next frame, or None if there is none now."""
        return sockets.receive(self._socket)

    def send(self, frame: bytes) -> bool:
        """Send without waiting; return False if no peer is connected."""
        return sockets.send_or_renew(self._socket, frame)


class Connection:
    """Joins a server: sends `Hello` until it is welcomed, answers clock probes, and reports refusals.

    ``clock``: monotonic time [ns].
    """

    def __init__(self, link: LogEndpoint, role: str, details: dict[str, str], clock: Callable[[], int]) -> None:
        self.welcomed = False
        self.problems = RateLimitedLog(log)
        self.answered_ns: deque[int] = deque(maxlen=ANSWERS)  # when the last answers to probes were sent [ns]
        self._link, self._clock = link, clock
        self._hello = Hello(role, "", PROTOCOL_VERSION, NAME, version("netboard"), details)
        self._last_message_ns = self._hello_ns = clock() - SILENCE_TIMEOUT_NS
        self._refused = ""

    def messages(self) -> Iterator[Message | None]:
        """Wait briefly, and return what has arrived; None for a frame that breaks the protocol."""
        self._link.wait(WAIT_SECONDS)
        for _ in range(BURST):
            frame = self._link.receive()
            if frame is None:
                break
            self._last_message_ns = self._clock()
            try:
                message = decode(frame)
            except WireError as error:
                self.problems.log(f"invalid message from the server: {error}")
                yield None
                continue
            match message:
                case Ping(sent_ns=ping_ns):
                    answer = Pong(ping_ns, self._last_message_ns, self._clock())
                    self.answered_ns.append(answer.sent_ns)
                    self.send(answer)
                case Refusal(reason=reason):
                    self.welcomed = False
                    if reason != self._refused:
                        self._refused = reason
                        log.warning("the server refused the connection: %s", reason)
                case _:
                    if isinstance(message, Welcome):
                        self._refused = ""  # a refusal after a welcome is reported again
                    yield message
        self._greet()

    def send(self, message: Message) -> None:
        """Send a message without waiting."""
        self._link.send(encode(message))

    def _greet(self) -> None:
        """Send `Hello` to a server that has not answered yet or has fallen silent.

        A server that has sent a `Welcome` gets no further `Hello` while its frames arrive, however late its first
        records are. Each `Hello` restarts the handshake, which over a slow link would then never finish.
        """
        now = self._clock()
        silent = now - self._last_message_ns >= SILENCE_TIMEOUT_NS
        if (silent or not self.welcomed) and now - self._hello_ns >= HELLO_INTERVAL_NS:
            self._hello_ns = now
            if self.welcomed:
                log.warning("the server has been silent for %g s: waiting for it", SILENCE_TIMEOUT_NS * 1e-9)
            self.welcomed = False
            self.send(self._hello)
