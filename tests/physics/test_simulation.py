"""Simulation against scipy's DOP853 on independent equations with continuous hands."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import netboard.physics.simulation
from netboard.base.errors import ConfigError
from netboard.base.tables.scene import Physics
from netboard.physics.hands.sampled import (
    INTERPOLATIONS,
    MAX_FILLED_INTERVAL,
    Hands,
    find_gaps,
    hold_hands,
    styluses_along,
)
from netboard.physics.simulation import (
    Motion,
    Steps,
    choose_steps,
    columns_of,
    energies_of,
    is_stably_integrated,
    simulate,
)

Array = NDArray[np.float64]
Waves = Callable[[Array], tuple[Array, Array]]
"""Heights and rates of both styluses, shape (times, 2), at any times."""

COLD = (0.0, 0.0, 0.0, 0.0, -0.03, 0.0)
"""The board at rest at the origin, whatever the hands do there: the quickest start there is."""


# --- hands that nobody sampled -----------------------------------------------------------------------------------


def waving(seed: int) -> Waves:
    """Both hands together and against each other, in sines of up to 4 Hz and 0.5 m/s."""
    random = np.random.default_rng(seed)
    omega = 2 * np.pi * random.uniform(0.2, 4.0, (2, 5))
    size, phase = random.uniform(0.2, 1.0, (2, 5)) * 0.1 / omega, random.uniform(0, 2 * np.pi, (2, 5))

    def waves(t: Array) -> tuple[Array, Array]:
        angle = np.asarray(t)[..., None, None] * omega + phase
        together, against = (size * np.sin(angle)).sum(-1), (size * omega * np.cos(angle)).sum(-1)
        turn = np.array([[1.0, 1.0], [-1.0, 1.0]])
        return together @ turn, against @ turn

    return waves


@dataclass(frozen=True)
class Reaches:
    """Movements of least jerk, some begun before the last is over."""

    begins: Array
    lasts: Array
    sizes: Array

    def __call__(self, t: Array) -> tuple[Array, Array]:
        s = np.clip((np.asarray(t)[..., None, None] - self.begins) / self.lasts, 0.0, 1.0)
        z = self.sizes * s**3 * (10 - 15 * s + 6 * s**2)
        return z.sum(-1), (self.sizes / self.lasts * 30 * s**2 * (1 - s) ** 2).sum(-1)

    def breaks(self) -> list[float]:
        return sorted({*self.begins.ravel().tolist(), *(self.begins + self.lasts).ravel().tolist()})


def reaching(seed: int) -> Reaches:
    random = np.random.default_rng(seed)
    begins = 0.1 + np.cumsum(random.uniform(0.25, 0.6, (2, 5)), axis=1)
    return Reaches(begins, random.uniform(0.3, 0.7, (2, 5)), random.uniform(-0.03, 0.03, (2, 5)))


def sampled(waves: Waves, t: Array) -> Hands:
    return Hands(t, *waves(t))


# --- the truth ---------------------------------------------------------------------------------------------------


def forces(x: Array, z: Array, vz: Array, k: Physics) -> tuple[Array, Array]:
    """Of the hands on the board (paper eq. 1-2)."""
    arm, rate = k.l * np.sin(x[2]), k.l * x[3] * np.cos(x[2])
    left = k.k_h * (z[..., 0] - (x[0] - arm)) + k.c_h * (vz[..., 0] - (x[1] - rate))
    right = k.k_h * (z[..., 1] - (x[0] + arm)) + k.c_h * (vz[..., 1] - (x[1] + rate))
    return left, right


def paper(x: Array, left: float, right: float, k: Physics, free: bool) -> list[float]:
    s, c = np.sin(x[2]), np.cos(x[2])
    az = (left + right - k.M * k.g - k.m * k.g * c**2 - k.k_s * x[0]) / k.M
    ao = ((right - left) * k.l * c - k.m * k.g * x[4] * c) / k.I
    return [x[1], az, x[3], ao, x[5], -k.g * s if free else 0.0]


def lagrangian(x: Array, left: float, right: float, k: Physics, free: bool) -> list[float]:
    """Of T = (M z'2 + I theta'2 + m |(p cos, z + p sin)'|2) / 2, with or without p as a coordinate."""
    z, vz, theta, omega, p, vp = x
    s, c = np.sin(theta), np.cos(theta)
    force, torque = left + right - (k.M + k.m) * k.g - k.k_s * z, (right - left) * k.l * c - k.m * k.g * p * c
    if free:  # m p'' = m (p omega2 - g s - s z''), put into the other two
        mass = [[k.M + k.m * c**2, k.m * p * c], [k.m * p * c, k.I + k.m * p**2]]
        force += k.m * k.g * s**2 - 2 * k.m * vp * omega * c + k.m * p * omega**2 * s - k.m * s * p * omega**2
        torque -= 2 * k.m * p * vp * omega
    else:
        mass = [[k.M + k.m, k.m * p * c], [k.m * p * c, k.I + k.m * p**2]]
        force += k.m * p * omega**2 * s
    az, ao = np.linalg.solve(mass, [force, torque])
    return [vz, az, omega, ao, vp, p * omega**2 - k.g * s - s * az if free else 0.0]


def truth(
    waves: Waves, t: Array, k: Physics, start: Sequence[float], free: bool = True, breaks: Sequence[float] = ()
) -> Array:
    """States and forces at these times, shape (times, 8)."""
    equations = paper if k.model == "paper" else lagrangian

    def derivatives(time: float, x: Array) -> list[float]:
        left, right = forces(x, *waves(np.asarray(time)), k)
        return equations(x, left, right, k, free)

    edges = [t[0], *(edge for edge in breaks if t[0] < edge < t[-1]), t[-1]]
    x, pieces = np.asarray(start, float), []
    for begin, end in pairwise(edges):
        inside = t[(t >= begin) & (t < end)]
        found = solve_ivp(
            derivatives, (begin, end), x, "DOP853", np.append(inside, end), rtol=1e-11, atol=1e-15, max_step=1e-2
        ).y
        x = found[:, -1]
        pieces.append(found[:, : len(inside)])
    states = np.hstack([*pieces, x[:, None]])
    return np.vstack([states, *forces(states, *waves(t), k)]).T


def error(motion: Motion, expected: Array) -> float:
    """The largest error of all signals, each in units of its own range."""
    found = np.hstack([motion.states, motion.forces])
    size = np.where(np.ptp(expected, axis=0) > 0, np.ptp(expected, axis=0), 1.0)
    return float((np.abs(found - expected).max(axis=0) / size).max())


T = np.arange(3001) / 1000
LAGRANGIAN = Physics(model="lagrangian")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.sampled(1)
def test_smooth_hands_have_an_error_below_1e_6_at_any_rate(seed: int) -> None:
    waves = waving(seed)
    expected = truth(waves, T, Physics(), COLD)
    assert error(simulate(sampled(waves, T), Physics(), COLD), expected) < 2e-8
    assert error(simulate(sampled(waves, T[::4]), Physics(), COLD), expected) < 2e-8
    assert error(simulate(sampled(waves, np.arange(301) / 100), Physics(), COLD), expected) < 2e-8
    random = np.random.default_rng(seed)
    irregular = np.arange(601) / 200 + np.clip(random.normal(0.0, 5e-4, 601), -1e-3, 1e-3)
    irregular[[0, -1]] = 0.0, 3.0
    assert error(simulate(sampled(waves, irregular), Physics(), COLD), expected) < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.sampled(1)
def test_minimum_jerk_reaches_have_an_error_below_1e_6(seed: int) -> None:
    hands = reaching(seed)
    expected = truth(hands, T, Physics(), COLD, breaks=hands.breaks())
    assert error(simulate(sampled(hands, T), Physics(), COLD), expected) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("physics", "free"),
    [
        (LAGRANGIAN, True),
        (LAGRANGIAN, False),
        (Physics(), False),
        (Physics(k_h=400.0, c_h=4.0, k_s=0.0, M=0.02), True),
        (Physics(k_h=2000.0, c_h=0.5), True),
        (Physics(c_h=40.0), True),
    ],
    ids=["lagrangian", "lagrangian fixed", "fixed", "heavier", "hardly damped", "stiff"],
)
@pytest.mark.sampled(3)
def test_other_scenes_have_an_error_below_1e_6(physics: Physics, free: bool) -> None:
    waves, t = waving(7), T[:1001]
    expected = truth(waves, t, physics, COLD, free)
    assert error(simulate(sampled(waves, t), physics, COLD, free=free), expected) < 2e-7


