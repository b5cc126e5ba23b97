"""Malformed messages for every socket of a real server, from strangers and from peers it has welcomed; and no ZeroMQ.

They come at a steady rate, not as fast as they go: what is tried here is what is in them. What a welcomed peer may say
with effect (a command, an acknowledgement, an emergency stop) is not malformed, and is left out.
"""

import random
import socket as net
import time
from collections.abc import Callable, Sequence

from netboard.base.errors import NetboardError
from netboard.base.tables.rig import Network
from netboard.benchmarks.faults import zmtp
from netboard.benchmarks.faults.mutants import Mutants, parse, true_frames
from netboard.network.protocol.codec import encode
from netboard.network.protocol.control import Command
from netboard.network.protocol.joining import Goodbye, Hello
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.motion import Safeguard, Stylus
from netboard.network.protocol.records import EventRecord, LogAck, LogRequest
from netboard.network.transport import channels, sockets

RATE_HZ = 450.0
"""Malformed messages per socket, below the rate limit of a peer so that the server examines them all [Hz]."""

STREAMS_HZ = 20.0
"""Connections per socket that do not speak ZeroMQ [Hz]."""

KEPT_OPEN = 20
"""Such connections that are open at a time [1]."""

RENEWED = 100
"""Messages after which a subscriber's connection is renewed, which clears its subscriptions [1]."""

TOO_LARGE = 0.005
"""Share of messages that exceed a socket's size limit; each of them loses the messages in transit with it [1]."""

SEVERAL = 0.03
"""Share of messages in more than one part [1]."""

STUCK_SECONDS = 60.0
"""Time without progress after which a socket counts as stuck [s]."""

TURN_SECONDS = 0.004
PREFIX = "fuzz"
MEANT: tuple[type[Message], ...] = (Hello, Goodbye, Command, LogAck, LogRequest)
"""Message types that have an effect when a welcomed peer sends them."""

Tell = Callable[[float], object]


class Assault:
    """One sender of malformed messages.

    - `sent`, `malformed`: how many it has sent, and how many of them cannot but be refused [1].
    """

    def __init__(self, channel: int, network: Network, hello: Hello | None, count: int, seed: int) -> None:
        self.channel = channels.CHANNELS[channel]
        self.count = count
        self.sent = self.malformed = 0
        self._welcomed = hello is not None
        self._chance = random.Random(seed)
        self._mutants = Mutants(true_frames(seed), seed)
        name = f"{PREFIX}.{self.channel}.{hello.role + hello.side if hello else 'stranger'}"
        self._subscribes = channel in channels.VIEW.values()
        kind = b"SUB" if self._subscribes else b"DEALER"
        first = [] if hello is None else [encode(hello)]
        self.line = zmtp.Line((network.host, network.port + channel), kind, name.encode(), first)
        self._next = self._make()
        self._stuck_since = time.monotonic()

    def fire(self, due: float) -> None:
        """Send until the due number is reached or the link takes no more."""
        while self.sent < min(due, self.count):
            if not self.line.offer(*self._next):
                if time.monotonic() - self._stuck_since > STUCK_SECONDS:
                    raise NetboardError(f"the {self.channel} socket takes nothing any more")
                return
            self.sent += 1
            self.malformed += self._is_malformed(self._next)
            self._stuck_since = time.monotonic()
            self._next = self._make()
            if self._subscribes and self.sent % RENEWED == 0:
                self.line.close()

    def say(self, message: Message) -> None:
        """Send a valid message that is meant."""
        self.line.offer(encode(message))

    def _make(self) -> list[bytes]:
        chance = self._chance
        if chance.random() < SEVERAL:
            return [next(self._mutants) for _ in range(chance.choice((2, 2, 3, 50)))]
        frame = next(self._mutants)
        while self._is_left_out(frame):
            frame = next(self._mutants)
        if self._subscribes:
            return [chance.choice((b"", b"\0", b"\1")) + frame]  # which subscribes and unsubscribes
        return [frame]

    def _is_left_out(self, frame: bytes) -> bool:
        """Return whether to skip a frame, because it has an effect or would cut the connection too often."""
        if len(frame) > sockets.LARGEST_REQUEST:
            return self._chance.random() > TOO_LARGE
        return self._welcomed and _is_meant(parse(frame))

    def _is_malformed(self, parts: list[bytes]) -> bool:
        """Return whether the server must refuse a message: any from a stranger, undecodable ones from other peers."""
        return not self._welcomed or len(parts) > 1 or parse(parts[0]) is None


