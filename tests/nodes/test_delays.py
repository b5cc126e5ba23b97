"""Round trips of both hands: the largest stable delay, and the reaction beyond half of it."""

from dataclasses import replace
from math import isnan

import pytest

from netboard.base.config import Config
from netboard.base.tables.rig import Network
from netboard.base.tables.scene import Physics
from netboard.nodes.ports.round_trips import DELAY_LIMIT, GAINS, MARGIN, MAX_GAIN_STEP, REST, Delays, limit_ns, loops_of
from netboard.physics.stability.delayed_coupling import Mechanism, largest_round_trip

FIXED = replace(Physics(), board="hinged", I=1e9, hold="zoh")


def delays(action: str, physics: Physics = FIXED) -> Delays:
    return Delays(Config(physics=physics, network=Network(delay_action=action)))  # type: ignore[arg-type]


def looks(watch: Delays, left_ms: float, right_ms: float, times: int = 60) -> list[str]:
    """Look so many times; the names of what is to be recorded."""
    watch.news.clear()
    for _ in range(times):
        watch.poll([int(left_ms * 1e6), int(right_ms * 1e6)], felt=True)
    return [name for name, _ in watch.news]


@pytest.mark.slow
def test_the_limit_is_that_of_a_bare_stylus_at_a_board_held_fast() -> None:
    assert delays("warn").limit_ns == 8_000_000
    assert delays("warn", replace(FIXED, coupling_at="both")).limit_ns == 60_000_000
    assert delays("warn", replace(FIXED, coupling="none")).limit_ns == 60_000_000
    assert delays("warn", replace(FIXED, k_h=1e6, c_h=0.0)).limit_ns == 0


def test_the_limit_is_recorded_when_the_scene_is_loaded() -> None:
    ((name, details),) = delays("warn").news
    assert name == "delay_limit"
    assert details == {"limit": "8 ms", "allowed": "4 ms", "coupling": "server"}


def test_an_agent_knows_its_own_device_better() -> None:
    watch = delays("warn")
    watch.news.clear()
    watch.know("left", {DELAY_LIMIT: "12 ms"})
    assert watch.limit_ns == 8_000_000  # the other side's is not known
    watch.know("right", {DELAY_LIMIT: "10.5 ms"})
    assert [details["limit"] for _, details in watch.news] == ["10.5 ms"]
    assert not looks(watch, 1.0, 5.0)
    for nonsense in ("", "nan ms", "-1 ms", "1e9 ms", "12 s"):
        watch.know("right", {DELAY_LIMIT: nonsense})
        assert watch.limit_ns == 8_000_000


def test_a_heavier_device_stands_more_than_a_lighter_one() -> None:
    light, heavy = (limit_ns(loops_of(Config(physics=FIXED), Mechanism(mass, 0.1))) for mass in (0.045, 0.2))
    assert light < heavy


def test_a_slow_loop_is_told_of_once_and_once_when_it_is_over() -> None:
    watch = delays("warn")
    assert looks(watch, 1.0, 3.9) == []
    assert not watch.notice
    assert looks(watch, 1.0, 5.0) == ["loop_too_slow"]
    assert "the right hand's loop takes 5 ms, more than the 4 ms" in watch.notice
    assert looks(watch, 1.0, 3.8) == []
    assert looks(watch, 1.0, 1.0) == ["loop_in_time"]
    assert not watch.notice + watch.trouble
    assert list(watch.gains) == [1.0, 1.0]


def test_a_loop_that_is_not_closed_has_no_delay() -> None:
    watch = delays("warn")
    looks(watch, 5.0, 0.0)
    assert not isnan(watch.late[0])
    assert isnan(watch.late[1])
    watch.poll([5_000_000, 0], felt=False)
    assert isnan(watch.late[0])
    assert not watch.notice


def test_a_trial_is_paused_and_none_begins_for_a_while() -> None:
    watch = delays("disarm")
    looks(watch, 5.0, 1.0)
    assert watch.trouble == watch.notice != ""
    for _ in range(REST):
        assert watch.lacking == ("a quicker network",)
        watch.poll([0, 0], felt=False)
        assert not watch.trouble
    assert watch.lacking == ()


@pytest.mark.slow
@pytest.mark.parametrize("physics", [FIXED, Physics()])
def test_a_hand_is_softened_smoothly_and_no_more_than_needed(physics: Physics) -> None:
    watch = delays("soften", physics)
    quick, slow = 0.4 * watch.limit_ns * 1e-6 / MARGIN, 3.0 * watch.limit_ns * 1e-6 / MARGIN
    before, gains = 1.0, []
    for _ in range(100):
        watch.poll([int(slow * 1e6), int(quick * 1e6)], felt=True)
        assert abs(watch.gains[0] - before) <= MAX_GAIN_STEP + 1e-12
        before = float(watch.gains[0])
        gains.append(before)
    assert GAINS[-1] <= before < 1.0
    assert gains == sorted(gains, reverse=True)
    assert watch.gains[1] == 1.0
    told = [details for name, details in watch.news if name == "softened"]
    assert told
    assert {details["side"] for details in told} == {"left"}
    assert looks(watch, quick, quick, 100).count("softened") >= 1
    assert list(watch.gains) == [1.0, 1.0]
    assert not watch.trouble


@pytest.mark.parametrize("changes", [{}, {"coupling": "left"}, {"k_h": 2000.0, "c_h": 0.5}])
def test_the_limit_is_that_of_the_loop_that_stands_least(changes: dict[str, object]) -> None:
    loops = loops_of(Config(physics=replace(Physics(), **changes)), Mechanism(0.045, 0.1))  # type: ignore[arg-type]
    assert len(loops) > 1
    assert limit_ns(loops) == 1_000_000 * max(min(largest_round_trip(loop) for loop in loops), 0)
