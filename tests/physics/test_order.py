"""The classical one-step methods, compared with independent equations solved to 13 digits."""

from typing import Any

import numpy as np
import pytest
from independent import Hands, rates, solution, still, waving
from trajectories import convergence_order, scene_of, trajectory

from netboard.physics.methods.catalogue import METHODS, NUMBER

CLASSICAL = ("euler", "semi_implicit", "heun", "verlet", "midpoint", "rk4", "dop853")
IMPLICIT = ("verlet", "midpoint")

STIFF = {"k_h": 10_000.0, "c_h": 100.0}
SCENES: dict[str, dict[str, Any]] = {
    "one hand, two balls": {"coupling": "left", "balls": 2, "ball_inertia": 0.4},
    "a hinge, with friction": {"board": "hinged", "b_theta": 0.002},
    "no ball": {"balls": 0, "b_z": 0.5},
    "no hand": {"coupling": "none"},
    "level": {"board": "level"},
}


def initial_state(scene: Any, free: bool = True) -> tuple[float, ...]:
    """A moving state near the level position."""
    board = (0.002, 0.01) if scene.parts.heaves else (0.0, 0.0)
    turn = (0.05, 0.2) if scene.parts.tilts else (0.0, 0.0)
    balls = [(0.06 - 0.15 * i, 0.03 if free else 0.0) for i in range((scene.length - 4) // 2)]
    return (*board, *turn, *(value for ball in balls for value in ball))


def errors(scene: Any, method: str, steps: list[int], duration: float, free: bool = True) -> list[float]:
    """The largest error of positions and angles at the end, for each number of steps."""
    start = initial_state(scene, free)
    end = solution(start, waving, np.array([0.0, duration]), scene.physics, free)[-1]
    found = [trajectory(scene, start, waving, duration / n, n, method)[-1] for n in steps]
    return [float(np.max(np.abs(x - end)[::2])) for x in found]


@pytest.mark.slow
@pytest.mark.parametrize("model", ["paper", "lagrangian"])
@pytest.mark.parametrize("method", CLASSICAL)
def test_classical_methods_converge_with_their_nominal_order(method: str, model: str) -> None:
    order = METHODS[NUMBER[method]].order
    steps = [6, 12, 24] if order == 8 else [100, 200, 400]
    assert convergence_order(errors(scene_of(model=model), method, steps, 0.048)) == pytest.approx(
        order, abs=0.2 + order / 10
    )


@pytest.mark.slow
@pytest.mark.parametrize("model", ["paper", "lagrangian"])
@pytest.mark.parametrize("method", [*IMPLICIT, "semi_implicit"])
@pytest.mark.parametrize("values", SCENES.values(), ids=SCENES)
@pytest.mark.sampled(3)
def test_methods_keep_their_order_in_every_scene(values: dict[str, Any], method: str, model: str) -> None:
    order = METHODS[NUMBER[method]].order
    assert convergence_order(errors(scene_of(model=model, **values), method, [100, 200], 0.048)) == pytest.approx(
        order, abs=0.3
    )


@pytest.mark.slow
@pytest.mark.parametrize("model", ["paper", "lagrangian"])
@pytest.mark.parametrize("method", CLASSICAL)
@pytest.mark.sampled(4)
def test_fixed_ball_does_not_move(method: str, model: str) -> None:
    scene = scene_of(free=False, model=model)
    start = (*initial_state(scene, free=False)[:4], 0.1, 0.3)
    states = trajectory(scene, start, waving, 1e-3, 20, method)
    assert np.all(states[:, 4:] == start[4:])


def residual(method: str, x: Any, y: Any, h: float, scene: Any, hands: Hands) -> float:
    """Residual of the equations that define the method, for a step from x to y, as a position."""
    x, y = np.array(x), np.array(y)
    middle = (x + y) / 2
    if method == "verlet":
        middle[::2] = x[::2] + h / 2 * x[1::2]
        miss = np.array(rates(middle, hands(h / 2), scene.physics)) * h - (y - x)
        miss[::2] = h / 2 * (x + y)[1::2] - (y - x)[::2]
    else:
        miss = np.array(rates(middle, hands(h / 2), scene.physics)) * h - (y - x)
    # Velocity residuals are weighted by the damping of the couplings.
    miss[1::2] /= 1 + h * scene.physics.c_h / scene.physics.M
    return float(np.max(np.abs(miss[::2])) + h * np.max(np.abs(miss[1::2])))


@pytest.mark.slow
@pytest.mark.parametrize("values", [{}, STIFF, {"k_h": 0.0, "c_h": 100.0}, {"m": 5.0}], ids=str)
@pytest.mark.parametrize("model", ["paper", "lagrangian"])
@pytest.mark.parametrize("method", IMPLICIT)
def test_implicit_step_is_solved_to_rounding_error(method: str, model: str, values: dict[str, Any]) -> None:
    scene, h = scene_of(model=model, **values), 5e-4
    for start in (initial_state(scene), (0.0, 0.0, -0.3, 0.0, 0.3, -0.4)):
        x = start
        for _ in range(20):
            y = trajectory(scene, x, waving, h, 1, method)[-1]
            assert residual(method, x, y, h, scene, waving) < 1e-14
            x = tuple(y.tolist())


@pytest.mark.slow
@pytest.mark.parametrize("model", ["paper", "lagrangian"])
@pytest.mark.parametrize("method", IMPLICIT)
def test_implicit_methods_are_time_reversible_without_damping(method: str, model: str) -> None:
    scene = scene_of(model=model, c_h=0.0)
    start = initial_state(scene)
    forward = trajectory(scene, start, still, 1e-3, 300, method)[-1]
    assert np.max(np.abs(forward - start)) > 0.01
    forward[1::2] *= -1
    backward = trajectory(scene, tuple(forward), still, 1e-3, 300, method)[-1]
    backward[1::2] *= -1
    assert backward == pytest.approx(np.array(start), abs=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["semi_implicit", "rk4"])
def test_other_methods_are_not_time_reversible(method: str) -> None:
    scene = scene_of(c_h=0.0)
    start = initial_state(scene)
    forward = trajectory(scene, start, still, 1e-3, 300, method)[-1]
    forward[1::2] *= -1
    backward = trajectory(scene, tuple(forward), still, 1e-3, 300, method)[-1]
    assert np.max(np.abs(backward[::2] - np.array(start)[::2])) > 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("damping", [20.0, 100.0])
def test_verlet_stays_accurate_under_strong_damping(damping: float) -> None:
    """From rest, with moving hands; each step lasts several times the time constant of the damping."""
    scene = scene_of(c_h=damping, balls=0)
    states = trajectory(scene, (0.0,) * 4, waving, 1e-3, 100, "verlet")
    truth = solution((0.0,) * 4, waving, np.arange(101) * 1e-3, scene.physics)
    assert np.max(np.abs(states - truth)[:, [0, 2]]) < 2e-4
