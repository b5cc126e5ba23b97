"""The measures, compared with implementations in other libraries."""

from typing import Literal

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import integrate, interpolate, ndimage, signal, stats
from sklearn.metrics import auc, mutual_info_score
from statsmodels.tsa.stattools import ccf
from two_hands import minimum_jerk_rate, rolled, two_hands

from netboard.analysis.measures.information import Past, transfer_entropy
from netboard.analysis.measures.interaction import (
    effort,
    exchanged,
    force_share,
    point_velocities,
    supports,
    work,
)
from netboard.analysis.measures.lags import lag_of, peak_delay, windowed_lags
from netboard.analysis.measures.motion import ball_speed, find_completion, motion
from netboard.analysis.measures.movements import mean_shares, shares
from netboard.analysis.measures.passive import PassiveHand, driven
from netboard.analysis.measures.performance import (
    first_and_last,
    learning_curve,
    level,
    running_number,
    summarise,
    trial_times,
)
from netboard.analysis.measures.signals import bridge, by_number, derivative, evenly, resample, runs
from netboard.analysis.measures.task import overshoots, time_in_target
from netboard.analysis.statistics.effect_sizes import hedges_factor
from netboard.analysis.statistics.estimates import bootstrap, ratio_of_sums
from netboard.analysis.statistics.exact_tests import permutation_test, permutation_test_between

RATE = 1000.0
samples = arrays(np.float64, st.integers(5, 60), elements=st.floats(-1, 1, width=16))
places = arrays(np.float64, st.integers(1, 60), elements=st.sampled_from([-0.15, 0.0, 0.12, 0.15, 0.18, 0.2, 0.3]))
forces = arrays(np.float64, 40, elements=st.floats(-4, 4, width=16))
HANDS = two_hands([(0.5, 0.4, 0.01), (1.2, 0.3, -0.012)], [(0.55, 0.4, -0.01), (1.2, 0.3, 0.01)])


# --- signals -----------------------------------------------------------------------------------------------------


@pytest.mark.evidence("independent", runs, by="scipy")
@given(arrays(bool, st.integers(1, 60)))
def test_runs_equal_labelled_objects_of_scipy(mask: np.ndarray) -> None:
    found = [(part[0].start, part[0].stop) for part in ndimage.find_objects(ndimage.label(mask)[0])]
    assert [tuple(run) for run in runs(mask)] == found


@pytest.mark.evidence("independent", derivative, by="scipy")
@given(samples)
def test_derivative_equals_a_three_point_savitzky_golay_filter(x: np.ndarray) -> None:
    expected = signal.savgol_filter(x, 3, 2, deriv=1, delta=1 / RATE, mode="interp")
    np.testing.assert_allclose(derivative(x, RATE), expected, atol=1e-9 * RATE)


@pytest.mark.evidence("independent", by_number, by="pandas")
@given(st.lists(st.integers(0, 60), min_size=1, max_size=30, unique=True).map(sorted), st.integers(0, 10**9))
def test_by_number_equals_pandas_reindex(numbers: list[int], start: int) -> None:
    values = np.sqrt(np.arange(len(numbers)))
    whole = pd.Series(values, index=numbers).reindex(range(numbers[0], numbers[-1] + 1))
    np.testing.assert_array_equal(by_number(np.array(numbers) + start, values), whole)


@pytest.mark.evidence("independent", bridge, by="pandas")
@given(samples, st.data())
def test_bridge_equals_pandas_interpolation(x: np.ndarray, data: st.DataObject) -> None:
    x[data.draw(st.lists(st.integers(0, x.size - 1)))] = np.nan
    expected = pd.Series(x).interpolate(limit_area="inside")
    np.testing.assert_allclose(bridge(x, RATE, longest=1.0), expected, atol=1e-12)


@pytest.mark.evidence("independent", resample, by="scipy")
@pytest.mark.parametrize("new_rate", [250.0, 800.0, 1500.0])
def test_resample_equals_fourier_resampling(new_rate: float) -> None:
    times = np.arange(4000) / RATE
    wave = np.sin(2 * np.pi * times) + 0.3 * np.cos(2 * np.pi * 7 * times)
    expected = signal.resample(wave, round(4 * new_rate))
    middle = slice(round(0.5 * new_rate), round(3.5 * new_rate))
    np.testing.assert_allclose(resample(wave, RATE, new_rate)[middle], expected[middle], atol=2e-3)


