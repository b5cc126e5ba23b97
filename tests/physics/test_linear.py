"""The matrix of a scene, compared with finite differences of its equations."""

from typing import Any

import numpy as np
import pytest
from independent import rates
from trajectories import scene_of

from netboard.physics.scene.linear import board_matrix, scene_matrix

STEP = 1e-5

SCENES: list[dict[str, Any]] = [
    {},
    {"balls": 0},
    {"balls": 2, "ball_inertia": 0.4, "b_z": 0.3, "b_theta": 0.002},
    {"ball_sign": "printed"},
    {"board": "hinged"},
    {"board": "level", "balls": 2},
    {"fixed_ball": "carried"},
    {"coupling": "left", "g": 0.0},
    {"coupling": "right", "g": 0.0, "board": "hinged"},
    {"coupling": "none", "k_s": 0.0, "g": 0.0},
]
MODELS: list[dict[str, Any]] = [{}, {"model": "lagrangian"}, {"model": "lagrangian", "ball_height": 0.04}]


@pytest.mark.parametrize("free", [True, False])
@pytest.mark.parametrize("model", MODELS, ids=["paper", "lagrangian", "above"])
@pytest.mark.parametrize("values", SCENES, ids=str)
def test_scene_matrix_is_the_jacobian_of_the_rates_at_rest(
    values: dict[str, Any], model: dict[str, Any], free: bool
) -> None:
    scene = scene_of(free, **values, **model)
    k, n = scene.physics, scene.length
    # Hands that carry the weights, so that the board is at rest.
    held = 1.0 if free or k.fixed_ball == "loads_board" else 0.0
    up = (k.M + held * k.balls * k.m) * k.g / (2 * k.k_h)
    slopes = []
    for step in STEP * np.eye(n):
        ahead, behind = (np.array(rates(direction * step, (up, 0.0, up, 0.0), k, free)) for direction in (1, -1))
        slopes.append((ahead - behind) / (2 * STEP))
    a = scene_matrix(scene.parts, scene.record, n)
    expected = np.array(slopes).T
    # Rates of constrained coordinates are 0 and have no slope.
    if not scene.parts.heaves:
        expected[:, 0:2] = 0
    if not scene.parts.tilts:
        expected[:, 2:4] = 0
    assert a == pytest.approx(expected, rel=1e-6, abs=1e-4)


def test_board_matrix_equals_the_scene_matrix_without_balls() -> None:
    scene, bare = scene_of(model="lagrangian", balls=2, ball_height=0.05), scene_of(balls=0)
    assert (board_matrix(scene.parts, scene.record) == scene_matrix(bare.parts, bare.record, 4)).all()
