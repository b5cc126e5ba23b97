"""The multistep methods against the equations written independently, solved to 13 digits."""

from typing import Any

import numpy as np
import pytest
from independent import solution, waving
from trajectories import Scene, drive, falling, scene_of

from netboard.benchmarks.physics.multistep import MULTISTEP, prepare_multistep

pytestmark = pytest.mark.daily(1, of="methods of benchmarks", part="multistep")

START = (0.002, 0.01, 0.05, 0.2, 0.03, 0.02)
DURATION = 0.32
ORDERS = {method.name: method.order for method in MULTISTEP}
STEPS = {"etd_ab2": 160, "etd_ab4": 40, "etd_ab6": 20, "etd_pece6": 20}
OTHERS: dict[str, dict[str, Any]] = {
    "one hand, two balls": {"coupling": "left", "balls": 2},
    "hinge": {"board": "hinged", "b_theta": 0.001},
    "level": {"board": "level"},
    "no ball": {"balls": 0},
    "lagrangian": {"model": "lagrangian", "balls": 2, "ball_height": 0.02},
}


def start_of(scene: Scene) -> tuple[float, ...]:
    """Somewhere near the level, in motion."""
    start = (*START, -0.02, 0.0)[: scene.length]
    heave = start[:2] if scene.parts.heaves else (0.0, 0.0)
    return (*heave, *(start[2:4] if scene.parts.tilts else (0.0, 0.0)), *start[4:])


def states_of(scene: Scene, name: str, n: int, every: int = 1, since: float = 0.0, start: Any = None) -> Any:
    """A run of so many steps, with the hands as they are since a time."""
    h = DURATION / n
    hands = np.array([drive(waving(since + i * h), scene.record) for i in range(n + 1)])
    return prepare_multistep(name, start or start_of(scene), hands, h, scene.parts, scene.packed, every)()


@pytest.mark.slow
@pytest.mark.parametrize("name", ORDERS)
@pytest.mark.daily(1)
def test_the_error_falls_with_the_order_of_the_method(name: str) -> None:
    """From when the transients of the start are over: they are fast for these steps."""
    scene = scene_of()
    start, end = solution(START, waving, np.array([0.0, 0.25, 0.25 + DURATION]), scene.physics)[1:]
    errors = [
        float(np.max(np.abs(states_of(scene, name, n, since=0.25, start=tuple(start.tolist()))[-1] - end)[::2]))
        for n in (STEPS[name], 2 * STEPS[name], 4 * STEPS[name])
    ]
    assert falling(errors) == pytest.approx(ORDERS[name], abs=1.0 if name == "etd_pece6" else 0.4)


@pytest.mark.slow
@pytest.mark.parametrize("values", OTHERS.values(), ids=OTHERS)
@pytest.mark.parametrize("free", [True, False], ids=["rolling", "fixed"])
@pytest.mark.daily(1)
def test_every_scene_can_be_run(free: bool, values: dict[str, Any]) -> None:
    scene = scene_of(free, **values)
    start = start_of(scene)
    times = np.linspace(0.0, DURATION, 1281)
    expected = solution(start, waving, times, scene.physics, free)
    found = states_of(scene, "etd_pece6", 1280)
    assert np.max(np.abs(found - expected)[:, ::2]) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", ["etd_ab4", "etd_pece6"])
@pytest.mark.parametrize("every", [3, 8, 50])
def test_a_part_of_the_states_can_be_kept(every: int, name: str) -> None:
    scene = scene_of()
    assert np.array_equal(states_of(scene, name, 100, every), states_of(scene, name, 100)[::every])


def test_what_has_no_smooth_history_is_refused() -> None:
    with pytest.raises(ValueError, match="stops"):
        states_of(scene_of(ball_stop=0.3), "etd_ab2", 100)
    with pytest.raises(ValueError, match="7 steps"):
        states_of(scene_of(), "etd_ab2", 6)