def test_extrapolated_hands_equal_those_of_a_live_tick() -> None:
    """Solved anew from sample to sample, with what each hold says of the hands."""
    hands, physics = sampled(waving(3), T[:21]), Physics()
    az = np.vstack([np.zeros(2), np.diff(hands.vz, axis=0) / 1e-3])
    for hold, keeps_rate, keeps_acceleration in (("zoh", 0, 0), ("cv", 1, 0), ("ca", 1, 1)):
        x, expected = np.array(COLD), []
        for i in range(20):

            def waves(t: Array, i: int = i, v: int = keeps_rate, a: int = keeps_acceleration) -> tuple[Array, Array]:
                age, bend = np.asarray(t)[..., None], a * az[i]
                return hands.z[i] + v * hands.vz[i] * age + 0.5 * bend * age**2, hands.vz[i] + bend * age

            piece = truth(waves, np.array([0.0, 1e-3]), physics, x)
            expected.append(piece[0])
            x = piece[1, :6]
        motion = simulate(hands, physics, COLD, hold=hold)
        motion = replace(motion, states=motion.states[:20], forces=motion.forces[:20])
        assert error(motion, np.array(expected)) < 1e-9


# --- hands between samples ---------------------------------------------------------------------------------------


def test_sparse_samples_of_degree_7_polynomials_are_interpolated_exactly() -> None:
    left, right = Polynomial([1, -2, 3, 1, -5, 2, 4, -3]), Polynomial([0, 1, 0, -2, 0, 0, 3, 5])
    t = np.array([0.0, 0.02, 0.031, 0.05, 0.06, 0.08])
    hands = Hands(t, np.stack([left(t), right(t)], 1), np.stack([left.deriv()(t), right.deriv()(t)], 1))
    held = hold_hands(hands, "hermite")
    times = held.ticks / held.scale
    assert np.diff(times).max() <= MAX_FILLED_INTERVAL * (1 + 1e-9)
    assert set(np.rint(t * held.scale)) <= set(held.ticks)
    np.testing.assert_allclose(held.z, np.stack([left(times), right(times)], 1), rtol=0, atol=1e-14)
    np.testing.assert_allclose(held.vz, np.stack([left.deriv()(times), right.deriv()(times)], 1), rtol=0, atol=1e-11)


