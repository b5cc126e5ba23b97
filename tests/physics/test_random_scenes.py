"""Random scenes with smoothly moving hands: finite states, mirror symmetry and energy balance."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from independent import Hands
from trajectories import Scene, sampled_trajectory, samples, scene_of, trajectory

import sampling
from evidence.physics.statics import equilibrium
from netboard.base.errors import ConfigError
from netboard.physics.scene.energy import stored_along, work_along
from netboard.physics.stability.method_choice import choose

TICK = 1e-3
EXAMPLES = 40 if sampling.ALL else 20


def log_uniform(least: float, most: float) -> st.SearchStrategy[float]:
    """Draw floats whose logarithm is uniform."""
    return st.floats(math.log(least), math.log(most)).map(math.exp)


NUMBERS = {
    "M": log_uniform(1e-3, 10),
    "m": log_uniform(1e-3, 10),
    "I": log_uniform(1e-5, 10),
    "l": log_uniform(0.05, 2),
    "g": st.floats(0, 30),
    "k_h": log_uniform(1, 10_000),
    "c_h": log_uniform(0.01, 100),
    "k_s": st.floats(0, 10_000),
    "ball_inertia": st.floats(0, 1),
}
ROLLING = {"model": "lagrangian", "balls": 2, "coupling": "right"}
KINDS: list[dict[str, Any]] = [{}, {"board": "level"}, {"model": "lagrangian", "board": "hinged"}, ROLLING]
ROLLING_VALUES: list[dict[str, Any]] = [
    {"b_theta": log_uniform(1e-3, 1), "b_z": log_uniform(1e-2, 10)},
    {"ball_height": st.floats(0.001, 0.2)},
]


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    """Scenes that the server would load."""
    kind = draw(st.sampled_from(KINDS))
    values = kind | {name: draw(numbers) for name, numbers in NUMBERS.items()}
    if kind is ROLLING:
        values |= {name: draw(numbers) for extra in ROLLING_VALUES for name, numbers in extra.items()}
    scene = scene_of(**values)
    try:
        choose(scene.physics, TICK)
    except ConfigError:
        assume(False)
    return scene


@st.composite
def smooth_hands(draw: st.DrawFn) -> Hands:
    """Hands that each move sinusoidally, by up to 0.1 of the board's arm and up to 3 Hz, for a unit arm."""
    size, hertz, phase = st.floats(0, 0.1), st.floats(0.2, 3), st.floats(0, 6.3)
    waves = [(draw(size), 2 * math.pi * draw(hertz), draw(phase)) for _ in range(2)]

    def hands(t: float) -> tuple[float, float, float, float]:
        (a, w, f), (b, v, q) = waves
        return (
            a * math.sin(w * t + f),
            a * w * math.cos(w * t + f),
            b * math.sin(v * t + q),
            b * v * math.cos(v * t + q),
        )

    return hands


def scaled(hands: Hands, arm: float, swapped: bool = False) -> Hands:
    """The hands scaled to an arm, optionally with the sides swapped."""

    def moved(t: float) -> tuple[float, float, float, float]:
        left_z, left_vz, right_z, right_vz = (arm * value for value in hands(t))
        return (right_z, right_vz, left_z, left_vz) if swapped else (left_z, left_vz, right_z, right_vz)

    return moved


def initial_state(scene: Scene) -> tuple[float, ...]:
    """The board at its equilibrium, if it has one, with balls near its centre."""
    p = (0.02, -0.01)[: scene.physics.balls]
    try:
        rest = equilibrium(0.0, 0.0, p, scene.parts, scene.record)
        z, theta = (rest.z, rest.theta) if abs(rest.theta) < 0.3 else (0.0, 0.0)
    except ValueError:
        z, theta = 0.0, 0.0
    return (z, 0.0, theta, 0.0, *(value for place in p for value in (place, 0.0)))


def mirror(x: Any) -> Any:
    """The mirror image of a state."""
    return (*x[:2], *(-value for value in x[2:]))


@pytest.mark.slow
@pytest.mark.timeout(300)
@settings(max_examples=EXAMPLES)
@given(scenes(), smooth_hands())
@example(scene_of(), lambda t: (0.0, 0.0, 0.0, 0.0))
@pytest.mark.sampled(1, of="any scene")
def test_accepted_scene_stays_finite_and_mirror_symmetric(scene: Scene, hands: Hands) -> None:
    physics, choice = scene.physics, choose(scene.physics, TICK)
    opposite = {"left": "right", "right": "left"}.get(physics.coupling, physics.coupling)
    mirrored_scene = scene_of(**{name: getattr(physics, name) for name in physics.__slots__} | {"coupling": opposite})
    start, h, steps = initial_state(scene), TICK / choice.substeps, 100 * choice.substeps
    path = trajectory(scene, start, scaled(hands, physics.l), h, steps, choice.method)
    mirrored_path = trajectory(mirrored_scene, mirror(start), scaled(hands, physics.l, True), h, steps, choice.method)
    assert np.isfinite(path).all()
    assert (np.array([mirror(x) for x in mirrored_path]) == path).all()


@pytest.mark.slow
@pytest.mark.timeout(300)
@settings(max_examples=EXAMPLES)
@given(scenes(), smooth_hands())
@example(scene_of(), lambda t: (0.0, 0.0, 0.0, 0.0))
@pytest.mark.sampled(1, of="any scene")
def test_energy_change_of_any_scene_equals_the_work_done(scene: Scene, hands: Hands) -> None:
    """With steps that are short compared with the fastest time constant."""
    fastest = choose(scene.physics, TICK).stiffness / TICK
    h = min(0.1 / fastest, TICK) if fastest > 0 else TICK
    hands = scaled(hands, scene.physics.l)
    path = sampled_trajectory(scene, initial_state(scene), hands, h, 100)
    times = np.arange(101) * h
    at = samples(hands, times)
    held = stored_along(path, at, scene.parts, scene.packed)
    work = work_along(times, path, at, scene.parts, scene.packed)
    change = held.sum(axis=1) - held[0].sum()
    # A hand may move so little that energies are subnormal: these have no relative precision.
    tolerance = 1e-9 * np.abs(held).max() + 1e-9 * np.abs(work).max() + 1e-300
    assert np.abs(change - work.sum(axis=1)).max() <= tolerance
