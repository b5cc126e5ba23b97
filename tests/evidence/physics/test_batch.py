"""Batches of simulations equal the strict step up to rounding, for every kind of scene."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from evidence.physics.batch import LANES, in_blocks, make_batch, out_of_blocks, scene_blocks
from netboard.base.tables.scene import Physics
from netboard.physics.methods.march import make_grid, run
from netboard.physics.scene.parameters import pack_scene, parts_of, state_length

pytestmark = pytest.mark.sampled(1, of="methods of benchmarks", part="batch")

Array = NDArray[np.float64]
H, COUNT = 1e-3, 2 * LANES

SCENES = {
    "paper": Physics(),
    "paper without a ball": Physics(balls=0),
    "paper, three balls": Physics(balls=3),
    "paper, one hand, damped": Physics(coupling="left", b_theta=0.01, b_z=0.1),
    "paper, hinged": Physics(board="hinged"),
    "lagrangian": Physics(model="lagrangian"),
    "lagrangian, two balls": Physics(model="lagrangian", balls=2, ball_inertia=0.4, ball_height=0.02),
    "lagrangian with stops": Physics(model="lagrangian", ball_stop=0.03, restitution=0.5),
}


def initial_states(length: int) -> Array:
    x = np.random.default_rng(1).normal(size=(COUNT, length)) * 0.02
    x[:, [1, 3]] *= 10.0
    return x


def drives_of(physics: Physics, steps: int) -> Array:
    """Polynomials of both drives for every simulation and step, for smooth hand movements."""
    rng = np.random.default_rng(2)
    t = np.arange(steps)[:, None, None] * H
    rate = rng.uniform(2.0, 20.0, (1, COUNT, 2))
    phase = rng.uniform(0.0, 6.0, (1, COUNT, 2))
    size = 0.02 * physics.k_h
    u = size * np.sin(rate * t + phase)
    du = size * rate * np.cos(rate * t + phase)
    hands = np.zeros((steps, COUNT, 8))
    hands[..., 0::4], hands[..., 1::4], hands[..., 2::4] = u, du, -0.5 * rate**2 * u
    return hands


def run_batch(physics: Physics, scenes: NDArray[Any], x: Array, hands: Array) -> Array:
    step = make_batch(parts_of(physics), x.shape[1], len(scenes) > 1)
    blocks, packed = in_blocks(x), scene_blocks(scenes)
    for now in hands:
        step(blocks, in_blocks(now), packed, H)
    return out_of_blocks(blocks)


def run_strict(physics: Physics, scene: NDArray[Any], x: Array, hands: Array) -> Array:
    parts, steps = parts_of(physics), len(hands)
    grid = make_grid("rk4", np.full(steps, H), np.ones(steps, np.int64), parts, len(x), scene)
    return run("rk4", tuple(x.tolist()), np.ascontiguousarray(hands), grid, parts, scene)[-1]


def assert_close(found: Array, selection: Array) -> None:
    scale = np.abs(selection).max(axis=0) + 1e-30
    assert np.max(np.abs(found - selection) / scale) < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.sampled(1)
def test_thousand_batch_steps_equal_the_strict_method(name: str) -> None:
    physics = SCENES[name]
    scene, x, hands = pack_scene(physics), initial_states(state_length(physics)), drives_of(physics, 1000)
    found = run_batch(physics, scene, x, hands)
    some = range(0, COUNT, 17)
    assert_close(found[some], np.array([run_strict(physics, scene, x[i], hands[:, i]) for i in some]))


@pytest.mark.slow
def test_each_simulation_may_have_its_own_scene() -> None:
    rng = np.random.default_rng(3)
    kinds = [replace(Physics(), M=rng.uniform(0.01, 0.1), k_h=rng.uniform(50, 300)) for _ in range(COUNT)]
    scenes = np.concatenate([pack_scene(physics) for physics in kinds])
    x, hands = initial_states(6), drives_of(Physics(), 1000)
    found = run_batch(Physics(), scenes, x, hands)
    some = range(0, COUNT, 17)
    assert_close(found[some], np.array([run_strict(kinds[i], scenes[i : i + 1], x[i], hands[:, i]) for i in some]))


@pytest.mark.parametrize("tilt", [0.78, 0.79, 1.6, 3.0, -2.4, 5.5, -1e3, 1e6])
def test_large_tilts_are_as_accurate_as_small_ones(tilt: float) -> None:
    """This includes tilts at the limit of the small-angle polynomial, which a step crosses."""
    physics, scene = Physics(), pack_scene(Physics())
    x, hands = initial_states(6), drives_of(physics, 1)
    x[5, 2], x[5, 3] = tilt, 10.0
    found = run_batch(physics, scene, x, hands)
    assert np.isfinite(found).all()
    selection = run_strict(physics, scene, x[5], hands[:, 5])
    assert np.allclose(found[5], selection, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e7])
@pytest.mark.parametrize("place", range(6))
def test_non_finite_values_stay_within_their_simulation(bad: float, place: int) -> None:
    physics, scene = Physics(), pack_scene(Physics())
    x, hands = initial_states(6), drives_of(physics, 1)
    selection = run_batch(physics, scene, x, hands)
    x[7, place] = bad
    found = run_batch(physics, scene, x, hands)
    others = np.arange(COUNT) != 7
    assert np.allclose(found[others], selection[others], rtol=1e-14, atol=1e-18)
    assert place == 5 or bad == 1e7 or not np.isfinite(found[7]).all()
    strict = run_strict(physics, scene, x[7], hands[:, 7])
    assert np.array_equal(np.isfinite(found[7]), np.isfinite(strict))


def test_blocks_contain_every_value_once() -> None:
    values = np.arange(COUNT * 5.0).reshape(COUNT, 5)
    blocks = in_blocks(values)
    assert blocks.shape == (2, 5, LANES)
    assert blocks[1, 3, 2] == values[LANES + 2, 3]
    assert np.array_equal(out_of_blocks(blocks), values)


PLAIN = """
import numpy as np
from netboard.base.config import Physics
from evidence.physics.batch import in_blocks, make_batch, out_of_blocks, scene_blocks
from netboard.physics.scene.parameters import pack_scene, parts_of
x = np.linspace(-1.0, 1.0, 64 * 6).reshape(64, 6)
hands = np.linspace(-3.0, 3.0, 64 * 8).reshape(64, 8)
blocks = in_blocks(x)
for model in ("paper", "lagrangian"):
    physics = Physics(model=model)
    make_batch(parts_of(physics), 6, False)(blocks, in_blocks(hands), scene_blocks(pack_scene(physics)), 1e-3)
print(out_of_blocks(blocks).tolist())
"""


@pytest.mark.slow
def test_batch_without_jit_gives_the_same_result() -> None:
    def printed(**environment: str) -> Array:
        run_ = subprocess.run(
            [sys.executable, "-c", PLAIN],
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]), **environment},
            capture_output=True,
            check=True,
            text=True,
        )
        return np.array(eval(run_.stdout))

    assert np.allclose(printed(NUMBA_DISABLE_JIT="1"), printed(), rtol=1e-12, atol=1e-14)