def test_close_samples_do_not_distort_the_interpolation_of_distant_ones() -> None:
    t = np.array([0.0, 0.004, 0.008, 0.0080001, 0.012, 0.016])
    hands = sampled(waving(0), t)
    hands.z[3] += 1e-6  # 10 m/s in the twinkling of an eye
    held = hold_hands(hands, "hermite")
    assert np.abs(held.vz).max() < 1.0


@pytest.mark.parametrize("count", [2, 3])
def test_two_or_three_samples_are_interpolated(count: int) -> None:
    t = np.arange(count) * 0.01
    held = hold_hands(Hands(t, np.stack([t**3, -t], 1), np.stack([3 * t**2, 0 * t - 1], 1)), "hermite")
    times = held.ticks / held.scale
    np.testing.assert_allclose(held.z, np.stack([times**3, -times], 1), atol=1e-15)


def test_dense_samples_are_used_unchanged() -> None:
    hands = sampled(waving(0), T[:50])
    held = hold_hands(hands, "hermite")
    assert held.z is hands.z
    np.testing.assert_array_equal(styluses_along(held, held.ticks)[:, 0::2], hands.z)
    np.testing.assert_array_equal(styluses_along(held, held.ticks)[:, 1::2], hands.vz)


GAPPED = np.concatenate((np.arange(10), np.arange(30, 40), np.arange(90, 100))) / 1000


def test_gaps_are_found() -> None:
    assert find_gaps(GAPPED).tolist() == [9, 19]
    assert find_gaps(T).tolist() == []


