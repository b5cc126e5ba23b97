"""Rendered parts of the force: reference values, their sum, and the board at equilibrium."""

import math
from dataclasses import replace
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from trajectories import scene_of

from evidence.physics.statics import equilibrium
from netboard.base.config import Config, parse
from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import Block
from netboard.base.tables.forces import CONDITIONS, FORCES, ForceInputs
from netboard.base.tables.scene import Physics
from netboard.physics.scene.parameters import pack_scene, parts_of
from netboard.physics.scene.rendering import (
    GAINS,
    NO_FORCE,
    TRIAL_ENTRIES,
    Rendering,
    force_on_hand,
    gains_of,
    is_catch,
    pack_rendering,
    rendering_of,
    scale_in,
)

PAPER = scene_of()
LEFT = np.array([(0.218, 25.93, 25.93, -0.981)], GAINS)[0]


def gains(**values: Any) -> tuple[Any, Any]:
    scene = scene_of(**values)
    left, right = gains_of(scene.parts, scene.record)
    return np.array([left], GAINS)[0], np.array([right], GAINS)[0]


def rendering_for(force: str, **values: Any) -> Rendering:
    return rendering_of(Block(force=force, unrelated="a.mcap" if force == "unrelated" else "", **values))


def left_hand_force(force: str, own_z: float = 0.01, partner_z: float = 0.02, p: float = 0.1, **values: Any) -> float:
    """Force on the left hand in the paper's scene, with a coupling force of 0.3 N and an unrelated force of 0.7 N."""
    hand = ForceInputs(0.3, own_z, partner_z, 0.0, 0.0, p, values.pop("other", 0.7), LEFT)
    return force_on_hand(hand, 0.5, rendering_for(force, **values))


def test_paper_scene_has_the_derived_gains() -> None:
    left, right = gains()
    for hand, sign in ((left, -1), (right, 1)):
        assert hand["weight"] == pytest.approx(0.218, abs=5e-4)
        assert hand["own"] == pytest.approx(25.93, abs=5e-3)
        assert hand["partner"] == pytest.approx(25.93, abs=5e-3)
        assert hand["ball"] == pytest.approx(sign * 0.981, abs=5e-4)


def test_gains_of_an_even_board_match_closed_forms() -> None:
    left, right = gains()
    a, weight = 200 / 540, 0.06 * 9.81
    expected = (a * weight, 140 * a / 2, 140 * a / 2, 0.05 * 9.81 / 0.5)
    assert tuple(right) == pytest.approx(expected, rel=1e-14)
    assert tuple(left) == pytest.approx((*expected[:3], -expected[3]), rel=1e-14)


def test_force_conditions_match_the_options_of_the_configuration() -> None:
    assert set(FORCES) == set(get_args(get_type_hints(Block)["force"]))


@pytest.mark.parametrize(
    ("force", "expected"),
    [
        ("full", -0.3),
        ("partner_only", -25.93 * 0.02),
        ("environment_only", -(0.218 + 25.93 * 0.01 - 0.0981)),
        ("none", 0.0),
        ("unrelated", 0.7),
        ("own_only", -(0.218 + 25.93 * 0.01)),
    ],
)
def test_each_condition_renders_its_part_of_the_force(force: str, expected: float) -> None:
    assert left_hand_force(force) == pytest.approx(expected, abs=1e-15)


def test_force_scale_multiplies_the_force_of_every_condition() -> None:
    for force in FORCES:
        assert left_hand_force(force, force_scale=0.5) == 0.5 * left_hand_force(force)


def test_partner_only_force_depends_on_the_partner_and_no_other_force_does() -> None:
    """Forces rendered without the partner stay bit-identical when the partner moves, and vice versa."""
    for z in (-0.07, 0.0, 0.03):
        for force in ("environment_only", "own_only", "unrelated", "none"):
            assert left_hand_force(force, partner_z=z) == left_hand_force(force)
        assert left_hand_force("own_only", partner_z=z, p=10 * z) == left_hand_force("own_only")
        assert left_hand_force("partner_only", own_z=z, p=10 * z) == left_hand_force("partner_only")
    assert left_hand_force("partner_only", partner_z=0.0) == 0.0


@pytest.mark.parametrize("other", [math.nan, math.inf, -math.inf])
def test_non_finite_recorded_force_is_rendered_as_zero(other: float) -> None:
    assert left_hand_force("unrelated", other=other) == 0.0


