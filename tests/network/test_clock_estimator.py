"""The clock estimate of one honest peer: offset, bound, round trip and drift."""

import math
import random

from hypothesis import given, settings
from hypothesis import strategies as st
from wire_clocks import MS, SECOND, PeerClock, Route, motion, pings, scattered

from netboard.network.protocol.clock_estimator import UNKNOWN_NS, ClockEstimator

ROUNDING_NS = 2  # stamps are whole nanoseconds
SAME_HOST = Route(40_000, 40_000, 20_000, 0.01)
LAN = Route(120_000, 150_000, 100_000, 0.02)

peers = st.builds(PeerClock, st.integers(-(10**15), 10**15), st.floats(-100, 100))
routes = st.builds(Route, st.integers(1000, 20 * MS), st.integers(1000, 20 * MS), st.integers(0, MS), st.floats(0, 0.2))


def test_estimate_is_unknown_before_the_first_probe() -> None:
    clock = ClockEstimator()
    assert not clock.known
    assert (clock.offset_ns, clock.bound_ns, clock.round_trip_ns) == (0, UNKNOWN_NS, UNKNOWN_NS)
    assert math.isnan(clock.drift_ppm)
    assert clock.drift_bound_ppm == math.inf


def test_symmetric_link_gives_the_exact_offset() -> None:
    clock = ClockEstimator()
    assert clock.add(1000, 5300, 5400, 1700)  # 300 there, 100 held, 300 back, offset 4000
    assert clock.known
    assert clock.offset_ns == 4000
    assert clock.round_trip_ns == 600
    assert clock.bound_ns == 300 + 2  # half of 600, and 2 for the ageing of t0 and the rounding


def test_bound_grows_with_the_age_of_the_probe() -> None:
    clock = ClockEstimator()
    clock.add(0, 300, 300, 600)
    before = clock.bound_ns
    clock.add(SECOND, SECOND + MS, SECOND + MS, SECOND + 2 * MS)  # a worse one, a second later
    assert clock.offset_ns == 0
    assert abs(clock.bound_ns - before - 100_200) <= 1  # 100 parts per million of 1.002 s
    assert clock.round_trip_ns == 600
    clock.add(5 * SECOND, 5 * SECOND + MS, 5 * SECOND + MS, 5 * SECOND + 2 * MS)  # when the first has expired
    assert clock.round_trip_ns == 2 * MS
    assert abs(clock.bound_ns - MS - 100) <= 2


def test_upper_and_lower_limits_may_come_from_different_probes() -> None:
    clock = ClockEstimator()
    clock.add(0, 100, 100, 5100)  # fast there, slow back
    clock.add(10_000, 15_000, 15_000, 15_100)  # slow there, fast back
    assert clock.offset_ns == 0
    assert clock.bound_ns <= 100 + 4
    assert clock.round_trip_ns == 5100


def test_offset_is_near_zero_on_the_same_host() -> None:
    clock = ClockEstimator()
    for exchange in motion(PeerClock(), SAME_HOST, random.Random(1), 2000):
        clock.add(*exchange.stamps)
    assert abs(clock.offset_ns) < 10_000
    assert clock.bound_ns < 60_000