@pytest.mark.parametrize("hold", INTERPOLATIONS)
def test_hands_hold_still_across_a_gap_or_are_interpolated(hold: str) -> None:
    hands = sampled(waving(1), GAPPED)
    held = hold_hands(hands, hold)
    before, within = (styluses_along(held, np.array([round(t * held.scale)])) for t in (0.0095, 0.0205))
    z, vz = hands.z[9], hands.vz[9]
    az = (vz - hands.vz[8]) / 1e-3
    if hold == "hermite":
        smooth = waving(1)(np.array([0.0205]))
        np.testing.assert_allclose(within[:, 0::2], smooth[0], atol=1e-5)
        return
    expected = {"zoh": (z, vz), "cv": (z + vz * 5e-4, vz), "ca": (z + vz * 5e-4 + az * 1.25e-7, vz + az * 5e-4)}[hold]
    np.testing.assert_allclose(before[0, 0::2], expected[0], rtol=1e-12)
    np.testing.assert_allclose(before[0, 1::2], expected[1], rtol=1e-12)
    rest = {"zoh": z, "cv": z + vz * 1e-3, "ca": z + vz * 1e-3 + az * 5e-7}[hold]
    np.testing.assert_allclose(within[0, 0::2], rest, rtol=1e-12)
    assert within[0, 1::2].tolist() == [0.0, 0.0]


def test_samples_too_close_in_time_are_refused() -> None:
    with pytest.raises(ConfigError, match="samples 2 and 3 are less than 1e-11 s apart"):
        hold_hands(Hands(np.array([0.0, 1.0, 1.0 + 1e-13]), np.zeros((3, 2)), np.zeros((3, 2))), "zoh")


# --- rows and steps ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("first", "dt", "rows"), [(0.0, 1e-3, 101), (-0.05, 3e-3, 34), (1.7e9, 1e-3, 101), (12.5, 1 / 3e3, 301)]
)
def test_rows_cover_the_first_to_the_last_sample(first: float, dt: float, rows: int) -> None:
    t = first + np.arange(101) / 1000
    motion = simulate(sampled(waving(0), t), Physics(), COLD, dt=dt)
    assert motion.states.shape == (rows, 6)
    assert motion.forces.shape == (rows, 2)
    np.testing.assert_allclose(motion.t, first + np.arange(rows) * dt, rtol=0, atol=1e-6 if first > 1e6 else 1e-11)
    assert motion.states[0].tolist() == list(COLD)


def test_times_are_exact_decimals() -> None:
    assert simulate(sampled(waving(0), T[:101]), Physics(), COLD).t.tolist() == [i / 1000 for i in range(101)]


def test_result_is_independent_of_the_time_origin() -> None:
    """Only the differences of times do, and the digits that float64 has left for them."""
    waves = waving(0)
    at_zero, later = (simulate(Hands(t, *waves(T[:301])), Physics(), COLD).states for t in (T[:301], 5000.0 + T[:301]))
    np.testing.assert_array_equal(at_zero, later)


def test_result_is_independent_of_the_chunk_size(monkeypatch: pytest.MonkeyPatch) -> None:
    hands = sampled(waving(0), np.arange(101) / 700)
    whole = simulate(hands, Physics(), COLD)
    monkeypatch.setattr(netboard.physics.simulation, "_CHUNK", 7)
    shares: list[float] = []
    parts = simulate(hands, Physics(), COLD, progress=shares.append)
    np.testing.assert_array_equal(whole.states, parts.states)
    np.testing.assert_array_equal(whole.forces, parts.forces)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_method_takes_the_requested_substeps_per_row() -> None:
    hands, good = sampled(waving(0), T[:101]), simulate(sampled(waving(0), T[:101]), Physics(), COLD)
    errors = []
    for substeps in (1, 2, 4):
        motion = simulate(hands, Physics(), COLD, steps=choose_steps(Physics(), method="rk4", substeps=substeps))
        assert motion.count == 100 * substeps
        assert motion.longest == pytest.approx(1e-3 / substeps)
        errors.append(error(motion, np.hstack([good.states, good.forces])))
    assert errors[0] / errors[1] > 12
    assert errors[1] / errors[2] > 12


def test_automatic_step_is_shorter_for_faster_scenes() -> None:
    hands = sampled(waving(0), T[:11])
    scenes = [Physics(c_h=c_h) for c_h in (0.5, 2.0, 100.0)]
    by_tolerance = [simulate(hands, physics, COLD).longest for physics in scenes]
    assert by_tolerance == sorted(by_tolerance, reverse=True)
    assert by_tolerance[0] == pytest.approx(1e-3)  # whole intervals between samples
    assert by_tolerance[-1] < 1e-3
    fixed = [choose_steps(physics, substeps=2).longest for physics in scenes]
    assert fixed == sorted(fixed, reverse=True)
    assert choose_steps(Physics(coupling="none", k_s=0.0, board="level"), substeps=2).longest == 0.005


