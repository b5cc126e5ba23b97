"""Friction of a ball: each law, and decelerating balls, compared with closed forms."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from independent import solution, still, waving
from numpy.typing import NDArray
from trajectories import Scene, convergence_order, scene_of, trajectory

from netboard.base.config import Config, parse
from netboard.base.errors import ConfigError
from netboard.base.tables.friction import MAX_SPEED, SMOOTHING_SPEED, Friction
from netboard.base.tables.scene import FRICTION, friction_rate
from netboard.base.tick import TICK_SECONDS
from netboard.physics.simulation import choose_steps
from netboard.physics.stability.method_choice import choose

SPEED = 0.1
LOAD = 0.05 * 9.81
EVERY = pytest.mark.parametrize("law", FRICTION.values(), ids=FRICTION.keys())
BOTH = pytest.mark.parametrize("model", ["paper", "lagrangian"])
LEVEL: dict[str, Any] = {"board": "level", "ball_inertia": 0.4}
START = (0.0, 0.0, 0.0, 0.0, -0.1, SPEED)


def rolling_states(scene: Scene, seconds: float, method: str = "rk4", h: float = 1e-3) -> NDArray[np.float64]:
    """States of a ball released at -0.1 m with `SPEED`."""
    return trajectory(scene, START, still, h, round(seconds / h), method)


# --- laws ------------------------------------------------------------------------------------------------------------


@EVERY
@given(speed=st.floats(-5, 5), coefficient=st.floats(0, 1))
def test_friction_law_is_odd_and_opposes_motion(law: Friction, speed: float, coefficient: float) -> None:
    force = law.force(coefficient, speed, LOAD)
    assert law.force(coefficient, -speed, LOAD) == -force
    assert force * speed >= 0


@EVERY
def test_friction_slope_is_the_largest_derivative_of_the_law(law: Friction) -> None:
    speeds = np.concatenate([np.linspace(0.0, 0.1, 10_001), np.linspace(0.1, MAX_SPEED, 10_001)[1:]])
    slopes = np.gradient([law.force(0.01, float(v), LOAD) for v in speeds], speeds)
    assert slopes.max() == pytest.approx(law.slope(0.01, LOAD), rel=1e-3)


def test_rolling_resistance_is_proportional_to_load_above_a_few_mm_per_second() -> None:
    force = FRICTION["rolling_resistance"].force
    assert force(0.01, 0.2, LOAD) == pytest.approx(0.01 * LOAD, rel=1e-4)
    assert force(0.01, -0.2, LOAD) == pytest.approx(-0.01 * LOAD, rel=1e-4)


# --- closed forms, on a level board ----------------------------------------------------------------------------------


@BOTH
def test_viscous_friction_slows_a_ball_exponentially(model: str) -> None:
    scene = scene_of(model=model, b_p=0.07, **LEVEL)
    rate = 0.07 * (5 / 7) / 0.05
    states = rolling_states(scene, 2.0)
    t = np.arange(len(states)) * 1e-3
    assert states[:, 5] == pytest.approx(SPEED * np.exp(-rate * t), abs=1e-12)
    assert states[:, 4] == pytest.approx(-0.1 + SPEED / rate * (1 - np.exp(-rate * t)), abs=1e-12)
    assert rolling_states(scene, 30.0)[-1, 4] + 0.1 == pytest.approx(SPEED / rate, abs=1e-12)  # distance to rest


@BOTH
def test_rolling_resistance_stops_a_ball_by_constant_deceleration(model: str) -> None:
    scene = scene_of(model=model, rolling_resistance=0.01, **LEVEL)
    deceleration = 0.01 * 9.81 * 5 / 7
    states = rolling_states(scene, 1.0)
    assert states[:, 5] == pytest.approx(SPEED - deceleration * np.arange(len(states)) * 1e-3, abs=1e-4)
    root = math.hypot(SPEED, SMOOTHING_SPEED)
    smooth = (SPEED * root + SMOOTHING_SPEED**2 * math.asinh(SPEED / SMOOTHING_SPEED)) / (2 * deceleration)
    rest = rolling_states(scene, 4.0)[-1]
    assert rest[4] + 0.1 == pytest.approx(smooth, abs=1e-9)
    assert rest[4] + 0.1 == pytest.approx(SPEED**2 / (2 * deceleration), rel=5e-3)
    assert abs(rest[5]) < 1e-15


# --- methods and choices ---------------------------------------------------------------------------------------------


@pytest.mark.slow
@BOTH
@pytest.mark.parametrize(
    ("method", "order"), [("rk4", 4), ("etdrk4", 4), ("etd2rk", 2), ("midpoint", 2), ("verlet", 2)]
)
def test_methods_keep_their_order_with_friction(model: str, method: str, order: int) -> None:
    scene = scene_of(model=model, b_p=0.05, rolling_resistance=0.01, ball_inertia=0.4)
    start, end = (0.002, 0.1, 0.05, -1.0, 0.1, 0.03), 0.048
    true = solution(start, waving, np.array([0.0, end]), scene.physics)[-1]
    ends = [trajectory(scene, start, waving, end / steps, steps, method)[-1] for steps in (96, 192, 384)]
    assert convergence_order([abs(found[5] - true[5]) for found in ends]) > order - 0.3


def test_exact_method_is_rejected_with_ball_friction() -> None:
    scene = scene_of(b_p=0.01, **LEVEL)
    assert choose(scene_of(**LEVEL).physics, TICK_SECONDS).method == "exact"
    assert choose(scene.physics, TICK_SECONDS).method == "rk4"
    with pytest.raises(ConfigError, match="without friction"):
        choose(scene_of(b_p=0.01, method="exact", **LEVEL).physics, TICK_SECONDS)
    with pytest.raises(ConfigError, match="without friction"):
        choose_steps(scene.physics, method="exact")
    with pytest.raises(ConfigError, match='it is for board = "level" without friction'):
        parse('[physics]\nboard = "level"\nmethod = "exact"\nb_p = 0.01')


def test_friction_requires_a_ball_and_may_not_stop_it_within_a_tick() -> None:
    assert friction_rate(Config().physics) == 0
    with pytest.raises(ConfigError, match=r"rolling_resistance: found 0\.01, which needs balls = 1 or more"):
        parse("[physics]\nballs = 0\nrolling_resistance = 0.01")
    with pytest.raises(ConfigError, match=r"b_p: found 80, which can stop a ball within a tick; .* 0\.625 times"):
        parse("[physics]\nb_p = 80.0")
    physics = parse("[physics]\nb_p = 50.0").physics
    assert friction_rate(physics) == pytest.approx(1000.0)
    assert choose_steps(physics, substeps=2).longest <= 1e-3
