"""The test problem has the stated properties, and its reference solutions are correct."""

from math import cos, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from netboard.benchmarks.physics.problem import (
    BALL,
    MODELS,
    STARTS,
    Array,
    Model,
    Problem,
    Start,
    derivatives,
    drives_at,
    errors_of,
    make_reference,
    multiples,
    node_times,
    push_and_turn,
    styluses_at,
    tight,
)
from netboard.physics.methods.march import make_grid, run
from netboard.physics.scene.models import rates

EVERY = [(model, start) for model in MODELS for start in STARTS]


def by_rk4(problem: Problem, ball: tuple[float, float] | None = None) -> Array:
    """Solve the problem by RK4 in short steps, optionally from another ball state."""
    h = 0.00025
    steps = round(problem.duration / h)
    grid = make_grid("rk4", np.full(steps, h), np.ones(steps, np.int64), problem.parts, 6, problem.scene)
    hands = drives_at(problem.waves, node_times(multiples(steps, h), h, (0.0, 0.5, 1.0)))
    first = problem.first if ball is None else (*problem.first[:4], *ball)
    return run("rk4", first, hands, grid, problem.parts, problem.scene)


def test_hands_stay_within_their_documented_range() -> None:
    z, vz = styluses_at(multiples(10_001, 1e-3))
    assert 0.050 < np.abs(z).max() < 0.0525
    assert 0.42 < np.abs(vz).max() < 0.435
    tilt = np.degrees(np.arcsin((z[:, 1] - z[:, 0]) / 0.5))
    assert -10.0 < tilt.min() < -9.8
    assert 9.5 < tilt.max() < 9.7


def test_velocities_of_hands_are_derivatives_of_their_positions() -> None:
    times = multiples(1000, 1e-2)
    _, vz = styluses_at(times)
    later, _ = styluses_at(times + 1e-6)
    earlier, _ = styluses_at(times - 1e-6)
    np.testing.assert_allclose((later - earlier) / 2e-6, vz, atol=1e-8)


def test_waves_give_the_drives_of_the_hands() -> None:
    problem = Problem("paper", "cold")
    times = multiples(500, 0.02)
    z, vz = styluses_at(times)
    physics = problem.physics
    np.testing.assert_allclose(drives_at(problem.waves, times), physics.k_h * z + physics.c_h * vz, atol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize(("model", "start"), EVERY)
def test_ball_stays_near_the_centre_of_the_board(model: Model, start: Start) -> None:
    assert 0.069 < np.abs(by_rk4(Problem(model, start))[:, 4]).max() < 0.072


@pytest.mark.slow
@pytest.mark.parametrize("model", MODELS)
def test_cold_start_of_the_ball_minimises_its_motion(model: Model) -> None:
    problem = Problem(model, "cold")
    p, vp = BALL[model, "cold"]
    least = np.sum(by_rk4(problem)[:, 4] ** 2)
    for there in ((p + 1e-4, vp), (p - 1e-4, vp), (p, vp + 1e-4), (p, vp - 1e-4)):
        assert np.sum(by_rk4(problem, there)[:, 4] ** 2) > least


@pytest.mark.parametrize("model", MODELS)
def test_settled_start_has_low_angular_acceleration_and_cold_start_high(model: Model) -> None:
    turning = {}
    for start in STARTS:
        problem = Problem(model, start)
        push, turn = push_and_turn(problem.waves.tolist(), 0.0, sin)
        turning[start] = abs(derivatives(problem.physics, problem.first, push, turn, sin, cos)[3])
    assert turning["settled"] < 20.0
    assert turning["cold"] > 1000.0


REACH = st.floats(-0.5, 0.5)


@pytest.mark.parametrize("model", MODELS)
@given(x=st.tuples(REACH, REACH, REACH, REACH, REACH, REACH), left=st.floats(-20, 20), right=st.floats(-20, 20))
def test_explicit_equations_equal_the_kernels(model: Model, x: tuple[float, ...], left: float, right: float) -> None:
    problem = Problem(model, "cold")
    kernels = rates.__wrapped__ if hasattr(rates, "__wrapped__") else getattr(rates, "py_func", rates)
    found = kernels(x, left, right, problem.parts, problem.scene[0])
    expected = derivatives(problem.physics, x, left + right, right - left, sin, cos)
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("model", "start"), EVERY)
def test_reference_agrees_with_radau_on_the_explicit_equations(model: Model, start: Start) -> None:
    problem = Problem(model, start, duration=0.5)
    waves = problem.waves.tolist()

    def rate(t: float, x: Array) -> list[float]:
        return derivatives(problem.physics, x.tolist(), *push_and_turn(waves, t, sin), sin, cos)

    other = solve_ivp(rate, (0.0, 0.5), problem.first, "Radau", problem.times, rtol=1e-9, atol=1e-12)
    reference = make_reference(problem, "tight", tight(problem))
    apart = errors_of(problem, reference, np.ascontiguousarray(other.y.T), 1)
    assert (apart < 1e-7 * reference.scales).all()


def test_reference_reproduces_its_own_forces() -> None:
    problem = Problem("paper", "cold", duration=0.1)
    reference = make_reference(problem, "tight", tight(problem))
    assert (errors_of(problem, reference, reference.states, 1) < 1e-13).all()
    assert reference.scales[3] == np.abs(reference.forces).max()


def test_non_finite_states_have_infinite_error() -> None:
    problem = Problem("paper", "cold", duration=0.1)
    reference = make_reference(problem, "tight", tight(problem))
    states = reference.states.copy()
    states[10, 2] = np.nan
    errors = errors_of(problem, reference, states, 1)
    assert np.isinf(errors[[1, 3]]).all()
    assert (errors[[0, 2]] == 0.0).all()
