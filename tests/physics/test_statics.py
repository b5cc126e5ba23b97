"""Closed forms, compared with reference values, the kernels at equilibrium and the scene's matrix."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from independent import still, waving
from trajectories import drive, scene_of, trajectory

from evidence.physics.statics import ball_poles, equilibrium
from netboard.physics.scene.linear import scene_matrix
from netboard.physics.scene.models import coupling, rates

MM = 1e-3
PAPER, BARE = scene_of(), scene_of(balls=0)


def rest_of(scene: Any, left_z: float, right_z: float, *p: float) -> Any:
    return equilibrium(left_z, right_z, p, scene.parts, scene.record)


# --- equilibrium ----------------------------------------------------------------------------------------------------


def test_bare_board_sags_by_the_reference_amount() -> None:
    rest = rest_of(BARE, 0.0, 0.0)
    assert rest.z == pytest.approx(-0.1817 * MM, abs=5e-5 * MM)
    assert rest.theta == 0


def test_ball_at_the_target_tilts_the_board_by_the_reference_amount() -> None:
    rest = rest_of(PAPER, 0.0, 0.0, 0.15)
    assert rest.z == pytest.approx(-1.0900 * MM, abs=5e-5 * MM)
    assert math.sin(rest.theta) == pytest.approx(-0.002943, abs=5e-7)
    assert math.degrees(rest.theta) == pytest.approx(-0.1686, abs=5e-5)
    assert (rest.left, rest.right) == pytest.approx((0.07085, 0.36515), abs=5e-6)
    assert rest.right - rest.left == pytest.approx(0.05 * 9.81 * 0.15 / 0.25, rel=1e-12)


def test_board_follows_the_hands_and_transmits_the_derived_partner_force() -> None:
    none, right_up, both_up = (rest_of(BARE, left, right) for left, right in ((0, 0), (0, 0.01), (0.01, 0.01)))
    assert (both_up.z - none.z) / 0.02 == pytest.approx(0.3704, abs=5e-5)
    # When only the partner's hand rises, one's own carries more of the spring at the centre: 0.26 N for 10 mm.
    assert (right_up.left - none.left) / 0.01 == pytest.approx(25.93, abs=5e-3)


def test_lagrangian_fixed_ball_rests_at_the_paper_tilt_with_its_full_weight() -> None:
    scene = scene_of(False, model="lagrangian")
    rest, printed = rest_of(scene, 0.0, 0.0, 0.15), rest_of(PAPER, 0.0, 0.0, 0.15)
    assert rest.theta == printed.theta
    assert rest.z - printed.z == pytest.approx(-0.05 * 9.81 * math.sin(rest.theta) ** 2 / 540, rel=1e-3)


boards = st.sampled_from(["free", "hinged", "level"])
couplings = st.sampled_from(["both", "left", "right"])
heights = st.floats(-0.05, 0.05)


@given(
    boards,
    couplings,
    st.booleans(),
    st.sampled_from(["paper", "lagrangian"]),
    st.sampled_from([0.0, 0.03]),
    st.sampled_from([0.0, 0.4]),
    st.tuples(heights, heights),
    st.lists(st.floats(-0.3, 0.3), max_size=2),
)
def test_equilibrium_has_no_acceleration_and_is_stable_if_hinged(
    board: Any, side: Any, free: bool, model: Any, above: float, beta: float, hands: Any, p: list[float]
) -> None:
    scene = scene_of(free, board=board, coupling=side, model=model, ball_height=above, ball_inertia=beta, balls=len(p))
    try:
        rest = rest_of(scene, *hands, *p)
    except ValueError:
        assume(False)
    left, right = drive((hands[0], 0.0, hands[1], 0.0), scene.record)
    x = (rest.z, 0.0, rest.theta, 0.0, *(value for place in p for value in (place, 0.0)))
    out = rates(x, left, right, scene.parts, scene.record)
    assert (out[1], out[3]) == pytest.approx((0, 0), abs=1e-9)
    assert coupling(x, left, right, scene.parts, scene.record) == pytest.approx((rest.left, rest.right), abs=1e-12)
    if board == "hinged":
        for off in (1e-4, -1e-4):
            tilted = rates((*x[:2], x[2] + off, *x[3:]), left, right, scene.parts, scene.record)
            assert tilted[3] * off < 0


@pytest.mark.parametrize("model", ["paper", "lagrangian"])
@pytest.mark.parametrize(("left_z", "right_z", "p"), [(0, 0, 0.15), (0, 0, -0.35), (0.03, -0.04, 0.1), (0.07, 0.05, 0)])
def test_board_with_a_fixed_ball_settles_at_the_equilibrium(
    left_z: float, right_z: float, p: float, model: Any
) -> None:
    scene = scene_of(False, model=model, b_z=1.0)
    x = trajectory(scene, (0, 0, 0, 0, p, 0), lambda t: (left_z, 0, right_z, 0), 1e-3, 3000)[-1]
    rest = rest_of(scene, left_z, right_z, p)
    assert x[:4] == pytest.approx((rest.z, 0, rest.theta, 0), abs=1e-12)


@pytest.mark.parametrize("scene", [BARE, scene_of(False, fixed_ball="carried")], ids=["bare", "carried"])
def test_bare_board_and_carried_ball_settle_without_the_ball_weight(scene: Any) -> None:
    start = (0.0, 0.0, 0.0, 0.0, 0.15, 0.0)[: scene.length]
    x = trajectory(scene, start, lambda t: (0.01, 0, 0.02, 0), 1e-3, 500)[-1]
    rest = rest_of(BARE, 0.01, 0.02)
    assert (x[0], x[2]) == pytest.approx((rest.z, rest.theta), abs=1e-14)
    assert rest_of(scene, 0.01, 0.02, *start[4::2]) == rest


@pytest.mark.parametrize(
    ("values", "hands", "p", "why"),
    [
        ({"k_h": 0.0}, (0.0, 0.0), 0.0, "tilt has no"),
        ({"k_h": 0.0, "k_s": 0.0}, (0.0, 0.0), 0.0, "no static equilibrium of height"),
        ({"coupling": "none", "board": "hinged"}, (0.0, 0.0), 0.0, "tilt has no"),
        ({"coupling": "left", "k_s": 0.0}, (0.0, 0.0), 0.0, "tilt has no"),
        ({}, (-0.3, 0.3), 0.0, "balances the torques"),
        ({"coupling": "left", "k_h": 10.0, "k_s": 1.0}, (0.0, 0.0), 0.3, "balances the torques"),
        ({"model": "lagrangian", "ball_height": 0.2, "k_h": 0.5}, (0.0, 0.0), 0.0, "tip the board over"),
        ({"model": "lagrangian", "ball_height": 0.2, "k_h": 4.0}, (-0.25, 0.25), 0.3, "tip the board over"),
    ],
)
def test_equilibrium_is_rejected_without_springs_or_if_the_board_tips(
    values: dict[str, Any], hands: tuple[float, float], p: float, why: str
) -> None:
    scene = scene_of(False, **values)
    with pytest.raises(ValueError, match=why):
        rest_of(scene, *hands, p)


# --- poles -----------------------------------------------------------------------------------------------------------


def coupled_ball_mass(scene: Any) -> float:
    """Mass of the balls that moves with the board in the Lagrangian model [kg]."""
    loads = 1.0 if scene.parts.free else float(scene.record["fixed_load"])
    by_lagrange = scene.parts.lagrangian and scene.parts.loaded
    return scene.physics.balls * float(scene.record["m"]) * loads if by_lagrange else 0.0


def roots(inertia: float, damping: float, stiffness: float) -> Any:
    """Both roots, the larger modulus first."""
    return sorted(np.roots([inertia, damping, stiffness]), key=lambda root: (-abs(root), root.imag))


def heave_poles(scene: Any) -> Any:
    """``M z'' + (c_l + c_r + b_z) z' + (k_l + k_r + k_s) z = 0``."""
    of = {name: float(scene.record[name]) for name in scene.record.dtype.names}
    mass = of["M"] + coupled_ball_mass(scene)
    return roots(mass, of["c_left"] + of["c_right"] + of["b_z"], of["k_left"] + of["k_right"] + of["k_s"])


