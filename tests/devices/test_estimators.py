"""Velocity estimators compared with closed forms: exact at constant velocity, with the predicted lag and noise."""

from typing import get_args, get_type_hints

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are

from netboard.base.tables.rig import Agent
from netboard.devices.contract.estimators import (
    CAPACITY,
    FORGET,
    GAP_NS,
    JERK,
    Estimator,
    Observer,
    WindowEstimator,
    alpha_beta,
    alpha_beta_gains,
    chai3d,
    difference,
    kalman,
    kalman_gains,
)
from netboard.devices.contract.velocity import KINDS, Velocimeter, make

STEP = 0.055e-3
MS = 1_000_000
FIXED_KINDS = sorted(set(KINDS) - {"adaptive"})
every_kind = pytest.mark.parametrize("kind", sorted(KINDS))
every_fixed_kind = pytest.mark.parametrize("kind", FIXED_KINDS)


def new(kind: str, resolution: float = STEP) -> Estimator:
    estimator = make(kind, resolution)
    assert estimator is not None
    return estimator


def feed(estimator: Estimator, heights: np.ndarray, stamps_ns: np.ndarray | None = None) -> np.ndarray:
    stamps = np.arange(len(heights)) * MS if stamps_ns is None else stamps_ns
    return np.array(
        [estimator.update(int(t), 0.0, -2.0 * float(z), float(z))[2] for t, z in zip(stamps, heights, strict=True)]
    )


def test_configuration_lists_every_estimator() -> None:
    assert set(get_args(get_type_hints(Agent)["velocity"])) == {"device", *KINDS}
    assert make("device", STEP) is None
    assert isinstance(make("adaptive", STEP), Velocimeter)


@every_kind
def test_first_position_gives_zero_velocity_and_the_second_the_slope(kind: str) -> None:
    estimator = new(kind)
    assert estimator.update(5 * MS, 0.1, 0.2, 0.3) == (0.0, 0.0, 0.0)
    assert estimator.update(6 * MS, 0.101, 0.2, 0.298) == pytest.approx((1.0, 0.0, -2.0))


@every_kind
@given(
    speed=st.floats(-0.5, 0.5),
    intervals=st.lists(st.integers(100_000, 30 * MS), min_size=3, max_size=60),
    start_ns=st.integers(0, 10**15),
)
def test_constant_velocity_is_exact_for_any_sample_intervals(
    kind: str, speed: float, intervals: list[int], start_ns: int
) -> None:
    stamps = np.cumsum([0, *intervals])
    found = feed(new(kind), speed * stamps * 1e-9, stamps + start_ns)
    assert found[1:] == pytest.approx(speed, rel=1e-6, abs=1e-7)


LAGS = {
    "difference": 0.5e-3,
    "chai3d": 7.5e-3,
    "alpha_beta": (alpha_beta_gains()[0] / alpha_beta_gains()[1] - 0.5) * 1e-3,
    "kalman": 0.0,
}
"""Lag of each estimator under constant acceleration [s]."""


@every_fixed_kind
def test_lag_under_constant_acceleration_matches_theory(kind: str) -> None:
    t, acceleration = 1e-3 * np.arange(1500), 2.0
    found = feed(new(kind), 0.5 * acceleration * t**2)
    lag = (acceleration * t - found)[-100:] / acceleration
    assert lag == pytest.approx(LAGS[kind], abs=1e-7)


def test_alpha_beta_filter_lags_by_three_and_a_half_samples() -> None:
    assert LAGS["alpha_beta"] == pytest.approx(3.5e-3)


def theoretical_noise(kind: str) -> float:
    """Standard deviation of the velocity for white position noise of standard deviation 1 [1/s]."""
    if kind in ("difference", "chai3d"):
        return float(np.sqrt(2.0)) / (1e-3 if kind == "difference" else 15e-3)
    if kind == "alpha_beta":
        a, b, _ = alpha_beta_gains()
        return float(np.sqrt(2.0 * b * b / (a * (4.0 - 2.0 * a - b)))) * 1e3
    f = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    k = np.array(kalman_gains(STEP))
    closed = f - np.outer(k, f[0])
    covariance = np.zeros((3, 3))
    for _ in range(5000):
        covariance = closed @ covariance @ closed.T + np.outer(k, k)
    return float(np.sqrt(covariance[1, 1])) * 1e3


@every_fixed_kind
def test_velocity_noise_matches_theory(kind: str) -> None:
    heights = 1e-5 * np.random.default_rng(1).standard_normal(40_000)
    assert feed(new(kind), heights)[100:].std() == pytest.approx(1e-5 * theoretical_noise(kind), rel=0.03)


@every_fixed_kind
def test_quantisation_noise_of_a_fast_movement_is_that_of_white_noise(kind: str) -> None:
    heights = 0.1 * np.sqrt(2.0) * 1e-3 * np.arange(20_000)
    found = feed(new(kind), np.round(heights / STEP) * STEP)[100:] - 0.1 * np.sqrt(2.0)
    # Successive quantisation errors are correlated, which a first difference sees; hence the tolerance of 50 %.
    assert found.std() == pytest.approx(STEP / np.sqrt(12.0) * theoretical_noise(kind), rel=0.5)
    assert abs(found.mean()) < 1e-4


@every_kind
def test_velocity_is_zero_at_rest_after_a_quantised_movement(kind: str) -> None:
    heights = np.concatenate([np.linspace(0.0, 0.02, 100), np.full(1000, 0.02)])
    found = feed(new(kind), np.round(heights / STEP) * STEP)
    assert np.abs(found[-100:]).max() < 1e-12


