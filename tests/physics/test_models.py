"""The equations, compared with independent ones, closed forms, mirror images and limiting cases."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from independent import rates as independent_rates
from independent import solution, still, waving
from numpy.typing import NDArray
from scipy.linalg import expm
from trajectories import Scene, changed, convergence_order, drive, scene_of, trajectory

from evidence.physics.statics import equilibrium
from netboard.physics.scene.models import coupling, rates, stopped

heights = st.floats(-0.1, 0.1)
speeds = st.floats(-1, 1)
boards = (heights, speeds, st.floats(-7, 7), st.floats(-20, 20))
balls = (st.floats(-0.35, 0.35), speeds)
states = st.sampled_from([1, 2]).flatmap(lambda n: st.tuples(*boards, *balls * n))
hands = st.tuples(heights, speeds, heights, speeds)

SCENES: dict[str, dict[str, Any]] = {
    "paper": {},
    "printed": {"ball_sign": "printed", "ball_inertia": 0.4, "b_z": 0.3, "b_theta": 0.01},
    "uneven": {"coupling": "left"},
    "hinged": {"board": "hinged"},
    "level": {"board": "level"},
    "lagrangian": {"model": "lagrangian"},
    "rolling": {"model": "lagrangian", "ball_inertia": 0.4, "ball_height": 0.03, "b_theta": 0.01},
    "rolling, uneven": {"model": "lagrangian", "ball_inertia": 0.4, "ball_height": 0.03, "coupling": "right"},
    "friction": {"b_p": 0.02, "rolling_resistance": 0.01, "ball_inertia": 0.4},
    "friction, lagrangian": {"b_p": 0.02, "rolling_resistance": 0.01, "model": "lagrangian", "ball_height": 0.03},
    "rolling, hinged": {"model": "lagrangian", "ball_inertia": 0.4, "ball_height": 0.03, "board": "hinged"},
    "rolling, level": {"model": "lagrangian", "ball_inertia": 0.4, "ball_height": 0.03, "board": "level"},
}
both = pytest.mark.parametrize("model", ["paper", "lagrangian"])
every = pytest.mark.parametrize("values", SCENES.values(), ids=SCENES.keys())


def constrained(scene: Scene, state: tuple[float, ...]) -> tuple[float, ...]:
    """The state with the constrained coordinates of the board set to zero."""
    z, vz, theta, omega, *rest = state
    if not scene.parts.heaves:
        z, vz = 0.0, 0.0
    if not scene.parts.tilts:
        theta, omega = 0.0, 0.0
    return z, vz, theta, omega, *rest


def accelerations(scene: Scene, state: tuple[float, ...], hand: Any) -> tuple[float, ...]:
    """The rates that the kernels give."""
    return rates(state, *drive(hand, scene.record), scene.parts, scene.record)


# --- independent equations -------------------------------------------------------------------------------------------


@every
@given(free=st.booleans(), state=states, hand=hands)
def test_rates_match_the_independent_equations(values: dict[str, Any], free: bool, state: Any, hand: Any) -> None:
    scene = scene_of(free, balls=(len(state) - 4) // 2, **values)
    state = constrained(scene, state)
    expected = np.array(independent_rates(np.array(state), hand, scene.physics, free))
    # Forces of some 100 N nearly cancel; their rounding error accelerates a board of 10 g by this much.
    assert accelerations(scene, state, hand) == pytest.approx(expected, rel=1e-9, abs=1e-9)


START = (0.002, 0.1, 0.05, -1.0, 0.1, 0.3, -0.05, 0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    "values",
    [
        {},
        {"ball_sign": "printed"},
        {"model": "lagrangian", "balls": 2, "ball_inertia": 0.4, "ball_height": 0.03, "b_theta": 0.01},
    ],
    ids=["downhill", "printed", "lagrangian"],
)
def test_rk4_converges_with_fourth_order(values: dict[str, Any]) -> None:
    scene = scene_of(**values)
    start, end = START[: scene.length], 0.048
    true = solution(start, waving, np.array([0.0, end]), scene.physics)[-1]
    ends = [trajectory(scene, start, waving, end / steps, steps)[-1] for steps in (96, 192, 384)]
    for i in range(scene.length):
        assert convergence_order([abs(found[i] - true[i]) for found in ends]) == pytest.approx(4, abs=0.3)


# --- closed forms ----------------------------------------------------------------------------------------------------


def heave_matrix(scene: Scene, balls: int) -> NDArray[np.float64]:
    """Of x = (z, vz, 1, hand z, hand vz), for a level board and hands that move together: x' = A x."""
    k, record = scene.physics, scene.record
    stiffness, damping = record["k_left"] + record["k_right"], record["c_left"] + record["c_right"]
    inertia = k.M + (balls * k.m if k.model == "lagrangian" else 0.0)
    a = np.zeros((5, 5))
    a[0, 1] = a[3, 4] = 1
    weight = (k.M + balls * k.m) * k.g
    a[1] = np.array([-(stiffness + k.k_s), -(damping + k.b_z), -weight, stiffness, damping]) / inertia
    return a


