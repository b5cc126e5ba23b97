"""The stylus between its samples."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.physics.hold import constant_velocity

REACH = 0.005


@given(st.floats(-0.1, 0.1), st.floats(-1, 1), st.floats(-REACH, REACH))
def test_moves_with_its_velocity_within_reach(z: float, vz: float, age: float) -> None:
    assert constant_velocity(z, vz, age, REACH) == z + vz * age


@pytest.mark.parametrize(("age", "used"), [(0.006, REACH), (1e9, REACH), (math.inf, REACH), (-0.5, -REACH)])
def test_goes_no_further_than_its_reach(age: float, used: float) -> None:
    assert constant_velocity(0.01, 0.3, age, REACH) == 0.01 + 0.3 * used


@given(st.floats(), st.floats(), st.floats(), st.floats(0, 1))
def test_takes_any_number(z: float, vz: float, age: float, reach: float) -> None:
    assert isinstance(constant_velocity(z, vz, age, reach), float)


def test_error_of_a_sampled_sine_is_that_of_the_missing_acceleration() -> None:
    a, w, h = 0.02, 2 * math.pi * 0.8, 1e-3
    worst = max(
        abs(constant_velocity(a * math.sin(w * t), a * w * math.cos(w * t), h, REACH) - a * math.sin(w * (t + h)))
        for t in (i * h for i in range(1250))
    )
    assert worst == pytest.approx(a * w * w * h * h / 2, rel=1e-3)