@pytest.mark.evidence("independent", evenly, by="scipy")
@given(arrays(np.float64, st.integers(2, 40), elements=st.floats(0.001, 0.05)))
def test_evenly_equals_a_first_order_spline(steps: np.ndarray) -> None:
    times = np.cumsum(steps)
    values = np.sin(9 * times)
    found = evenly(times, values, 200.0)
    line = interpolate.make_interp_spline(times, values, k=1)
    np.testing.assert_allclose(found, line(times[0] + np.arange(found.size) / 200.0), atol=1e-9)


# --- motion ------------------------------------------------------------------------------------------------------


@pytest.mark.evidence("independent", motion, ball_speed, by="scipy")
def test_motion_equals_filtfilt_of_the_recording() -> None:
    p, _ = rolled(HANDS.theta, RATE, -0.15)
    fast, slow = signal.butter(5, 20, fs=RATE), signal.butter(5, 5, fs=RATE)

    def rate_of(x: np.ndarray) -> np.ndarray:
        return np.asarray(signal.savgol_filter(x, 3, 2, deriv=1, delta=1 / RATE, mode="interp"))

    def filtered(by: tuple[np.ndarray, np.ndarray], x: np.ndarray) -> np.ndarray:
        return np.asarray(signal.filtfilt(*by, x, padlen=1000))

    found = motion(RATE, HANDS.left_z, HANDS.right_z, HANDS.theta, p)
    for name, position in (("left_vz", HANDS.left_z), ("right_vz", HANDS.right_z), ("vp", p)):
        np.testing.assert_allclose(getattr(found, name), rate_of(filtered(fast, position)), atol=1e-6, err_msg=name)
    np.testing.assert_allclose(found.theta, filtered(fast, HANDS.theta), atol=1e-8)
    np.testing.assert_allclose(found.omega, filtered(slow, rate_of(filtered(fast, HANDS.theta))), atol=1e-6)
    speed = filtered(slow, np.abs(rate_of(filtered(fast, p))))
    np.testing.assert_allclose(found.speed, speed, atol=1e-6)
    np.testing.assert_allclose(ball_speed(found.vp, RATE), speed, atol=1e-6)


@pytest.mark.evidence("independent", find_completion, by="pandas")
@given(places, st.integers(1, 12))
def test_completion_equals_a_rolling_window_inside_the_target(p: np.ndarray, hold: int) -> None:
    inside = pd.Series((np.abs(p - 0.15) <= 0.0351).astype(float))
    whole = np.flatnonzero(inside.rolling(hold + 1).min() == 1)
    found = find_completion(p, 10.0, 0.15, half_width=0.0351, hold=hold / 10)
    assert found.sample == (whole[0] - hold if whole.size else None)


@pytest.mark.evidence("independent", time_in_target, overshoots, by="scipy")
@given(places)
def test_time_in_target_equals_labelled_objects_of_scipy(p: np.ndarray) -> None:
    label, visits = ndimage.label(np.abs(p - 0.15) <= 0.0351)
    stays = np.bincount(label, minlength=1)[1:]
    found = time_in_target(p, 10.0, centre=0.15, half_width=0.0351)
    assert (found.visits, found.time) == (visits, pytest.approx(stays.sum() / 10))
    assert found.longest == pytest.approx((stays.max(initial=1) - 1) / 10)
    beyond, count = ndimage.label(np.sign(0.15 - p[0] or 1) * (p - 0.15) > 0.0351)
    past = overshoots(p, 10.0, centre=0.15, half_width=0.0351)
    assert (past.count, past.time) == (count, pytest.approx((beyond > 0).sum() / 10))


# --- trials ------------------------------------------------------------------------------------------------------


@pytest.mark.evidence("independent", shares, mean_shares, by="pandas")
@given(arrays(np.float64, st.tuples(st.integers(1, 30), st.just(4)), elements=st.integers(0, 9)), st.data())
def test_mean_shares_equal_pandas_groups(seconds: np.ndarray, data: st.DataObject) -> None:
    people = np.array(data.draw(st.lists(st.integers(0, 3), min_size=len(seconds), max_size=len(seconds))))
    frame = pd.DataFrame(seconds)
    each = frame.div(frame.sum(axis=1), axis=0)
    np.testing.assert_allclose(shares(seconds), each)
    np.testing.assert_allclose(mean_shares(seconds, people), each.groupby(people).mean().mean())
    pooled = frame.groupby(people).sum()
    expected = pooled.div(pooled.sum(axis=1), axis=0).mean()
    np.testing.assert_allclose(mean_shares(seconds, people, of="time"), expected)