@settings(max_examples=60, deadline=None)
@given(peers, routes, st.integers(0, 2**32))
def test_bound_uses_the_tightest_limits_in_the_window(peer: PeerClock, route: Route, seed: int) -> None:
    """Compared with searches of the window, and of the three quarters of it that are always kept."""
    window, skew = 20 * MS, 100e-6
    clock = ClockEstimator(window)
    exchanged: list[tuple[int, int, int, int]] = []
    for exchange in scattered(peer, route, random.Random(seed), 60):
        clock.add(*exchange.stamps)
        exchanged.append(exchange.stamps)
        now = exchange.done_ns

        def searched(age: int) -> float:
            recent = [stamps for stamps in exchanged if stamps[3] >= now - age]  # noqa: B023
            upper = min(t1 - t0 + skew * (now - t0) for t0, t1, _, _ in recent)  # noqa: B023
            lower = max(t2 - t3 - skew * (now - t3) for _, _, t2, t3 in recent)  # noqa: B023
            return (upper - lower) / 2

        assert searched(window) - ROUNDING_NS <= clock.bound_ns <= searched(window * 3 // 4) + ROUNDING_NS + 2


def test_bound_covers_a_fully_asymmetric_delay_and_is_tight() -> None:
    clock = ClockEstimator()
    for exchange in motion(PeerClock(), Route(1 * MS, 0), random.Random(2), 100):
        clock.add(*exchange.stamps)
    assert abs(clock.offset_ns - MS // 2) < 1000  # all the delay was on the way there: half of it looks like offset
    assert clock.offset_ns <= clock.bound_ns <= clock.offset_ns * 1.01


def test_five_probes_per_second_keep_the_bound_below_400_us() -> None:
    peer = PeerClock(7 * SECOND, 60.0)
    for window in (2 * SECOND, 8 * SECOND):
        clock = ClockEstimator(window)
        bounds = []
        for exchange in pings(peer, LAN, random.Random(5), 120):
            clock.add(*exchange.stamps)
            bounds.append(clock.bound_ns)
            assert abs(clock.offset_ns - peer.offset(exchange.done_ns)) <= clock.bound_ns + ROUNDING_NS
        assert max(bounds[25:]) < 400_000
        assert sorted(bounds)[len(bounds) // 2] < 250_000  # half the shortest round trip is 135 us


def test_offset_follows_the_drift() -> None:
    peer = PeerClock(7 * SECOND, 80.0)
    clock = ClockEstimator()
    errors = []
    for exchange in motion(peer, Route(100_000, 100_000, 50_000, 0.01), random.Random(3), 10_000):
        clock.add(*exchange.stamps)
        errors.append(abs(clock.offset_ns - peer.offset(exchange.done_ns)))
    assert max(errors[1000:]) < 100_000
    assert clock.restarts == 0


@settings(max_examples=15, deadline=None)
@given(peers, st.integers(0, 2**32))
def test_true_drift_lies_within_its_bound_and_the_bound_converges(peer: PeerClock, seed: int) -> None:
    clock = ClockEstimator(8 * SECOND)
    for exchange in pings(peer, LAN, random.Random(seed), 150):
        clock.add(*exchange.stamps)
        if not math.isnan(clock.drift_ppm):
            assert clock.drift_bound_ppm <= 10
            assert abs(clock.drift_ppm - peer.ppm) <= clock.drift_bound_ppm
    assert abs(clock.drift_ppm - peer.ppm) < 3
    assert clock.drift_bound_ppm < 5


def test_varying_rate_gives_the_mean_drift_of_recent_minutes() -> None:
    warming = PeerClock(0, 20.0, sway_ppm=30.0, sway_ns=1800 * SECOND)
    clock = ClockEstimator()
    drifts = []
    for exchange in pings(warming, LAN, random.Random(6), 1800):
        clock.add(*exchange.stamps)
        drifts.append(clock.drift_ppm)
        assert abs(clock.offset_ns - warming.offset(exchange.done_ns)) <= clock.bound_ns + ROUNDING_NS
    known = [drift for drift in drifts if not math.isnan(drift)]
    assert len(known) > 8000
    assert 45 < max(known) < 50
    assert -10 < min(known) < -5
    assert clock.restarts == 0


def test_drift_is_nan_while_its_bound_is_too_wide() -> None:
    clock = ClockEstimator()
    for exchange in pings(PeerClock(ppm=30.0), Route(20 * MS, 20 * MS, 5 * MS), random.Random(7), 300):
        clock.add(*exchange.stamps)
    assert math.isnan(clock.drift_ppm)
    assert 10 < clock.drift_bound_ppm < 1000


def test_impossible_exchanges_are_rejected() -> None:
    clock = ClockEstimator()
    assert not clock.add(1000, 5000, 6000, 1500)  # held for 1000, back after 500: a negative round trip
    assert not clock.add(1000, 5000, 4900, 1500)  # answered before it was asked
    assert not clock.add(1000, 5000, 4000, 900)  # back before it was sent
    assert not clock.add(1000, 2**62, 2**62, 1500)  # a clock of another age
    assert (clock.known, clock.rejected, clock.accepted) == (False, 4, 0)


@given(st.lists(st.tuples(*[st.integers(-(2**63), 2**63 - 1)] * 4), max_size=20))
def test_estimate_stays_in_range_for_arbitrary_stamps(probes: list[tuple[int, int, int, int]]) -> None:
    clock = ClockEstimator()
    for probe in probes:
        clock.add(*probe)
        assert -(2**63) <= clock.offset_ns < 2**63
        assert 0 <= clock.bound_ns < 2**63
        assert isinstance(clock.offset_ns, int)
    assert clock.accepted + clock.rejected == len(probes)
    assert clock.known == (clock.accepted > 0)
