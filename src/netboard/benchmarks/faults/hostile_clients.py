"""Clients that send malformed messages to every socket of a real server, and clients that do not speak ZeroMQ.

Some clients have joined the server, others have not. They send at a fixed rate below the server's rate limit, because
the test is about the content of the messages. Frames that have an effect when a joined client sends them (a command, an
acknowledgement, an emergency stop) are skipped.
"""

import random
import socket as net
import time
from collections import Counter
from collections.abc import Callable, Sequence

from netboard.base.errors import NetboardError
from netboard.base.tables.rig import Network
from netboard.benchmarks.faults import zmtp
from netboard.benchmarks.faults.malformed_frames import MalformedFrames, decode_or_none, valid_frames
from netboard.network.protocol.codec import encode
from netboard.network.protocol.control import Command
from netboard.network.protocol.joining import Goodbye, Hello
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.motion import Safeguard, Stylus
from netboard.network.protocol.records import EventRecord, LogAck, LogRequest
from netboard.network.transport import channels, sockets

RATE_HZ = 450.0
"""Rate of malformed messages per socket, below a peer's rate limit so that the server decodes all of them [Hz]."""

STREAMS_HZ = 20.0
"""Rate of connections per socket that do not speak ZeroMQ [Hz]."""

MAX_OPEN = 20
"""Number of these connections that are open at a time [1]."""

MESSAGES_PER_CONNECTION = 100
"""Number of messages after which a subscriber reconnects, which clears its subscriptions [1]."""

OVERSIZED_SHARE = 0.005
"""Share of oversized frames that are sent; the server closes the connection after each one [1]."""

MULTIPART_SHARE = 0.03
"""Share of multipart messages [1]."""

STUCK_SECONDS = 60.0
"""Time without progress after which a socket counts as stuck [s]."""

TURN_SECONDS = 0.004
NAME_PREFIX = "fuzz"
EFFECTIVE: tuple[type[Message], ...] = (Hello, Goodbye, Command, LogAck, LogRequest)
"""Message types that have an effect when a joined client sends them."""


class FuzzingClient:
    """Sends malformed messages to one channel; joins first if it has a greeting.

    - `sent`: number of messages sent [1].
    - `malformed`: number of messages sent that the server must refuse [1].
    """

    def __init__(self, channel: int, network: Network, hello: Hello | None, count: int, seed: int) -> None:
        self.channel = channels.CHANNELS[channel]
        self.count = count
        self.sent = self.malformed = 0
        self._joined = hello is not None
        self._rng = random.Random(seed)
        self._frames = MalformedFrames(valid_frames(seed), seed)
        name = f"{NAME_PREFIX}.{self.channel}.{hello.role + hello.side if hello else 'stranger'}"
        self._subscribes = channel in channels.VIEW.values()
        socket_type = b"SUB" if self._subscribes else b"DEALER"
        opening = [] if hello is None else [encode(hello)]
        self.connection = zmtp.Connection((network.host, network.port + channel), socket_type, name.encode(), opening)
        self._next = self._make()
        self._stuck_since = time.monotonic()

    def send_until(self, due: float) -> None:
        """Send until `due` messages are sent or the connection accepts no more."""
        while self.sent < min(due, self.count):
            if not self.connection.send(*self._next):
                if time.monotonic() - self._stuck_since > STUCK_SECONDS:
                    raise NetboardError(f"the {self.channel} socket has accepted no message for {STUCK_SECONDS:g} s")
                return
            self.sent += 1
            self.malformed += self._must_be_refused(self._next)
            self._stuck_since = time.monotonic()
            self._next = self._make()
            if self._subscribes and self.sent % MESSAGES_PER_CONNECTION == 0:
                self.connection.close()

    def send(self, message: Message) -> None:
        """Send a valid message."""
        self.connection.send(encode(message))

    def _make(self) -> list[bytes]:
        rng = self._rng
        if rng.random() < MULTIPART_SHARE:
            return [next(self._frames) for _ in range(rng.choice((2, 2, 3, 50)))]
        frame = next(self._frames)
        while self._is_skipped(frame):
            frame = next(self._frames)
        if self._subscribes:
            return [rng.choice((b"", b"\0", b"\1")) + frame]  # 1 subscribes, 0 unsubscribes
        return [frame]

    def _is_skipped(self, frame: bytes) -> bool:
        """Return whether to skip a frame: most oversized ones, and those that have an effect."""
        if len(frame) > sockets.MAX_REQUEST:
            return self._rng.random() > OVERSIZED_SHARE
        return self._joined and _has_effect(decode_or_none(frame))

    def _must_be_refused(self, parts: list[bytes]) -> bool:
        """Return whether the server must refuse a message: if the client has not joined, or the message is invalid."""
        return not self._joined or len(parts) > 1 or decode_or_none(parts[0]) is None


