"""The operator's endpoint of the control channel: ask for the status, give commands.

A caller with its own loop (a window) calls `poll` often, and `command` as needed. A caller without one (a shell
command) calls `ask` and `do`, which wait.
"""

import logging
from collections import deque
from importlib.metadata import version

from netboard.base.clock import now_ns
from netboard.base.errors import NetboardError, WireError
from netboard.base.process.resources import NAME
from netboard.base.tables.rig import Network
from netboard.network import keys
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.control import (
    Command,
    Outcomes,
    OutcomesRequest,
    Reply,
    Status,
    StatusRequest,
    Trace,
    TracePoint,
    TraceRequest,
)
from netboard.network.protocol.joining import (
    HELLO_FIRST,
    HELLO_INTERVAL_NS,
    Goodbye,
    Hello,
    Ping,
    Pong,
    Refusal,
    Welcome,
)
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.transport import channels, poller, sockets
from netboard.task.journal.outcome import AttemptOutcome

ANSWER_SECONDS = 3.0
"""Timeout of the server's reply to a command [s]."""

MAX_POINTS = 4000
"""Points of the trace that are kept: 20 s [1]."""

SILENCE_TIMEOUT_NS = 3_000_000_000
"""Silence of a known server, without even a ping, after which the connection is renewed [ns]."""

log = logging.getLogger(__name__)


class Operator:
    """Talks to one server; nothing here waits longer than its timeout."""

    def __init__(self, network: Network, context: sockets.Context) -> None:
        where = keys.reach(network, "console")
        self.status: Status | None = None
        self.config = ""  # the server's configuration of the session and its block, as text; empty before the welcome
        self.attempts: list[AttemptOutcome] = []  # all of the session so far
        self.points: deque[TracePoint] = deque(maxlen=MAX_POINTS)
        self._replies: dict[int, Reply] = {}
        self._number = 0
        self._socket = sockets.control_client(context, where.reach(channels.CONTROL), f"console@{NAME}")
        self._hello = encode(Hello("console", "", PROTOCOL_VERSION, NAME, version("netboard"), {}))
        self._hello_ns = -HELLO_INTERVAL_NS
        self._welcomed = False
        self.over = False  # whether the server has said goodbye since its last welcome
        self._last_message_ns = 0

    def ask(self, seconds: float) -> Status | None:
        """Ask for the status and wait until the timeout [s]; return None without an answer."""
        self.poll(trace=False)
        answered = None
        while answered is None and poller.wait_readable(self._socket, seconds):
            answered = self._take()
        return answered

    def poll(self, *, trace: bool = True) -> Status | None:
        """Take what has arrived, and ask for the status, new outcomes and, if wanted, the trace; never waits."""
        newest = self._take()
        if self._welcomed and now_ns() - self._last_message_ns > SILENCE_TIMEOUT_NS:
            log.info("the server has been silent for %g s: reconnecting", SILENCE_TIMEOUT_NS * 1e-9)
            self._welcomed = False
            sockets.renew(self._socket)
        if self._welcomed:
            self._send(StatusRequest())
            if self.status is not None and len(self.attempts) < self.status.outcomes:
                self._send(OutcomesRequest(len(self.attempts)))
            if trace:
                self._send(TraceRequest(self.points[-1].tick if self.points else -1))
        elif now_ns() - self._hello_ns > HELLO_INTERVAL_NS:
            self._hello_ns = now_ns()
            sockets.send_or_renew(self._socket, self._hello)
        return newest

    def command(self, name: str, argument: str = "") -> int:
        """Send a command; return the number with which to ask for its `reply`."""
        self._number += 1
        # A terminal with another coding than UTF-8 yields halves of characters, which cannot be sent.
        sendable = argument.encode(errors="replace").decode()
        self._send(Command(name, sendable, self._number))
        return self._number

    def reply(self, number: int) -> Reply | None:
        """Take the reply to a command, once; None while there is none."""
        return self._replies.pop(number, None)

    def do(self, name: str, argument: str = "") -> Reply:
        """Send a command, and wait for its reply."""
        number = self.command(name, argument)
        until_ns = now_ns() + int(ANSWER_SECONDS * 1e9)
        while (left_ns := until_ns - now_ns()) > 0:
            if poller.wait_readable(self._socket, left_ns * 1e-9):
                self._take()
            if (reply := self.reply(number)) is not None:
                return reply
        raise NetboardError(f"{name}: the server has not answered within {ANSWER_SECONDS:g} s")

    def attend(self, seconds: float) -> None:
        """Wait for this time [s], and answer the server's pings meanwhile."""
        until_ns = now_ns() + int(seconds * 1e9)
        while (left_ns := until_ns - now_ns()) > 0:
            if poller.wait_readable(self._socket, left_ns * 1e-9):
                self._take()

    def leave(self) -> None:
        """Say goodbye and close."""
        sockets.send(self._socket, encode(Goodbye("done")))
        sockets.close_after_goodbye(self._socket)

    def _send(self, message: Message) -> None:
        sockets.send(self._socket, encode(message))

    def _take(self) -> Status | None:
        newest = None
        while (frame := sockets.receive(self._socket)) is not None:
            self._last_message_ns = now_ns()
            try:
                message = decode(frame)
            except WireError as error:
                raise NetboardError(f"invalid message from the server: {error}") from error
            match message:
                case Welcome(config=config):
                    self._welcomed, self.over, self.config = True, False, config
                case Ping(sent_ns=ping_ns):
                    received_ns = now_ns()
                    self._send(Pong(ping_ns, received_ns, now_ns()))
                case Status():
                    newest = self._store(message)
                case Reply(number=number):
                    self._replies[number] = message
                case Outcomes(first=first, attempts=attempts) if first == len(self.attempts):
                    self.attempts.extend(attempts)
                case Trace(points=points):
                    last = self.points[-1].tick if self.points else -1
                    self.points.extend(point for point in points if point[0] > last)
                case Goodbye():
                    self._welcomed, self.over = False, True
                case Refusal(reason=reason) if reason == HELLO_FIRST:  # removed as a silent peer
                    self._welcomed = False
                case Refusal(reason=reason):
                    raise NetboardError(f"the server refused the connection: {reason}")
        return newest

    def _store(self, status: Status) -> Status:
        """Store a status.

        Drop outcomes and points of another session, and those that lie ahead of a replay's position.
        """
        if self.status is not None and status.session != self.status.session:
            self.attempts.clear()
            self.points.clear()
        del self.attempts[status.outcomes :]
        if self.points and self.points[-1].tick >= status.tick:
            self.points.clear()
        self.status = status
        return status