def rotation_poles(scene: Any) -> Any:
    """``I t'' + ((c_l + c_r) l^2 + b_theta) t' + (k_l + k_r) l^2 t = 0``; fixed balls above the board tip it."""
    of = {name: float(scene.record[name]) for name in scene.record.dtype.names}
    square, above = of["l"] ** 2, of["ball_height"]
    mass = 0.0 if scene.parts.free else coupled_ball_mass(scene)
    return roots(
        of["I"] + mass * above**2 / of["mass_ratio"],
        (of["c_left"] + of["c_right"]) * square + of["b_theta"],
        (of["k_left"] + of["k_right"]) * square - mass * of["g"] * above,
    )


def test_board_poles_match_the_reference_values() -> None:
    fast, slow = heave_poles(PAPER)
    assert (fast, slow) == pytest.approx((-200 - 118.3j, -200 + 118.3j), abs=0.05)
    assert abs(fast) / (2 * math.pi) == pytest.approx(37.0, abs=0.05)
    assert -fast.real / abs(fast) == pytest.approx(0.86, abs=0.005)
    fast, slow = rotation_poles(PAPER)
    assert (fast, slow) == pytest.approx((-500, -125), rel=1e-12)
    assert math.sqrt(abs(fast * slow)) / (2 * math.pi) == pytest.approx(39.8, abs=0.05)
    assert abs(fast + slow) / 2 / math.sqrt(abs(fast * slow)) == pytest.approx(1.25, rel=1e-12)


