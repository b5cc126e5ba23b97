"""Simulated clocks and links with known offsets, for the tests of the clock estimate."""

import math
import random
from collections.abc import Iterator
from dataclasses import dataclass

MS = 1_000_000
SECOND = 1000 * MS
BEGIN_NS = 10**12
"""Server time at which every simulation begins [ns]."""


@dataclass(frozen=True)
class PeerClock:
    """A clock that was set somehow, runs a little fast or slow, and may be stepped or stopped once."""

    set_ns: int = 0
    ppm: float = 0.0
    sway_ppm: float = 0.0  # on top, as with the temperature of a room
    sway_ns: int = 60 * SECOND
    stepped_at_ns: int = 0
    step_ns: int = 0
    stopped_at_ns: int = 0
    stop_ns: int = 0

    def read(self, server_ns: int) -> int:
        """What it shows at a server time."""
        passed = server_ns - BEGIN_NS
        phase = 2 * math.pi / self.sway_ns
        gained = self.ppm * passed + self.sway_ppm * (1 - math.cos(phase * passed)) / phase
        step = self.step_ns if server_ns >= self.stepped_at_ns else 0
        stood_still = min(max(server_ns - self.stopped_at_ns, 0), self.stop_ns)
        return self.set_ns + server_ns + round(gained * 1e-6) + step - stood_still

    def offset(self, server_ns: int) -> int:
        """How far it is ahead of the server's then."""
        return self.read(server_ns) - server_ns


@dataclass(frozen=True)
class Route:
    """Delays both ways: a least one each, an exponential tail, now and then a spike; and messages that never come."""

    there_ns: int
    back_ns: int
    tail_ns: int = 0
    spike: float = 0.0
    loss: float = 0.0

    def delays(self, chance: random.Random) -> tuple[int, int]:
        """Delay there and back of one exchange."""

        def tail() -> int:
            return int(chance.expovariate(1.0) * self.tail_ns) + (5 * MS if chance.random() < self.spike else 0)

        return self.there_ns + tail(), self.back_ns + tail()


@dataclass(frozen=True)
class Exchange:
    """One probe as the server has it, and the server times of what happened at the peer."""

    stamps: tuple[int, int, int, int]
    received_ns: int
    sent_ns: int

    @property
    def done_ns(self) -> int:
        """When the answer came in."""
        return self.stamps[3]


def motion(peer: PeerClock, route: Route, chance: random.Random, count: int) -> Iterator[Exchange]:
    """Probes as the motion channel gives them: a sample each millisecond, with the newest stamp that has come."""
    forces: list[tuple[int, int]] = []
    for now in range(BEGIN_NS, BEGIN_NS + count * MS, MS):
        received = max(now + route.delays(chance)[0], forces[-1][0] if forces else 0)  # nothing overtakes
        if chance.random() >= route.loss:
            forces.append((received, now))
    newest, arrived = -1, 0
    for sent in range(BEGIN_NS + chance.randrange(MS), BEGIN_NS + count * MS, MS):
        while newest + 1 < len(forces) and forces[newest + 1][0] <= sent:
            newest += 1
        arrived = max(sent + route.delays(chance)[1], arrived)
        if newest >= 0 and chance.random() >= route.loss:
            received, t0 = forces[newest]
            yield Exchange((t0, peer.read(received), peer.read(sent), arrived), received, sent)


def scattered(peer: PeerClock, route: Route, chance: random.Random, count: int) -> Iterator[Exchange]:
    """Worse probes than any channel gives: held for any time, answered several times, and overtaking each other."""
    exchanges = []
    for now in range(BEGIN_NS, BEGIN_NS + count * MS, MS):
        there, back = route.delays(chance)
        received = now + there
        for _ in range(chance.choice((1, 1, 1, 2, 5))):
            sent = received + chance.randrange(10 * MS)
            if chance.random() >= route.loss:
                stamps = now, peer.read(received), peer.read(sent), sent + back
                exchanges.append(Exchange(stamps, received, sent))
    yield from sorted(exchanges, key=lambda exchange: exchange.done_ns)


def pings(
    peer: PeerClock, route: Route, chance: random.Random, seconds: float, silent: tuple[float, float] = (0.0, 0.0)
) -> Iterator[Exchange]:
    """Probes as the other channels give them: five a second, answered at once, in order; with one silence."""
    arrived = 0
    for number in range(int(seconds * 5)):
        if silent[0] <= number / 5 < silent[1]:
            continue
        now = BEGIN_NS + number * SECOND // 5
        there, back = route.delays(chance)
        received = now + there
        sent = received + chance.randrange(200_000)
        if chance.random() >= route.loss:
            arrived = max(sent + back, arrived)
            yield Exchange((now, peer.read(received), peer.read(sent), arrived), received, sent)
