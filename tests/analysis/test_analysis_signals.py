"""Filters against closed forms and textbook forms; derivatives, gaps and other sampling rates."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.signal import butter, filtfilt, sosfiltfilt

from netboard.analysis.measures.signals import (
    LowPass,
    bridge,
    by_number,
    derivative,
    evenly,
    is_whole,
    lasting,
    lasts,
    resample,
    runs,
    ticks_of,
)
from netboard.analysis.measures.zero_phase import zero_phase

RATE = 1000.0
FAST, SLOW = LowPass(20.0), LowPass(5.0)
TIMES = np.arange(4000) / RATE

signals = arrays(np.float64, st.integers(50, 400), elements=st.floats(-1, 1, width=16))


def closed_form(low_pass: LowPass, frequency: np.ndarray, n: int) -> np.ndarray:
    """Gain of two passes of an n-th order digital Butterworth filter: 1 / (1 + (tan(pi f/r) / tan(pi c/r))^2n)."""
    ratio = np.tan(np.pi * frequency / RATE) / np.tan(np.pi * low_pass.pass_cutoff(RATE) / RATE)
    return 1 / (1 + ratio ** (2 * n))


@pytest.mark.evidence("truth", LowPass)
@pytest.mark.parametrize(
    ("low_pass", "n"),
    [
        (SLOW, 5),
        (FAST, 5),
        (LowPass(20.0, order_of="each_pass"), 10),
        (LowPass(5.0, cutoff_of="both_passes"), 5),
        (LowPass(8.0, order=4), 2),
    ],
)
def test_filter_has_the_closed_form_gain(low_pass: LowPass, n: int) -> None:
    times = np.arange(20_000) / RATE
    frequencies = np.array([0.3, 1.1, 3.7, 4.9, 7.3, 15.1, 23.9, 61.7])
    waves = np.sin(2 * np.pi * frequencies[:, None] * times + np.arange(8)[:, None])
    expected = closed_form(low_pass, frequencies, n) @ waves
    middle = slice(5000, 15_000)
    np.testing.assert_allclose(low_pass(waves.sum(axis=0), RATE)[middle], expected[middle], atol=1e-9)


@pytest.mark.evidence("independent", LowPass, by="scipy")
def test_filter_equals_the_transfer_function_form_where_that_is_stable() -> None:
    rng = np.random.default_rng(1)
    walk = np.cumsum(rng.normal(size=4000))
    b, a = butter(5, 20, fs=RATE)
    expected = filtfilt(b, a, walk, padlen=1000)
    np.testing.assert_allclose(FAST(walk, RATE), expected, atol=1e-6)


def test_filter_of_tenth_order_at_5_hz_is_stable() -> None:
    a = butter(10, 5, fs=RATE)[1]
    assert np.abs(np.roots(a)).max() > 1
    filtered = LowPass(5.0, order_of="each_pass")(np.sin(2 * np.pi * TIMES), RATE)
    assert np.abs(filtered).max() < 1.1


@pytest.mark.parametrize("cutoff", [5.0, 20.0])
def test_gain_at_the_cutoff_is_half_or_the_square_root_of_half(cutoff: float) -> None:
    at = np.array([cutoff])
    assert closed_form(LowPass(cutoff), at, 5)[0] == pytest.approx(0.5)
    assert closed_form(LowPass(cutoff, cutoff_of="both_passes"), at, 5)[0] == pytest.approx(1 / np.sqrt(2))
    assert LowPass(cutoff, cutoff_of="both_passes").pass_cutoff(RATE) / cutoff == pytest.approx(1.0921, abs=5e-4)


@pytest.mark.evidence("truth", LowPass)
def test_filter_does_not_delay_a_step() -> None:
    filtered = SLOW((TIMES >= 2.0).astype(float), RATE)
    crossing = np.interp(0.5, filtered[1900:2100], TIMES[1900:2100])
    assert crossing == pytest.approx(2.0 - 0.5 / RATE, abs=1e-9)


@pytest.mark.evidence("independent", LowPass, by="scipy")
@pytest.mark.parametrize("length", [1, 2, 150, TIMES.size])
@pytest.mark.parametrize("padding", ["odd", "even", "constant", "none"])
def test_padding_equals_that_of_scipy(padding: str, length: int) -> None:
    """Equal to the bit: both compute the initial steady state in the same way."""
    kinds = {"odd": "odd", "even": "even", "constant": "constant", "none": None}
    ramp = (3 * TIMES + np.sin(2 * np.pi * 0.7 * TIMES))[:length]
    pad = 0 if padding == "none" else min(200, length - 1)
    sections = butter(5, 20, fs=RATE, output="sos")
    expected = sosfiltfilt(sections, ramp, padtype=kinds[padding], padlen=pad)
    np.testing.assert_array_equal(LowPass(20.0, padding=padding, pad=0.2)(ramp, RATE), expected)


@pytest.mark.evidence("independent", zero_phase, by="scipy")
@pytest.mark.parametrize("padding", ["odd", "even", "constant", "none"])
def test_signals_filtered_together_equal_each_alone_and_scipy(padding: str) -> None:
    """Equal to the bit, piece by piece, whatever lies on the other lanes: gaps, breaks, huge and tiny values."""
    rng = np.random.default_rng(5)
    signals = [rng.normal(size=size).cumsum() * scale for size, scale in ((900, 1), (1300, 1e280), (7, 1e-300))]
    signals += [rng.normal(size=1100), rng.normal(size=1), np.empty(0), np.full(5, np.nan)]
    signals[0][[0, 200, 201, 899]] = np.nan
    breaks = [(300, 302, 300), (), (), (1, 500), (), (), ()]
    low_pass = LowPass(20.0, padding=padding, pad=0.1)
    found = low_pass.together(signals, RATE, breaks)
    sections = butter(5, 20, fs=RATE, output="sos")
    kind = None if padding == "none" else padding
    for values, own, filtered in zip(signals, breaks, found, strict=True):
        np.testing.assert_array_equal(filtered, low_pass(values, RATE, own))
        for first, stop in pieces_of(values, own):
            pad = 0 if padding == "none" else min(100, stop - first - 1)
            expected = sosfiltfilt(sections, values[first:stop], padtype=kind, padlen=pad)
            np.testing.assert_array_equal(filtered[first:stop], expected)
        np.testing.assert_array_equal(np.isnan(filtered), np.isnan(values))


def pieces_of(values: np.ndarray, breaks: tuple[int, ...]) -> list[tuple[int, int]]:
    """Pieces between gaps and breaks."""
    known = np.isfinite(values)
    starts = [n for n in np.flatnonzero(known) if n == 0 or not known[n - 1] or n in breaks]
    return [
        (n, next(k for k in range(n + 1, len(values) + 1) if k == len(values) or k in starts or not known[k]))
        for n in starts
    ]


def test_derivative_equals_the_gradient_of_numpy_to_the_bit() -> None:
    x = np.random.default_rng(6).normal(size=600)
    x[[0, 100, 102, 103, 106, 599]] = np.nan
    breaks = (200, 201, 203, 206, 400)
    found = derivative(x, RATE, breaks)
    for first, stop in pieces_of(x, breaks):
        order = 2 if stop - first > 2 else 1
        expected = [np.nan] if stop - first == 1 else np.gradient(x[first:stop], 1 / RATE, edge_order=order)
        np.testing.assert_array_equal(found[first:stop], expected)
    assert np.isnan(found[np.isnan(x)]).all()


def test_invalid_filter_parameters_are_refused() -> None:
    with pytest.raises(ValueError, match="odd order, found 9"):
        LowPass(5.0, order=9)
    with pytest.raises(ValueError, match="positive"):
        LowPass(-5.0)
    with pytest.raises(ValueError, match="continued"):
        LowPass(5.0, pad=-1)
    for cutoff_of in ("design", "both_passes"):
        with pytest.raises(ValueError, match="samples per second"):
            LowPass(60.0, cutoff_of=cutoff_of)(TIMES, 100.0)
    with pytest.raises(ValueError, match="samples per second"):
        LowPass(48.0, cutoff_of="both_passes", order=2)(TIMES, 96.0)


@pytest.mark.evidence("properties", LowPass, zero_phase, of=("unit", "constant"))
@given(signals, st.floats(-10, 10), st.floats(0.01, 100))
def test_filter_is_linear_and_passes_constants(x: np.ndarray, constant: float, factor: float) -> None:
    np.testing.assert_allclose(FAST(factor * x + constant, RATE), factor * FAST(x, RATE) + constant, atol=1e-7 * factor)


@pytest.mark.evidence("properties", LowPass, zero_phase, of="time")
@given(signals)
def test_filter_is_invariant_to_time_reversal_far_from_the_ends(x: np.ndarray) -> None:
    padded = np.pad(x, 3000)
    np.testing.assert_allclose(FAST(padded[::-1], RATE)[::-1], FAST(padded, RATE), atol=1e-9)


@pytest.mark.evidence("disturbance", LowPass, zero_phase, derivative, of="holes")
@given(signals, st.data())
def test_segments_between_breaks_or_holes_are_processed_independently(x: np.ndarray, data: st.DataObject) -> None:
    at = data.draw(st.integers(1, x.size - 1))
    for change in (FAST, derivative):
        apart = np.concatenate([change(x[:at], RATE), change(x[at:], RATE)])
        np.testing.assert_array_equal(change(x, RATE, [at]), apart)
        holed = x.copy()
        holed[at] = np.nan
        apart = np.concatenate([change(x[:at], RATE), [np.nan], change(x[at + 1 :], RATE)])
        np.testing.assert_array_equal(change(holed, RATE), apart)


def test_breaks_outside_the_record_are_ignored() -> None:
    np.testing.assert_array_equal(FAST(TIMES, RATE, [0, 4000, 5000, -3]), FAST(TIMES, RATE))


@pytest.mark.evidence("truth", derivative)
def test_derivative_of_a_parabola_is_exact_including_the_ends() -> None:
    np.testing.assert_allclose(derivative(3 * TIMES**2 - TIMES, RATE), 6 * TIMES - 1, atol=1e-8)
    np.testing.assert_array_equal(derivative(np.array([1.0, 3.0]), 10.0), [20.0, 20.0])
    assert np.isnan(derivative(np.array([1.0]), 10.0)).all()
    assert derivative(np.empty(0), 10.0).size == 0


@pytest.mark.evidence("truth", runs)
def test_runs_are_the_intervals_of_true_samples() -> None:
    mask = np.array([1, 1, 0, 0, 1, 0, 1], bool)
    np.testing.assert_array_equal(runs(mask), [[0, 2], [4, 5], [6, 7]])
    assert runs(np.zeros(3, bool)).shape == (0, 2)
    assert runs(np.zeros(0, bool)).shape == (0, 2)


@pytest.mark.evidence("truth", lasting, lasts, ticks_of)
def test_hold_of_n_ticks_takes_n_plus_one_samples() -> None:
    assert (ticks_of(1.5, 1000.0), ticks_of(0.03, 100.0), ticks_of(0.0, 1000.0)) == (1500, 3, 0)
    mask = np.repeat([False, True, False, True], [5, 1500, 5, 1501])
    np.testing.assert_array_equal(lasting(mask, 1.5, 1000.0), [[1510, 3011]])
    np.testing.assert_array_equal(lasts(*runs(mask).T, 1000.0), [1.499, 1.5])
    assert lasting(mask, 0.0, 1000.0).shape == (2, 2), "a single sample lasts for no time"


@pytest.mark.evidence("properties", lasting, lasts, ticks_of, of=("time", "rate"))
@given(st.lists(st.booleans(), max_size=60), st.integers(0, 9), st.sampled_from([250.0, 1000.0]), st.integers(0, 9))
def test_lasting_finds_all_runs_of_at_least_a_duration(mask: list[bool], ticks: int, rate: float, shift: int) -> None:
    found = lasting(np.array(mask, bool), ticks / rate, rate)
    assert ticks_of(ticks / rate, rate) == ticks
    assert (lasts(*found.T, rate) >= ticks / rate - 1e-12).all()
    long = [k for k in range(len(mask) - ticks) if all(mask[k : k + ticks + 1])]
    assert all(any(first <= k and k + ticks < stop for first, stop in found) for k in long)
    later = lasting(np.array([False] * shift + mask, bool), ticks / rate, rate)
    np.testing.assert_array_equal(later, found + shift)


@pytest.mark.evidence("disturbance", by_number, of="holes")
@pytest.mark.evidence("truth", by_number)
def test_by_number_fills_missing_samples_with_nan() -> None:
    whole = by_number(np.array([7, 8, 11]), np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(whole, [1, 2, np.nan, np.nan, 3])
    assert by_number(np.empty(0, np.int64), np.empty(0)).size == 0
    with pytest.raises(ValueError, match="increase"):
        by_number(np.array([1, 1]), np.zeros(2))


@pytest.mark.evidence("disturbance", is_whole, of="holes")
@pytest.mark.evidence("properties", is_whole, of=("time", "unit"))
@pytest.mark.evidence("truth", is_whole)
@pytest.mark.parametrize("lost", [np.nan, np.inf, -np.inf])
@given(st.integers(1, 70), st.data())
def test_signal_is_whole_unless_a_sample_is_missing(lost: float, n: int, data: st.DataObject) -> None:
    x = np.arange(n) - 3.0
    holed = x.copy()
    holed[data.draw(st.integers(0, n - 1))] = lost
    for one, expected in ((x, True), (holed, False)):
        assert [is_whole(each) for each in (one, 1e3 * one, one[::-1])] == [expected] * 3
    assert is_whole(np.empty(0))


@pytest.mark.evidence("disturbance", bridge, of="holes")
@pytest.mark.evidence("truth", bridge)
def test_bridge_fills_only_short_interior_holes() -> None:
    x = np.array([np.nan, 1, np.nan, 3, np.nan, np.nan, np.nan, 7, np.nan])
    np.testing.assert_array_equal(bridge(x, RATE, 0.002), [np.nan, 1, 2, 3, np.nan, np.nan, np.nan, 7, np.nan])
    np.testing.assert_allclose(bridge(x, RATE, 0.003), [np.nan, 1, 2, 3, 4, 5, 6, 7, np.nan])
    assert np.isnan(bridge(np.full(4, np.nan), RATE)).all()


@pytest.mark.evidence("truth", bridge)
@given(st.integers(20, 120), st.data())
def test_bridge_restores_a_straight_line(n: int, data: st.DataObject) -> None:
    x = 2.0 * np.arange(n)
    lost = data.draw(st.lists(st.integers(1, n - 2), max_size=15))
    holed = x.copy()
    holed[lost] = np.nan
    np.testing.assert_allclose(bridge(holed, RATE, 1.0), x, atol=1e-9)


@pytest.mark.evidence("truth", resample)
@pytest.mark.parametrize("new_rate", [250.0, 500.0, 600.0, 2000.0])
def test_resampling_preserves_slow_waves(new_rate: float) -> None:
    def wave(times: np.ndarray) -> np.ndarray:
        return np.sin(2 * np.pi * 3 * times) + 0.4 * times

    found = resample(wave(TIMES), RATE, new_rate)
    times = np.arange(found.size) / new_rate
    assert found.size == np.ceil(TIMES.size * new_rate / RATE)
    middle = (times > 0.5) & (times < 3.5)
    np.testing.assert_allclose(found[middle], wave(times)[middle], atol=5e-3)


@pytest.mark.evidence("disturbance", resample, of="holes")
def test_resampling_refuses_holes_and_odd_ratios() -> None:
    with pytest.raises(ValueError, match="missing samples"):
        resample(np.array([1.0, np.nan]), RATE, 500.0)
    with pytest.raises(ValueError, match="ratio"):
        resample(TIMES, RATE, 1000 * np.pi)


@pytest.mark.evidence("truth", evenly)
@pytest.mark.parametrize(("kind", "tolerance"), [("linear", 2e-2), ("monotone", 4e-3)])
def test_evenly_interpolates_uneven_samples(kind: str, tolerance: float) -> None:
    rng = np.random.default_rng(2)
    times = np.sort(rng.uniform(0, 2, 400))
    found = evenly(times, np.sin(2 * np.pi * times), 500.0, kind)
    wanted = times[0] + np.arange(found.size) / 500.0
    assert times[-1] - 1 / 500.0 < wanted[-1] <= times[-1] + 1e-9
    np.testing.assert_allclose(found, np.sin(2 * np.pi * wanted), atol=tolerance)
    with pytest.raises(ValueError, match="increasing times"):
        evenly(np.array([0.0, 0.0]), np.zeros(2), 500.0)