scenes = st.fixed_dictionaries(
    {
        "board": st.sampled_from(["free", "hinged", "level"]),
        "coupling": st.sampled_from(["both", "left", "right"]),
        "model": st.sampled_from(["paper", "lagrangian"]),
        "balls": st.sampled_from([0, 1]),
        "fixed_ball": st.sampled_from(["loads_board", "carried"]),
        "free": st.booleans(),
        "k_h": st.floats(50.0, 2000.0),
        "k_s": st.sampled_from([0.0, 10.0, 140.0, 2000.0]),
        "M": st.floats(0.001, 0.5),
    }
)
heights = st.floats(-0.05, 0.05)


@given(scenes, st.floats(0.2, 3.0), st.sampled_from([0.0, 0.03]), heights, heights, st.floats(-0.3, 0.3))
def test_gains_are_the_derivatives_of_the_equilibrium_forces(
    values: dict[str, Any], uneven: float, above: float, left_z: float, right_z: float, p: float
) -> None:
    """For any scene with unequal couplings, the gains agree with the exact equilibrium near the level board."""
    above = above if values["model"] == "lagrangian" and values["balls"] else 0.0
    scene = scene_of(**values, ball_height=above)
    record = scene.record.copy()
    record["k_right"] *= uneven
    parts, balls = scene.parts._replace(even=False), (p,) * values["balls"]

    def rest(scale: float) -> Any:
        return equilibrium(scale * left_z, scale * right_z, tuple(scale * at for at in balls), parts, record)

    record["M"] = record["m"] = 0.0  # without weights, small displacements and loads, the board stays nearly level
    try:
        gains_of(parts, record)
    except ConfigError:
        assume(False)
    for mass, ball in ((0.0, 0.0), (values["M"], 0.0), (values["M"], 1e-4)):
        record["M"], record["m"] = mass * 1e-3, ball
        left, right = gains_of(parts, record)
        at = rest(1e-4)
        found = [
            hand[0] + 1e-4 * (hand[1] * own + hand[2] * other + hand[3] * sum(balls))
            for hand, own, other in ((left, left_z, right_z), (right, right_z, left_z))
        ]
        size = 1e-4 * 2000.0 * 0.05 + record["M"] * 9.81 + ball * 9.81
        assert found == pytest.approx([at.left, at.right], abs=2e-4 * size)


@given(scenes, st.floats(0.2, 3.0))
def test_gains_agree_with_a_linear_solver_and_mirror_bit_identically(values: dict[str, Any], uneven: float) -> None:
    scene = scene_of(**(values | {"board": "free", "coupling": "both", "k_s": 140.0}))
    record, mirrored = scene.record.copy(), scene.record.copy()
    record["k_right"] *= uneven
    mirrored["k_left"] *= uneven
    k, arm, s = (float(record["k_left"]), float(record["k_right"])), float(record["l"]), float(record["k_s"])
    load = 0.05 * 9.81 * scene.parts.loaded * (1.0 if scene.parts.free else float(record["fixed_load"]))
    matrix = [[sum(k) + s, (k[1] - k[0]) * arm], [(k[1] - k[0]) * arm, sum(k) * arm * arm]]
    loads = [[-float(record["M"]) * 9.81 - load, k[0], k[1], 0.0], [0.0, -k[0] * arm, k[1] * arm, -load]]
    z, theta = np.linalg.solve(matrix, loads)
    left, right = gains_of(scene.parts, record)
    at_left = -k[0] * (z - arm * theta) + [0, k[0], 0, 0]
    at_right = -k[1] * (z + arm * theta) + [0, 0, k[1], 0]
    assert left == pytest.approx(at_left[[0, 1, 2, 3]], rel=1e-9, abs=1e-12)
    assert right == pytest.approx(at_right[[0, 2, 1, 3]], rel=1e-9, abs=1e-12)
    other_left, other_right = gains_of(scene.parts, mirrored)
    assert other_right == (*left[:3], -left[3])
    assert other_left == (*right[:3], -right[3])


@pytest.mark.parametrize(("left_z", "right_z", "p"), [(0, 0, 0.15), (0.02, -0.03, -0.1), (-0.05, -0.05, 0.3)])
def test_partner_and_environment_parts_add_up_to_the_equilibrium_force(left_z: float, right_z: float, p: float) -> None:
    """Except for the part of the ball's weight that a tilted board does not carry in the paper's equations."""
    rest = equilibrium(left_z, right_z, (p,), PAPER.parts, PAPER.record)
    uncarried = 200 / 540 * 0.05 * 9.81 * math.sin(rest.theta) ** 2
    assert uncarried < 2e-3
    for hand, own, partner, force in zip(
        gains(), (left_z, right_z), (right_z, left_z), (rest.left, rest.right), strict=True
    ):
        parts = [
            force_on_hand(ForceInputs(0.0, own, partner, 0.0, 0.0, p, 0.0, hand), 1.0, rendering_for(part))
            for part in ("partner_only", "environment_only")
        ]
        assert sum(parts) == pytest.approx(-force - uncarried, abs=1e-14)


