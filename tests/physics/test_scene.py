"""Packing a configuration into constants and parts for the kernels."""

from typing import Any

import pytest

from netboard.base.tables.scene import FRICTION, Physics
from netboard.physics.scene.parameters import SCENE, pack_scene, parts_of, state_length


def test_packed_record_holds_the_configuration() -> None:
    scene = pack_scene(Physics(b_z=0.1, b_theta=0.2, ball_stop=0.3, restitution=0.4, ball_height=0.05))
    assert scene.shape == (1,)
    assert scene.dtype == SCENE
    assert dict(zip(SCENE.names or (), scene[0].item(), strict=True)) == {
        "M": 0.01,
        "m": 0.05,
        "g": 9.81,
        "k_left": 200.0,
        "c_left": 2.0,
        "k_right": 200.0,
        "c_right": 2.0,
        "k_s": 140.0,
        "l": 0.25,
        "I": 0.0004,
        "b_z": 0.1,
        "b_theta": 0.2,
        "ball_gravity": -9.81,
        "mass_ratio": 1.0,
        "ball_height": 0.05,
        "fixed_load": 1.0,
        "stop": 0.3,
        "restitution": 0.4,
        **dict.fromkeys(FRICTION, 0.0),
    }


def test_packed_record_reflects_ball_sign_and_fixed_ball_options() -> None:
    scene = pack_scene(Physics(ball_sign="printed", fixed_ball="carried"))[0]
    assert (scene["ball_gravity"], scene["fixed_load"]) == (9.81, 0.0)


def test_solid_sphere_rolls_with_five_sevenths_of_gravity() -> None:
    scene = pack_scene(Physics(ball_inertia=0.4))[0]
    assert (scene["mass_ratio"], scene["ball_gravity"]) == pytest.approx((5 / 7, -9.81 * 5 / 7))


@pytest.mark.parametrize(
    ("coupling", "left", "right"), [("both", 1, 1), ("left", 1, 0), ("right", 0, 1), ("none", 0, 0)]
)
def test_uncoupled_hands_have_zero_stiffness_and_damping(coupling: Any, left: int, right: int) -> None:
    physics = Physics(coupling=coupling)
    scene = pack_scene(physics)[0]
    assert (scene["k_left"], scene["c_left"]) == (200.0 * left, 2.0 * left)
    assert (scene["k_right"], scene["c_right"]) == (200.0 * right, 2.0 * right)
    assert parts_of(physics).even == (left == right)


PAPER = {
    "lagrangian": False,
    "heaves": True,
    "tilts": True,
    "even": True,
    "damped": False,
    "loaded": True,
    "free": True,
    "stops": False,
    "resisted": False,
    "friction": (False,) * len(FRICTION),
}


def only(law: str) -> dict[str, Any]:
    """The parts that differ if one law of friction applies."""
    return {"resisted": True, "friction": tuple(key == law for key in FRICTION)}


@pytest.mark.parametrize(
    ("values", "free", "differences"),
    [
        ({}, True, {}),
        ({}, False, {"free": False}),
        ({"balls": 0}, True, {"loaded": False, "free": False}),
        ({"model": "lagrangian"}, True, {"lagrangian": True}),
        ({"board": "hinged"}, True, {"heaves": False}),
        ({"board": "level"}, True, {"tilts": False}),
        ({"b_theta": 0.1}, True, {"damped": True}),
        ({"b_theta": 0.1, "board": "level"}, True, {"tilts": False}),
        ({"ball_stop": 0.3}, True, {"stops": True}),
        ({"ball_stop": 0.3}, False, {"free": False}),
        ({"b_p": 0.1}, True, only("b_p")),
        ({"rolling_resistance": 0.1}, True, only("rolling_resistance")),
        ({"rolling_resistance": 0.1}, False, {"free": False}),
        ({"ball_stop": 0.3, "balls": 0}, True, {"loaded": False, "free": False}),
    ],
)
def test_parts_follow_from_the_configuration(values: dict[str, Any], free: bool, differences: dict[str, Any]) -> None:
    assert parts_of(Physics(**values), free)._asdict() == {**PAPER, **differences}


@pytest.mark.parametrize("balls", range(5))
def test_state_length_grows_by_two_per_ball(balls: int) -> None:
    assert state_length(Physics(balls=balls)) == 4 + 2 * balls
