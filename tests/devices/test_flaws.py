"""Motor temperature against its closed form, and delayed readings on a line."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.devices.simulated.virtual import COOL, DelayLine, MotorTemperature

MS = 1_000_000


def test_the_continuous_force_is_borne_for_ever() -> None:
    heat = MotorTemperature(0.88, 100.0)
    for _ in range(10_000):
        heat.live(1.0, 0.88)
    assert heat.temperature == pytest.approx(1.0)
    assert not heat.warm


@given(st.floats(0.9, 3.3), st.floats(0.1, 1000.0), st.integers(1, 50))
def test_how_time_is_cut_does_not_matter(force: float, seconds: float, parts: int) -> None:
    whole, cut = MotorTemperature(0.88, 100.0), MotorTemperature(0.88, 100.0)
    whole.live(seconds, force)
    for _ in range(parts):
        cut.live(seconds / parts, force)
    assert cut.temperature == pytest.approx(whole.temperature)


def test_warm_motors_stay_warm_until_they_have_cooled_down() -> None:
    heat = MotorTemperature(1.0, 1.0)
    heat.live(1.0, 2.0)
    assert heat.warm
    while heat.temperature > 1.0:
        heat.live(0.01, 0.0)
    assert heat.warm
    while heat.warm:
        heat.live(0.01, 0.0)
    assert heat.temperature == pytest.approx(COOL, abs=0.01)


@given(st.lists(st.integers(1, 5 * MS), min_size=1, max_size=60), st.integers(1, 20 * MS))
def test_late_places_are_on_the_line_between_those_taken(intervals: list[int], delay_ns: int) -> None:
    late, now = DelayLine(delay_ns), 0
    late.take(0, (0.0, 0.0, 0.0))
    for interval in intervals:
        now += interval
        then = max(now - delay_ns, 0) * 1e-9
        assert late.take(now, (now * 1e-9, -now * 1e-9, 1.0 if now else 0.0))[:2] == pytest.approx((then, -then))


def test_a_time_that_is_read_twice_is_taken_once() -> None:
    late = DelayLine(2 * MS)
    for k in range(10):
        first = late.take(k * MS, (float(k), 0.0, 0.0))
        assert late.take(k * MS, (99.0, 0.0, 0.0)) == first