def test_exact_method_agrees_for_a_level_board() -> None:
    level, hands = Physics(board="level"), sampled(waving(0), T[:301])
    motions = [simulate(hands, level, COLD, steps=choose_steps(level, method=method)) for method in ("auto", "exact")]
    np.testing.assert_allclose(motions[0].states, motions[1].states, rtol=1e-9, atol=1e-12)


# --- what is refused ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("physics", "start", "free", "words"),
    [
        (Physics(balls=2), COLD, True, r"p0, v0: found 1 balls, expected 2 \(physics.balls\)"),
        (Physics(), (np.nan, *COLD[1:]), True, "the initial state is not finite"),
        (Physics(board="hinged"), (0.0, 0.1, *COLD[2:]), True, "z0, vz0: found 0 and 0.1, expected 0: a hinged board"),
        (Physics(board="hinged"), (0.1, 0.0, *COLD[2:]), True, "z0, vz0: found 0.1 and 0, expected 0: a hinged board"),
        (Physics(board="level"), (0.0, 0.0, 0.1, *COLD[3:]), True, "theta0, omega0: found 0.1 and 0, expected 0"),
        (Physics(), (*COLD[:5], 0.2), False, "v0: found 0.2, expected 0: the ball is fixed"),
        (Physics(ball_stop=0.02), COLD, True, "p0: found -0.03, expected within the stops, 0.02 m from the centre"),
    ],
)
def test_impossible_initial_state_is_refused(physics: Physics, start: Sequence[float], free: bool, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        simulate(sampled(waving(0), T[:11]), physics, tuple(start), free=free)


@pytest.mark.parametrize("dt", [0.0, -1.0, np.nan, np.inf, 1e-12, 0.0101])
def test_invalid_row_interval_is_refused(dt: float) -> None:
    with pytest.raises(ConfigError, match=r"dt: found .*, expected from 1e-09 s to the 0.01 s of the hands"):
        simulate(sampled(waving(0), T[:11]), Physics(), COLD, dt=dt)


def test_too_many_rows_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"dt: found 1e-08, which makes 3e\+08 rows, expected at most 1e\+08"):
        simulate(sampled(waving(0), T), Physics(), COLD, dt=1e-8)


def test_too_many_steps_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(netboard.physics.simulation, "MAX_STEPS", 9)
    hands = sampled(waving(0), T[:11])
    for substeps, words in ((1, "taylor needs 10"), (2, "dop853 needs 20")):
        with pytest.raises(ConfigError, match=f"method: {words} steps for a scene this quick"):
            simulate(hands, Physics(), COLD, steps=choose_steps(Physics(), substeps=substeps))


def test_unknown_or_unsuitable_method_is_refused() -> None:
    with pytest.raises(ConfigError, match=r'method: found "rk5", expected auto or one of taylor, euler, .*rk4'):
        choose_steps(Physics(), method="rk5")
    with pytest.raises(ConfigError, match='"exact", which is for boards that cannot tilt'):
        choose_steps(Physics(), method="exact")
    with pytest.raises(ConfigError, match="substeps: found 3, expected 1: the tolerance of taylor gives"):
        choose_steps(Physics(), method="taylor", substeps=3)


def test_too_many_step_lengths_are_refused_for_etdrk4() -> None:
    random = np.random.default_rng(0)
    hands = sampled(waving(0), np.cumsum(random.uniform(0.5e-3, 1.5e-3, 500)))
    with pytest.raises(ConfigError, match="method: etdrk4 needs a table for each length of step"):
        simulate(hands, Physics(), COLD, steps=choose_steps(Physics(), method="etdrk4"))


@pytest.mark.parametrize(("method", "c_h", "held"), [("rk4", 8.0, True), ("rk4", 10.0, False), ("etdrk4", 10.0, True)])
def test_stability_of_a_method_is_detected(method: str, c_h: float, held: bool) -> None:
    physics = Physics(c_h=c_h)
    motion = simulate(sampled(waving(0), T[:11]), physics, COLD, steps=choose_steps(physics, method=method))
    assert is_stably_integrated(motion, physics) is held