def test_ball_is_a_saddle_downhill_and_an_oscillator_with_the_printed_sign() -> None:
    printed = scene_of(ball_sign="printed")
    assert ball_poles(1, PAPER.parts, PAPER.record)[1].real == pytest.approx(1 / 2.28, abs=0.001)
    assert abs(ball_poles(1, PAPER.parts, PAPER.record)[0]) ** 2 == pytest.approx(0.1925, abs=5e-5)
    turns = abs(ball_poles(1, printed.parts, printed.record)[0]) / (2 * math.pi)
    assert turns == pytest.approx(0.070, abs=5e-4)


@pytest.mark.parametrize("free", [True, False])
@pytest.mark.parametrize(
    "values",
    [
        {},
        {"balls": 0},
        {"b_z": 0.5, "b_theta": 0.01},
        {"model": "lagrangian"},
        {"model": "lagrangian", "balls": 3, "ball_inertia": 0.4},
        {"model": "lagrangian", "balls": 2, "ball_height": 0.05, "ball_inertia": 0.4},
    ],
    ids=str,
)
def test_poles_are_eigenvalues_of_the_scene_matrix(values: dict[str, Any], free: bool) -> None:
    scene = scene_of(free, **values)
    found = np.linalg.eigvals(scene_matrix(scene.parts, scene.record, scene.length))
    balls = scene.physics.balls
    # Free balls couple to the tilt, but are about a thousand times slower.
    for pole in (*heave_poles(scene), *rotation_poles(scene)):
        assert abs(found - pole).min() < (5e-3 if scene.parts.free else 1e-9) * abs(pole)
    if scene.parts.free:
        assert abs(found - ball_poles(balls, scene.parts, scene.record)[1]).min() < 3e-3


def test_ball_poles_are_rejected_for_an_uncoupled_board() -> None:
    loose = scene_of(k_h=0.0)
    with pytest.raises(ValueError, match="tilt has no"):
        ball_poles(1, loose.parts, loose.record)


def test_ball_growth_rate_with_one_hand_follows_springs_in_series() -> None:
    """The hand's spring at its end and the spring at the board's centre act in series."""
    left = scene_of(coupling="left")
    growth = ball_poles(1, left.parts, left.record)[1].real
    stiffness = 0.25**2 / (1 / 200 + 1 / 140)
    assert growth**2 == pytest.approx(9.81 * 0.05 * 9.81 / stiffness)


def test_ball_poles_are_zero_on_a_level_board() -> None:
    level = scene_of(board="level")
    assert ball_poles(1, level.parts, level.record) == (0, 0)


@pytest.mark.parametrize(("sign", "spec_mm", "motion"), [("downhill", 21.6, math.cosh), ("printed", 18.5, math.cos)])
def test_ball_released_at_20_mm_rolls_as_derived(sign: Any, spec_mm: float, motion: Any) -> None:
    scene = scene_of(ball_sign=sign)
    rest = rest_of(scene, 0.0, 0.0, 0.02)
    path = trajectory(scene, (rest.z, 0.0, rest.theta, 0.0, 0.02, 0.0), still, 1e-3, 1000)[:, 4]
    assert path[900] / MM == pytest.approx(spec_mm, abs=0.05)
    # The board lags the ball by some 10 ms, which the closed form neglects.
    pole = abs(ball_poles(1, scene.parts, scene.record)[0])
    assert path[1000] == pytest.approx(0.02 * motion(pole), rel=2e-3)


def test_board_follows_slow_hands_quasi_statically() -> None:
    path = trajectory(BARE, (0.0, 0.0, 0.0, 0.0), waving, 1e-3, 1000)
    gaps = [abs(path[i, 2] - rest_of(BARE, *waving(i * 1e-3)[0::2]).theta) for i in range(100, 1000, 50)]
    assert 1e-6 < max(gaps) < 1e-4