def test_uncoupled_hand_has_zero_gains_and_adds_no_partner_force() -> None:
    left, right = gains(coupling="left")
    assert tuple(right) == (0.0, 0.0, 0.0, 0.0)
    assert left["partner"] == 0.0
    # The board hangs on one hand and the spring at its centre: the hand carries the whole spring and the ball's moment.
    assert left["weight"] == pytest.approx(0.0, abs=1e-12)


def test_hands_share_the_load_of_a_level_board_but_not_of_a_hinged_one() -> None:
    level, hinged = gains(board="level")[0], gains(board="hinged")[1]
    assert tuple(level) == pytest.approx((0.218, 200 - 200 * 200 / 540, -200 * 200 / 540, 0.0), abs=1e-3)
    assert tuple(hinged) == pytest.approx((0.0, 100.0, 100.0, 0.981), abs=1e-9)


def test_carried_ball_loads_the_board_only_after_its_release() -> None:
    packed = pack_rendering(parse('[block]\nforce = "environment_only"\n[physics]\nfixed_ball = "carried"'))[0]
    assert packed["left_fixed"]["weight"] == pytest.approx(0.01 * 9.81 * 200 / 540)
    assert packed["left_fixed"]["ball"] == 0.0
    assert packed["left_free"]["weight"] == pytest.approx(0.218)
    assert packed["left_free"]["ball"] == pytest.approx(-0.981)


@pytest.mark.parametrize(
    "values",
    [
        {"k_h": 0.0},
        {"coupling": "none"},
        {"coupling": "left", "k_s": 0.0},
        {"coupling": "none", "board": "hinged"},
        {"coupling": "none", "board": "level", "k_s": 0.0},
    ],
)
def test_quasi_static_conditions_are_rejected_without_an_equilibrium(values: dict[str, Any]) -> None:
    physics = Physics(**values)
    for force in [name for name, condition in CONDITIONS.items() if condition.quasi_static]:
        with pytest.raises(ConfigError, match="springs hold"):
            pack_rendering(Config(block=Block(force=force), physics=physics))
    pack_rendering(Config(physics=physics))


def test_gains_are_rejected_if_the_ball_tips_the_board_over() -> None:
    physics = Physics(model="lagrangian", ball_height=0.2, k_h=0.5)
    with pytest.raises(ConfigError, match="springs hold"):
        gains_of(parts_of(physics, False), pack_scene(physics)[0])


def test_rendering_enables_only_the_parts_that_a_block_needs() -> None:
    assert rendering_for("none", force_scale=0.5, catch=(3,)) == NO_FORCE
    assert rendering_for("full", force_scale=0.0) == NO_FORCE
    assert rendering_for("full") == Rendering(FORCES.index("full"), False, True, True, False)
    assert rendering_for("partner_only", force_scale=2.0, right="still", catch=(1,)) == Rendering(
        2, True, True, False, True
    )
    assert rendering_for("full", right="robot") == rendering_for("full")
    assert rendering_for("full", left="still").left is False


def test_only_listed_trials_are_catch_trials() -> None:
    packed = pack_rendering(parse(f"[block]\ncatch = [2, 7, {TRIAL_ENTRIES - 1}]"))[0]
    catches = rendering_for("full", catch=(2,))
    found = [trial for trial in range(-5, TRIAL_ENTRIES + 5) if is_catch(trial, packed, catches)]
    assert found == [2, 7, TRIAL_ENTRIES - 1]
    assert not is_catch(2, packed, rendering_for("full"))


def test_trial_scales_repeat_cyclically() -> None:
    block = replace(Config().block, trial_scales=(0.5, 1.5, 0.0))
    packed, shape = pack_rendering(replace(Config(), block=block))[0], rendering_of(block)
    assert shape.scaled
    assert [float(scale_in(trial, packed, shape)) for trial in range(1, 7)] == [0.5, 1.5, 0.0, 0.5, 1.5, 0.0]
    assert float(scale_in(0, packed, shape)) == block.force_scale


def test_trial_scales_apply_even_if_the_block_scale_is_zero() -> None:
    assert rendering_of(replace(Config().block, force_scale=0.0, trial_scales=(1.0,))).varies
    assert rendering_of(replace(Config().block, force="none")) == NO_FORCE


def test_gains_of_a_condition_that_does_not_ask_for_them_are_not_a_number() -> None:
    """A condition that uses gains without ``quasi_static`` must not render a force that lacks them."""
    packed = pack_rendering(parse('[block]\nforce = "full"'))[0]
    for gains in ("left_fixed", "right_fixed", "left_free", "right_free"):
        assert np.isnan(packed[gains].tolist()).all()
