"""Smoothness, against the authors' program, published values and closed forms."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from monalysa.quality import smoothness as oracle
from scipy.integrate import quad
from scipy.signal import zoom_fft

from netboard.analysis.measures.smoothness import (
    _chirp,
    _zoomed,
    dimensionless_jerk,
    log_dimensionless_jerk,
    spectral_arc_length,
)

GAUSSIAN = np.exp(-5.0 * np.arange(-1.0, 1.0, 0.01) ** 2)


def minimum_jerk(duration: float, distance: float, rate: float) -> np.ndarray:
    s = (np.arange(round(duration * rate)) + 0.5) / round(duration * rate)
    return distance / duration * 30.0 * s**2 * (1.0 - s) ** 2


def submovements(seed: int, count: int, rate: float = 200.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    speed = np.zeros(round(3.0 * rate))
    for start in rng.uniform(0.0, 2.4, count):
        one = minimum_jerk(0.5, rng.uniform(0.02, 0.1), rate)
        speed[round(start * rate) :][: len(one)] += one
    return speed


@pytest.mark.evidence("truth", spectral_arc_length, dimensionless_jerk, log_dimensionless_jerk)
def test_smoothness_equals_published_values() -> None:
    assert spectral_arc_length(GAUSSIAN, 100.0) == pytest.approx(-1.41403, abs=5e-6)
    assert dimensionless_jerk(GAUSSIAN, 100.0) == pytest.approx(-335.74684, abs=5e-6)
    assert log_dimensionless_jerk(GAUSSIAN, 100.0) == pytest.approx(-5.81636, abs=5e-6)


@given(st.integers(2, 20_000), st.integers(0, 2**32))
def test_shared_chirp_gives_the_bits_of_the_library(n: int, seed: int) -> None:
    v, longest = np.random.default_rng(seed).standard_normal(n), 1 << (n - 1).bit_length()
    count = longest * 16 // 100 + 1
    span = count / (longest * 16)
    expected = zoom_fft(v, count * 1000.0 / (longest * 16), count, fs=1000.0)
    assert np.abs(_zoomed(v, _chirp(longest, count, span))).tobytes() == np.abs(expected).tobytes()


@pytest.mark.evidence("independent", spectral_arc_length, dimensionless_jerk, log_dimensionless_jerk, by="monalysa")
@pytest.mark.parametrize("count", [1, 2, 5, 9])
@pytest.mark.parametrize("seed", range(4))
def test_smoothness_equals_the_authors_program(count: int, seed: int) -> None:
    speed = submovements(seed, count)
    for options in ({}, {"highest": 6.0, "threshold": 0.1, "padding": 3}):
        named = {"highest": "fc", "threshold": "amp_th", "padding": "padlevel"}
        theirs = oracle.sparc(speed, 200.0, **{named[key]: value for key, value in options.items()})[0]
        assert spectral_arc_length(speed, 200.0, **options) == pytest.approx(theirs, rel=1e-12)
    assert dimensionless_jerk(speed, 200.0) == pytest.approx(oracle.dimensionless_jerk(speed, 200.0), rel=1e-12)
    assert log_dimensionless_jerk(speed, 200.0) == pytest.approx(oracle.log_dimensionless_jerk(speed, 200.0), rel=1e-12)


@pytest.mark.evidence("independent", spectral_arc_length, by="numpy")
@pytest.mark.parametrize("rate", [100.0, 1000.0])
@pytest.mark.parametrize("n", [60, 1000, 4001, 4096])
def test_spectral_arc_length_uses_the_frequencies_of_the_padded_record(n: int, rate: float) -> None:
    # A ball's speed, filtered, is a little below zero here and there.
    speed = np.abs(np.convolve(np.random.default_rng(n).normal(size=n + 40), np.hanning(41), "valid")) - 1e-3
    size = 2 ** (int(np.ceil(np.log2(n))) + 4)
    frequencies, magnitude = np.fft.rfftfreq(size, 1 / rate), np.abs(np.fft.rfft(speed, size))
    within = frequencies <= 20.0
    step = np.diff(frequencies[within]) / frequencies[within][-1]
    expected = -np.hypot(step, np.diff(magnitude[within] / magnitude.max())).sum()
    assert spectral_arc_length(speed, rate, cutoff="fixed", highest=20.0) == pytest.approx(expected, rel=1e-10)
    assert spectral_arc_length(speed, rate) == pytest.approx(oracle.sparc(speed, rate)[0], rel=1e-10)


@pytest.mark.evidence("truth", dimensionless_jerk, log_dimensionless_jerk)
@pytest.mark.parametrize(("scale", "jerk"), [("peak_speed", 720.0 / 1.875**2), ("mean_speed", 720.0)])
def test_jerk_of_a_minimum_jerk_movement_equals_the_closed_form(scale: str, jerk: float) -> None:
    speed = minimum_jerk(0.8, 0.3, 20_000.0)
    assert dimensionless_jerk(speed, 20_000.0, scale=scale) == pytest.approx(-jerk, rel=1e-3)
    assert log_dimensionless_jerk(speed, 20_000.0, scale=scale) == pytest.approx(-np.log(jerk), abs=1e-3)


@pytest.mark.evidence("truth", spectral_arc_length)
def test_arc_length_of_a_gaussian_equals_the_closed_form() -> None:
    # Its spectrum is exp(-f^2 / (2 s^2)), s = sqrt(10) / (2 pi), and falls to the threshold at f_c.
    t, s = np.arange(-3.0, 3.0, 0.001), np.sqrt(10.0) / (2.0 * np.pi)
    highest = s * np.sqrt(2.0 * np.log(20.0))
    length, _ = quad(lambda f: np.hypot(1.0 / highest, f / s**2 * np.exp(-(f**2) / (2 * s**2))), 0.0, highest)
    assert spectral_arc_length(np.exp(-5.0 * t**2), 1000.0, padding=7) == pytest.approx(-length, abs=2e-4)
    fixed, _ = quad(lambda f: np.hypot(1.0 / 20.0, f / s**2 * np.exp(-(f**2) / (2 * s**2))), 0.0, 20.0, limit=200)
    assert spectral_arc_length(np.exp(-5.0 * t**2), 1000.0, cutoff="fixed", highest=20.0, padding=7) == pytest.approx(
        -fixed, abs=2e-4
    )


def test_more_submovements_are_less_smooth() -> None:
    one, apart = minimum_jerk(0.5, 0.1, 200.0), np.zeros(400)
    apart[:100] = apart[150:250] = apart[300:] = one
    alone = np.concatenate([one, np.zeros(300)])
    assert spectral_arc_length(apart, 200.0) < spectral_arc_length(alone, 200.0) - 1.0
    assert log_dimensionless_jerk(apart, 200.0) < log_dimensionless_jerk(alone, 200.0) - 1.0


@pytest.mark.evidence("disturbance", spectral_arc_length, dimensionless_jerk, log_dimensionless_jerk, of="holes")
def test_undefined_smoothness_is_nan_or_refused() -> None:
    for measure in (spectral_arc_length, dimensionless_jerk, log_dimensionless_jerk):
        assert np.isnan(measure(np.zeros(50), 100.0))
        assert np.isnan(measure(np.array([0.0, np.nan, 1.0, 0.0]), 100.0))
        with pytest.raises(ValueError, match="samples"):
            measure(np.ones(1), 100.0)
    assert np.isnan(log_dimensionless_jerk(np.ones(9), 100.0))
    assert np.isnan(dimensionless_jerk([1.0, 0.0, -1.0], 100.0, scale="mean_speed"))
    assert np.isnan(spectral_arc_length([1.0, 0.9], 100.0, threshold=1.0, highest=1.0))
    with pytest.raises(ValueError, match="half the rate"):
        spectral_arc_length(GAUSSIAN, 10.0)


@pytest.mark.evidence("properties", spectral_arc_length, of="time")
@pytest.mark.evidence("properties", spectral_arc_length, log_dimensionless_jerk, of=("unit", "mirror"))
@given(st.integers(0, 10_000), st.integers(1, 8), st.floats(1e-6, 1e6), st.integers(0, 400))
def test_smoothness_is_invariant_to_unit_sign_and_shift(seed: int, count: int, unit: float, wait: int) -> None:
    speed = submovements(seed, count)
    assume(speed.max() > 0.0)
    for measure in (spectral_arc_length, log_dimensionless_jerk):
        assert measure(unit * speed, 200.0) == pytest.approx(measure(speed, 200.0), rel=1e-6)
        assert measure(-speed, 200.0) == pytest.approx(measure(speed, 200.0), rel=1e-9)
        assert measure(speed[::-1], 200.0) == pytest.approx(measure(speed, 200.0), rel=1e-6)
    # 600 samples and up to 400 zeros are padded to the same length.
    later = np.concatenate([np.zeros(wait), speed])
    assert spectral_arc_length(later, 200.0) == pytest.approx(spectral_arc_length(speed, 200.0), rel=1e-6)


@pytest.mark.evidence("properties", spectral_arc_length, log_dimensionless_jerk, of="rate")
@given(st.floats(0.3, 2.0), st.sampled_from([200.0, 500.0, 1000.0]))
def test_smoothness_hardly_depends_on_duration_and_rate(duration: float, rate: float) -> None:
    speed = minimum_jerk(duration, 0.1, rate)
    # Its jerk begins and ends with (60 A / T^3)^2, five times the mean: half a sample at each end and more is lost.
    assert log_dimensionless_jerk(speed, rate) == pytest.approx(-np.log(204.8), abs=12.0 / (rate * duration))
    assert spectral_arc_length(speed, rate) == pytest.approx(-1.4, abs=0.15)