def rising_hands(t: float) -> tuple[float, float, float, float]:
    """Both hands at constant velocity."""
    return 0.01 + 0.15 * t, 0.15, 0.01 + 0.15 * t, 0.15


LEVEL: list[dict[str, Any]] = [
    {"balls": 0},
    {"balls": 2, "board": "level", "b_z": 0.5},
    {"balls": 2, "board": "level", "model": "lagrangian", "coupling": "right"},
]


@pytest.mark.parametrize("values", LEVEL, ids=["bare", "paper", "lagrangian"])
def test_rk4_step_of_a_level_board_is_the_taylor_polynomial_of_its_matrix(values: dict[str, Any]) -> None:
    scene = scene_of(**values)
    a = 1e-3 * heave_matrix(scene, scene.physics.balls)
    by_matrix = np.eye(5) + a @ (np.eye(5) + a / 2 @ (np.eye(5) + a / 3 @ (np.eye(5) + a / 4)))
    start = (0.003, -0.2, 0.0, 0.0, 0.1, 0.5, -0.1, 0.0)[: scene.length]
    end = trajectory(scene, start, rising_hands, 1e-3, 1)[-1]
    assert end[:2] == pytest.approx((by_matrix @ [0.003, -0.2, 1.0, 0.01, 0.15])[:2], rel=1e-13)
    assert (end[2:4] == 0).all()


@pytest.mark.parametrize("values", LEVEL, ids=["bare", "paper", "lagrangian"])
def test_level_board_follows_the_exact_solution(values: dict[str, Any]) -> None:
    scene = scene_of(**values)
    start = (0.003, -0.2, 0.0, 0.0, 0.1, 0.5, -0.1, 0.0)[: scene.length]
    path = trajectory(scene, start, rising_hands, 4e-5, 2000)
    a = heave_matrix(scene, scene.physics.balls)
    for i in (100, 500, 2000):
        exact = expm(a * i * 4e-5) @ [0.003, -0.2, 1.0, 0.01, 0.15]
        assert path[i, 0] == pytest.approx(exact[0], abs=1e-12)
        assert path[i, 4::2] == pytest.approx(np.array(start[4::2]) + np.array(start[5::2]) * i * 4e-5, abs=1e-14)


@both
def test_board_without_springs_falls_freely_at_constant_angular_velocity(model: Any) -> None:
    scene = scene_of(model=model, coupling="none", k_s=0.0, balls=0)
    end = trajectory(scene, (0.1, 0.2, 0.3, 4.0), still, 1e-3, 500)[-1]
    assert end == pytest.approx((0.1 + 0.1 - 9.81 / 8, 0.2 - 9.81 / 2, 2.3, 4.0), rel=1e-13)


def test_lagrangian_ball_falls_with_the_board() -> None:
    scene = scene_of(model="lagrangian", coupling="none", k_s=0.0, ball_inertia=0.4)
    end = trajectory(scene, (0.1, 0.2, 0.0, 0.0, 0.05, 0.3), still, 1e-3, 500)[-1]
    # In free fall it moves along the board at constant velocity.
    assert end == pytest.approx((0.1 + 0.1 - 9.81 / 8, 0.2 - 9.81 / 2, 0.0, 0.0, 0.2, 0.3), rel=1e-12, abs=1e-13)


