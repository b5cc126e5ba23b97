"""The safety chain: each rule by itself, then all rules for any sequence of inputs."""

from dataclasses import replace
from math import hypot, inf, isfinite, log, nan
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference_chain import ReferenceSafety

from netboard.base.safeguards import Safeguard
from netboard.base.tables.rig import Safety as Limits
from netboard.devices.safety.chain import (
    LIVE,
    MARGIN,
    MAX_STEP_NS,
    MEAN_TIME,
    TABLE,
    Guard,
    Limited,
    SafetyChain,
    Trip,
)
from netboard.recording.files.reader import Recording

DATA = Path(__file__).parents[1] / "data" / "recordings"
MS = 1_000_000
LIMITS = Limits()
STILL = (0.0, 0.0, 0.0)
QUIET = (0.0, 0.0, 0.0)


class Bench:
    """A safety chain stepped at 1 kHz, with a server that sends a force every tick unless it is cut off."""

    def __init__(self, limits: Limits = LIMITS, device: float = 3.3, lasting: float = 3.3) -> None:
        self.chain = SafetyChain(limits, device, lasting)
        self.now = 0
        self.fresh_ns: int | None = None
        self.history: list[Limited] = []

    def run(self, ms: int, wanted=QUIET, velocity=STILL, cut: bool = False) -> Limited:
        for _ in range(ms):
            self.now += MS
            if not cut:
                self.fresh_ns = self.now
            self.history.append(self.chain.step(self.now, wanted, self.fresh_ns, velocity))
        return self.history[-1]

    def armed(self, wanted=QUIET) -> "Bench":
        """Arm the chain, wait for the end of the ramp, and reach the wanted force."""
        assert self.chain.arm()
        self.run(1200)
        self.run(60, wanted)
        assert self.chain.guard is Guard.ARMED
        return self

    def largest_step(self) -> float:
        pairs = zip(self.history, self.history[1:], strict=False)
        return max(hypot(b.fx - a.fx, b.fy - a.fy, b.fz - a.fz) for a, b in pairs)


number = st.one_of(
    st.floats(-5.0, 5.0), st.sampled_from([0.0, 0.1, -0.1, nan, inf, -inf, 1e308, -1e308, 5e-324]), st.floats()
)
moderate = st.floats(-3.0, 3.0)
vector = st.one_of(
    st.tuples(moderate, moderate, st.floats(-0.1, 0.1)),
    st.tuples(moderate, moderate, moderate),
    st.tuples(*[number] * 3),
)
velocity = st.one_of(st.just(STILL), st.tuples(*[st.floats(-0.5, 0.5)] * 3), st.tuples(*[number] * 3))
SLEW = LIMITS.max_slew * 1e-3 + 1e-12


def test_transition_table_covers_every_state() -> None:
    assert set(TABLE) == set(Guard)
    for guard, edges in TABLE.items():
        assert all(then in Guard and then is not guard for then in edges.values())
        assert Trip.NONE not in edges
        if guard is not Guard.FAULT:
            assert edges[Trip.FAULT] is Guard.FAULT
        if guard in LIVE:
            assert {Trip.DISARM, Trip.EXPIRED, Trip.TOO_FAST} <= set(edges)
    assert Trip.EXPIRED in TABLE[Guard.WAITING]


def test_only_arming_leaves_disarmed_and_only_disarming_leaves_fault() -> None:
    assert {trip for trip in TABLE[Guard.DISARMED] if trip is not Trip.FAULT} == {Trip.ARM}
    assert TABLE[Guard.FAULT] == {Trip.DISARM: Guard.DISARMED}


def test_disarmed_device_gets_no_force() -> None:
    bench = Bench()
    last = bench.run(100, (1.0, 1.0, 1.0))
    assert last == (0.0, 0.0, 0.0, Safeguard(0))


def test_force_rises_by_the_ramp_after_arming() -> None:
    bench = Bench()
    bench.chain.arm()
    bench.run(1)
    assert bench.chain.guard is Guard.RAMPING
    half = bench.run(500, (0.0, 0.0, 1.0))
    assert half.fz == pytest.approx(0.5, abs=0.005)
    assert half.safeguards == Safeguard.ARMED | Safeguard.RAMPING
    full = bench.run(600, (0.0, 0.0, 1.0))
    assert full.fz == 1.0
    assert full.safeguards == Safeguard.ARMED