trials = st.lists(
    st.tuples(st.integers(1, 5), st.booleans(), st.floats(0.5, 30) | st.just(np.nan)), min_size=1, max_size=40
)


@pytest.mark.evidence("independent", running_number, summarise, learning_curve, level, by="pandas")
@given(trials)
def test_performance_equals_pandas_groups(rows: list[tuple[int, bool, float]]) -> None:
    frame = pd.DataFrame(rows, columns=["person", "haptics", "time"])
    person, haptics, times = (frame[name].to_numpy() for name in frame)
    order = running_number(person, haptics)
    np.testing.assert_array_equal(order, frame.groupby(["person", "haptics"]).cumcount() + 1)
    curve = frame.groupby(order)["time"].agg(["mean", "std", "count"])
    found = learning_curve(times, order)
    np.testing.assert_allclose(np.array([found.mean, found.deviation, found.count]).T, curve, atol=1e-9)
    means = frame.groupby("person")["time"].mean()
    of_people = summarise(times, person)
    np.testing.assert_allclose([of_people.mean, of_people.deviation], [means.mean(), means.std()], atol=1e-9)
    np.testing.assert_allclose(level(times), frame["time"].mean())
    np.testing.assert_allclose(level(times, of="median"), frame["time"].median())
    np.testing.assert_allclose(level(times, of="last", last=7), frame["time"].dropna().tail(7).mean())


