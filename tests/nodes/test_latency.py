"""Round trips of both hands: the largest stable delay, and the reaction beyond half of it."""

from dataclasses import replace
from math import isnan

import pytest

from netboard.base.config import Config
from netboard.base.tables.rig import Network
from netboard.base.tables.scene import Physics
from netboard.nodes.ports.latency import (
    CHECKS_TO_WAIT,
    DELAY_LIMIT,
    GAINS,
    MARGIN,
    MAX_GAIN_STEP,
    LatencySupervisor,
    limit_ns,
    loops_of,
)
from netboard.physics.stability.delayed_coupling import Mechanism, largest_round_trip

FIXED = replace(Physics(), board="hinged", I=1e9, hold="zoh")


def delays(action: str, physics: Physics = FIXED) -> LatencySupervisor:
    return LatencySupervisor(Config(physics=physics, network=Network(delay_action=action)))  # type: ignore[arg-type]


def poll_repeatedly(watch: LatencySupervisor, left_ms: float, right_ms: float, times: int = 60) -> list[str]:
    """Poll a number of times and return the names of the events."""
    watch.news.clear()
    for _ in range(times):
        watch.poll([int(left_ms * 1e6), int(right_ms * 1e6)], haptics=True)
    return [name for name, _ in watch.news]


@pytest.mark.slow
def test_delay_limit_of_a_bare_stylus_on_a_fixed_board() -> None:
    assert delays("warn").limit_ns == 8_000_000
    assert delays("warn", replace(FIXED, coupling_at="both")).limit_ns == 60_000_000
    assert delays("warn", replace(FIXED, coupling="none")).limit_ns == 60_000_000
    assert delays("warn", replace(FIXED, k_h=1e6, c_h=0.0)).limit_ns == 0


def test_delay_limit_is_recorded_when_the_scene_is_loaded() -> None:
    ((name, details),) = delays("warn").news
    assert name == "delay_limit"
    assert details == {"limit": "8 ms", "allowed": "4 ms", "coupling": "server"}


def test_delay_limits_of_the_agents_override_the_default() -> None:
    watch = delays("warn")
    watch.news.clear()
    watch.take_limit("left", {DELAY_LIMIT: "12 ms"})
    assert watch.limit_ns == 8_000_000  # the other side's is not known
    watch.take_limit("right", {DELAY_LIMIT: "10.5 ms"})
    assert [details["limit"] for _, details in watch.news] == ["10.5 ms"]
    assert not poll_repeatedly(watch, 1.0, 5.0)
    for nonsense in ("", "nan ms", "-1 ms", "1e9 ms", "12 s"):
        watch.take_limit("right", {DELAY_LIMIT: nonsense})
        assert watch.limit_ns == 8_000_000


def test_heavier_device_tolerates_a_longer_delay() -> None:
    light, heavy = (limit_ns(loops_of(Config(physics=FIXED), Mechanism(mass, 0.1))) for mass in (0.045, 0.2))
    assert light < heavy


def test_slow_loop_is_reported_once_at_its_start_and_end() -> None:
    watch = delays("warn")
    assert poll_repeatedly(watch, 1.0, 3.9) == []
    assert not watch.notice
    assert poll_repeatedly(watch, 1.0, 5.0) == ["loop_too_slow"]
    assert "the sample-to-force latency of the right hand is 5 ms, above the limit of 4 ms" in watch.notice
    assert poll_repeatedly(watch, 1.0, 3.8) == []
    assert poll_repeatedly(watch, 1.0, 1.0) == ["loop_in_time"]
    assert not watch.notice + watch.trouble
    assert list(watch.gains) == [1.0, 1.0]


def test_open_loop_has_no_delay() -> None:
    watch = delays("warn")
    poll_repeatedly(watch, 5.0, 0.0)
    assert not isnan(watch.latencies[0])
    assert isnan(watch.latencies[1])
    watch.poll([5_000_000, 0], haptics=False)
    assert isnan(watch.latencies[0])
    assert not watch.notice


def test_disarm_action_pauses_the_trial_and_blocks_the_next() -> None:
    watch = delays("disarm")
    poll_repeatedly(watch, 5.0, 1.0)
    assert watch.trouble == watch.notice != ""
    for _ in range(CHECKS_TO_WAIT):
        assert watch.missing == ("a shorter sample-to-force latency",)
        watch.poll([0, 0], haptics=False)
        assert not watch.trouble
    assert watch.missing == ()


@pytest.mark.slow
@pytest.mark.parametrize("physics", [FIXED, Physics()])
def test_soften_action_reduces_the_gain_smoothly_and_restores_it(physics: Physics) -> None:
    watch = delays("soften", physics)
    quick, slow = 0.4 * watch.limit_ns * 1e-6 / MARGIN, 3.0 * watch.limit_ns * 1e-6 / MARGIN
    before, gains = 1.0, []
    for _ in range(100):
        watch.poll([int(slow * 1e6), int(quick * 1e6)], haptics=True)
        assert abs(watch.gains[0] - before) <= MAX_GAIN_STEP + 1e-12
        before = float(watch.gains[0])
        gains.append(before)
    assert GAINS[-1] <= before < 1.0
    assert gains == sorted(gains, reverse=True)
    assert watch.gains[1] == 1.0
    softened = [details for name, details in watch.news if name == "softened"]
    assert softened
    assert {details["side"] for details in softened} == {"left"}
    assert poll_repeatedly(watch, quick, quick, 100).count("softened") >= 1
    assert list(watch.gains) == [1.0, 1.0]
    assert not watch.trouble


@pytest.mark.parametrize("changes", [{}, {"coupling": "left"}, {"k_h": 2000.0, "c_h": 0.5}])
def test_delay_limit_is_that_of_the_least_stable_loop(changes: dict[str, object]) -> None:
    loops = loops_of(Config(physics=replace(Physics(), **changes)), Mechanism(0.045, 0.1))  # type: ignore[arg-type]
    assert len(loops) > 1
    assert limit_ns(loops) == 1_000_000 * max(min(largest_round_trip(loop) for loop in loops), 0)