def test_arming_waits_until_the_wanted_force_is_below_the_gate() -> None:
    bench = Bench()
    bench.chain.arm()
    bench.run(500, (0.0, 0.0, LIMITS.arm_gate * 1.01))
    assert bench.chain.guard is Guard.WAITING
    assert not any(h.safeguards & Safeguard.ARMED for h in bench.history)
    bench.run(1, (0.0, 0.0, LIMITS.arm_gate * 0.99))
    assert bench.chain.guard is Guard.RAMPING


def test_arming_gate_ignores_lateral_forces() -> None:
    bench = Bench()
    bench.chain.arm()
    bench.run(1000, (-8.0, 4.0, 0.0))
    assert bench.chain.guard in LIVE
    assert bench.largest_step() <= SLEW


def test_arming_lapses_without_the_server() -> None:
    bench = Bench()
    bench.chain.arm()
    bench.run(3000, cut=True)
    assert bench.chain.guard is Guard.DISARMED
    assert bench.run(3000)[:3] == STILL
    assert not any(h.safeguards & Safeguard.ARMED for h in bench.history)


def test_second_arming_has_no_effect() -> None:
    bench = Bench().armed()
    assert not bench.chain.arm()
    assert bench.chain.guard is Guard.ARMED


def test_stale_force_is_held_then_fades_then_the_device_is_disarmed() -> None:
    bench = Bench().armed((0.0, 0.0, 1.0))
    held = bench.run(int(LIMITS.stale_after_ms), (0.0, 0.0, 1.0), cut=True)
    assert held.fz == 1.0
    assert held.safeguards == Safeguard.ARMED
    fading = bench.run(int(LIMITS.fade_ms) // 2, (0.0, 0.0, 1.0), cut=True)
    assert fading.fz == pytest.approx(0.5, abs=0.03)
    assert fading.safeguards & Safeguard.STALE
    gone = bench.run(int(LIMITS.fade_ms) // 2, (0.0, 0.0, 1.0), cut=True)
    assert gone.fz == pytest.approx(0.0, abs=1e-9)
    bench.run(60, (0.0, 0.0, 1.0), cut=True)
    assert bench.chain.guard is Guard.DISARMED
    back = bench.run(5000, (0.0, 0.0, 0.1))
    assert back == (0.0, 0.0, 0.0, Safeguard(0))
    assert bench.largest_step() <= SLEW


def test_force_ramps_up_from_its_faded_value_after_a_short_outage() -> None:
    bench = Bench().armed((0.0, 0.0, 1.0))
    left = bench.run(35, (0.0, 0.0, 1.0), cut=True).fz
    assert left == pytest.approx(0.5, abs=0.03)
    soon = bench.run(100, (0.0, 0.0, 1.0))
    assert soon.fz == pytest.approx(left + 0.1 / LIMITS.arm_time, abs=0.01)
    assert soon.safeguards & Safeguard.RAMPING
    assert bench.run(600, (0.0, 0.0, 1.0)).fz == 1.0


def test_lateral_force_does_not_fade_in_an_outage() -> None:
    bench = Bench().armed((0.4, 0.0, 1.0))
    assert bench.run(90, (0.4, 0.0, 1.0), cut=True).fx == pytest.approx(0.4)


def test_outage_without_force_adds_no_damping() -> None:
    bench = Bench().armed()
    assert bench.run(50, velocity=(0.0, 0.0, 0.3), cut=True).fz == 0.0


@pytest.mark.parametrize("speed", [-0.9, -0.1, 0.1, 0.9])
def test_damping_while_fading_opposes_motion_and_ends_with_the_force(speed: float) -> None:
    still, moving = Bench().armed((0.0, 0.0, 0.5)), Bench().armed((0.0, 0.0, 0.5))
    for _ in range(80):
        plain = still.run(1, (0.0, 0.0, 0.5), cut=True).fz
        braked = moving.run(1, (0.0, 0.0, 0.5), (0.0, 0.0, speed), cut=True).fz
        assert (braked - plain) * speed <= 1e-12
    assert moving.largest_step() <= SLEW
    assert moving.history[-1].fz == pytest.approx(0.0, abs=1e-9)


def test_heartbeats_keep_the_lateral_fixture_active() -> None:
    bench = Bench().armed((0.3, 0.0, 0.0))
    for _ in range(50):
        bench.run(8, (0.3, 0.0, 0.0), cut=True)
        bench.run(1, (0.3, 0.0, 0.0))
    assert bench.history[-1].fx == pytest.approx(0.3)
    assert not any(h.safeguards & Safeguard.STALE for h in bench.history)


def test_too_fast_stylus_gets_no_force_until_gate_and_ramp() -> None:
    bench = Bench().armed((0.0, 0.0, 2.0))
    cut = bench.run(10, (0.0, 0.0, 2.0), (0.8, 0.8, 0.0))
    assert cut[:3] == STILL
    assert cut.safeguards == Safeguard.TOO_FAST
    assert bench.run(500, (0.0, 0.0, 2.0))[:3] == STILL
    bench.run(1, (0.0, 0.0, 0.0))
    assert bench.run(100, (0.0, 0.0, 2.0)).fz == pytest.approx(0.2, abs=0.01)
    assert bench.largest_step() <= SLEW


def test_velocity_cut_and_then_a_long_outage_need_a_new_arming() -> None:
    bench = Bench().armed((0.0, 0.0, 2.0))
    bench.run(1, (0.0, 0.0, 2.0), (0.0, 0.0, 2.0))
    assert bench.chain.guard is Guard.WAITING
    bench.run(int(LIMITS.disarm_after_ms) + 20, (0.0, 0.0, 2.0), cut=True)
    assert bench.chain.guard is Guard.DISARMED
    assert bench.run(3000)[:3] == STILL
    assert bench.largest_step() <= SLEW
    assert bench.chain.arm()
    bench.run(1200)
    assert bench.chain.guard is Guard.ARMED


@pytest.mark.parametrize("bad", [nan, inf, -inf])
@pytest.mark.parametrize("place", range(6))
def test_non_finite_input_cuts_the_force_at_once_until_disarmed(bad: float, place: int) -> None:
    bench = Bench().armed((0.5, 0.0, 2.0))
    numbers = [0.5, 0.0, 2.0, 0.0, 0.0, 0.0]
    numbers[place] = bad
    cut = bench.run(1, tuple(numbers[:3]), tuple(numbers[3:]))
    assert cut[:3] == STILL
    assert cut.safeguards == Safeguard.NOT_FINITE
    assert not bench.chain.arm()
    assert bench.run(100, (0.0, 0.0, 0.0)).safeguards == Safeguard.NOT_FINITE
    bench.chain.disarm()
    assert bench.run(1).safeguards == Safeguard(0)
    assert bench.chain.arm()


def test_lost_device_cuts_the_force_at_once() -> None:
    bench = Bench().armed((0.0, 0.0, 2.0))
    bench.chain.device_lost()
    cut = bench.run(1, (0.0, 0.0, 2.0))
    assert cut == (0.0, 0.0, 0.0, Safeguard.DEVICE_LOST)
    assert bench.chain.guard is Guard.FAULT


def test_disarming_releases_the_force_at_the_slew_limit() -> None:
    bench = Bench().armed((0.0, 0.0, 2.0))
    bench.chain.disarm()
    assert bench.chain.guard is Guard.RELEASING
    assert bench.run(1, (0.0, 0.0, 2.0)).fz == pytest.approx(1.5)
    bench.run(10, (0.0, 0.0, 2.0))
    assert bench.chain.guard is Guard.DISARMED
    assert bench.run(1000, (0.0, 0.0, 0.0))[:3] == STILL


@pytest.mark.parametrize(("device", "most"), [(3.3, 3.0), (1.2, 1.2)])
def test_force_is_clamped_to_the_smaller_limit_and_keeps_its_direction(device: float, most: float) -> None:
    bench = Bench(replace(LIMITS, mean_force=40.0), device).armed()
    clamped = bench.run(100, (3.0, 0.0, -4.0))
    assert hypot(*clamped[:3]) == pytest.approx(most)
    assert clamped.fx / clamped.fz == pytest.approx(-0.75)
    assert clamped.safeguards == Safeguard.ARMED | Safeguard.CLAMPED


@pytest.mark.slow
def test_sustained_force_decreases_to_the_mean_force_limit() -> None:
    """Under a constant force F the mean is F (1 - exp(-t / MEAN_TIME)); near its limit the clamp decreases."""
    bench = Bench().armed((0.0, 0.0, 2.0))
    lasting = LIMITS.mean_force
    limit_time = -MEAN_TIME * log(1.0 - (1.0 - MARGIN) * lasting / 2.0)
    bench.run(round((limit_time - 0.5) * 1000), (0.0, 0.0, 2.0))
    assert bench.history[-1].fz == 2.0
    assert not any(h.safeguards & Safeguard.WORN for h in bench.history)
    last = bench.run(60_000, (0.0, 0.0, 2.0))
    assert last.fz == pytest.approx(lasting, rel=1e-3)
    assert last.safeguards == Safeguard.ARMED | Safeguard.WORN
    assert bench.largest_step() <= SLEW
    bench.run(10_000, QUIET)
    assert bench.run(100, (0.0, 0.0, 2.0)).fz == 2.0


@pytest.mark.slow
@pytest.mark.parametrize(("limit", "device", "most"), [(0.88, 3.3, 0.88), (0.88, 0.5, 0.5), (2.0, 0.9, 0.9)])
def test_mean_force_is_limited_by_the_smaller_of_limit_and_rating(limit: float, device: float, most: float) -> None:
    bench = Bench(replace(LIMITS, mean_force=limit), lasting=device).armed((0.0, 0.0, 3.0))
    assert bench.run(100_000, (0.0, 0.0, 3.0)).fz == pytest.approx(most, rel=1e-3)


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(st.floats(0.1, 3.0), st.lists(st.tuples(moderate, st.integers(1, 6000)), min_size=4, max_size=8))
def test_no_wanted_force_raises_the_mean_above_its_limit(lasting: float, segments: list[tuple[float, int]]) -> None:
    bench, mean = Bench(lasting=lasting).armed(), 0.0
    most = min(lasting, LIMITS.mean_force)
    for wanted, times in segments:
        for _ in range(times):
            mean += (abs(bench.run(1, (0.0, 0.0, wanted)).fz) - mean) * 1e-3 / MEAN_TIME
            assert mean <= most * 1.001 + LIMITS.max_force * 0.006 / MEAN_TIME


def test_device_without_motors_gets_no_force() -> None:
    bench = Bench(device=0.0, lasting=0.0)
    bench.chain.arm()
    assert bench.run(3000, (0.1, 0.0, 0.1))[:3] == STILL


def test_device_with_the_smallest_rating_gets_practically_no_force() -> None:
    """A tenth of the smallest float is 0, by which nothing may be divided."""
    bench = Bench(lasting=5e-324)
    bench.chain.arm()
    assert abs(bench.run(3000, (0.0, 0.0, 3.0)).fz) <= 5e-324


def test_emergency_stop_cuts_the_force_at_once_until_disarmed() -> None:
    bench = Bench().armed((0.0, 0.0, 2.0))
    bench.chain.stop()
    assert bench.run(1, (0.0, 0.0, 2.0)) == (0.0, 0.0, 0.0, Safeguard.STOPPED)
    assert not bench.chain.arm()
    bench.chain.disarm()
    assert bench.run(1).safeguards == Safeguard(0)
    assert bench.chain.arm()


def test_slew_limit_spreads_a_force_step_over_several_ticks() -> None:
    bench = Bench().armed()
    first = bench.run(1, (0.0, 0.0, 2.0))
    assert first.fz == pytest.approx(0.5)
    assert first.safeguards == Safeguard.ARMED | Safeguard.SLEWED
    assert bench.run(3, (0.0, 0.0, 2.0)).fz == pytest.approx(2.0)


def test_force_change_in_a_late_step_is_bounded() -> None:
    bench = Bench().armed()
    bench.now += 500 * MS
    bench.fresh_ns = bench.now
    late = bench.chain.step(bench.now, (0.0, 0.0, 3.0), bench.fresh_ns, STILL)
    assert late.fz == pytest.approx(LIMITS.max_slew * MAX_STEP_NS * 1e-9)


def test_clock_that_steps_back_does_not_change_the_force() -> None:
    bench = Bench().armed((0.0, 0.0, 1.0))
    before = bench.history[-1]
    assert bench.chain.step(bench.now - 50 * MS, (0.0, 0.0, 3.0), bench.now, STILL)[:3] == before[:3]


moment = st.tuples(
    st.sampled_from(["", "", "", "", "", "", "arm", "arm", "disarm", "lost", "stop"]),
    st.sampled_from([0, 1, 1, 1, 1, 2, 5, 30, 300]),
    vector,
    st.sampled_from([0, 0, 0, 0, 11, 40, 150, None]),
    velocity,
    st.integers(1, 40),
)
CALLS = {"arm": "arm", "disarm": "disarm", "lost": "device_lost", "stop": "stop"}
limit = st.builds(
    replace,
    st.just(LIMITS),
    max_force=st.floats(0.1, 10.0),
    max_slew=st.floats(1.0, 5000.0),
    arm_time=st.floats(0.01, 2.0),
)


@pytest.mark.slow
@settings(max_examples=200)
@given(limit, st.floats(0.1, 10.0), st.floats(0.1, 10.0), st.lists(moment, max_size=25))
def test_safety_rules_hold_for_any_input_sequence(limits: Limits, device: float, lasting: float, moments: list) -> None:
    chain, now, last = SafetyChain(limits, device, lasting), 0, STILL
    for action, dt, wanted, age, speed, times in moments:
        before = chain.guard
        if action == "arm":
            armed = chain.arm()
            assert armed == (before is Guard.DISARMED)
        elif action == "disarm":
            chain.disarm()
        elif action == "lost":
            chain.device_lost()
        elif action == "stop":
            chain.stop()
        for _ in range(times):
            was = chain.guard
            now += dt * MS
            force = chain.step(now, wanted, None if age is None else now - age * MS, speed)
            out, guard = force[:3], chain.guard
            assert all(map(isfinite, out))
            assert hypot(*out) <= min(limits.max_force, device) * (1 + 1e-12)
            if guard in (Guard.DISARMED, Guard.FAULT):
                assert out == STILL
            if guard is not Guard.FAULT:
                most = limits.max_slew * min(dt * MS, MAX_STEP_NS) * 1e-9
                assert hypot(*(b - a for a, b in zip(last, out, strict=True))) <= most * (1 + 1e-9) + 1e-12
            assert bool(force.safeguards & Safeguard.ARMED) == (guard in LIVE)
            assert guard is was or guard in TABLE[was].values()
            assert not (was is Guard.DISARMED and guard in LIVE)
            last = out


@pytest.mark.slow
@settings(max_examples=300)
@given(limit, st.floats(0.0, 10.0), st.floats(0.0, 10.0), st.lists(moment, max_size=25))
def test_compiled_chain_matches_the_plain_python_reference(
    limits: Limits, device: float, lasting: float, moments: list
) -> None:
    """Bit for bit, in every state and fault, also if the clock steps back."""
    pair, now = (SafetyChain(limits, device, lasting), ReferenceSafety(limits, device, lasting)), 0
    for action, dt, wanted, age, speed, times in moments:
        if action:
            first, second = (getattr(chain, CALLS[action])() for chain in pair)
            assert first == second
        for number in range(times):
            now += (dt if number != 3 else -dt) * MS
            fresh_ns = None if age is None else now - age * MS
            compiled, plain = (chain.step(now, wanted, fresh_ns, speed) for chain in pair)
            assert list(map(repr, compiled[:3])) == list(map(repr, plain[:3]))  # distinguishes -0.0 from 0.0
            assert compiled.safeguards == plain.safeguards
            assert pair[0].guard is pair[1].guard


@pytest.mark.parametrize("side", ["left", "right"])
def test_compiled_chain_matches_the_reference_on_recorded_traffic(side: str) -> None:
    """Recorded commanded forces at their recorded times, with occasional outages and emergency stops."""
    with Recording(DATA / "format-3.mcap") as recording:
        ticks = recording.ticks()
    limits, forces, rng = replace(LIMITS, arm_time=0.01, arm_gate=5.0), [], np.random.default_rng(3)
    pair = SafetyChain(limits, 3.3, 0.88), ReferenceSafety(limits, 3.3, 0.88)
    fresh_ns = None
    for tick in ticks:
        now, fz, vz = int(tick["time_ns"]), float(tick[f"{side}_force"]), float(tick[f"{side}_sent_vz"])
        wanted = (-float(tick[f"{side}_x"]), -float(tick[f"{side}_y"]), fz)
        silent = len(forces) % 400 > 340  # outages of 60 ms
        fresh_ns = fresh_ns if silent else now
        stops = rng.random() < 0.001
        for chain in pair:
            if stops:
                chain.stop()
            elif chain.guard is Guard.FAULT and len(forces) % 50 == 0:
                chain.disarm()
            chain.arm()
        found = [chain.step(now, wanted, fresh_ns, (0.0, 0.0, vz)) for chain in pair]
        assert found[0] == found[1]
        forces.append(found[0].fz)
    assert np.ptp(forces) > 0.1
