"""Authentication: the server checks the keys of its peers, and each peer has the keys with which it connects.

CURVE (ZeroMQ's RFC 26) encrypts, and at each handshake libzmq asks whether the peer's key is accepted (ZAP, RFC 27).
The server's own loop answers, a few handshakes at a time, so no thread can hold up a tick. This module does not know
which role a key has; a `KnownKeys` does.
"""

import logging
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias

import zmq
from zmq.utils import z85
from zmq.utils.monitor import parse_monitor_message

from netboard.base.system.monotonic import monotonic_ns
from netboard.base.system.scheduling import scheduling
from netboard.network.transport.refusal_count import RefusalCounter

log = logging.getLogger(__name__)

Socket: TypeAlias = "zmq.Socket[bytes]"

MAX_HANDSHAKES = 3
"""Handshakes answered, and failures read of a channel, in one call; it limits what unknown peers take of a tick [1]."""
MAX_FULL_READS = 20
"""Consecutive full readings of failed handshakes after which a channel is not read for a while [1]."""
MONITOR_PAUSE_NS = 10_000_000_000
"""Time for which a channel with too many failed handshakes is not read [ns]."""
LOW_PRIORITY_NS = 1_000_000_000
"""Time after a refused handshake for which libzmq's thread runs below the loop [ns]."""

ZAP_ADDRESS = "inproc://zeromq.zap.01"
"""Where libzmq asks whether a key is accepted (ZeroMQ's RFC 27)."""

EVENTS, POLLIN, NOBLOCK = int(zmq.EVENTS), int(zmq.POLLIN), int(zmq.NOBLOCK)
"""Plain numbers: arithmetic with pyzmq's flags costs as much as receiving."""


def readable(socket: Socket) -> bool:
    """Return whether there is something to read; cheaper than catching an exception."""
    return int(socket.getsockopt(EVENTS)) & POLLIN != 0


@dataclass(frozen=True, slots=True)
class Credentials:
    """A peer's own keys, and the server's public key (Z85)."""

    public: str
    secret: str = field(repr=False)
    server: str


@dataclass(frozen=True, slots=True)
class SharedKey:
    """A pair of keys that both ends of a local endpoint have (Z85): to know either is to be the same user."""

    public: str
    secret: str = field(repr=False)


class KnownKeys(Protocol):
    """The server's key, and the role of each peer's key."""

    secret: str
    """The server's secret key (Z85)."""

    def channel_refusal(self, key: str, channel: str) -> str:
        """Return why a key may not open a channel; empty if it may."""

    def role_refusal(self, key: str, role: str, side: str) -> str:
        """Return why the owner of a key may not act in this role and side; empty if it may."""

    def owner(self, key: str) -> str:
        """Return the role and side of a key, such as ``agent.left``."""

    def fingerprint(self, key: str) -> str:
        """Return the fingerprint of a public key."""


def new_keys() -> tuple[str, str]:
    """Return a new pair of keys, public and secret (Z85)."""
    public, secret = zmq.curve_keypair()
    return public.decode(), secret.decode()


def public_of(secret: str) -> str:
    """Return the public key of a secret one (Z85)."""
    return zmq.curve_public(secret.encode()).decode()


class Authenticator:
    """Authenticates one server's peers; its port distinguishes it from other servers in the same context."""

    def __init__(self, ring: KnownKeys, port: int) -> None:
        self.ring = ring
        self._port = port
        self._handlers: list[_ZapHandler] = []
        self._monitors: list[_HandshakeMonitor] = []
        self._refused = RefusalCounter()

    @property
    def totals(self) -> dict[str, int]:
        """Refused handshakes and frames so far, by reason [1]."""
        return self._refused.totals

    def answer_handshakes(self) -> None:
        """Answer waiting handshakes, a few at a time, in the context of each channel.

        No peer can connect unless this is called; the session calls it at least 50 times a second.
        """
        for handler in self._handlers:
            handler.answer()

    def reports(self, now_ns: int) -> list[dict[str, str]]:
        """Count the handshakes that failed, and return the reports of refusals that are due."""
        for monitor in self._monitors:
            for reason in monitor.failures():
                monitor.handler.note_failure()
                self.refuse(monitor.channel, "", "", reason)
        return self._refused.reports(now_ns)

    def final_reports(self) -> list[dict[str, str]]:
        """Return the final counts of refusals."""
        return self._refused.final_reports()

    def refuse(self, channel: str, address: str, key: str, reason: str) -> None:
        """Count a refusal; address and key may be empty, if they are not known."""
        peer = {"address": address, "key": self.ring.fingerprint(key) if key else ""}
        details = {name: value for name, value in peer.items() if value}
        self._refused.count((channel, key or address, reason), {"channel": channel, **details, "reason": reason})

    def guard(self, context: "Context", socket: Socket, name: str) -> None:
        """Require keys on the socket of a channel with this name, before it is bound."""
        handler = context.handler = context.handler or _ZapHandler(context)
        handler.authenticators[f"{self._port}.{name}"] = (self, name)
        if handler not in self._handlers:
            self._handlers.append(handler)
        socket.setsockopt(zmq.CURVE_SERVER, 1)
        socket.setsockopt(zmq.CURVE_SECRETKEY, self.ring.secret.encode())
        socket.setsockopt(zmq.ZAP_DOMAIN, f"{self._port}.{name}".encode())
        socket.setsockopt(zmq.ZAP_ENFORCE_DOMAIN, 1)
        self._monitors.append(_HandshakeMonitor(context, socket, name, handler))


