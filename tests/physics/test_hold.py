"""Extrapolation of the styluses between samples, and the resulting drives."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

from netboard.physics.hands.extrapolation import between, drives, later, moving, reached, resting

QUICK, REACH = 0.005, 0.010
K, C = 200.0, 2.0

height = st.floats(-0.1, 0.1)
rate = st.floats(-1, 1)
bend = st.floats(-50, 50)


@given(height, rate, bend, st.floats(-QUICK, QUICK))
def test_a_stylus_keeps_its_acceleration_while_that_counts(z: float, vz: float, az: float, age: float) -> None:
    there = reached(z, vz, az, age, QUICK, REACH)
    assert there == pytest.approx((z + vz * age + az * age * age / 2, vz + az * age), rel=1e-14, abs=1e-17)


@given(height, rate, bend, st.floats(QUICK, REACH), st.sampled_from([-1, 1]))
def test_then_it_keeps_its_rate(z: float, vz: float, az: float, age: float, way: int) -> None:
    turned_z, turned_vz = reached(z, vz, az, way * QUICK, QUICK, REACH)
    there = reached(z, vz, az, way * age, QUICK, REACH)
    assert there[1] == turned_vz
    assert there[0] == pytest.approx(turned_z + turned_vz * way * (age - QUICK), abs=1e-15)


@pytest.mark.parametrize("age", [0.011, 1e9, math.inf])
@pytest.mark.parametrize("way", [-1, 1])
def test_it_goes_no_further_than_its_reach(age: float, way: int) -> None:
    assert reached(0.01, 0.3, -7.0, way * age, QUICK, REACH) == reached(0.01, 0.3, -7.0, way * REACH, QUICK, REACH)


@given(height, rate, st.floats(-REACH, REACH))
def test_without_an_acceleration_it_moves_with_its_velocity(z: float, vz: float, age: float) -> None:
    assert reached(z, vz, 0.0, age, QUICK, REACH) == pytest.approx((z + vz * age, vz), abs=1e-16)


def at(u: tuple[float, ...], t: float) -> float:
    return float(np.polynomial.Polynomial(u)(t))


@given(height, rate, bend, st.floats(0, 0.01))
def test_the_drive_of_a_moving_hand_is_that_of_its_height_and_rate(z: float, vz: float, az: float, t: float) -> None:
    there = K * (z + vz * t + az * t * t / 2) + C * (vz + az * t)
    assert at(moving(z, vz, az, K, C), t) == pytest.approx(there, abs=1e-13)


@given(height, rate)
def test_the_drive_of_a_resting_hand_stays(z: float, vz: float) -> None:
    assert resting(z, vz, K, C) == (K * z + C * vz, 0, 0, 0)


@given(height, rate, height, rate, st.floats(1e-4, 0.1))
def test_the_drive_between_two_samples_is_that_of_the_cubic_that_meets_both(
    z: float, vz: float, next_z: float, next_vz: float, gap: float
) -> None:
    path = CubicHermiteSpline([0, gap], [z, next_z], [vz, next_vz])
    u = between(z, vz, next_z, next_vz, gap, K, C)
    for t in np.linspace(0, gap, 5):
        assert at(u, t) == pytest.approx(K * path(t) + C * path(t, 1), rel=1e-11, abs=1e-11 * max(1, C / gap))


numbers = st.floats(-10, 10)


@given(st.tuples(*[numbers] * 8), st.floats(-0.01, 0.01), st.floats(0, 0.01))
def test_counted_from_later_the_hands_move_the_same(u: Any, t: float, s: float) -> None:
    assert drives(later(u, t), 0, s) == pytest.approx(drives(u, 0, t + s), abs=1e-13)
    left, right = at(u[:4], t + s), at(u[4:], t + s)
    assert drives(u, 0, t + s) == pytest.approx((left, right), abs=1e-13)


def test_drives_are_also_taken_from_a_table() -> None:
    table = np.arange(12.0).reshape(2, 3, 2)
    assert drives((table, 1), 2, 0.5) == (10, 11)


anything = st.floats()


@given(anything, anything, anything, anything)
def test_any_number_is_taken(z: float, vz: float, az: float, age: float) -> None:
    results = (*reached(z, vz, az, age, QUICK, REACH), *moving(z, vz, az, K, C), *between(z, vz, az, age, 0.001, K, C))
    assert all(isinstance(value, float) for value in results)


@pytest.mark.parametrize(("az", "order"), [(0.0, 2), (1.0, 3)], ids=["velocity", "acceleration"])
def test_error_of_a_sampled_sine_is_that_of_the_next_derivative(az: float, order: int) -> None:
    a, w, h = 0.02, 2 * math.pi * 0.8, 1e-3
    worst = 0.0
    for t in np.arange(1250) * h:
        z, vz, slope = a * math.sin(w * t), a * w * math.cos(w * t), -az * a * w * w * math.sin(w * t)
        worst = max(worst, abs(reached(z, vz, slope, h, QUICK, REACH)[0] - a * math.sin(w * (t + h))))
    assert worst == pytest.approx(a * (w * h) ** order / math.factorial(order), rel=1e-3)
