"""Faults of clocks and links: the true offset stays within the bound."""

import math
import random
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wire_clocks import BEGIN_NS, MS, SECOND, Exchange, PeerClock, Route, motion, pings, scattered

from netboard.network.protocol.clock_estimator import ClockEstimator

Probes = Callable[[PeerClock, Route, random.Random, int], Iterator[Exchange]]

ROUNDING_NS = 2  # stamps are whole nanoseconds
LAN = Route(120_000, 150_000, 100_000, 0.02)

peers = st.builds(
    PeerClock,
    set_ns=st.integers(-(10**15), 10**15),
    ppm=st.floats(-50, 50),
    sway_ppm=st.floats(-50, 50),
    sway_ns=st.integers(SECOND // 10, 600 * SECOND),
)
least = st.integers(1000, 20 * MS)
routes = st.builds(Route, least, least, st.integers(0, 2 * MS), st.floats(0, 0.2), st.floats(0, 0.9))
seeds = st.integers(0, 2**32)
windows = st.sampled_from((20 * MS, 50 * MS, 2 * SECOND))
channels = st.sampled_from((motion, scattered))


def excess(clock: ClockEstimator, peer: PeerClock, now_ns: int) -> int:
    """Amount by which the error exceeds the bound."""
    return abs(clock.offset_ns - peer.offset(now_ns)) - clock.bound_ns - ROUNDING_NS


@settings(max_examples=150, deadline=None)
@given(peers, routes, seeds, windows, channels)
def test_bound_holds_under_skew_jitter_loss_asymmetry_and_late_replies(
    peer: PeerClock, route: Route, seed: int, window: int, probes: Probes
) -> None:
    clock = ClockEstimator(window)
    for exchange in probes(peer, route, random.Random(seed), 60):
        assert clock.add(*exchange.stamps)
        assert excess(clock, peer, exchange.done_ns) <= 0
        assert clock.round_trip_ns >= route.there_ns + route.back_ns - 2 * ROUNDING_NS - MS // 500
    assert clock.restarts == clock.rejected == 0


@settings(max_examples=40, deadline=None)
@given(peers, routes, seeds)
def test_bound_holds_with_sparse_probes_and_a_silence(peer: PeerClock, route: Route, seed: int) -> None:
    clock = ClockEstimator(8 * SECOND)
    for exchange in pings(peer, route, random.Random(seed), 60, silent=(20, 40)):
        assert clock.add(*exchange.stamps)
        assert excess(clock, peer, exchange.done_ns) <= 0
    assert clock.restarts == 0


@settings(max_examples=100, deadline=None)
@given(peers, routes, seeds, st.integers(0, 60 * MS), st.integers(150 * MS, 10**13), st.sampled_from((-1, 1)))
def test_clock_step_larger_than_the_delay_is_detected_by_the_first_probe(
    peer: PeerClock, route: Route, seed: int, after: int, size: int, sign: int
) -> None:
    peer = replace(peer, stepped_at_ns=BEGIN_NS + after, step_ns=sign * size)
    clock = ClockEstimator()
    probed_before = probed_after = False
    for exchange in motion(peer, replace(route, tail_ns=0), random.Random(seed), 60):
        clock.add(*exchange.stamps)
        before, after_it = exchange.done_ns < peer.stepped_at_ns, exchange.received_ns >= peer.stepped_at_ns
        probed_before, probed_after = probed_before or before, probed_after or after_it
        if before or after_it:
            assert excess(clock, peer, exchange.done_ns) <= 0
    assert clock.restarts == 1 or not (probed_before and probed_after)


@settings(max_examples=100, deadline=None)
@given(peers, routes, seeds, st.integers(0, 100 * MS), st.integers(-60 * MS, 60 * MS))
def test_undetectable_step_adds_at_most_the_delay_for_at_most_one_window(
    peer: PeerClock, route: Route, seed: int, after: int, size: int
) -> None:
    peer = replace(peer, stepped_at_ns=BEGIN_NS + after, step_ns=size)
    window = 20 * MS
    clock = ClockEstimator(window)
    shortest = math.inf
    straddled_ns = BEGIN_NS
    for exchange in motion(peer, route, random.Random(seed), 150):
        clock.add(*exchange.stamps)
        if exchange.received_ns < peer.stepped_at_ns:
            straddled_ns = exchange.done_ns
            continue
        t0, _, _, t3 = exchange.stamps
        shortest = min(shortest, t3 - exchange.sent_ns if size > 0 else exchange.received_ns - t0)
        assert excess(clock, peer, t3) <= shortest * 1.001 + ROUNDING_NS
        if t3 - straddled_ns > window * 9 // 8:
            assert excess(clock, peer, t3) <= 0


@pytest.mark.slow
@pytest.mark.parametrize("probing", ["often", "sparse"])
def test_clock_stopped_during_a_silence_is_detected(probing: str) -> None:
    """As on a suspended machine, which sends nothing meanwhile."""
    near = Route(40_000, 40_000, 20_000, 0.01)
    peer = PeerClock(3 * SECOND, 15.0, stopped_at_ns=BEGIN_NS + 20 * SECOND, stop_ns=9 * SECOND)
    rng = random.Random(4)
    exchanges = motion(peer, near, rng, 60_000) if probing == "often" else pings(peer, LAN, rng, 90)
    clock = ClockEstimator()
    drifts = []
    for exchange in exchanges:
        if peer.stopped_at_ns <= exchange.done_ns <= peer.stopped_at_ns + peer.stop_ns + SECOND // 10:
            continue
        clock.add(*exchange.stamps)
        drifts.append(clock.drift_ppm)
        assert excess(clock, peer, exchange.done_ns) <= 0
    assert clock.restarts == 1
    assert abs(drifts[-1] - 15) < 10
    assert all(math.isnan(drift) or abs(drift - 15) < 10 for drift in drifts)


def test_backward_jump_rejects_one_probe_then_restarts_the_estimate() -> None:
    clock = ClockEstimator()
    clock.add(0, 50 * MS, 50 * MS, 200_000)
    assert not clock.add(MS, 51 * MS, 31 * MS, MS + 200_000)  # between receiving and sending
    assert clock.add(2 * MS, 32 * MS, 32 * MS, 2 * MS + 200_000)
    assert (clock.restarts, clock.rejected) == (1, 1)
    assert abs(clock.offset_ns - 30 * MS + 100_000) < 100


def test_step_restarts_the_estimate() -> None:
    clock = ClockEstimator()
    clock.add(0, 5 * MS, 5 * MS, 100_000)
    clock.add(MS, 6 * MS, 6 * MS, MS + 300_000)
    assert clock.restarts == 0
    assert abs(clock.offset_ns - 5 * MS + 50_000) < 100
    clock.add(2 * MS, 8 * MS, 8 * MS, 2 * MS + 900_000)  # worse than both, but 1 ms away
    assert clock.restarts == 1
    assert abs(clock.offset_ns - 6 * MS + 450_000) < 100


def test_step_makes_the_drift_unknown_again() -> None:
    peer = PeerClock(0, 25.0, stepped_at_ns=BEGIN_NS + 60 * SECOND, step_ns=-40 * MS)
    clock = ClockEstimator()
    drifts = {}
    for exchange in pings(peer, LAN, random.Random(8), 180):
        clock.add(*exchange.stamps)
        drifts[(exchange.done_ns - BEGIN_NS) // SECOND] = clock.drift_ppm
    assert abs(drifts[59] - 25) < 5
    assert math.isnan(drifts[61])
    assert abs(drifts[179] - 25) < 5


@pytest.mark.parametrize("ppm", [-5000.0, -400.0, 400.0, 5000.0])
def test_error_stays_bounded_for_a_clock_slewed_faster_than_assumed(ppm: float) -> None:
    """A daemon that corrects a clock may slew it at such a rate for a while."""
    peer = PeerClock(0, ppm)
    clock = ClockEstimator()
    for exchange in motion(peer, LAN, random.Random(9), 5000):
        clock.add(*exchange.stamps)
        assert excess(clock, peer, exchange.done_ns) <= (LAN.there_ns + LAN.back_ns) * 1.5
    assert clock.restarts > 0