class _ZapHandler:
    """The ZAP handler of one context, for all its authenticators."""

    def __init__(self, context: "Context") -> None:
        self.authenticators: dict[str, tuple[Authenticator, str]] = {}
        self._context = context
        self._low_priority_until_ns = 0
        self._socket: Socket = context.socket(zmq.REP)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.bind(ZAP_ADDRESS)

    def note_failure(self) -> None:
        """Note a handshake that was refused or failed."""
        self._low_priority_until_ns = monotonic_ns() + LOW_PRIORITY_NS

    def answer(self) -> None:
        """Answer some of the waiting handshakes."""
        until_ns = self._low_priority_until_ns
        self._context.set_low_priority(until_ns > 0 and monotonic_ns() < until_ns)
        for _ in range(MAX_HANDSHAKES):
            if not readable(self._socket):
                return
            version, request, domain, address, _, _, *credentials = self._socket.recv_multipart(NOBLOCK)
            key = z85.encode(credentials[0]).decode()
            authenticator, channel = self.authenticators[domain.decode()]
            reason = authenticator.ring.channel_refusal(key, channel)
            if reason:
                authenticator.refuse(channel, address.decode(errors="replace"), key, reason)
                verdict = (b"400", reason.encode(), b"")
                self.note_failure()
            else:
                verdict = (b"200", b"OK", key.encode())
            self._socket.send_multipart((version, request, *verdict, b""), NOBLOCK)


class _HandshakeMonitor:
    """Monitors a socket for handshakes that failed before the key was checked; libzmq does not say whose they were."""

    def __init__(self, context: "Context", socket: Socket, channel: str, handler: _ZapHandler) -> None:
        self.channel, self.handler = channel, handler
        self._context = context
        self._socket = socket
        self._paused_until_ns = self._full_reads = 0
        self._monitor = self._open()

    def failures(self) -> Iterator[str]:
        """Yield the reasons of the failures since the last call."""
        if self._socket.closed:
            return
        if self._paused_until_ns:
            if monotonic_ns() < self._paused_until_ns:
                return
            self._paused_until_ns, self._monitor = 0, self._open()
        for _ in range(MAX_HANDSHAKES):
            if self._monitor.closed or not readable(self._monitor):
                self._full_reads = 0
                return
            event = parse_monitor_message(self._monitor.recv_multipart(NOBLOCK))
            if event["event"] == zmq.Event.HANDSHAKE_FAILED_NO_DETAIL:
                yield NO_KEY
            elif event["event"] == zmq.Event.HANDSHAKE_FAILED_PROTOCOL:
                yield FAILURES.get(event["value"], NO_HANDSHAKE)
        self._full_reads += 1
        if self._full_reads < MAX_FULL_READS:
            return
        self._full_reads = 0
        self._socket.monitor(None, 0)
        self._monitor.close()
        self._paused_until_ns = monotonic_ns() + MONITOR_PAUSE_NS
        yield "more handshakes fail here than can be reported; none is for 10 s"

    def _open(self) -> Socket:
        """Start the monitor. Its queue has no bound, because a full one would hold up libzmq's own thread."""
        address = f"inproc://monitor.{id(self)}.{monotonic_ns()}"
        self._socket.monitor(address, zmq.Event.HANDSHAKE_FAILED_PROTOCOL | zmq.Event.HANDSHAKE_FAILED_NO_DETAIL)
        monitor: Socket = self._context.socket(zmq.PAIR)
        monitor.setsockopt(zmq.LINGER, 0)
        monitor.setsockopt(zmq.RCVHWM, 0)
        monitor.connect(address)
        return monitor


NO_KEY = "it has no key, or closed the connection during the handshake"
"""A peer without a key may learn first that the server requires one, and hang up."""
FAILURES: dict[int, str] = {
    int(zmq.PROTOCOL_ERROR_ZMTP_MECHANISM_MISMATCH): NO_KEY,
    int(zmq.PROTOCOL_ERROR_ZMTP_CRYPTOGRAPHIC): "it has a wrong server key, or replayed a handshake",
}
NO_HANDSHAKE = "protocol error in the handshake"


class Context(zmq.Context["zmq.Socket[bytes]"]):
    """A ZeroMQ context with the ZAP handler, and a second context for channels that may wait.

    Its threads may have a real-time priority above that of the loop they serve, so that the loop's frames leave at
    once. A handshake takes such a thread up to a third of a tick. While handshakes are being refused, the threads run
    below the loop: no tick then waits for a handshake, and forces leave when the loop has finished its tick.
    """

    handler: _ZapHandler | None = None
    best_effort: "Context | None" = None
    threads: tuple[int, ...] = ()
    above = below = 0
    _is_low_priority = False

    def set_low_priority(self, wanted: bool) -> None:
        """Let the threads run below the loop they serve, or above it again."""
        if wanted == self._is_low_priority or not self.threads:
            return
        self._is_low_priority = wanted
        priority = self.below if wanted else self.above
        try:
            for thread in self.threads:
                scheduling.set_thread(thread, priority)
        except OSError as error:
            log.warning("ZeroMQ's thread keeps its priority (%s)", error.strerror)
            self.threads = ()
