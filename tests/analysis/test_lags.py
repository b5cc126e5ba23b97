"""Delays between two sides, against movements whose delays are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import pearsonr
from two_hands import minimum_jerk_rate

from netboard.analysis.measures.lags import _normalise, lag_of, leadership, peak_delay, windowed_lags

RATE = 1000.0


def minimum_jerk(start: float, duration: float, distance: float, rate: float = RATE, record: float = 1.5) -> np.ndarray:
    return minimum_jerk_rate(np.arange(round(record * rate)) / rate, start, duration, distance)


def swept(delay: float, record: float = 6.0, seed: int = 3) -> np.ndarray:
    """A signal without a period, as a function of time: exact at any delay."""
    rng = np.random.default_rng(seed)
    f, phase = rng.uniform(0.3, 4.0, 12), rng.uniform(0.0, 2 * np.pi, 12)
    t = np.arange(round(record * RATE)) / RATE - delay
    return np.sin(2 * np.pi * f * t[:, None] + phase).sum(axis=1)


@pytest.mark.evidence("truth", peak_delay)
@pytest.mark.parametrize("ratio", [1.0, 2.0, 9.0])
@pytest.mark.parametrize("lag", [0.0, 0.04, 0.08, -0.0613])
def test_peak_delay_equals_the_lag_for_any_amplitudes(lag: float, ratio: float) -> None:
    left, right = minimum_jerk(0.3 + lag, 0.4, 0.01 * ratio), -minimum_jerk(0.3, 0.4, 0.01)
    assert peak_delay(left, right, RATE) == pytest.approx(lag, abs=1e-6)


def test_peak_at_an_end_of_the_record_gives_no_delay() -> None:
    assert np.isnan(peak_delay([], [], RATE))
    assert np.isnan(peak_delay(np.linspace(0, 1, 50), minimum_jerk(0.01, 0.03, 0.01)[:50], RATE))


@pytest.mark.evidence("truth", lag_of)
@pytest.mark.parametrize("overlap", ["pearson", "full"])
@pytest.mark.parametrize("delay", [0.0, 0.037, -0.0904, 0.1207])
def test_correlation_finds_delays_between_samples(delay: float, overlap: str) -> None:
    found = lag_of(swept(delay), -3.0 * swept(0.0), RATE, overlap=overlap)
    assert found.delay == pytest.approx(delay, abs=5e-5 if overlap == "pearson" else 2e-3)
    assert found.n == 6000
    if overlap == "pearson":
        assert found.coefficient == pytest.approx(1.0, abs=1e-4)


@pytest.mark.evidence("independent", lag_of, by="scipy")
def test_coefficients_equal_pearsonr_of_scipy() -> None:
    rng = np.random.default_rng(1)
    left, right = rng.normal(size=200), rng.normal(size=200)
    left[3:] += 2.0 * right[:-3]
    found = lag_of(left, right, 1.0, longest=20.0, relation="alike")
    assert found.at_once == pytest.approx(pearsonr(left, right).statistic, abs=1e-12)
    assert round(found.delay) == 3
    assert found.coefficient >= pearsonr(left[3:], right[:-3]).statistic


def in_arrays(products: np.ndarray, a: np.ndarray, b: np.ndarray, squares: tuple[float, float]) -> np.ndarray:
    """Coefficients at all delays as operations of numpy on whole arrays."""
    n, reach = len(a), len(products) // 2
    lags = np.arange(-reach, reach + 1)
    count, first, other = n - np.abs(lags), np.maximum(lags, 0), np.maximum(-lags, 0)

    def sums(x: np.ndarray, start: np.ndarray) -> np.ndarray:
        total = np.concatenate([[0.0], np.cumsum(x)])
        return total[start + count] - total[start]

    sum_a, sum_b = sums(a, first), sums(b, other)
    vary_a, vary_b = sums(a * a, first) - sum_a**2 / count, sums(b * b, other) - sum_b**2 / count
    vary = np.where((vary_a > 1e-12 * squares[0]) & (vary_b > 1e-12 * squares[1]), vary_a * vary_b, np.nan)
    return (products - sum_a * sum_b / count) / np.sqrt(vary)


@given(st.integers(12, 400), st.integers(0, 2**32), st.booleans())
def test_compiled_coefficients_have_the_bits_of_array_operations(n: int, seed: int, constant: bool) -> None:
    generator = np.random.default_rng(seed)
    a, b = np.cumsum(generator.standard_normal((2, n)), axis=1)
    if constant:
        b[5:] = b[5]
    products, values = generator.standard_normal(21), np.empty(21)
    squares = float(np.sum(a * a)), float(np.sum(b * b))
    _normalise(products, a, b, *squares, values)
    assert values.tobytes() == in_arrays(products, a, b, squares).tobytes()


def test_lag_at_the_end_of_the_search_range_is_nan() -> None:
    found = lag_of(swept(0.2), swept(0.0), RATE, longest=0.1, relation="alike")
    assert np.isnan(found.delay)
    still = lag_of(np.ones(1000), swept(0.0)[:1000], RATE)
    assert np.isnan([still.delay, still.coefficient, still.at_once]).all()


@pytest.mark.evidence("truth", windowed_lags)
def test_side_whose_variance_is_rounded_to_zero_has_no_lag() -> None:
    time = np.arange(0.0, 2.0, 0.01)
    found = lag_of(np.sin(time), 1e-200 * np.cos(time), 100.0)
    assert np.isnan([found.delay, found.coefficient, found.at_once]).all()
    assert found.n == len(time)


def test_windowed_lags_follow_a_change_of_leader() -> None:
    left = np.concatenate([swept(0.05, 3.0), swept(-0.08, 3.0, seed=4)])
    right = -np.concatenate([swept(0.0, 3.0), swept(0.0, 3.0, seed=4)])
    centres, lags = windowed_lags(left, right, RATE, window=1.5, step=0.5)
    assert centres[0] == pytest.approx(0.7495)
    assert [lag.delay for lag in lags[:4]] == pytest.approx([0.05] * 4, abs=5e-4)
    assert [lag.delay for lag in lags[-4:]] == pytest.approx([-0.08] * 4, abs=5e-4)


@pytest.mark.evidence("disturbance", leadership, of="holes")
@pytest.mark.evidence("truth", leadership)
def test_leadership_counts_who_moves_first() -> None:
    found = leadership([0.05, -0.02, 0.03, 0.001, np.nan], tolerance=0.005)
    assert (found.left_first, found.right_first, found.together, found.n) == (1, 2, 1, 4)
    assert found.index == pytest.approx(1 / 3)
    assert found.mean == pytest.approx(0.01525)
    assert np.isnan(leadership([]).index)
    assert leadership([0.1, 0.2], unit="trial").unit == "trial"


def test_invalid_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="same length"):
        lag_of(np.ones(3), np.ones(4), RATE)
    with pytest.raises(ValueError, match="samples"):
        lag_of(np.ones(100), np.ones(100), RATE)


@pytest.mark.evidence("properties", lag_of, of=("mirror", "constant"))
@pytest.mark.evidence("properties", peak_delay, of=("unit", "time", "mirror"))
@given(
    st.floats(-0.1, 0.1),
    st.floats(0.2, 5.0),
    st.floats(0.2, 0.6),
    st.floats(0.0, 0.1),
)
def test_delays_are_invariant_to_scale_and_shift(lag: float, ratio: float, duration: float, later: float) -> None:
    left = minimum_jerk(0.3 + lag + later, duration, 0.01 * ratio)
    right = -minimum_jerk(0.3 + later, duration, 0.01)
    delay = peak_delay(left, right, RATE)
    assert delay == pytest.approx(lag, abs=5e-5)
    assert peak_delay(right, left, RATE) == pytest.approx(-delay, abs=1e-12)
    assert peak_delay(-1000.0 * left, 1000.0 * right, RATE) == pytest.approx(delay, abs=1e-9)
    found = lag_of(left, right, RATE)
    assert found.delay == pytest.approx(lag, abs=1e-4)
    assert lag_of(right, left, RATE).delay == pytest.approx(-found.delay, abs=1e-9)
    assert lag_of(left + 0.2, right - 0.1, RATE).delay == pytest.approx(found.delay, abs=1e-6)


@pytest.mark.evidence("properties", lag_of, peak_delay, of="rate")
@given(st.sampled_from([250.0, 500.0, 2000.0]), st.floats(-0.1, 0.1))
def test_delays_hardly_depend_on_the_sampling_rate(rate: float, lag: float) -> None:
    left, right = minimum_jerk(0.3 + lag, 0.4, 0.01, rate), -minimum_jerk(0.3, 0.4, 0.02, rate)
    assert peak_delay(left, right, rate) == pytest.approx(lag, abs=3e-4)
    assert lag_of(left, right, rate).delay == pytest.approx(lag, abs=3e-4)