@pytest.mark.evidence("independent", first_and_last, trial_times, by="pandas")
@given(arrays(np.float64, st.integers(12, 40), elements=st.floats(0.5, 30) | st.just(np.nan)))
def test_first_and_last_trials_equal_pandas_groups(times: np.ndarray) -> None:
    frame = pd.DataFrame({"trial": np.arange(times.size) // 3, "time": times})
    found = first_and_last(times, 1 + np.arange(times.size), count=6)
    ends = (frame["time"].head(6), frame["time"].tail(6))
    for part, end in zip((found.first, found.last), ends, strict=True):
        np.testing.assert_allclose([part.mean, part.deviation, part.count], [end.mean(), end.std(), end.count()])
    numbers, first = trial_times(frame["trial"].to_numpy(), np.ones(times.size), times)
    np.testing.assert_array_equal(first, frame.groupby("trial")["time"].first())
    np.testing.assert_array_equal(numbers, frame["trial"].unique())


# --- two sides ---------------------------------------------------------------------------------------------------


@pytest.mark.evidence("independent", lag_of, by="statsmodels")
@given(arrays(np.float64, 60, elements=st.floats(-1, 1, width=16)), st.integers(0, 9))
def test_cross_correlation_equals_ccf_of_statsmodels(x: np.ndarray, late: int) -> None:
    left, right = np.pad(x, (late, 5)) + np.hypot(0.1, np.arange(65 + late)), np.pad(x, (0, 5 + late))
    if np.ptp(right) == 0:
        return
    expected = max(*ccf(left, right, adjusted=False)[:21], *ccf(right, left, adjusted=False)[:21])
    found = lag_of(left, right, 1.0, longest=20, relation="alike", overlap="full")
    assert found.at_once == pytest.approx(ccf(left, right, adjusted=False)[0], abs=1e-9)
    assert found.coefficient >= expected - 1e-9, "the parabola's height is that of the best sample, or more"


@pytest.mark.evidence("independent", windowed_lags, by="scipy")
def test_windowed_lags_have_pearson_coefficients() -> None:
    source = np.random.default_rng(8)
    left, right = source.normal(size=(2, 5000))
    centres, lags = windowed_lags(left, right, RATE, window=0.8, step=0.3, longest=0.1)
    assert len(centres) == len(lags) == 15
    for k, lag in enumerate(lags):
        part = slice(300 * k, 300 * k + 800)
        assert lag.at_once == pytest.approx(stats.pearsonr(left[part], -right[part]).statistic, abs=1e-12)


@pytest.mark.evidence("independent", peak_delay, by="scipy")
@given(st.floats(0.05, 0.15), st.floats(0.25, 0.6), st.floats(0.25, 0.6))
def test_peak_delay_equals_that_of_a_cubic_spline(start: float, of_left: float, of_right: float) -> None:
    times = np.arange(800) / RATE
    left, right = minimum_jerk_rate(times, start, of_left, 0.02), -minimum_jerk_rate(times, 0.1, of_right, 0.01)

    def peak(speed: np.ndarray) -> float:
        spline = interpolate.CubicSpline(times, speed)
        turns = spline.derivative().roots(extrapolate=False)
        return float(turns[np.argmax(spline(turns))])

    assert peak_delay(left, right, RATE) == pytest.approx(peak(left) - peak(-right), abs=1e-5)


@pytest.mark.evidence("independent", supports, by="numpy")
@pytest.mark.parametrize("p", [-0.3, -0.15, 0.0, 0.22])
def test_supports_solve_the_force_and_moment_balance(p: float) -> None:
    weight, ball, arm = (0.01 + 0.05) * 9.81, 0.05 * 9.81, 0.25
    both = np.linalg.solve([[1.0, 1.0], [-arm, arm]], [weight, ball * p])
    assert np.ravel(supports([p], board_mass=0.01, ball_mass=0.05, arm=arm)) == pytest.approx(both)


@pytest.mark.evidence("independent", point_velocities, by="scipy")
def test_point_velocities_are_derivatives_of_point_heights() -> None:
    t = np.arange(2000) / RATE
    z, theta = 0.01 * np.sin(3 * t), 0.3 * np.sin(2 * t + 1)
    found = point_velocities(0.03 * np.cos(3 * t), theta, 0.6 * np.cos(2 * t + 1), arm=0.25)
    for side, velocity in zip((-1, 1), found, strict=True):
        spline = interpolate.CubicSpline(t, z + side * 0.25 * np.sin(theta))
        np.testing.assert_allclose(velocity, spline(t, 1), atol=1e-7)


@pytest.mark.evidence("independent", work, exchanged, effort, by="scikit-learn")
@given(forces, forces)
def test_work_and_effort_equal_areas_under_curves(a: np.ndarray, b: np.ndarray) -> None:
    t = np.arange(a.size) / RATE
    power = a * b
    found = work(a, b, RATE)
    expected = [auc(t, part) for part in (power, power.clip(0), -power.clip(None, 0))]
    assert [found.net, found.given, found.received] == pytest.approx(expected, abs=1e-12)
    passing = [np.minimum(one.clip(0), -other.clip(None, 0)) for one, other in ((a, b), (b, a))]
    assert exchanged(a, b, RATE) == pytest.approx([auc(t, part) for part in passing], abs=1e-12)
    assert effort(a, RATE) == pytest.approx(auc(t, a**2))
    assert effort(a, RATE, kind="absolute") == pytest.approx(auc(t, np.abs(a)))
    assert effort(a, RATE, kind="rms") == pytest.approx(np.linalg.norm(a) / np.sqrt(a.size))


@pytest.mark.evidence("independent", force_share, by="numpy")
@given(forces, forces)
def test_force_share_equals_a_ratio_of_norms(left: np.ndarray, right: np.ndarray) -> None:
    if left.any() or right.any():
        for kind, order in (("absolute", 1), ("squared", 2)):
            a, b = (np.linalg.norm(side, order) ** order for side in (left, right))
            assert force_share(left, right, kind=kind) == pytest.approx(b / (a + b))


# --- influence, passive hands --------------------------------------------------------------------------------------


@pytest.mark.evidence("independent", transfer_entropy, by="scikit-learn")
@pytest.mark.parametrize("seed", range(3))
def test_binned_transfer_entropy_is_a_difference_of_mutual_information(seed: int) -> None:
    source = np.random.default_rng(seed)
    x, y = source.normal(size=(2, 301))
    y[1:] += 0.7 * x[:-1]
    now, own, other = (pd.qcut(part, 3, labels=False) for part in (y[1:], y[:-1], x[:-1]))
    expected = mutual_info_score(now, 3 * own + other) - mutual_info_score(now, own)
    one = Past(step=1, own=1, other=1, delay=1)
    assert transfer_entropy([x], [y], past=one, estimator="binned", bins=3) == pytest.approx(expected, abs=1e-12)


@pytest.mark.slow
@pytest.mark.evidence("independent", driven, by="scipy")
@given(arrays(np.float64, st.integers(2, 80), elements=st.floats(-2, 2, width=16)), st.floats(20, 400))
def test_driven_hand_equals_lsim(force: np.ndarray, stiffness: float) -> None:
    hand = PassiveHand(0.5, 8.0, stiffness)
    times = np.arange(force.size) / RATE
    system = ([1.0], [hand.mass, hand.damping, hand.stiffness])
    expected = signal.lsim(system, force - force[0], times, interp=True)[1]
    np.testing.assert_allclose(driven(force, RATE, hand), expected, atol=1e-12)


def test_driven_hand_equals_solve_ivp() -> None:
    hand, times = PassiveHand(), np.arange(1000) / RATE
    force = 0.3 * np.sin(5 * times) * times

    def slopes(now: float, y: np.ndarray) -> list[float]:
        push = 0.3 * np.sin(5 * now) * now
        return [y[1], (push - hand.damping * y[1] - hand.stiffness * y[0]) / hand.mass]

    solved = integrate.solve_ivp(slopes, (0, times[-1]), [0, 0], t_eval=times, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(driven(force, RATE, hand), solved.y[0], atol=1e-8)


# --- statistics --------------------------------------------------------------------------------------------------


@pytest.mark.evidence("independent", permutation_test, by="scipy")
@given(st.integers(2, 9).flatmap(lambda n: st.lists(st.booleans(), min_size=n, max_size=n)))
def test_permutation_test_of_ranks_equals_wilcoxon(signs: list[bool]) -> None:
    ranks = [float(rank if positive else -rank) for rank, positive in enumerate(signs, start=1)]
    for alternative in ("two-sided", "greater", "less"):
        expected = stats.wilcoxon(ranks, alternative=alternative, method="exact").pvalue
        assert permutation_test(ranks, alternative=alternative).p == pytest.approx(expected)


@pytest.mark.evidence("independent", permutation_test_between, by="scipy")
@given(st.permutations(range(9)), st.integers(2, 7))
def test_permutation_test_between_ranks_equals_mann_whitney(ranks: list[int], size: int) -> None:
    x, y = (np.array(part, float) for part in (ranks[:size], ranks[size:]))
    for alternative in ("two-sided", "greater", "less"):
        expected = stats.mannwhitneyu(x, y, alternative=alternative, method="exact").pvalue
        assert permutation_test_between(x, y, alternative=alternative).p == pytest.approx(expected)


@pytest.mark.evidence("truth", permutation_test_between)
@pytest.mark.parametrize("size", [2, 3, 4])
@pytest.mark.parametrize("alternative", ["two-sided", "greater"])
def test_most_extreme_division_has_the_least_p(size: int, alternative: Literal["two-sided", "greater"]) -> None:
    found = permutation_test_between(10.0 + np.arange(size), [1, 2, 3], alternative=alternative)
    assert found.p == pytest.approx(found.least_p)


@pytest.mark.slow
@pytest.mark.evidence("independent", bootstrap, by="pandas")
def test_bootstrap_equals_resampling_in_pandas() -> None:
    frame = pd.DataFrame({"above": [1.0, 2.0, 1.5, 0.3, 2.2, 0.9], "below": [2.0, 3.0, 4.0, 1.0, 2.5, 2.1]})
    source = np.random.RandomState(3)
    draws = [frame.sample(frac=1, replace=True, random_state=source).sum() for _ in range(3000)]
    low, high = np.percentile([one["above"] / one["below"] for one in draws], [2.5, 97.5])
    columns = [frame["above"], frame["below"]]
    found = bootstrap(columns, ratio_of_sums, np.random.default_rng(4), method="percentile")
    assert (found.low, found.high) == pytest.approx((low, high), abs=0.015)


@pytest.mark.evidence("independent", ratio_of_sums, by="numpy")
@given(*[arrays(np.float64, 12, elements=st.floats(0.1, 9))] * 2)
def test_ratio_of_sums_equals_a_weighted_mean(above: np.ndarray, below: np.ndarray) -> None:
    assert ratio_of_sums(above, below) == pytest.approx(np.average(above / below, weights=below))


@pytest.mark.slow
@pytest.mark.evidence("independent", hedges_factor, by="scipy")
@given(st.integers(2, 300))
def test_hedges_factor_equals_its_chi_expectation(free: int) -> None:
    # The mean of one over a standard deviation of normal values, and with it the bias, is that of chi.
    assert hedges_factor(free) * np.sqrt(free) * stats.chi.expect(lambda c: 1 / c, args=(free,)) == pytest.approx(1.0)