@both
@pytest.mark.parametrize(("beta", "share"), [(0.0, 1), (0.4, 5 / 7), (2 / 3, 3 / 5)])
def test_ball_on_an_immovable_slope_slides_or_rolls_as_in_a_textbook(model: Any, beta: float, share: float) -> None:
    scene = scene_of(model=model, board="hinged", ball_inertia=beta)
    slope = changed(scene.record, I=1e30)
    out = rates((0.0, 0.0, 0.3, 0.0, 0.2, 0.5), 0.0, 0.0, scene.parts, slope)
    assert out[4:] == pytest.approx((0.5, -share * 9.81 * math.sin(0.3)), rel=1e-14)


def test_undamped_level_board_follows_the_rk4_amplification_factor() -> None:
    scene = scene_of(c_h=0.0, balls=0)
    x = 1j * 1e-3 * math.sqrt((2 * float(scene.physics.k_h) + float(scene.record["k_s"])) / float(scene.record["M"]))
    factor = 1 + x * (1 + x / 2 * (1 + x / 3 * (1 + x / 4)))
    rest = equilibrium(0.0, 0.0, (), scene.parts, scene.record).z
    end = trajectory(scene, (rest + 0.01, 0.0, 0.0, 0.0), still, 1e-3, 1000)[-1]
    assert end[0] - rest == pytest.approx((0.01 * factor**1000).real, abs=1e-13)


def test_lagrangian_model_conserves_vertical_momentum_and_energy() -> None:
    """Without gravity and springs, board and ball tumble with constant momentum and energy."""
    scene = scene_of(model="lagrangian", coupling="none", k_s=0.0, g=0.0)
    path = trajectory(scene, (0.0, 0.3, 0.2, 3.0, 0.2, -0.4), still, 2e-4, 2000)
    _, vz, theta, omega, p, vp = path.T
    momentum = 0.01 * vz + 0.05 * (vz + vp * np.sin(theta) + p * omega * np.cos(theta))
    across, up = vp * np.cos(theta) - p * omega * np.sin(theta), vz + vp * np.sin(theta) + p * omega * np.cos(theta)
    energy = (0.01 * vz**2 + 0.0004 * omega**2 + 0.05 * (across**2 + up**2)) / 2
    assert np.ptp(omega) > 0.9
    assert momentum == pytest.approx(momentum[0], rel=1e-8)
    assert energy == pytest.approx(energy[0], rel=1e-8)


# --- symmetry --------------------------------------------------------------------------------------------------------


def mirrored(state: tuple[float, ...]) -> tuple[float, ...]:
    z, vz, *rest = state
    return z, vz, *(-value for value in rest)


def mirrored_record(record: Any) -> Any:
    """The record with the couplings of the two sides exchanged."""
    names = {"k_left": "k_right", "c_left": "c_right"}
    exchanged = {a: record[b] for pair in names.items() for a, b in (pair, pair[::-1])}
    return changed(record, **exchanged)


