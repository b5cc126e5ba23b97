"""The clock estimate against simulated clocks and links of which the truth is known."""

import random
from dataclasses import dataclass

from hypothesis import given, settings
from hypothesis import strategies as st

from netboard.wire.session import NEVER_NS, ClockEstimator

MS = 1_000_000
SECOND = 1000 * MS
ROUNDING_NS = 2  # stamps are whole nanoseconds


@dataclass(frozen=True)
class Peer:
    """A clock that was set somehow and runs a little fast or slow."""

    set_ns: int
    ppm: float

    def clock(self, server_ns: int) -> int:
        """What it reads at a server time."""
        return self.set_ns + server_ns + round(server_ns * self.ppm * 1e-6)


@dataclass(frozen=True)
class Route:
    """Delays both ways: a least one each, an exponential tail, and now and then a spike."""

    there_ns: int
    back_ns: int
    tail_ns: int
    spike: float

    def delays(self, chance: random.Random) -> tuple[int, int]:
        """Delay there and back of one exchange."""

        def tail() -> int:
            return int(chance.expovariate(1.0) * self.tail_ns) + (5 * MS if chance.random() < self.spike else 0)

        return self.there_ns + tail(), self.back_ns + tail()


peers = st.builds(Peer, st.integers(-(10**15), 10**15), st.floats(-100, 100))
delays = st.integers(1000, 2 * MS)  # so that 10 ms of holding at 100 ppm cannot make a round trip negative
routes = st.builds(Route, delays, delays, st.integers(0, MS), st.floats(0, 0.2))


def exchanges(
    peer: Peer, route: Route, chance: random.Random, count: int, begin_ns: int = 10**12
) -> list[tuple[int, int, int, int]]:
    """Probes as the motion channel gives them: a server stamp may be answered several times."""
    probes = []
    now = begin_ns
    arrived = 0
    for _ in range(count):
        there, back = route.delays(chance)
        received = now + there
        for _ in range(chance.choice((1, 1, 1, 2, 5))):
            sent = received + chance.randrange(10 * MS)
            arrived = max(sent + back, arrived)  # one connection: nothing overtakes
            probes.append((now, peer.clock(received), peer.clock(sent), arrived))
        now += MS
    return sorted(probes, key=lambda probe: probe[3])


def test_before_the_first_probe_nothing_is_known() -> None:
    clock = ClockEstimator()
    assert not clock.known
    assert (clock.offset_ns, clock.bound_ns) == (0, NEVER_NS)
    assert clock.to_server(123) == 123


def test_a_symmetric_link_gives_the_exact_offset() -> None:
    clock = ClockEstimator()
    assert clock.add(1000, 5300, 5400, 1700)  # 300 there, 100 held, 300 back, offset 4000
    assert clock.known
    assert clock.offset_ns == 4000
    assert clock.bound_ns == 301 + 1  # half of 600, 700 ns of ageing at 100 ppm rounded up, 1 for rounding
    assert clock.to_server(5300) == 1300


def test_the_same_clock_reads_nearly_zero() -> None:
    chance = random.Random(1)
    clock = ClockEstimator()
    for probe in exchanges(Peer(0, 0.0), Route(40_000, 40_000, 20_000, 0.01), chance, 2000):
        clock.add(*probe)
    assert abs(clock.offset_ns) < 20_000
    assert clock.bound_ns < 100_000


@settings(max_examples=150, deadline=None)
@given(peers, routes, st.integers(0, 2**32))
def test_the_truth_is_within_the_bound(peer: Peer, route: Route, seed: int) -> None:
    clock = ClockEstimator(window_ns=50 * MS)
    for probe in exchanges(peer, route, random.Random(seed), 60):
        assert clock.add(*probe)
        now = probe[3]
        truth = peer.clock(now) - now
        assert abs(clock.offset_ns - truth) <= clock.bound_ns + ROUNDING_NS
        assert abs(clock.to_server(peer.clock(now)) - now) <= clock.bound_ns + ROUNDING_NS
    assert clock.restarts == clock.rejected == 0


@settings(max_examples=60, deadline=None)
@given(peers, routes, st.integers(0, 2**32))
def test_the_best_probe_of_the_window_is_used(peer: Peer, route: Route, seed: int) -> None:
    """Against a search through all of them."""
    window, ppm = 20 * MS, 100
    clock = ClockEstimator(window, ppm)
    heard: list[tuple[int, int, int, int]] = []
    for probe in sorted(exchanges(peer, route, random.Random(seed), 60), key=lambda p: (p[0], p[3])):
        clock.add(*probe)
        heard.append(probe)
        now = probe[3]
        recent = [p for p in heard if p[0] >= now - window] or [probe]
        best = min(((t1 - t0) + (t3 - t2)) / 2 + (now - t0) * ppm * 1e-6 for t0, t1, t2, t3 in recent)
        assert best <= clock.bound_ns + ROUNDING_NS
        assert clock.bound_ns <= best + ROUNDING_NS + 1


def test_asymmetry_is_inside_the_bound_and_no_better_than_it() -> None:
    clock = ClockEstimator()
    for probe in exchanges(Peer(0, 0.0), Route(1 * MS, 0, 0, 0.0), random.Random(2), 100):
        clock.add(*probe)
    assert clock.offset_ns == MS // 2  # all the delay was on the way there: half of it looks like offset
    assert clock.offset_ns <= clock.bound_ns <= clock.offset_ns * 1.01


def test_drift_is_followed() -> None:
    peer, route = Peer(7 * SECOND, 80.0), Route(100_000, 100_000, 50_000, 0.01)
    clock = ClockEstimator()
    errors = []
    for probe in exchanges(peer, route, random.Random(3), 10_000):
        clock.add(*probe)
        errors.append(abs(clock.offset_ns - (peer.clock(probe[3]) - probe[3])))
    assert max(errors[1000:]) < 150_000
    assert clock.restarts == 0


def test_a_step_of_the_clock_starts_the_estimate_anew() -> None:
    clock = ClockEstimator()
    clock.add(0, 5 * MS, 5 * MS, 100_000)
    clock.add(MS, 6 * MS, 6 * MS, MS + 300_000)
    assert (clock.offset_ns, clock.restarts) == (5 * MS - 50_000, 0)
    clock.add(2 * MS, 8 * MS, 8 * MS, 2 * MS + 900_000)  # worse than both, but 1 ms away
    assert (clock.offset_ns, clock.restarts) == (6 * MS - 450_000, 1)


def test_impossible_exchanges_are_rejected() -> None:
    clock = ClockEstimator()
    assert not clock.add(1000, 5000, 6000, 1500)  # held for 1000, back after 500: a negative round trip
    assert not clock.add(1000, 5000, 4900, 1500)  # answered before it was asked
    assert not clock.add(1000, 5000, 4000, 900)  # back before it was sent
    assert (clock.known, clock.rejected, clock.accepted) == (False, 3, 0)


@given(st.lists(st.tuples(*[st.integers(-(2**63), 2**63 - 1)] * 4), max_size=20))
def test_no_stamps_break_it(probes: list[tuple[int, int, int, int]]) -> None:
    clock = ClockEstimator()
    for probe in probes:
        clock.add(*probe)
    assert clock.accepted + clock.rejected == len(probes)
    assert clock.known == (clock.accepted > 0)
    assert isinstance(clock.offset_ns, int)
