"""Energy of a scene and its flows, balanced at each instant and along trajectories."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from independent import Hands, still, waving
from numpy.typing import NDArray
from trajectories import Scene, convergence_order, drive, sampled_trajectory, samples, scene_of, trajectory

from evidence.physics.statics import equilibrium
from netboard.physics.scene.energy import Powers, flows, stored, stored_along, work_along
from netboard.physics.scene.models import rates

heights = st.floats(-0.1, 0.1)
speeds = st.floats(-1, 1)
boards = (heights, speeds, st.floats(-3, 3), st.floats(-20, 20))
balls = (st.floats(-0.35, 0.35), speeds)
states = st.sampled_from([1, 2]).flatmap(lambda n: st.tuples(*boards, *balls * n))
hands = st.tuples(heights, speeds, heights, speeds)

SCENES: dict[str, dict[str, Any]] = {
    "paper": {},
    "printed, rolling": {"ball_sign": "printed", "ball_inertia": 0.4, "b_z": 0.3, "b_theta": 0.01},
    "uneven": {"coupling": "left"},
    "lagrangian": {"model": "lagrangian"},
    "rolling": {"model": "lagrangian", "ball_inertia": 0.4, "ball_height": 0.03, "b_z": 0.3, "b_theta": 0.01},
    "rolling, uneven": {"model": "lagrangian", "ball_inertia": 0.4, "ball_height": 0.03, "coupling": "right"},
    "friction": {"b_p": 0.02, "rolling_resistance": 0.01, "ball_inertia": 0.4},
    "friction, lagrangian": {"b_p": 0.02, "rolling_resistance": 0.01, "model": "lagrangian", "ball_height": 0.03},
}
every = pytest.mark.parametrize("values", SCENES.values(), ids=SCENES.keys())
STEP_LENGTHS = (4e-3, 2e-3, 1e-3)
MOVING_STATE = (0.002, 0.1, 0.1, -2.0, 0.1, 0.3, -0.05, 0.1)


# --- at an instant ---------------------------------------------------------------------------------------------------


@pytest.mark.slow
@every
@given(free=st.booleans(), state=states, hand=hands)
def test_power_flows_sum_to_the_rate_of_stored_energy(
    values: dict[str, Any], free: bool, state: Any, hand: Any
) -> None:
    """By central differences along the motion; tests/physics/derivation.py shows it exactly."""
    scene = scene_of(free, balls=(len(state) - 4) // 2, **values)
    rate = rates(state, *drive(hand, scene.record), scene.parts, scene.record)
    left_z, left_vz, right_z, right_vz = hand
    h = 1e-6

    def after(t: float) -> float:
        x = tuple(value + t * by for value, by in zip(state, rate, strict=True))
        return sum(stored(x, left_z + t * left_vz, right_z + t * right_vz, scene.parts, scene.record))

    powers = flows(state, *hand, scene.parts, scene.record)
    scale = max(1.0, sum(abs(power) for power in powers), abs(after(0.0)))
    assert (after(h) - after(-h)) / (2 * h) == pytest.approx(sum(powers), abs=1e-6 * scale)


@every
@given(free=st.booleans(), state=states, hand=hands)
def test_dampers_only_dissipate_and_lagrangian_model_adds_no_power(
    values: dict[str, Any], free: bool, state: Any, hand: Any
) -> None:
    scene = scene_of(free, balls=(len(state) - 4) // 2, **values)
    powers = flows(state, *hand, scene.parts, scene.record)
    assert max(powers.damper_left, powers.damper_right, powers.damper_board, powers.friction) <= 0
    if scene.parts.lagrangian:
        assert powers.model == 0


def test_level_board_at_rest_at_the_origin_has_no_energy() -> None:
    scene = scene_of()
    assert stored((0.0,) * 6, 0.0, 0.0, scene.parts, scene.record) == (0, 0, 0, 0, 0)


def test_stored_energies_match_closed_forms() -> None:
    scene = scene_of(balls=0)
    held = stored((0.01, 0.2, 0.0, 3.0), 0.03, -0.01, scene.parts, scene.record)
    assert held.kinetic == pytest.approx((0.01 * 0.2**2 + 0.0004 * 3**2) / 2)
    assert held.gravity == pytest.approx(0.01 * 9.81 * 0.01)
    assert held.spring_left == pytest.approx(200 * 0.02**2 / 2)
    assert held.spring_right == pytest.approx(200 * 0.02**2 / 2)
    assert held.spring_board == pytest.approx(140 * 0.01**2 / 2)


def test_power_added_by_the_paper_model_matches_its_closed_form() -> None:
    state = (0.0, 0.2, 0.3, 1.0, 0.1, 0.5)
    s = np.sin(0.3)
    downhill, printed = scene_of(), scene_of(ball_sign="printed")
    unloaded = 0.05 * 9.81 * s * s * 0.2
    assert flows(state, 0.0, 0.0, 0.0, 0.0, downhill.parts, downhill.record).model == pytest.approx(unloaded)
    climbing = unloaded + 2 * 0.05 * 9.81 * s * 0.5
    assert flows(state, 0.0, 0.0, 0.0, 0.0, printed.parts, printed.record).model == pytest.approx(climbing)


# --- along trajectories ----------------------------------------------------------------------------------------------


def resting_state(scene: Scene, *p: float) -> tuple[float, ...]:
    """The equilibrium state with both styluses at the origin."""
    rest = equilibrium(0.0, 0.0, p, scene.parts, scene.record)
    return (rest.z, 0.0, rest.theta, 0.0, *(value for place in p for value in (place, 0.0)))


def gentle_hands(t: float) -> tuple[float, float, float, float]:
    """Hands that start smoothly, the right one moving twice as far."""
    w = 2 * np.pi * 0.8
    z, vz = 0.02 * np.sin(w * t) ** 6, 0.02 * 6 * w * np.sin(w * t) ** 5 * np.cos(w * t)
    return -0.5 * z, -0.5 * vz, z, vz


def balance_error(scene: Scene, path: NDArray[np.float64], hand: Hands, h: float) -> tuple[float, float]:
    """Largest difference between energy change and work done, and the largest work through one flow."""
    times = np.arange(len(path)) * h
    at = samples(hand, times)
    total = stored_along(path, at, scene.parts, scene.packed).sum(axis=1)
    work = work_along(times, path, at, scene.parts, scene.packed)
    return float(np.abs(total - total[0] - work.sum(axis=1)).max()), float(np.abs(work).max())


@pytest.mark.slow
@pytest.mark.parametrize("free", [True, False])
@every
@pytest.mark.sampled(2)
def test_energy_balance_converges_with_sixth_order_to_twelve_digits(values: dict[str, Any], free: bool) -> None:
    scene = scene_of(free, **values)
    start = resting_state(scene, 0.02)
    errors = [
        balance_error(scene, sampled_trajectory(scene, start, gentle_hands, h, round(1 / h), counts=4), gentle_hands, h)
        for h in STEP_LENGTHS
    ]
    assert convergence_order([error for error, _ in errors]) == pytest.approx(6, abs=0.4)
    assert errors[-1][0] < 2e-12 * errors[-1][1]


def test_work_is_integrated_from_the_start_for_each_flow() -> None:
    scene = scene_of()
    path = trajectory(scene, MOVING_STATE[:6], waving, 1e-3, 50)
    times = np.arange(51) * 1e-3
    work = work_along(times, path, samples(waving, times), scene.parts, scene.packed)
    assert work.shape == (51, len(Powers._fields))
    assert (work[0] == 0).all()
    assert (np.diff(work[:, 2:4], axis=0) <= 0).all()
    # The trapezoidal rule is coarse, but tells the flows apart.
    powers = np.array(
        [flows(tuple(x), *waving(t), scene.parts, scene.record) for x, t in zip(path.tolist(), times, strict=True)]
    )
    coarse = np.vstack([np.zeros(len(Powers._fields)), np.cumsum((powers[1:] + powers[:-1]) / 2 * 1e-3, axis=0)])
    assert work == pytest.approx(coarse, abs=0.02 * np.abs(coarse).max())


@pytest.mark.slow
def test_energy_missing_from_the_balance_is_lost_at_the_stops() -> None:
    """In the paper's model a stop removes kinetic energy from the ball alone."""
    scene = scene_of(board="level", ball_stop=0.1, restitution=0.5)
    times = np.arange(1001) * 1e-3
    z, *_ = resting_state(scene, 0.0)
    path = trajectory(scene, (z, 0.0, 0.0, 0.0, 0.0, 0.3), still, 1e-3, 1000)
    at = samples(still, times)
    total = stored_along(path, at, scene.parts, scene.packed).sum(axis=1)
    work = work_along(times, path, at, scene.parts, scene.packed).sum(axis=1)
    assert (total - total[0] - work)[-1] == pytest.approx(-0.05 * 0.3**2 / 2 * (1 - 0.25), rel=1e-9)


# --- drift of RK4 ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    "values", [{"balls": 0}, {}, {"model": "lagrangian", "balls": 2, "ball_height": 0.02, "ball_inertia": 0.4}], ids=str
)
@pytest.mark.sampled(1)
def test_energy_drift_of_an_undamped_scene_falls_with_fourth_order(values: dict[str, Any]) -> None:
    scene = scene_of(c_h=0.0, **values)
    drifts = []
    for h in (1e-3, 5e-4, 2.5e-4, 1.25e-4):
        path = trajectory(scene, MOVING_STATE[: scene.length], still, h, round(0.4 / h))
        total = stored_along(path, np.zeros((len(path), 4)), scene.parts, scene.packed).sum(axis=1)
        work = work_along(np.arange(len(path)) * h, path, np.zeros((len(path), 4)), scene.parts, scene.packed)
        drifts.append(float(np.abs(total - total[0] - work[:, 5]).max() / abs(total[0])))
    assert convergence_order(drifts) > 3.8
    assert drifts[-1] < 1e-5
