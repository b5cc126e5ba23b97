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
    """A clock with an offset and a rate error, which may be stepped or stopped once."""

    set_ns: int = 0
    ppm: float = 0.0
    sway_ppm: float = 0.0  # on top, as with the temperature of a room
    sway_ns: int = 60 * SECOND
    stepped_at_ns: int = 0
    step_ns: int = 0
    stopped_at_ns: int = 0
    stop_ns: int = 0

    def read(self, server_ns: int) -> int:
        """Reading at a server time [ns]."""
        passed = server_ns - BEGIN_NS
        phase = 2 * math.pi / self.sway_ns
        gained = self.ppm * passed + self.sway_ppm * (1 - math.cos(phase * passed)) / phase
        step = self.step_ns if server_ns >= self.stepped_at_ns else 0
        stopped_for = min(max(server_ns - self.stopped_at_ns, 0), self.stop_ns)
        return self.set_ns + server_ns + round(gained * 1e-6) + step - stopped_for

    def offset(self, server_ns: int) -> int:
        """Offset to the server's clock at a server time [ns]."""
        return self.read(server_ns) - server_ns


@dataclass(frozen=True)
class Route:
    """Delays both ways: a minimum, an exponential tail and rare spikes; some messages are lost."""

    there_ns: int
    back_ns: int
    tail_ns: int = 0
    spike: float = 0.0
    loss: float = 0.0

    def delays(self, rng: random.Random) -> tuple[int, int]:
        """Delays of one exchange: to the peer and back [ns]."""

        def tail() -> int:
            return int(rng.expovariate(1.0) * self.tail_ns) + (5 * MS if rng.random() < self.spike else 0)

        return self.there_ns + tail(), self.back_ns + tail()


@dataclass(frozen=True)
class Exchange:
    """One probe as the server records it, and the server times at which the peer received and sent."""

    stamps: tuple[int, int, int, int]
    received_ns: int
    sent_ns: int

    @property
    def done_ns(self) -> int:
        """Server time at which the reply arrived [ns]."""
        return self.stamps[3]


def motion(peer: PeerClock, route: Route, rng: random.Random, count: int) -> Iterator[Exchange]:
    """Probes of the motion channel: one sample each millisecond, with the newest stamp received."""
    forces: list[tuple[int, int]] = []
    for now in range(BEGIN_NS, BEGIN_NS + count * MS, MS):
        received = max(now + route.delays(rng)[0], forces[-1][0] if forces else 0)  # nothing overtakes
        if rng.random() >= route.loss:
            forces.append((received, now))
    newest, arrived = -1, 0
    for sent in range(BEGIN_NS + rng.randrange(MS), BEGIN_NS + count * MS, MS):
        while newest + 1 < len(forces) and forces[newest + 1][0] <= sent:
            newest += 1
        arrived = max(sent + route.delays(rng)[1], arrived)
        if newest >= 0 and rng.random() >= route.loss:
            received, t0 = forces[newest]
            yield Exchange((t0, peer.read(received), peer.read(sent), arrived), received, sent)


def scattered(peer: PeerClock, route: Route, rng: random.Random, count: int) -> Iterator[Exchange]:
    """Worse probes than on any channel: delayed at the peer, answered repeatedly, and reordered."""
    exchanges = []
    for now in range(BEGIN_NS, BEGIN_NS + count * MS, MS):
        there, back = route.delays(rng)
        received = now + there
        for _ in range(rng.choice((1, 1, 1, 2, 5))):
            sent = received + rng.randrange(10 * MS)
            if rng.random() >= route.loss:
                stamps = now, peer.read(received), peer.read(sent), sent + back
                exchanges.append(Exchange(stamps, received, sent))
    yield from sorted(exchanges, key=lambda exchange: exchange.done_ns)


def pings(
    peer: PeerClock, route: Route, rng: random.Random, seconds: float, silent: tuple[float, float] = (0.0, 0.0)
) -> Iterator[Exchange]:
    """Probes of the other channels: five per second, answered at once and in order, with one silence."""
    arrived = 0
    for number in range(int(seconds * 5)):
        if silent[0] <= number / 5 < silent[1]:
            continue
        now = BEGIN_NS + number * SECOND // 5
        there, back = route.delays(rng)
        received = now + there
        sent = received + rng.randrange(200_000)
        if rng.random() >= route.loss:
            arrived = max(sent + back, arrived)
            yield Exchange((now, peer.read(received), peer.read(sent), arrived), received, sent)
