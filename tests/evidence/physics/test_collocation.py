"""Exponential collocation against an independent implementation of the equations, solved to 13 digits."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from independent import Hands, solution, waving
from trajectories import Scene, convergence_order, drive, scene_of

from evidence.physics.collocation import gauss_nodes, make_collocation, make_tables

pytestmark = pytest.mark.sampled(1, of="methods of benchmarks", part="collocation")

START = (0.002, 0.01, 0.05, 0.2, 0.03, 0.02)
DURATION = 0.16
KINDS: dict[str, dict[str, Any]] = {
    "both hands": {},
    "one hand, two balls": {"coupling": "left", "balls": 2, "b_z": 0.3},
    "hinge": {"board": "hinged", "b_theta": 0.001},
    "level": {"board": "level"},
    "no ball": {"balls": 0},
    "four balls": {"balls": 4},
    "lagrangian": {"model": "lagrangian", "ball_inertia": 0.4, "ball_height": 0.02},
    "lagrangian, one hand, two balls": {"model": "lagrangian", "coupling": "right", "balls": 2},
}
TOLERANCE = 1e-15
"""The iteration ends when the remaining change of position in a step is smaller [m, rad]."""

ROUNDING = 5e-17
"""Rounding error of an acceleration over the largest element of A: the last digits of the state [m, rad]."""

PLAIN = """
import json, sys
sys.path[:0] = {path!r}
import test_collocation as own
print(json.dumps(own.states_of(own.scene_of(), 0.02, 8).tolist()))
"""


def start_of(scene: Scene) -> tuple[float, ...]:
    """A moving state near level."""
    start = (*START, -0.02, 0.0, 0.01, 0.1, -0.05, 0.2)[: scene.length]
    heave = start[:2] if scene.parts.heaves else (0.0, 0.0)
    return (*heave, *(start[2:4] if scene.parts.tilts else (0.0, 0.0)), *start[4:])


def states_of(
    scene: Scene, h: float, nodes: int, every: int = 1, hands: Hands = waving, start: tuple[float, ...] | None = None
) -> Any:
    """Solve over `DURATION` and return the states."""
    n, places = round(DURATION / h), [float(c) for c in gauss_nodes(nodes)]
    table = np.array([[drive(hands((i + c) * h), scene.record) for c in places] for i in range(n)])
    x, out = start or start_of(scene), np.empty((n // every + 1, scene.length))
    tables = make_tables(scene.parts, scene.record, scene.length, h, nodes)
    bound = max(TOLERANCE / (h * h), ROUNDING * float(np.abs(tables.a).max()))
    march = make_collocation(scene.parts, scene.length, nodes)
    march(x, table, bound, *vars(tables).values(), scene.packed, every, out)
    return out


def error(found: Any, expected: Any) -> float:
    """The largest difference of a position or an angle."""
    return float(np.max(np.abs(found - expected)[..., ::2]))


@pytest.mark.slow
def test_order_of_convergence_is_twice_the_number_of_nodes() -> None:
    """Start after the initial transients, which are fast for these steps."""
    scene = scene_of()
    start, end = solution(START, waving, np.array([0.0, 0.4, 0.4 + DURATION]), scene.physics)[1:]

    def later(t: float) -> tuple[float, float, float, float]:
        return waving(0.4 + t)

    def slope(nodes: int, steps: tuple[int, ...]) -> float:
        runs = [states_of(scene, DURATION / n, nodes, hands=later, start=tuple(start.tolist())) for n in steps]
        return convergence_order([error(states[-1], end) for states in runs])

    assert slope(4, (8, 16, 32)) == pytest.approx(8.0, abs=0.5)
    assert slope(8, (1, 2)) > 8.0


@pytest.mark.slow
@pytest.mark.parametrize("values", KINDS.values(), ids=KINDS)
@pytest.mark.parametrize("free", [True, False], ids=["rolling", "fixed"])
@pytest.mark.sampled(2)
def test_every_scene_is_solved_to_twelve_digits(free: bool, values: dict[str, Any]) -> None:
    scene = scene_of(free, **values)
    times = np.linspace(0.0, DURATION, 65)
    expected = solution(start_of(scene), waving, times, scene.physics, free)
    assert error(states_of(scene, DURATION / 64, 8), expected) < 1e-12


def flipping(t: float) -> tuple[float, float, float, float]:
    """Hands that tilt the board far from level."""
    return -0.24 * np.sin(8 * t), -1.92 * np.cos(8 * t), 0.24 * np.sin(8 * t), 1.92 * np.cos(8 * t)


@pytest.mark.slow
def test_large_tilts_are_solved() -> None:
    scene = scene_of(balls=0)
    times = np.linspace(0.0, DURATION, 81)
    expected = solution(start_of(scene), flipping, times, scene.physics)
    assert np.abs(expected[:, 2]).max() > 0.9
    assert error(states_of(scene, 2e-3, 8, hands=flipping), expected) < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("every", [3, 16])
def test_every_nth_state_can_be_kept(every: int) -> None:
    scene = scene_of()
    assert np.array_equal(states_of(scene, 0.01, 8, every), states_of(scene, 0.01, 8)[::every])


@pytest.mark.slow
def test_ball_bounces_off_a_stop() -> None:
    scene = scene_of(ball_stop=0.05, restitution=1.0)
    states = states_of(scene, 0.01, 8, start=(0.0, 0.0, 0.0, 0.0, 0.04, 0.5))
    assert states[:, 4].max() == pytest.approx(0.05)
    assert states[-1, 5] == pytest.approx(-0.5, abs=0.2)


@pytest.mark.slow
def test_collocation_without_jit_gives_the_same_result(tmp_path: Path) -> None:
    tests = Path(__file__).parents[2]
    script = PLAIN.format(path=[str(Path(__file__).parent), str(tests), str(tests / "physics")])
    done = subprocess.run(
        [sys.executable, "-c", script],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert np.array(json.loads(done.stdout)) == pytest.approx(states_of(scene_of(), 0.02, 8), rel=1e-11, abs=1e-13)