@every
@given(free=st.booleans(), state=states, left=speeds, right=speeds)
def test_mirrored_rates_and_forces_are_bit_identical(
    values: dict[str, Any], free: bool, state: Any, left: float, right: float
) -> None:
    scene = scene_of(free, balls=(len(state) - 4) // 2, **values)
    behind = mirrored_record(scene.record)
    here = rates(state, left, right, scene.parts, scene.record)
    assert mirrored(rates(mirrored(state), right, left, scene.parts, behind)) == here
    forces = coupling(state, left, right, scene.parts, scene.record)
    assert coupling(mirrored(state), right, left, scene.parts, behind) == forces[::-1]


@both
@given(state=states, restitution=st.floats(0, 1))
def test_mirrored_impacts_are_bit_identical(model: Any, state: Any, restitution: float) -> None:
    scene = scene_of(balls=(len(state) - 4) // 2, model=model, ball_stop=0.1, restitution=restitution, ball_height=0.02)
    here = stopped(state, scene.parts, scene.record)
    assert mirrored(stopped(mirrored(state), scene.parts, scene.record)) == here


# --- limiting cases of a scene ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("values", [one for one in SCENES.values() if "b_p" not in one])  # friction acts without mass
@given(state=states, hand=hands)
def test_bare_board_is_bit_identical_to_one_with_massless_balls(values: dict[str, Any], state: Any, hand: Any) -> None:
    scene = scene_of(balls=(len(state) - 4) // 2, **values)
    bare = scene_of(**(values | {"balls": 0, "b_theta": scene.physics.b_theta}))
    state = constrained(scene, state)
    light = scene._replace(packed=changed(scene.packed, m=0.0))
    assert accelerations(light, state, hand)[:4] == accelerations(bare, state[:4], hand)
    fixed = scene._replace(parts=scene.parts._replace(free=False))
    carried = fixed._replace(packed=changed(scene.packed, fixed_load=0.0))
    assert accelerations(carried, state, hand)[:4] == accelerations(bare, state[:4], hand)


@both
@given(state=states, hand=hands)
def test_fixed_ball_equals_a_ball_that_cannot_accelerate(model: Any, state: Any, hand: Any) -> None:
    fixed, scene = (scene_of(free, model=model, balls=(len(state) - 4) // 2) for free in (False, True))
    state = tuple(0.0 if i in (5, 7) else value for i, value in enumerate(state))
    pinned = scene._replace(packed=changed(scene.packed, mass_ratio=0.0, ball_gravity=0.0))
    expected = accelerations(pinned, state, hand)
    assert accelerations(fixed, state, hand) == pytest.approx(expected, rel=1e-11, abs=1e-9)
    if model == "paper":
        assert accelerations(fixed, state, hand) == expected


@both
@given(state=states, hand=hands)
def test_level_board_equals_a_board_of_huge_moment_of_inertia(model: Any, state: Any, hand: Any) -> None:
    level, scene = (scene_of(board=board, model=model, balls=(len(state) - 4) // 2) for board in ("level", "free"))
    heavy = scene._replace(packed=changed(scene.packed, I=1e30))
    state = constrained(level, state)
    out = accelerations(level, state, hand)
    assert out == pytest.approx(accelerations(heavy, state, hand), rel=1e-11, abs=1e-20)
    assert out[2:4] == (0, 0)


@both
@given(state=states, hand=hands)
def test_hinged_board_equals_a_board_of_huge_mass(model: Any, state: Any, hand: Any) -> None:
    hinged, scene = (scene_of(board=board, model=model, balls=(len(state) - 4) // 2) for board in ("hinged", "free"))
    state = constrained(hinged, state)
    # A spring whose stiffness equals the mass carries the weight.
    heavy = scene._replace(packed=changed(scene.packed, M=1e30, k_s=1e30))
    sunk = (-scene.physics.g, *state[1:])
    assert accelerations(hinged, state, hand)[1] == 0
    assert accelerations(hinged, state, hand) == pytest.approx(accelerations(heavy, sunk, hand), rel=1e-9, abs=1e-9)


@pytest.mark.slow
@both
@given(state=st.tuples(*boards, *balls), hand=hands)
def test_two_coincident_balls_equal_one_of_twice_the_mass(model: Any, state: Any, hand: Any) -> None:
    twins, scene = (scene_of(balls=n, model=model, ball_inertia=0.4, ball_height=0.03) for n in (2, 1))
    heavy = scene._replace(packed=changed(scene.packed, m=0.1))
    expected = accelerations(heavy, state, hand)
    out = accelerations(twins, (*state, *state[4:]), hand)
    assert out == pytest.approx((*expected, *expected[4:]), rel=1e-10, abs=1e-10)


@both
@given(state=st.tuples(*boards, *balls, *balls), hand=hands)
def test_rates_are_independent_of_the_order_of_the_balls(model: Any, state: Any, hand: Any) -> None:
    scene = scene_of(balls=2, model=model, ball_inertia=0.4, ball_height=0.03)
    other = accelerations(scene, (*state[:4], *state[6:], *state[4:6]), hand)
    # A sum of two terms is commutative.
    assert (*other[:4], *other[6:], *other[4:6]) == accelerations(scene, state, hand)


@every
@given(state=states, hand=hands)
def test_coupling_forces_account_for_the_board_accelerations(values: dict[str, Any], state: Any, hand: Any) -> None:
    scene = scene_of(**(values | {"balls": 0, "board": "free"}))
    state = state[:4]
    left, right = coupling(state, *drive(hand, scene.record), scene.parts, scene.record)
    k = scene.physics
    force = (left + right) - k.M * k.g - k.k_s * state[0] - k.b_z * state[1]
    torque = (right - left) * k.l * math.cos(state[2]) - k.b_theta * state[3]
    out = accelerations(scene, state, hand)
    assert (out[1], out[3]) == pytest.approx((force / k.M, torque / k.I), rel=1e-9, abs=1e-9)


# --- stops -----------------------------------------------------------------------------------------------------------


@given(state=states, restitution=st.floats(0, 1))
def test_stop_in_the_paper_model_reflects_the_ball_alone(state: Any, restitution: float) -> None:
    scene = scene_of(ball_stop=0.1, restitution=restitution, balls=(len(state) - 4) // 2)
    after = stopped(state, scene.parts, scene.record)
    assert after[:4] == state[:4]
    for i in range(4, len(state), 2):
        p, vp = state[i : i + 2]
        assert after[i] == max(-0.1, min(0.1, p))
        expected = -restitution * vp if abs(p) > 0.1 and p * vp > 0 else vp
        assert after[i + 1] == pytest.approx(expected, rel=1e-14, abs=1e-16)


def test_elastic_lagrangian_impact_conserves_vertical_momentum_and_energy() -> None:
    scene = scene_of(model="lagrangian", ball_stop=0.1, restitution=1.0, ball_height=0.02, ball_inertia=0.4, balls=2)
    state = (0.01, 0.4, 0.3, -2.0, 0.1001, 0.8, -0.05, 0.3)
    after = stopped(state, scene.parts, scene.record)
    assert after[5] == pytest.approx(-0.8)

    def momentum_and_energy(x: tuple[float, ...]) -> tuple[float, float]:
        _, vz, theta, omega, *rest = x
        s, c = math.sin(theta), math.cos(theta)
        momentum, energy = 0.01 * vz, (0.01 * vz**2 + 0.0004 * omega**2) / 2
        for p, vp in zip((0.1, -0.05), rest[1::2], strict=True):
            w = vp - 0.02 * omega
            momentum += 0.05 * (vz + w * s + p * omega * c)
            across, up = w * c - p * omega * s, vz + w * s + p * omega * c
            energy += 0.05 * (across**2 + up**2 + 0.4 * w**2) / 2
        return momentum, energy

    assert momentum_and_energy(after) == pytest.approx(momentum_and_energy(state), rel=1e-12)


@both
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_no_ball_passes_a_stop(model: Any, restitution: float) -> None:
    scene = scene_of(model=model, ball_stop=0.1, restitution=restitution, balls=2, ball_height=0.02)
    path = trajectory(scene, (0.0, 0.0, 0.05, 0.0, 0.05, 0.5, -0.05, -0.5), waving, 1e-3, 2000)
    assert np.isfinite(path).all()
    assert np.abs(path[:, 4::2]).max() == 0.1
    if restitution == 0:
        at_stop = np.abs(path[:, 4]) == 0.1
        assert at_stop.sum() > 10


# --- non-finite values -----------------------------------------------------------------------------------------------

anything = st.floats()


@both
@given(free=st.booleans(), state=st.tuples(*[anything] * 6), left=anything, right=anything)
def test_kernels_accept_any_float_and_propagate_non_finite_values(
    model: Any, free: bool, state: Any, left: float, right: float
) -> None:
    scene = scene_of(free, model=model, ball_stop=0.1, ball_height=0.02)
    with np.errstate(all="ignore"):  # numpy's own numbers warn when the kernels are run in plain Python
        out = rates(state, left, right, scene.parts, scene.record)
        others = coupling(state, left, right, scene.parts, scene.record)
        moved = stopped(state, scene.parts, scene.record)
    assert (len(out), len(others), len(moved)) == (6, 2, 6)
    assert all(isinstance(value, float) for value in (*out, *others, *moved))
    if not all(math.isfinite(value) for value in (*state[:4], left, right)):
        assert not all(math.isfinite(value) for value in out)
