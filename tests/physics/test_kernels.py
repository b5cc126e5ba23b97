"""The steps against independent solutions, conservation laws and symmetry."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from paper_equations import STILL, Hands, after, moving, solution
from scipy.linalg import expm

from netboard.config import Physics
from netboard.physics.kernels import coupling, rk4_bare, rk4_fixed, rk4_free
from netboard.physics.scene import pack_scene
from netboard.physics.stability import rk4_factor
from netboard.physics.statics import energy, equilibrium, heave_poles, power

H = 1e-3
PAPER = Physics()
STEPS = [rk4_free, rk4_fixed, rk4_bare]
Step = Callable[..., tuple[float, ...]]


def run(step: Step, start: Any, hands: Hands, h: float, steps: int, scene: Any) -> NDArray[np.float64]:
    """States at the start and after each step, shape (steps + 1, 6)."""
    states = [tuple(float(value) for value in start)]
    for i in range(steps):
        states.append(step(*states[-1], *hands(i * h), h, scene))
    return np.array(states)


def waving(t: float) -> tuple[float, float, float, float]:
    """20 mm at 0.8 Hz, the hands in opposite directions."""
    w = 2 * math.pi * 0.8
    z, vz = 0.02 * math.sin(w * t), 0.02 * w * math.cos(w * t)
    return -z, -vz, z, vz


# --- accuracy ----------------------------------------------------------------------------------------------------

COLD = np.array([0.0, 0.0, 0.0, 0.0, -0.15, 0.0])


@pytest.mark.slow
def test_error_of_the_integrator_is_the_printed_one(scene: Any) -> None:
    """Both sides get the same held samples, so that only the integrator's error is left."""
    kernel = run(rk4_free, COLD, waving, H, 3000, scene)
    true = COLD
    worst = np.zeros(6)
    for i in range(3000):
        true = after(true, moving(*waving(i * H)), H, PAPER)
        worst = np.maximum(worst, np.abs(kernel[i + 1] - true))
    assert worst[4] < 3.5e-8 * 1e-3
    assert math.degrees(worst[2]) < 5.5e-5


def test_error_with_sampled_hands_is_that_of_the_hold(scene: Any) -> None:
    """What constant velocity between samples costs against hands that move smoothly: thousands of times RK4's own."""
    kernel = run(rk4_free, COLD, waving, H, 3000, scene)
    true = solution(COLD, waving, np.arange(3001) * H, PAPER)
    worst = np.abs(kernel - true).max(axis=0)
    assert worst[4] == pytest.approx(0.077e-3, rel=0.05)
    assert math.degrees(worst[2]) == pytest.approx(6.8e-4, rel=0.05)
    assert worst[0] < 5e-5 * 1e-3


@pytest.mark.parametrize("sign", ["downhill", "printed"])
def test_order_of_convergence_is_four(sign: Any) -> None:
    physics = Physics(ball_sign=sign)
    scene = pack_scene(physics)[0]
    hands = moving(-0.03, 0.2, 0.04, -0.3)
    end = 0.048
    start = np.array([0.002, 0.1, 0.05, -1.0, 0.1, 0.3])
    true = solution(start, hands, np.array([0.0, end]), physics)[-1]
    counts = np.array([96, 192, 384])
    errors = np.array(
        [np.abs(run(rk4_free, start, hands, end / n, n, scene)[-1] - true) / np.abs(true) for n in counts]
    )
    slopes = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slopes == pytest.approx(4, abs=0.2)


def heave_matrix(k: Physics) -> NDArray[np.float64]:
    """Of x = (z, vz, 1, hand z, hand vz), for a bare, level board and hands that move together: x' = A x."""
    a = np.zeros((5, 5))
    a[0, 1] = 1
    a[1] = [-(2 * k.k_h + k.k_s) / k.M, -2 * k.c_h / k.M, -k.g, 2 * k.k_h / k.M, 2 * k.c_h / k.M]
    a[3, 4] = 1
    return a


def test_level_board_steps_by_the_fourth_order_polynomial_of_its_matrix(scene: Any) -> None:
    a = H * heave_matrix(PAPER)
    by_matrix = np.eye(5) + a @ (np.eye(5) + a / 2 @ (np.eye(5) + a / 3 @ (np.eye(5) + a / 4)))
    x = np.array([0.003, -0.2, 1.0, 0.01, 0.15])
    kernel = rk4_bare(0.003, -0.2, 0.0, 0.0, 0.0, 0.0, 0.01, 0.15, 0.01, 0.15, H, scene)
    assert kernel[:2] == pytest.approx((by_matrix @ x)[:2], rel=1e-13)
    assert kernel[2:] == (0, 0, 0, 0)


