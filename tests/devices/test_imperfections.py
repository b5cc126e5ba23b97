"""Motor temperature compared with its closed form, and interpolation of delayed readings."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.devices.simulated.device import COOL, DelayLine, MotorTemperature

MS = 1_000_000


def test_motors_sustain_the_continuous_force_indefinitely() -> None:
    motor = MotorTemperature(0.88, 100.0)
    for _ in range(10_000):
        motor.live(1.0, 0.88)
    assert motor.temperature == pytest.approx(1.0)
    assert not motor.warm


@given(st.floats(0.9, 3.3), st.floats(0.1, 1000.0), st.integers(1, 50))
def test_temperature_is_independent_of_the_step_length(force: float, seconds: float, parts: int) -> None:
    whole, split = MotorTemperature(0.88, 100.0), MotorTemperature(0.88, 100.0)
    whole.live(seconds, force)
    for _ in range(parts):
        split.live(seconds / parts, force)
    assert split.temperature == pytest.approx(whole.temperature)


def test_hot_motors_recover_only_below_the_lower_threshold() -> None:
    motor = MotorTemperature(1.0, 1.0)
    motor.live(1.0, 2.0)
    assert motor.warm
    while motor.temperature > 1.0:
        motor.live(0.01, 0.0)
    assert motor.warm
    while motor.warm:
        motor.live(0.01, 0.0)
    assert motor.temperature == pytest.approx(COOL, abs=0.01)


@given(st.lists(st.integers(1, 5 * MS), min_size=1, max_size=60), st.integers(1, 20 * MS))
def test_delayed_positions_are_interpolated_linearly(intervals: list[int], delay_ns: int) -> None:
    late, now = DelayLine(delay_ns), 0
    late.take(0, (0.0, 0.0, 0.0))
    for interval in intervals:
        now += interval
        then = max(now - delay_ns, 0) * 1e-9
        assert late.take(now, (now * 1e-9, -now * 1e-9, 1.0 if now else 0.0))[:2] == pytest.approx((then, -then))


def test_second_position_at_the_same_time_is_ignored() -> None:
    late = DelayLine(2 * MS)
    for k in range(10):
        first = late.take(k * MS, (float(k), 0.0, 0.0))
        assert late.take(k * MS, (99.0, 0.0, 0.0)) == first
