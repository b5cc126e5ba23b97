"""The reference solutions of the test problem are correct."""

from math import cos, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from evidence.physics.reference import derivatives, errors_of, make_reference, push_and_turn, tight
from netboard.benchmarks.physics.problem import MODELS, STARTS, Array, Model, Problem, Start
from netboard.physics.scene.models import rates

EVERY = [(model, start) for model in MODELS for start in STARTS]


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
