"""The partner's height inferred from the felt force, compared with the statics of the scene."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from netboard.base.tables.experiment import Task
from netboard.base.tables.scene import Physics
from netboard.base.tables.simulated import Participant
from netboard.participants.controller import pack_constants
from netboard.participants.partner import (
    GOAL,
    SIGN,
    follow_goal,
    goal_gains,
    haptic_weight,
    partner_height,
    partner_seen,
    towards_goal,
)
from netboard.participants.submovement import minimum_jerk
from netboard.physics.scene.parameters import pack_scene, parts_of
from netboard.physics.scene.statics import equilibrium

PHYSICS = Physics()
KNOWN = pack_constants(Participant(), PHYSICS, Task(), ("left",))[0]
PARTS, SCENE = parts_of(PHYSICS), pack_scene(PHYSICS)[0]

height = st.floats(-0.02, 0.02)


@given(height, height, st.floats(-0.3, 0.3))
def test_equilibrium_force_determines_the_partner_height(left: float, right: float, p: float) -> None:
    rest = equilibrium(left, right, (p,), parts_of(PHYSICS), SCENE)
    assert partner_height(-rest.left, left, p, SIGN["left"], KNOWN) == pytest.approx(right, abs=2e-4)
    assert partner_height(-rest.right, right, p, SIGN["right"], KNOWN) == pytest.approx(left, abs=2e-4)


def test_ten_millimetres_of_partner_height_change_the_force_by_0_26_newtons() -> None:
    """dF/dz of the partner is 25.93 N/m."""
    lower = partner_height(-0.3, 0.0, 0.0, SIGN["left"], KNOWN)
    higher = partner_height(-0.3 - 0.2593, 0.0, 0.0, SIGN["left"], KNOWN)
    assert higher - lower == pytest.approx(0.010, rel=1e-3)


@given(height, height)
def test_tilt_determines_the_partner_height(left: float, right: float) -> None:
    theta = (right - left) / (2 * PHYSICS.l)
    assert partner_seen(left, theta, SIGN["left"], PHYSICS.l) == pytest.approx(right, abs=1e-12)
    assert partner_seen(right, theta, SIGN["right"], PHYSICS.l) == pytest.approx(left, abs=1e-12)


def test_haptic_weight_minimises_the_variance() -> None:
    """The best linear combination of a noisy delayed view and a noisy touch, found by brute force."""
    seen, drift, apart, felt = 0.002, 1.4e-4, 0.105, 0.003
    rng = np.random.default_rng(1)
    truth = rng.normal(0.0, np.sqrt(drift * apart), 200_000)
    view, touch = rng.normal(0.0, seen, truth.size), truth + rng.normal(0.0, felt, truth.size)
    weights = np.linspace(0.0, 1.0, 201)
    variances = [np.var(weight * touch + (1 - weight) * view - truth) for weight in weights]
    assert haptic_weight(seen, drift, apart, felt) == pytest.approx(weights[np.argmin(variances)], abs=0.01)


@pytest.mark.parametrize(("seen", "felt", "weight"), [(0.0, 0.0, 0.0), (0.0, 0.01, 0.0), (0.01, 0.0, 1.0)])
def test_noise_free_sense_gets_the_full_weight(seen: float, felt: float, weight: float) -> None:
    assert haptic_weight(seen, 0.0, 0.1, felt) == weight


APPROACH = np.array([[0.0, 1.0, 0.0], [-(13.0**2), -26.0, 13.0**2], [0.0, 0.0, 0.0]])
"""d/dt of height, rate and goal of a critically damped approach with 13 rad/s."""


@given(height, st.floats(-0.5, 0.5), height, st.floats(0.0, 0.5))
def test_approach_to_a_goal_matches_the_matrix_exponential(h: float, rate: float, goal: float, dt: float) -> None:
    expected = expm(APPROACH * dt) @ (h, rate, goal)
    assert towards_goal(h, rate, goal, 13.0, dt) == pytest.approx(expected[:2], abs=1e-12)


@given(st.floats(1e-5, 1e-3), st.floats(5e-4, 0.01))
def test_goal_gains_are_those_of_an_iterated_kalman_filter(drift: float, felt: float) -> None:
    advance, noise = expm(APPROACH * 0.01), np.diag([0.0, 0.0, drift * 0.01])
    spread = np.eye(3)
    for _ in range(3000):
        gains = spread[:, 0] / (spread[0, 0] + felt**2)
        spread = advance @ (spread - np.outer(gains, spread[0])) @ advance.T + noise
    assert goal_gains(13.0, drift, felt, 0.01) == pytest.approx(gains, rel=1e-6)


def test_goal_is_estimated_before_a_movement_ends_and_kept_afterwards() -> None:
    """A movement of 10 mm in 0.3 s: half is known before half is done, and the end is right to 5 %."""
    estimate, gains = np.zeros(1, GOAL), goal_gains(13.0, 1.4e-4, 0.002, 0.01)
    estimate["time"] = np.nan
    heights, goals = [], []
    for k in range(150):
        heights.append(0.02 + 0.01 * minimum_jerk((k * 0.01 - 0.1) / 0.3))
        follow_goal(estimate[0], k * 0.01, heights[-1], 13.0, gains)
        goals.append(float(estimate["goal"][0]))
    half = [int(np.argmax(np.array(one) > 0.025)) for one in (heights, goals)]
    assert half[1] < half[0]
    assert goals[0] == 0.02
    assert goals[-1] == pytest.approx(0.03, abs=5e-4)


def test_estimate_of_a_goal_begins_anew_after_a_time_without_force() -> None:
    estimate, gains = np.zeros(1, GOAL), goal_gains(13.0, 1.4e-4, 0.002, 0.01)
    estimate["time"] = np.nan
    for time, height in ((0.0, 0.0), (0.01, 0.0), (0.5, 0.03)):
        follow_goal(estimate[0], time, height, 13.0, gains)
    assert [float(estimate[name][0]) for name in ("height", "rate", "goal")] == [0.03, 0.0, 0.03]


def test_goal_that_cannot_drift_is_not_corrected() -> None:
    assert goal_gains(13.0, 0.0, 0.002, 0.01).tolist() == [0.0, 0.0, 0.0]
