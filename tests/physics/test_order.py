"""The classical one-step methods against the equations written independently, solved to 13 digits."""

from typing import Any

import numpy as np
import pytest
from independent import Hands, rates, solution, still, waving
from trajectories import falling, scene_of, trajectory

from netboard.physics.methods.catalogue import METHODS, NUMBER

CLASSICAL = ("euler", "semi_implicit", "heun", "verlet", "midpoint", "rk4", "dop853")
IMPLICIT = ("verlet", "midpoint")

STEEP = {"k_h": 10_000.0, "c_h": 100.0}
SCENES: dict[str, dict[str, Any]] = {
    "one hand, two balls": {"coupling": "left", "balls": 2, "ball_inertia": 0.4},
    "a hinge, with friction": {"board": "hinged", "b_theta": 0.002},
    "no ball": {"balls": 0, "b_z": 0.5},
    "no hand": {"coupling": "none"},
    "level": {"board": "level"},
}


def start_of(scene: Any, free: bool = True) -> tuple[float, ...]:
    """Somewhere near the level, in motion."""
    board = (0.002, 0.01) if scene.parts.heaves else (0.0, 0.0)
    turn = (0.05, 0.2) if scene.parts.tilts else (0.0, 0.0)
    balls = [(0.06 - 0.15 * i, 0.03 if free else 0.0) for i in range((scene.length - 4) // 2)]
    return (*board, *turn, *(value for ball in balls for value in ball))


def errors(scene: Any, method: str, steps: list[int], duration: float, free: bool = True) -> list[float]:
    """The largest difference at the end, of places and angles, in units of their size."""
    start = start_of(scene, free)
    end = solution(start, waving, np.array([0.0, duration]), scene.physics, free)[-1]
    found = [trajectory(scene, start, waving, duration / n, n, method)[-1] for n in steps]
    return [float(np.max(np.abs(x - end)[::2])) for x in found]


@pytest.mark.slow
@pytest.mark.parametrize("model", ["paper", "lagrangian"])
@pytest.mark.parametrize("method", CLASSICAL)
def test_the_error_falls_with_the_order_of_the_method(method: str, model: str) -> None:
    order = METHODS[NUMBER[method]].order
    steps = [6, 12, 24] if order == 8 else [100, 200, 400]
    assert falling(errors(scene_of(model=model), method, steps, 0.048)) == pytest.approx(order, abs=0.2 + order / 10)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["paper", "lagrangian"])
@pytest.mark.parametrize("method", [*IMPLICIT, "semi_implicit"])
@pytest.mark.parametrize("values", SCENES.values(), ids=SCENES)
@pytest.mark.daily(3)
def test_every_scene_can_be_stepped(values: dict[str, Any], method: str, model: str) -> None:
    order = METHODS[NUMBER[method]].order
    assert falling(errors(scene_of(model=model, **values), method, [100, 200], 0.048)) == pytest.approx(order, abs=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["paper", "lagrangian"])
@pytest.mark.parametrize("method", CLASSICAL)
@pytest.mark.daily(4)
def test_a_fixed_ball_stays(method: str, model: str) -> None:
    scene = scene_of(free=False, model=model)
    start = (*start_of(scene, free=False)[:4], 0.1, 0.3)
    states = trajectory(scene, start, waving, 1e-3, 20, method)
    assert np.all(states[:, 4:] == start[4:])


def defect(method: str, x: Any, y: Any, h: float, scene: Any, hands: Hands) -> float:
    """By how much a step from x to y misses what defines the method, as a place."""
    x, y = np.array(x), np.array(y)
    middle = (x + y) / 2
    if method == "verlet":
        middle[::2] = x[::2] + h / 2 * x[1::2]
        miss = np.array(rates(middle, hands(h / 2), scene.physics)) * h - (y - x)
        miss[::2] = h / 2 * (x + y)[1::2] - (y - x)[::2]
    else:
        miss = np.array(rates(middle, hands(h / 2), scene.physics)) * h - (y - x)
    # A velocity that is missed counts by what the couplings let it do.
    miss[1::2] /= 1 + h * scene.physics.c_h / scene.physics.M
    return float(np.max(np.abs(miss[::2])) + h * np.max(np.abs(miss[1::2])))


@pytest.mark.slow
@pytest.mark.parametrize("values", [{}, STEEP, {"k_h": 0.0, "c_h": 100.0}, {"m": 5.0}], ids=str)
@pytest.mark.parametrize("model", ["paper", "lagrangian"])
@pytest.mark.parametrize("method", IMPLICIT)
def test_an_implicit_step_is_solved_to_rounding(method: str, model: str, values: dict[str, Any]) -> None:
    scene, h = scene_of(model=model, **values), 5e-4
    for start in (start_of(scene), (0.0, 0.0, -0.3, 0.0, 0.3, -0.4)):
        x = start
        for _ in range(20):
            y = trajectory(scene, x, waving, h, 1, method)[-1]
            assert defect(method, x, y, h, scene, waving) < 1e-14
            x = tuple(y.tolist())


@pytest.mark.slow
@pytest.mark.parametrize("model", ["paper", "lagrangian"])
@pytest.mark.parametrize("method", IMPLICIT)
def test_motion_without_damping_runs_back_the_way_it_came(method: str, model: str) -> None:
    scene = scene_of(model=model, c_h=0.0)
    start = start_of(scene)
    there = trajectory(scene, start, still, 1e-3, 300, method)[-1]
    assert np.max(np.abs(there - start)) > 0.01
    there[1::2] *= -1
    back = trajectory(scene, tuple(there), still, 1e-3, 300, method)[-1]
    back[1::2] *= -1
    assert back == pytest.approx(np.array(start), abs=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["semi_implicit", "rk4"])
def test_others_do_not(method: str) -> None:
    scene = scene_of(c_h=0.0)
    start = start_of(scene)
    there = trajectory(scene, start, still, 1e-3, 300, method)[-1]
    there[1::2] *= -1
    back = trajectory(scene, tuple(there), still, 1e-3, 300, method)[-1]
    assert np.max(np.abs(back[::2] - np.array(start)[::2])) > 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("damping", [20.0, 100.0])
def test_a_strong_damping_does_not_throw_verlet_off(damping: float) -> None:
    """From rest between hands in motion; steps of a few hundred times what the damping takes."""
    scene = scene_of(c_h=damping, balls=0)
    states = trajectory(scene, (0.0,) * 4, waving, 1e-3, 100, "verlet")
    truth = solution((0.0,) * 4, waving, np.arange(101) * 1e-3, scene.physics)
    assert np.max(np.abs(states - truth)[:, [0, 2]]) < 2e-4
