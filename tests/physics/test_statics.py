"""Closed forms against the printed acceptance values, and the kernels against the closed forms."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from netboard.config import Physics
from netboard.physics.kernels import coupling, rk4_bare, rk4_fixed, rk4_free
from netboard.physics.scene import pack_scene
from netboard.physics.stability import rk4_factor
from netboard.physics.statics import ball_poles, equilibrium, heave_poles, rotation_poles

H = 1e-3
MM = 1e-3


def test_bare_board_hangs_by_the_printed_amount(scene: Any) -> None:
    rest = equilibrium(0.0, 0.0, 0.0, scene, load=0.0)
    assert rest.z == pytest.approx(-0.1817 * MM, abs=5e-5 * MM)
    assert rest.theta == 0


def test_ball_at_the_target_tilts_the_board_by_the_printed_amount(scene: Any) -> None:
    rest = equilibrium(0.0, 0.0, 0.15, scene)
    assert rest.z == pytest.approx(-1.0900 * MM, abs=5e-5 * MM)
    assert math.sin(rest.theta) == pytest.approx(-0.002943, abs=5e-7)
    assert math.degrees(rest.theta) == pytest.approx(-0.1686, abs=5e-5)
    assert (rest.left, rest.right) == pytest.approx((0.07085, 0.36515), abs=5e-6)
    assert rest.right - rest.left == pytest.approx(0.05 * 9.81 * 0.15 / 0.25, rel=1e-12)


def settled(step: Any, left_z: float, right_z: float, p: float, scene: Any) -> tuple[float, ...]:
    state = (0.0, 0.0, 0.0, 0.0, p, 0.0)
    for _ in range(500):
        state = step(*state, left_z, 0.0, right_z, 0.0, H, scene)
    return state


@pytest.mark.parametrize(("left_z", "right_z", "p"), [(0, 0, 0.15), (0, 0, -0.35), (0.03, -0.04, 0.1), (0.07, 0.05, 0)])
def test_fixed_ball_comes_to_rest_where_it_must(left_z: float, right_z: float, p: float, scene: Any) -> None:
    z, vz, theta, omega, *_ = settled(rk4_fixed, left_z, right_z, p, scene)
    rest = equilibrium(left_z, right_z, p, scene)
    assert (z, theta, vz, omega) == pytest.approx((rest.z, rest.theta, 0, 0), abs=1e-14)
    forces = coupling(z, vz, theta, omega, left_z, 0.0, right_z, 0.0, scene)
    assert forces == pytest.approx((rest.left, rest.right), abs=1e-12)


def test_bare_board_and_carried_ball_come_to_rest_without_its_weight(scene: Any) -> None:
    rest = equilibrium(0.01, 0.02, 0.15, scene, load=0.0)
    carried = pack_scene(Physics(fixed_ball="carried"))[0]
    for step, record in ((rk4_bare, scene), (rk4_fixed, carried)):
        state = settled(step, 0.01, 0.02, 0.15, record)
        assert (state[0], state[2]) == pytest.approx((rest.z, rest.theta), abs=1e-14)


def test_height_follows_the_hands_and_hands_feel_each_other_as_derived(scene: Any) -> None:
    none, right_up, both_up = (
        equilibrium(left, right, 0.0, scene, load=0.0) for left, right in ((0, 0), (0, 0.01), (0.01, 0.01))
    )
    assert (both_up.z - none.z) / 0.02 == pytest.approx(0.3704, abs=5e-5)
    # When only the partner's hand rises, one's own carries more of the spring at the centre: 0.26 N for 10 mm.
    assert (right_up.left - none.left) / 0.01 == pytest.approx(25.93, abs=5e-3)


def test_there_is_no_rest_without_springs_or_beyond_the_upright(scene: Any) -> None:
    loose = pack_scene(Physics(k_h=0.0))[0]
    with pytest.raises(ValueError, match="nowhere"):
        equilibrium(0.0, 0.0, 0.0, loose)
    with pytest.raises(ValueError, match="no tilt"):
        equilibrium(-0.3, 0.3, 0.0, scene)


def test_poles_are_the_printed_ones(scene: Any) -> None:
    fast, slow = heave_poles(scene)
    assert (fast, slow) == pytest.approx((-200 - 118.3j, -200 + 118.3j), abs=0.05)
    assert abs(fast) / (2 * math.pi) == pytest.approx(37.0, abs=0.05)
    assert -fast.real / abs(fast) == pytest.approx(0.86, abs=0.005)
    fast, slow = rotation_poles(scene)
    assert (fast, slow) == pytest.approx((-500, -125), rel=1e-12)
    assert math.sqrt(abs(fast * slow)) / (2 * math.pi) == pytest.approx(39.8, abs=0.05)
    assert abs(fast + slow) / 2 / math.sqrt(abs(fast * slow)) == pytest.approx(1.25, rel=1e-12)


def test_ball_is_a_saddle_downhill_and_an_oscillator_as_printed(scene: Any) -> None:
    assert ball_poles(scene)[1].real == pytest.approx(1 / 2.28, abs=0.001)
    assert abs(ball_poles(scene)[0]) ** 2 == pytest.approx(0.1925, abs=5e-5)
    assert abs(ball_poles(pack_scene(Physics(ball_sign="printed"))[0])[0]) / (2 * math.pi) == pytest.approx(
        0.070, abs=5e-4
    )


@pytest.mark.parametrize("change", [{}, {"c_h": 0.0}, {"k_h": 900.0, "c_h": 0.5}, {"M": 0.1, "I": 0.01}])
def test_a_step_of_the_kernel_multiplies_each_mode_by_its_factor(change: dict[str, float]) -> None:
    scene = pack_scene(replace(Physics(), **change))[0]  # type: ignore[arg-type]
    rest = equilibrium(0.0, 0.0, 0.0, scene, load=0.0)
    at_rest = np.array([rest.z, 0.0, 0.0, 0.0])
    jacobian = approx_fprime(at_rest, lambda x: np.array(rk4_bare(*x, 0, 0, 0, 0, 0, 0, H, scene)[:4]), 1e-7)
    found = np.sort_complex(np.linalg.eigvals(jacobian))
    poles = (*heave_poles(scene), *rotation_poles(scene))
    assert found == pytest.approx(np.sort_complex([rk4_factor(H * pole) for pole in poles]), abs=1e-6)


@pytest.mark.parametrize(("sign", "spec_mm", "motion"), [("downhill", 21.6, math.cosh), ("printed", 18.5, math.cos)])
def test_ball_rolls_from_20_mm_as_derived(sign: Any, spec_mm: float, motion: Any) -> None:
    scene = pack_scene(Physics(ball_sign=sign))[0]
    rest = equilibrium(0.0, 0.0, 0.02, scene)
    state = (rest.z, 0.0, rest.theta, 0.0, 0.02, 0.0)
    path = [0.02]
    for _ in range(1000):
        state = rk4_free(*state, 0.0, 0.0, 0.0, 0.0, H, scene)
        path.append(state[4])
    assert path[900] / MM == pytest.approx(spec_mm, abs=0.05)
    # The board follows the ball some 10 ms late, which the closed form leaves out.
    assert path[1000] == pytest.approx(0.02 * motion(abs(ball_poles(scene)[0])), rel=2e-3)