def _is_meant(message: Message | None) -> bool:
    """Return whether a message from a welcomed peer has an effect."""
    return isinstance(message, MEANT) or (isinstance(message, Stylus) and bool(message.safeguards & Safeguard.STOPPED))


class Vandal:
    """Opens connections to some sockets and does not speak ZeroMQ in them."""

    def __init__(self, places: Sequence[zmtp.Place], count: int, seed: int) -> None:
        self.count = count
        self.sent = 0
        self._places = places
        self._talk = zmtp.Talk(KEPT_OPEN, seed)

    def fire(self, due: float) -> None:
        """Open connections until the due number is reached, and continue those that are open."""
        while self.sent < min(due, self.count):
            place = self._places[self.sent % len(self._places)]
            self._talk.take(net.create_connection(place, zmtp.CONNECT_SECONDS))
            self.sent += 1
        self._talk.turn()

    def close(self) -> None:
        """Close all connections."""
        self._talk.close()


def as_agents(network: Network, count: int) -> list[Assault]:
    """Return senders that take the place of both agents."""
    return [
        Assault(channels.MOTION, network, _hello("agent", side), count, seed)
        for seed, side in enumerate(("left", "right"), start=1)
    ]


def as_others(network: Network, count: int) -> list[Assault]:
    """Return senders to all sockets of a server whose agents are connected."""
    of: dict[int, list[Hello | None]] = {
        channels.MOTION: [None],
        channels.LOG: [None, _hello("logger", "")],
        channels.CONTROL: [None, _hello("display", "right"), _hello("console", "")],
        channels.VIEW_LEFT: [None],
        channels.VIEW_RIGHT: [None],
    }
    return [
        Assault(channel, network, hello, count // len(hellos), 10 * channel + place)
        for channel, hellos in of.items()
        for place, hello in enumerate(hellos)
    ]


def vandal(network: Network, count: int) -> Vandal:
    """Return a sender that connects to every socket and does not speak ZeroMQ."""
    places = [(network.host, network.port + channel) for channel in range(channels.CONTROL + 1)]
    return Vandal(places, count * len(places), 77)


def _hello(role: str, side: str) -> Hello:
    return Hello(role, side, PROTOCOL_VERSION, PREFIX, "0", {})


def fire(assaults: Sequence[Assault], vandal: Vandal | None, look: Callable[[], object], tell: Tell) -> None:
    """Run all senders to completion at their rates."""
    rates = {assault.channel: RATE_HZ / sum(a.channel == assault.channel for a in assaults) for assault in assaults}
    whole = sum(assault.count for assault in assaults)
    began = looked = time.monotonic()
    while any(assault.sent < assault.count for assault in assaults) or (vandal and vandal.sent < vandal.count):
        now = time.monotonic()
        for assault in assaults:
            assault.fire((now - began) * rates[assault.channel])
        if vandal is not None:
            vandal.fire((now - began) * STREAMS_HZ * (channels.CONTROL + 1))
        if now - looked > 1.0:
            looked = now
            look()
            tell(sum(assault.sent for assault in assaults) / whole)
        time.sleep(TURN_SECONDS)


def refused(events: Sequence[EventRecord]) -> dict[str, int]:
    """Count refusals by channel from the server's events; the last report of each kind has the total."""
    kinds: dict[tuple[str, str, str], int] = {}
    for event in events:
        if event.name == "refused":
            channel, peer, reason = (event.details.get(name, "") for name in ("channel", "peer", "reason"))
            kinds[channel, peer, reason] = int(event.details["times"])
    found: dict[str, int] = {}
    for (channel, _, _), times in kinds.items():
        found[channel] = found.get(channel, 0) + times
    return found