def _has_effect(message: Message | None) -> bool:
    """Return whether a message from a joined client has an effect."""
    stop = isinstance(message, Stylus) and bool(message.safeguards & Safeguard.STOPPED)
    return stop or isinstance(message, EFFECTIVE)


class NonZmqClient:
    """Connects to every socket of a server and sends bytes that violate ZeroMQ's protocol.

    - `count`: number of connections to each socket [1].
    - `sent`: number of connections made to all sockets [1].
    """

    def __init__(self, network: Network, count: int) -> None:
        self._addresses = [(network.host, network.port + channel) for channel in range(channels.CONTROL + 1)]
        self.count = count * len(self._addresses)
        self.sent = 0
        self._streams = zmtp.StreamSender(MAX_OPEN, seed=77)

    def send_until(self, due: float) -> None:
        """Open connections until `due` are made, and send the next part over those that are open."""
        while self.sent < min(due, self.count):
            address = self._addresses[self.sent % len(self._addresses)]
            self._streams.add(net.create_connection(address, zmtp.CONNECT_SECONDS))
            self.sent += 1
        self._streams.send_next()

    def close(self) -> None:
        """Close all connections."""
        self._streams.close()


def agent_clients(network: Network, count: int) -> list[FuzzingClient]:
    """Return clients that join as the two agents."""
    return [
        FuzzingClient(channels.MOTION, network, _hello("agent", side), count, seed)
        for seed, side in enumerate(("left", "right"), start=1)
    ]


def other_clients(network: Network, count: int) -> list[FuzzingClient]:
    """Return clients of all sockets of a server whose agents are connected; None stands for one that does not join."""
    greetings: dict[int, list[Hello | None]] = {
        channels.MOTION: [None],
        channels.LOG: [None, _hello("logger", "")],
        channels.CONTROL: [None, _hello("display", "right"), _hello("console", "")],
        channels.VIEW_LEFT: [None],
        channels.VIEW_RIGHT: [None],
    }
    return [
        FuzzingClient(channel, network, hello, count // len(hellos), 10 * channel + number)
        for channel, hellos in greetings.items()
        for number, hello in enumerate(hellos)
    ]


def _hello(role: str, side: str) -> Hello:
    return Hello(role, side, PROTOCOL_VERSION, NAME_PREFIX, "0", {})


def send_all(clients: Sequence[FuzzingClient], non_zmq: NonZmqClient | None, check: Callable[[float], object]) -> None:
    """Send the messages of all clients at their rates, and call `check` once a second with the share sent [1]."""
    rates = {client.channel: RATE_HZ / sum(a.channel == client.channel for a in clients) for client in clients}
    count = sum(client.count for client in clients)
    began = checked = time.monotonic()
    while any(client.sent < client.count for client in clients) or (non_zmq and non_zmq.sent < non_zmq.count):
        now = time.monotonic()
        for client in clients:
            client.send_until((now - began) * rates[client.channel])
        if non_zmq is not None:
            non_zmq.send_until((now - began) * STREAMS_HZ * (channels.CONTROL + 1))
        if now - checked > 1.0:
            checked = now
            check(sum(client.sent for client in clients) / count)
        time.sleep(TURN_SECONDS)


def refusals(events: Sequence[EventRecord]) -> Counter[str]:
    """Return the number of refusals by channel; the last event of a channel, peer and reason has their total."""
    totals: dict[tuple[str, str, str], int] = {}
    for event in events:
        if event.name == "refused":
            channel, peer, reason = (event.details.get(name, "") for name in ("channel", "peer", "reason"))
            totals[channel, peer, reason] = int(event.details["times"])
    counts: Counter[str] = Counter()
    for (channel, _, _), times in totals.items():
        counts[channel] += times
    return counts
