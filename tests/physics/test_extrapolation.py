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
velocity = st.floats(-1, 1)
acceleration = st.floats(-50, 50)


@given(height, velocity, acceleration, st.floats(-QUICK, QUICK))
def test_extrapolation_uses_the_acceleration_within_its_window(z: float, vz: float, az: float, age: float) -> None:
    found = reached(z, vz, az, age, QUICK, REACH)
    assert found == pytest.approx((z + vz * age + az * age * age / 2, vz + az * age), rel=1e-14, abs=1e-17)


@given(height, velocity, acceleration, st.floats(QUICK, REACH), st.sampled_from([-1, 1]))
def test_extrapolation_has_constant_velocity_beyond_the_window(
    z: float, vz: float, az: float, age: float, sign: int
) -> None:
    edge_z, edge_vz = reached(z, vz, az, sign * QUICK, QUICK, REACH)
    found = reached(z, vz, az, sign * age, QUICK, REACH)
    assert found[1] == edge_vz
    assert found[0] == pytest.approx(edge_z + edge_vz * sign * (age - QUICK), abs=1e-15)


@pytest.mark.parametrize("age", [0.011, 1e9, math.inf])
@pytest.mark.parametrize("sign", [-1, 1])
def test_extrapolation_stops_at_its_reach(age: float, sign: int) -> None:
    assert reached(0.01, 0.3, -7.0, sign * age, QUICK, REACH) == reached(0.01, 0.3, -7.0, sign * REACH, QUICK, REACH)


@given(height, velocity, st.floats(-REACH, REACH))
def test_extrapolation_without_acceleration_is_linear(z: float, vz: float, age: float) -> None:
    assert reached(z, vz, 0.0, age, QUICK, REACH) == pytest.approx((z + vz * age, vz), abs=1e-16)


def evaluate(u: tuple[float, ...], t: float) -> float:
    return float(np.polynomial.Polynomial(u)(t))


@given(height, velocity, acceleration, st.floats(0, 0.01))
def test_drive_of_a_moving_hand_follows_its_height_and_velocity(z: float, vz: float, az: float, t: float) -> None:
    expected = K * (z + vz * t + az * t * t / 2) + C * (vz + az * t)
    assert evaluate(moving(z, vz, az, K, C), t) == pytest.approx(expected, abs=1e-13)


@given(height, velocity)
def test_drive_of_a_resting_hand_is_constant(z: float, vz: float) -> None:
    assert resting(z, vz, K, C) == (K * z + C * vz, 0, 0, 0)


@given(height, velocity, height, velocity, st.floats(1e-4, 0.1))
def test_drive_between_samples_follows_the_cubic_hermite_spline(
    z: float, vz: float, next_z: float, next_vz: float, gap: float
) -> None:
    path = CubicHermiteSpline([0, gap], [z, next_z], [vz, next_vz])
    u = between(z, vz, next_z, next_vz, gap, K, C)
    for t in np.linspace(0, gap, 5):
        assert evaluate(u, t) == pytest.approx(K * path(t) + C * path(t, 1), rel=1e-11, abs=1e-11 * max(1, C / gap))


numbers = st.floats(-10, 10)


@given(st.tuples(*[numbers] * 8), st.floats(-0.01, 0.01), st.floats(0, 0.01))
def test_shifted_time_origin_gives_the_same_drives(u: Any, t: float, s: float) -> None:
    assert drives(later(u, t), 0, s) == pytest.approx(drives(u, 0, t + s), abs=1e-13)
    left, right = evaluate(u[:4], t + s), evaluate(u[4:], t + s)
    assert drives(u, 0, t + s) == pytest.approx((left, right), abs=1e-13)


def test_drives_can_be_read_from_a_table() -> None:
    table = np.arange(12.0).reshape(2, 3, 2)
    assert drives((table, 1), 2, 0.5) == (10, 11)


anything = st.floats()


@given(anything, anything, anything, anything)
def test_extrapolation_accepts_any_float(z: float, vz: float, az: float, age: float) -> None:
    results = (*reached(z, vz, az, age, QUICK, REACH), *moving(z, vz, az, K, C), *between(z, vz, az, age, 0.001, K, C))
    assert all(isinstance(value, float) for value in results)


@pytest.mark.parametrize(("az", "order"), [(0.0, 2), (1.0, 3)], ids=["velocity", "acceleration"])
def test_error_for_a_sampled_sine_matches_the_next_taylor_term(az: float, order: int) -> None:
    a, w, h = 0.02, 2 * math.pi * 0.8, 1e-3
    worst = 0.0
    for t in np.arange(1250) * h:
        z, vz, slope = a * math.sin(w * t), a * w * math.cos(w * t), -az * a * w * w * math.sin(w * t)
        worst = max(worst, abs(reached(z, vz, slope, h, QUICK, REACH)[0] - a * math.sin(w * (t + h))))
    assert worst == pytest.approx(a * (w * h) ** order / math.factorial(order), rel=1e-3)