def test_level_board_follows_the_exact_solution(scene: Any) -> None:
    x = np.array([0.003, -0.2, 1.0, 0.01, 0.15])
    hands = moving(0.01, 0.15, 0.01, 0.15)
    kernel = run(rk4_bare, (0.003, -0.2, 0, 0, 0, 0), hands, H, 100, scene)
    exact = np.array([expm(heave_matrix(PAPER) * i * H) @ x for i in range(101)])
    # RK4 misses each mode by its fifth-order term, once per step; at its worst that adds up over one time constant.
    fast = H * abs(heave_poles(scene)[0])
    assert np.abs(kernel[:, 0] - exact[:, 0]).max() < 0.02 * fast**5
    assert np.abs(kernel[-1, :2] - exact[-1, :2]).max() < 1e-10


def test_undamped_level_board_turns_by_the_phase_of_its_factor() -> None:
    scene = pack_scene(Physics(c_h=0.0))[0]
    pole = heave_poles(scene)[1]
    rest = equilibrium(0.0, 0.0, 0.0, scene, load=0.0).z
    kernel = run(rk4_bare, (rest + 0.01, 0, 0, 0, 0, 0), STILL, H, 1000, scene)
    assert kernel[-1, 0] - rest == pytest.approx((0.01 * rk4_factor(H * pole) ** 1000).real, abs=1e-13)


# --- energy ------------------------------------------------------------------------------------------------------


def imbalance(step: Step, start: Any, hands: Hands, h: float, load: float, scene: Any) -> float:
    """Change of energy over 0.4 s, less the work done (Simpson), of the scene's largest energy."""
    steps = round(0.4 / h)
    states = run(step, start, hands, h, steps, scene)
    held, work = np.empty(steps + 1), np.empty(steps + 1)
    for i, (z, vz, theta, omega, p, vp) in enumerate(states):
        left_z, left_vz, right_z, right_vz = hands(i * h)
        held[i] = energy(z, vz, theta, omega, p, vp, left_z, right_z, scene, load)
        work[i] = power(z, vz, theta, omega, vp, left_z, left_vz, right_z, right_vz, scene, load)
    done = h / 3 * (work[0] + 4 * work[1:-1:2].sum() + 2 * work[2:-1:2].sum() + work[-1])
    return float(abs(held[-1] - held[0] - done) / np.abs(held).max())


def falling(values: list[float]) -> float:
    """By which power of the step the values fall; each has half the step of the one before."""
    return float(-np.polyfit(np.arange(len(values)), np.log2(values), 1)[0])


SHAKEN = (0.002, 0.1, 0.1, -2.0, 0.1, 0.3)
HALVED = [1e-3, 5e-4, 2.5e-4, 1.25e-4]


@pytest.mark.parametrize(("step", "load"), [(rk4_bare, 0.0), (rk4_free, 1.0)])
def test_undamped_scene_keeps_its_energy_but_for_the_order(step: Step, load: float) -> None:
    scene = pack_scene(Physics(c_h=0.0))[0]
    start = SHAKEN if load else (*SHAKEN[:4], 0, 0)
    drifts = [imbalance(step, start, STILL, h, load, scene) for h in HALVED]
    assert falling(drifts) > 3.8
    assert drifts[-1] < 1e-6


def test_bare_undamped_scene_is_a_mechanical_system() -> None:
    """No power enters or leaves at all: the energy itself is constant."""
    scene = pack_scene(Physics(c_h=0.0))[0]
    states = run(rk4_bare, (*SHAKEN[:4], 0, 0), STILL, 1e-4, 4000, scene)
    held = np.array([energy(*state, 0.0, 0.0, scene, load=0.0) for state in states])
    assert np.ptp(held) / held.max() < 1e-6


@pytest.mark.parametrize("sign", ["downhill", "printed"])
def test_energy_of_the_damped_scene_is_what_the_hands_put_in(sign: Any) -> None:
    scene = pack_scene(Physics(ball_sign=sign))[0]
    hands = moving(-0.03, 0.2, 0.04, -0.15)
    gaps = [imbalance(rk4_free, SHAKEN, hands, h, 1.0, scene) for h in HALVED]
    assert falling(gaps) > 3.8
    assert gaps[-1] < 1e-6