FRICTION_LIMITS = {"euler": 2.0, "semi_implicit": 2.0, "verlet": 1.8, "midpoint": 1.8, "rk4": 2.785, "etd2rk": 2.0}
"""Largest rate of friction times the step."""


@pytest.mark.parametrize("model", ["paper", "lagrangian"])
@pytest.mark.parametrize("method", FRICTION_LIMITS)
def test_instability_by_friction_is_detected(method: str, model: Any) -> None:
    nothing = np.zeros((0, 6))
    motion = Motion(nothing[:, 0], nothing, nothing[:, :2], Steps(method, 1e-3, 1, 0.0), 1, 1e-3)
    for factor, stable in ((0.99, True), (1.01, False)):
        rate = factor * FRICTION_LIMITS[method] / motion.longest
        physics = Physics(model=model, k_h=20.0, c_h=0.2, M=0.5, I=0.1, b_p=rate * 0.05)
        assert is_stably_integrated(motion, physics) is stable
        assert is_stably_integrated(motion, physics, free=False), "a fixed ball has no friction"


def test_implicit_method_whose_iteration_diverges_is_reported() -> None:
    """At twice this limit the iteration gives up at once, and the ball rolls as if there were no friction."""
    physics = Physics(b_p=100.0)
    motion = simulate(
        sampled(waving(0), T[:51]), physics, (*COLD[:5], 0.1), steps=choose_steps(physics, method="midpoint")
    )
    assert motion.states[-1, 5] == pytest.approx(0.1, rel=1e-2)
    assert not is_stably_integrated(motion, physics)


def test_diverging_method_is_refused_with_the_time() -> None:
    stiff = Physics(k_h=10_000.0, c_h=100.0)
    with pytest.raises(ConfigError, match=r"not finite from t = 0\.\d+ s on, with euler in steps of 0.001 s, 31.\d of"):
        simulate(sampled(waving(0), T[:501]), stiff, COLD, steps=choose_steps(stiff, method="euler"))


# --- what comes out ----------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("balls", "names"),
    [(0, []), (1, ["p", "vp"]), (3, ["p", "vp", "p2", "vp2", "p3", "vp3"])],
)
def test_columns_depend_on_the_number_of_balls(balls: int, names: list[str]) -> None:
    physics, start = Physics(balls=balls), (0.0,) * (4 + 2 * balls)
    motion = simulate(sampled(waving(0), T[:11]), physics, start, steps=choose_steps(physics, method="euler"))
    assert list(columns_of(motion)) == ["t", "z", "vz", "theta", "omega", *names, "f_left", "f_right"]


@pytest.mark.parametrize("physics", [Physics(), LAGRANGIAN])
def test_energy_is_balanced(physics: Physics) -> None:
    hands = sampled(waving(0), T[:501:2])
    columns = energies_of(simulate(hands, physics, COLD), hands, physics)
    stored = np.sum([column for name, column in columns.items() if name.startswith("E_")], axis=0)
    worked = np.sum([column for name, column in columns.items() if name.startswith("W_")], axis=0)
    assert len(columns) == 11
    assert np.abs(stored - stored[0] - worked).max() < 1e-6 * np.ptp(stored)


@settings(deadline=None, max_examples=40)
@given(data=st.data(), count=st.integers(2, 12), hold=st.sampled_from(INTERPOLATIONS), free=st.booleans())
def test_any_hands_give_a_finite_motion(data: st.DataObject, count: int, hold: str, free: bool) -> None:
    def floats(limit: float, *shape: int) -> Array:
        numbers = st.lists(st.floats(-limit, limit), min_size=int(np.prod(shape)), max_size=int(np.prod(shape)))
        return np.reshape(data.draw(numbers), shape)

    t = np.cumsum(data.draw(st.lists(st.floats(1e-4, 0.02), min_size=count, max_size=count)))
    motion = simulate(
        Hands(t, floats(0.1, count, 2), floats(1.0, count, 2)), Physics(), COLD, free=free, hold=hold, dt=1e-4
    )
    rows = int((t[-1] - t[0]) / 1e-4 + 1e-6) + 1
    assert motion.states.shape == (rows, 6)
    assert np.isfinite(motion.states).all()
    assert np.isfinite(motion.forces).all()