def test_response_to_one_encoder_step_matches_the_closed_form() -> None:
    heights = np.zeros(60)
    heights[30:] = STEP
    assert np.abs(feed(chai3d(), heights)).max() == pytest.approx(STEP / 15e-3)
    assert np.abs(feed(difference(), heights)).max() == pytest.approx(STEP / 1e-3)
    # With both poles at r, the velocity response of an alpha-beta filter is (1 - r)^2 (n + 1) r^n.
    n = np.arange(30)
    response = (1.0 - FORGET) ** 2 * ((n + 1.0) * FORGET**n) * STEP / 1e-3
    assert feed(alpha_beta(), heights)[30:] == pytest.approx(response)


@every_kind
def test_second_reading_at_the_same_time_replaces_the_first(kind: str) -> None:
    once, twice = new(kind), new(kind)
    rng = np.random.default_rng(3)
    for k in range(100):
        place = tuple(rng.standard_normal(3) * 1e-3)
        twice.update(k * MS, 0.5, -0.5, 0.1 * k)
        twice.update(k * MS - 300_000 * (k > 0), 0.3, 0.2, -0.1)
        assert twice.update(k * MS, *place) == once.update(k * MS, *place)


@every_fixed_kind
def test_estimate_recovers_after_a_gap(kind: str) -> None:
    """The hand moves 5 mm during the gap; the estimate is first the slope over the gap, then the new velocity."""
    estimator = new(kind)
    feed(estimator, np.zeros(50))
    after = 50 * MS + 10 * GAP_NS
    assert estimator.update(after, 0.0, 0.0, 0.005)[2] == pytest.approx(0.005 / (0.001 + 0.2))
    late = [estimator.update(after + k * MS, 0.0, 0.0, 0.005 + 1e-4 * k)[2] for k in range(1, 80)]
    assert late[-1] == pytest.approx(0.1, rel=1e-3)
    assert max(late) < 0.13


@pytest.mark.parametrize("kind", ["chai3d", "alpha_beta", "kalman"])
def test_encoder_step_between_close_readings_gives_no_velocity_spike(kind: str) -> None:
    estimator = new(kind)
    feed(estimator, np.zeros(50))
    found = [estimator.update(50 * MS, 0.0, 0.0, 0.0)[2], estimator.update(50 * MS + 5000, 0.0, 0.0, STEP)[2]]
    found += [estimator.update((50 + k) * MS, 0.0, 0.0, STEP)[2] for k in range(1, 100)]
    assert np.abs(found).max() < STEP / 1e-3
    assert found[-1] == pytest.approx(0.0, abs=1e-6)


def test_window_is_limited_to_its_capacity() -> None:
    estimator = chai3d()
    stamps = np.arange(500) * 100_000
    found = feed(estimator, stamps * 1e-9 * stamps * 1e-9, stamps)
    assert stamps[-1] * 2e-9 - found[-1] == pytest.approx((CAPACITY - 1) * 1e-4, rel=1e-6)


def test_window_starts_at_the_newest_position_older_than_its_span() -> None:
    estimator = WindowEstimator(10 * MS)
    heights = {0: 0.0, 4: 0.001, 5: 0.003, 12: 0.0, 15: 0.004}
    for t, z in heights.items():
        found = estimator.update(t * MS, 0.0, 0.0, z)[2]
    assert found == pytest.approx((0.004 - 0.003) / 10e-3)


@pytest.mark.parametrize("resolution", [STEP, 0.01e-3, 1e-3])
def test_kalman_gains_solve_the_riccati_equation(resolution: float) -> None:
    f = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    process_noise = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
    ratio = JERK * 1e-15 / (resolution**2 / 12.0)
    predicted = solve_discrete_are(f.T, np.array([[1.0], [0.0], [0.0]]), ratio * process_noise, np.eye(1))
    assert kalman_gains(resolution) == pytest.approx(predicted[:, 0] / (predicted[0, 0] + 1.0), rel=1e-6)


def test_kalman_gains_for_unknown_resolution_assume_the_finest_step() -> None:
    assert kalman_gains(0.0) == kalman_gains(1e-6)
    assert kalman_gains(0.0)[0] > kalman_gains(STEP)[0]


def test_kalman_filter_is_most_accurate_for_the_modelled_jerk() -> None:
    rng = np.random.default_rng(5)
    process_noise = JERK * 1e-15 * np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
    disturbances = rng.multivariate_normal(np.zeros(3), process_noise, 5000)
    state, states = np.zeros(3), []
    f = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 0.995]])
    for disturbance in disturbances:
        state = f @ state + disturbance
        states.append(state)
    z, v = np.array(states)[:, 0], np.array(states)[:, 1] / 1e-3
    measured = z + STEP / np.sqrt(12.0) * rng.standard_normal(len(z))
    errors = {kind: float(np.std((feed(new(kind), measured) - v)[200:])) for kind in KINDS}
    assert min(errors, key=lambda kind: errors[kind]) == "kalman"


def test_axes_are_estimated_independently() -> None:
    for estimator in (kalman(STEP), alpha_beta(), chai3d(), difference()):
        for k in range(50):
            found = estimator.update(k * MS, 0.1e-3 * k, -0.2e-3 * k, 0.0)
        assert found == pytest.approx((0.1, -0.2, 0.0))
    assert isinstance(kalman(STEP), Observer)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@every_kind
def test_estimate_recovers_after_a_position_that_is_not_finite(kind: str, bad: float) -> None:
    estimator = new(kind)
    for k in range(50):
        estimator.update(k * MS, 0.0, 0.0, 1e-4 * k)
    estimator.update(50 * MS, 0.0, 0.0, bad)
    for k in range(51, 51 + 2 * CAPACITY):
        velocity = estimator.update(k * MS, 0.0, 0.0, 1e-4 * k)
    assert velocity == pytest.approx((0.0, 0.0, 0.1))