# --- symmetry ----------------------------------------------------------------------------------------------------

heights = st.floats(-0.1, 0.1)
rates = st.floats(-1, 1)
states = st.tuples(heights, rates, st.floats(-7, 7), st.floats(-20, 20), st.floats(-0.35, 0.35), rates)
styluses = st.tuples(heights, rates, heights, rates)


def mirrored(state: tuple[float, ...]) -> tuple[float, ...]:
    z, vz, theta, omega, p, vp = state
    return z, vz, -theta, -omega, -p, -vp


@pytest.mark.parametrize("step", STEPS)
@given(state=states, stylus=styluses)
def test_mirror_images_agree_to_the_bit(step: Step, state: Any, stylus: Any, scene: Any) -> None:
    left_z, left_vz, right_z, right_vz = stylus
    there = step(*mirrored(state), right_z, right_vz, left_z, left_vz, H, scene)
    assert mirrored(there) == step(*state, *stylus, H, scene)


@given(state=states, stylus=styluses)
def test_mirrored_forces_change_hands_to_the_bit(state: Any, stylus: Any, scene: Any) -> None:
    left_z, left_vz, right_z, right_vz = stylus
    left, right = coupling(*state[:4], *stylus, scene)
    assert coupling(*mirrored(state)[:4], right_z, right_vz, left_z, left_vz, scene) == (right, left)


# --- what is skipped ---------------------------------------------------------------------------------------------


def changed(scene: Any, **values: float) -> Any:
    record = scene.copy()
    for name, value in values.items():
        record[name] = value
    return record


@given(state=states, stylus=styluses)
def test_fixed_is_free_with_the_ball_pinned_to_the_bit(state: Any, stylus: Any, scene: Any) -> None:
    pinned = changed(scene, ball_gravity=0.0)
    *board, p, vp = rk4_fixed(*state, *stylus, H, scene)
    assert (*board, p, 0.0) == rk4_free(*state[:5], 0.0, *stylus, H, pinned)
    assert (p, vp) == (state[4], 0.0)


@given(state=states, stylus=styluses)
def test_bare_is_free_with_a_ball_of_no_mass_to_the_bit(state: Any, stylus: Any, scene: Any) -> None:
    *board, p, vp = rk4_bare(*state, *stylus, H, scene)
    assert tuple(board) == rk4_free(*state, *stylus, H, changed(scene, m=0.0))[:4]
    assert (p, vp) == state[4:]
    assert tuple(board) == rk4_fixed(*state, *stylus, H, changed(scene, fixed_load=0.0))[:4]


@given(state=states, stylus=styluses)
def test_forces_of_the_coupling_are_those_the_board_moves_by(state: Any, stylus: Any, scene: Any) -> None:
    """The change of momentum over a step too short for anything else to happen."""
    z, vz, theta, omega, *_ = state
    h = 1e-7
    left, right = coupling(z, vz, theta, omega, *stylus, scene)
    step = rk4_bare(*state, *stylus, h, scene)
    force = (left + right) - 0.01 * 9.81 - 140 * z
    torque = (right - left) * 0.25 * math.cos(theta)
    assert step[1] - vz == pytest.approx(h * force / 0.01, rel=2e-3, abs=2e-6)
    assert step[3] - omega == pytest.approx(h * torque / 0.0004, rel=2e-3, abs=2e-5)


# --- bad numbers -------------------------------------------------------------------------------------------------

anything = st.floats()


@pytest.mark.parametrize("step", STEPS)
@given(state=st.tuples(*[anything] * 6), stylus=st.tuples(*[anything] * 4))
def test_any_numbers_go_through_without_an_exception(step: Step, state: Any, stylus: Any, scene: Any) -> None:
    with np.errstate(all="ignore"):  # numpy's own numbers warn when the kernels are run in plain Python
        out = step(*state, *stylus, H, scene)
    assert len(out) == 6
    assert all(isinstance(value, float) for value in out)
    if not all(math.isfinite(value) for value in (*state[:4], *stylus)):
        assert not all(math.isfinite(value) for value in out)


@given(numbers=st.tuples(*[anything] * 8))
def test_any_numbers_give_a_force_without_an_exception(numbers: Any, scene: Any) -> None:
    with np.errstate(all="ignore"):
        assert all(isinstance(value, float) for value in coupling(*numbers, scene))
