"""The test problem has the stated properties."""

import numpy as np
import pytest

from netboard.benchmarks.physics.problem import (
    BALL,
    MODELS,
    STARTS,
    Array,
    Model,
    Problem,
    Start,
    drives_at,
    multiples,
    node_times,
    styluses_at,
)
from netboard.physics.methods.march import make_grid, run

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
