"""Velocity peaks, compared with known peaks and with scipy, and their invariances."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.signal import argrelmax, argrelmin, find_peaks, peak_prominences

from netboard.analysis.measures.motion import ball_speed, motion
from netboard.analysis.measures.peaks import velocity_peaks

speeds = arrays(np.float64, st.integers(0, 60), elements=st.floats(0, 1, allow_subnormal=False))
TIMES = np.arange(4000) / 1000


def bells(centres: list[float], heights: list[float]) -> np.ndarray:
    return sum(h * np.exp(-(((TIMES - c) / 0.12) ** 2)) for c, h in zip(centres, heights, strict=True))


@pytest.mark.evidence("truth", velocity_peaks)
def test_known_peaks_are_found() -> None:
    found = velocity_peaks(bells([0.8, 1.6, 2.9], [0.3, 0.1, 0.2]))
    assert found.count == 3
    np.testing.assert_allclose(found.samples, [800, 1600, 2900], atol=1)
    np.testing.assert_allclose(found.heights, [0.3, 0.1, 0.2], atol=1e-4)


def test_minima_are_counted_on_request() -> None:
    speed = bells([0.8, 1.6, 2.9], [0.3, 0.1, 0.2])
    assert velocity_peaks(speed, extrema="maxima_and_minima").count == 5


def test_small_peaks_are_ignored_on_request() -> None:
    speed = bells([0.8, 1.6, 2.9], [0.3, 0.009, 0.2])
    assert (velocity_peaks(speed).count, velocity_peaks(speed, least_prominence=0.01).count) == (3, 2)
    assert velocity_peaks(speed, extrema="maxima_and_minima", least_prominence=0.01).count == 3
    assert velocity_peaks(np.zeros(9), least_prominence=0.01).count == 0


@pytest.mark.parametrize(("duration", "ringing"), [(0.6, 0.0060), (1.0, 0.0023), (2.0, 0.0006)])
def test_default_prominence_exceeds_the_ringing_of_the_filters(duration: float, ringing: float) -> None:
    """A minimum-jerk roll has one peak; without a prominence floor, filter ringing adds dozens."""
    s = np.clip((np.arange(9000) / 1000 - 4.0) / duration, 0.0, 1.0)
    p = -0.15 + 0.3 * s**3 * (10 - 15 * s + 6 * s**2)
    still = np.zeros_like(p)
    speed = motion(1000.0, still, still, still, p).speed
    found = velocity_peaks(speed)
    assert found.count > 10
    others = np.sort(peak_prominences(speed, found.samples)[0])[:-1]
    assert 0.5 * ringing < others.max() / speed.max() < ringing
    assert velocity_peaks(speed, least_prominence=1e-4, least_share=0.006).count == 1
    assert velocity_peaks(np.full(5, np.nan), least_share=0.006).samples.size == 0


@pytest.mark.evidence("truth", velocity_peaks)
def test_plateaus_are_peaks_and_ends_are_not() -> None:
    plateau = np.array([0.0, 1, 1, 1, 0])
    assert velocity_peaks(plateau).samples.tolist() == [1]
    assert velocity_peaks(plateau, plateau="midpoint").samples.tolist() == [2]
    shelf = np.array([0.0, 1, 1, 2, 0])
    assert velocity_peaks(shelf).samples.tolist() == [1, 3]
    assert velocity_peaks(shelf, plateau="midpoint").samples.tolist() == [3]
    for ends in ([2.0, 1, 0, 1, 2], [0.0, 1], [1.0], []):
        assert velocity_peaks(np.array(ends)).count == 0


@pytest.mark.evidence("truth", velocity_peaks, ball_speed)
@pytest.mark.parametrize("order", ["absolute_first", "filter_first"])
def test_swinging_ball_has_one_peak_per_swing(order: str) -> None:
    """A ball that swings at 0.8 Hz passes the centre at top speed every 0.625 s."""
    speed = ball_speed(0.2 * np.cos(2 * np.pi * 0.8 * np.arange(7000) / 1000), 1000.0, order=order)
    assert velocity_peaks(speed[2000:5000]).count == np.count_nonzero(
        (np.arange(20) / 1.6 > 2) & (np.arange(20) / 1.6 < 5)
    )


@pytest.mark.evidence("independent", velocity_peaks, by="scipy")
@given(speeds)
def test_peaks_equal_those_of_scipy(speed: np.ndarray) -> None:
    np.testing.assert_array_equal(velocity_peaks(speed, plateau="midpoint").samples, find_peaks(speed)[0])
    distinct = speed + 1e-3 * np.arange(speed.size) ** 2 * np.sqrt(2)
    if np.all(np.diff(distinct) != 0):
        for plateau in ("first_sample", "midpoint"):
            np.testing.assert_array_equal(velocity_peaks(distinct, plateau=plateau).samples, argrelmax(distinct)[0])
        both = np.sort(np.concatenate([argrelmax(distinct)[0], argrelmin(distinct)[0]]))
        np.testing.assert_array_equal(velocity_peaks(distinct, extrema="maxima_and_minima").samples, both)


@pytest.mark.evidence("independent", velocity_peaks, by="scipy")
@given(speeds, st.floats(0.05, 0.5))
def test_peaks_with_prominence_equal_those_of_scipy(speed: np.ndarray, least: float) -> None:
    expected = find_peaks(speed, prominence=least)[0]
    np.testing.assert_array_equal(velocity_peaks(speed, plateau="midpoint", least_prominence=least).samples, expected)


@pytest.mark.evidence("properties", velocity_peaks, of=("unit", "time"))
@given(speeds, st.sampled_from([0.25, 2.0, 1024.0]), st.integers(1, 5))
def test_peaks_are_invariant_to_unit_and_time_shift(speed: np.ndarray, unit: float, shift: int) -> None:
    found = velocity_peaks(speed).samples
    np.testing.assert_array_equal(velocity_peaks(unit * speed).samples, found)
    if speed.size and speed[0] > 0:
        later = velocity_peaks(np.concatenate([np.full(shift, 2.0), speed])).samples
        np.testing.assert_array_equal(later[later > shift], found[found > 0] + shift)


@pytest.mark.evidence("properties", velocity_peaks, of="rate")
@given(st.lists(st.floats(0.3, 3.7), min_size=1, max_size=4), st.integers(2, 4))
def test_peak_count_is_independent_of_the_sampling_rate(centres: list[float], step: int) -> None:
    speed = ball_speed(bells(centres, [0.2] * len(centres)), 1000.0)
    fine = velocity_peaks(speed, least_prominence=1e-4)
    coarse = velocity_peaks(speed[::step], least_prominence=1e-4)
    assert abs(coarse.count - fine.count) <= (0 if len(centres) == 1 else 1)
