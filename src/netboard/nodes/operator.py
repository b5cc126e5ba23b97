"""The operator's end of the control channel: ask how the server is, tell it what to do."""

import logging
from importlib.metadata import version

from netboard import keys, sockets
from netboard.clock import now_ns
from netboard.config import Network
from netboard.errors import NetboardError, WireError
from netboard.process import NAME
from netboard.wire.codec import decode, encode
from netboard.wire.messages import (
    PROTOCOL_VERSION,
    Command,
    Goodbye,
    Hello,
    Ping,
    Pong,
    Refusal,
    Status,
    StatusRequest,
    Welcome,
)

HELLO_NS = 500_000_000
"""Hello is said again after so long without an answer [ns]."""

SILENT_NS = 3_000_000_000
"""A server that was there and has not even asked for the time for so long is called anew [ns]."""

log = logging.getLogger(__name__)


class Operator:
    """Talks to one server; nothing here waits longer than it is told to.

    Parameters
    ----------
    network : Network
        Where the server is.
    context : zmq.Context
        Where the socket is made.
    """

    def __init__(self, network: Network, context: sockets.Context) -> None:
        where = keys.reach(network, "console")
        self.status: Status | None = None
        self._socket = sockets.control_client(context, where.reach(sockets.CONTROL), f"console@{NAME}")
        self._hello = encode(Hello("console", "", PROTOCOL_VERSION, NAME, version("netboard"), {}))
        self._said_hello_ns = -HELLO_NS
        self._welcomed = False
        self._heard_ns = 0

    def ask(self, seconds: float) -> Status | None:
        """Ask for the status and wait for an answer at most so long [s]; None without an answer.

        Raises
        ------
        NetboardError
            If the server refuses.
        """
        self._take()
        if self._welcomed and now_ns() - self._heard_ns > SILENT_NS:
            log.info("the server has been silent for %g s: connecting anew", SILENT_NS * 1e-9)
            self._welcomed = False
            sockets.renew(self._socket)
        if self._welcomed:
            sockets.send(self._socket, encode(StatusRequest()))
        elif now_ns() - self._said_hello_ns > HELLO_NS:
            self._said_hello_ns = now_ns()
            sockets.send_or_renew(self._socket, self._hello)
        answered = None
        while answered is None and sockets.wait_readable(self._socket, seconds):
            answered = self._take()
        return answered

    def command(self, name: str) -> None:
        """Tell the server what to do; it answers with its status."""
        sockets.send(self._socket, encode(Command(name)))

    def attend(self, seconds: float) -> None:
        """Let time pass, answering what the server asks [s]."""
        until_ns = now_ns() + int(seconds * 1e9)
        while (left_ns := until_ns - now_ns()) > 0:
            if sockets.wait_readable(self._socket, left_ns * 1e-9):
                self._take()

    def leave(self) -> None:
        """Say goodbye and close."""
        sockets.send(self._socket, encode(Goodbye("done")))
        sockets.close_after_goodbye(self._socket)

    def _take(self) -> Status | None:
        newest = None
        while (frame := sockets.receive(self._socket)) is not None:
            self._heard_ns = now_ns()
            try:
                message = decode(frame)
            except WireError as error:
                raise NetboardError(f"the server sent nonsense: {error}") from error
            match message:
                case Welcome():
                    self._welcomed = True
                case Ping(sent_ns=ping_ns):
                    received_ns = now_ns()
                    sockets.send(self._socket, encode(Pong(ping_ns, received_ns, now_ns())))
                case Status():
                    newest = self.status = message
                case Refusal(reason=reason):
                    raise NetboardError(f"the server refuses: {reason}")
        return newest
