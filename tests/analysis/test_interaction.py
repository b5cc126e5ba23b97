"""Decomposition of the forces of two hands, and their work, against closed forms and the simulated scene."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import trapezoid
from scipy.optimize import minimize_scalar

from evidence.physics.statics import equilibrium
from netboard.analysis.measures.interaction import (
    effort,
    exchanged,
    force_share,
    interaction,
    point_velocities,
    supports,
    work,
)
from netboard.base.tables.scene import Physics
from netboard.physics.hands.sampled import Hands
from netboard.physics.scene.parameters import pack_scene, parts_of
from netboard.physics.simulation import energies_of, simulate

RATE = 1000.0
FORCES = arrays(float, 20, elements=st.floats(-4.0, 4.0).map(lambda force: round(force, 3)))


@given(st.integers(0, 2000), st.integers(0, 2**32), st.sampled_from((1.0, 0.0, -0.0, np.nan)))
def test_integral_has_the_bits_of_the_library(count: int, seed: int, factor: float) -> None:
    generator = np.random.default_rng(seed)
    values = generator.standard_normal(count) * 10.0 ** generator.integers(-9, 9)
    values[count // 2 :] *= factor
    expected = np.float64(trapezoid(values**2, dx=1.0 / RATE))
    assert np.float64(effort(values, RATE)).tobytes() == expected.tobytes()


@pytest.mark.evidence("truth", supports)
@pytest.mark.parametrize("p", [-0.15, 0.0, 0.31])
def test_supports_keep_the_scene_in_static_equilibrium(p: float) -> None:
    # Without the spring to the origin, and with the styluses where the board is then level.
    physics = replace(Physics(), k_s=0.0)
    scene = pack_scene(physics)[0]
    left, right = supports([p], board_mass=physics.M, ball_mass=physics.m, arm=0.25)
    rest = equilibrium(left[0] / physics.k_h, right[0] / physics.k_h, (p,), parts_of(physics, True), scene)
    assert (rest.left, rest.right) == pytest.approx((left[0], right[0]), rel=1e-9)
    assert rest.theta == pytest.approx(0.0, abs=1e-12)


@pytest.mark.evidence("truth", interaction)
def test_opposing_forces_are_split_into_external_and_interaction_force() -> None:
    left, right = np.array([2.0, -2.0, 1.0, 0.0]), np.array([0.5, 0.5, 1.0, 1.0])
    heave = interaction(left, right, axis="heave")
    assert heave.net.tolist() == [2.5, -1.5, 2.0, 1.0]
    assert heave.between.tolist() == [0.0, -0.5, 0.0, 0.0]
    assert heave.left_external.tolist() == [2.0, -1.5, 1.0, 0.0]
    assert heave.right_external.tolist() == [0.5, 0.0, 1.0, 1.0]
    tilt = interaction(left, right)
    assert tilt.net.tolist() == [-1.5, 2.5, 0.0, 1.0]
    assert tilt.between.tolist() == [-0.5, 0.0, -1.0, 0.0]
    half = interaction(left, right, rule="half_difference")
    assert half.between.tolist() == [-1.25, 0.75, -1.0, -0.5]
    assert half.left_external.tolist() == half.right_external.tolist()


@pytest.mark.evidence("properties", interaction, of=("mirror", "unit", "balance"))
@given(FORCES, FORCES, st.sampled_from(["tilt", "heave"]), st.sampled_from(["opposing", "half_difference"]))
def test_decomposition_is_balanced_and_mirror_symmetric(
    left: np.ndarray, right: np.ndarray, axis: str, rule: str
) -> None:
    found = interaction(left, right, axis=axis, rule=rule)
    sign = -1.0 if axis == "tilt" else 1.0
    assert found.left_external + found.between == pytest.approx(sign * left)
    assert found.right_external - found.between == pytest.approx(right)
    assert found.left_external + found.right_external == pytest.approx(found.net)
    mirrored = interaction(right, left, axis=axis, rule=rule)
    assert mirrored.net == pytest.approx(sign * found.net)
    assert mirrored.between == pytest.approx(-sign * found.between)
    scaled = interaction(1000.0 * left, 1000.0 * right, axis=axis, rule=rule)
    assert scaled.between == pytest.approx(1000.0 * found.between)


@pytest.mark.evidence("independent", interaction, by="scipy")
@given(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0))
def test_interaction_force_is_the_least_that_makes_external_forces_agree(a: float, b: float) -> None:
    found = interaction([a], [b], axis="heave")
    # The least effort of both externals with the same sum, reached from the measured forces with the least between.
    least = minimize_scalar(lambda x: abs(a - x) + abs(b + x), bounds=(-8.0, 8.0), method="bounded")
    assert abs(found.left_external[0]) + abs(found.right_external[0]) == pytest.approx(least.fun, abs=1e-4)
    assert found.left_external[0] * found.right_external[0] >= 0.0


@pytest.mark.evidence("truth", work, effort)
def test_work_and_effort_of_sine_waves_equal_the_closed_form() -> None:
    t = np.arange(0.0, 2.0 + 1e-9, 1.0 / RATE)
    in_phase = work(3.0 * np.sin(2 * np.pi * t), 0.1 * np.sin(2 * np.pi * t), RATE)
    assert in_phase.net == pytest.approx(3.0 * 0.1 * 2.0 / 2.0, rel=1e-9)
    assert in_phase.received == 0.0
    # In quadrature a spring gives back what it took: F v / (4 pi f) in every half of a period.
    spring = work(3.0 * np.sin(2 * np.pi * t), 0.1 * np.cos(2 * np.pi * t), RATE)
    assert spring.net == pytest.approx(0.0, abs=1e-12)
    assert spring.given == pytest.approx(4 * 0.3 / (4 * np.pi), rel=1e-4)
    assert effort(3.0 * np.sin(2 * np.pi * t), RATE) == pytest.approx(9.0, rel=1e-9)
    assert effort(3.0 * np.sin(2 * np.pi * t), RATE, kind="absolute") == pytest.approx(
        3.0 * 2.0 * 2.0 / np.pi, rel=1e-5
    )
    assert effort(3.0 * np.sin(2 * np.pi * t), RATE, kind="rms") == pytest.approx(3.0 / np.sqrt(2.0), rel=1e-3)


@pytest.mark.evidence("truth", exchanged)
def test_exchanged_work_equals_hand_computed_values() -> None:
    left, right = np.array([2.0, 2.0, 2.0, 2.0]), np.array([-0.5, -0.5, -0.5, -0.5])
    assert exchanged(left, right, 1.0) == (1.5, 0.0)
    assert exchanged(right, left, 1.0) == (0.0, 1.5)
    assert exchanged(left, left, 1.0) == (0.0, 0.0)


@pytest.mark.evidence("truth", force_share)
def test_force_share_equals_hand_computed_values() -> None:
    assert force_share([1.0, -1.0], [3.0, 3.0]) == 0.75
    assert force_share([1.0, -1.0], [3.0, 3.0], kind="squared") == 0.9
    assert np.isnan(force_share([0.0], [0.0]))
    with pytest.raises(ValueError, match="same length"):
        force_share([1.0, 2.0], [1.0])


@pytest.mark.evidence("properties", force_share, of=("mirror", "unit", "balance"))
@given(FORCES, FORCES)
def test_force_shares_of_both_sides_add_up_to_one(left: np.ndarray, right: np.ndarray) -> None:
    share = force_share(left, right)
    if np.isfinite(share):
        assert 0.0 <= share <= 1.0
        assert force_share(right, left) == pytest.approx(1.0 - share)
        assert force_share(-5.0 * left, 5.0 * right) == pytest.approx(share)


@pytest.mark.evidence("truth", work, point_velocities)
@pytest.mark.slow
def test_work_equals_the_energy_balance_of_the_simulated_scene() -> None:
    physics = Physics()
    t = np.arange(0.0, 2.0, 1e-3)
    z = np.stack([0.01 * np.sin(5 * t) + 0.004 * np.sin(2 * t), -0.008 * np.sin(5 * t + 0.3)], axis=1)
    vz = np.stack([0.05 * np.cos(5 * t) + 0.008 * np.cos(2 * t), -0.04 * np.cos(5 * t + 0.3)], axis=1)
    hands = Hands(t, z, vz)
    motion = simulate(hands, physics, (0.0, 0.0, 0.0, 0.0, -0.05, 0.0))
    # From the second tenth on: the start is a jolt of the couplings that a sample each millisecond does not resolve.
    late = slice(200, None)
    energies = {name: column[late] - column[200] for name, column in energies_of(motion, hands, physics).items()}
    points = point_velocities(motion.states[:, 1], motion.states[:, 2], motion.states[:, 3], arm=0.25)
    for side, name in enumerate(("left", "right")):
        force = motion.forces[late, side]
        given = work(force, vz[late, side], RATE).net
        assert given == pytest.approx(energies[f"W_hand_{name}"][-1], abs=1e-7)
        # What the hand gives and the board does not get went into spring and damper of its coupling.
        kept = energies[f"E_spring_{name}"][-1] - energies[f"W_damper_{name}"][-1]
        assert given - work(force, points[side][late], RATE).net == pytest.approx(kept, abs=1e-7)
    # A light board: what is left of the tilting forces is its inertia, and what cancels in it is the spring's.
    borne = supports(motion.states[:, 4], board_mass=physics.M, ball_mass=physics.m, arm=0.25)
    apart = interaction(motion.forces[:, 0] - borne[0], motion.forces[:, 1] - borne[1], rule="half_difference")
    assert np.abs(apart.net[late]).max() < 0.01
    assert apart.between[late] == pytest.approx(-physics.k_s * motion.states[late, 0] / 2.0, abs=0.005)
