"""Samples at ticks against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.errors import ConfigError
from netboard.recording.importing.resampling import resampled, segments


def at_ticks(time: np.ndarray, columns: dict[str, np.ndarray], kind="cubic") -> tuple[np.ndarray, dict]:
    (segment,) = segments(time, 0.1)
    return segment.ticks, dict(resampled(time, columns, segment, kind))


@pytest.mark.parametrize("rate", [100, 250, 333, 2000])
def test_cubic_interpolation_error_is_of_fourth_order(rate: int) -> None:
    time = 1234.5 + np.arange(2 * rate) / rate
    wave = 6.0  # rad/s
    moved = {"left_z": 0.1 * np.sin(wave * (time - time[0]))}
    ticks, found = at_ticks(time, moved)
    exact = 0.1 * np.sin(wave * ticks * 1e-3)
    assert ticks.tolist() == list(range(ticks.size))
    bound = 0.1 * (wave / rate) ** 4
    assert found["left_z"] == pytest.approx(exact, abs=bound + 1e-12)
    assert found["left_vz"] == pytest.approx(0.1 * wave * np.cos(wave * ticks * 1e-3), abs=20 * bound * rate + 1e-8)


def test_given_velocities_define_the_interpolating_cubic() -> None:
    time = np.array([0.0, 0.05, 0.1])
    cubic, slope = 3 * time**3 - time, 9 * time**2 - 1
    ticks, found = at_ticks(time, {"p": cubic, "vp": slope})
    t = ticks * 1e-3
    assert found["p"] == pytest.approx(3 * t**3 - t, abs=1e-15)
    assert found["vp"] == pytest.approx(np.interp(t, time, slope), abs=1e-15)


def test_linear_resampling_follows_straight_lines() -> None:
    time = np.array([0.0, 0.004, 0.008])
    found = at_ticks(time, {"left_z": np.array([0.0, 4.0, 0.0])}, "linear")[1]
    assert found["left_z"] == pytest.approx([0, 1, 2, 3, 4, 3, 2, 1, 0])


def test_resampled_jump_does_not_overshoot() -> None:
    time = np.arange(50) / 200
    jumps = np.where(time < 0.1, 0.2, -0.2)
    found = at_ticks(time, {"p": jumps})[1]
    assert found["p"].max() == pytest.approx(0.2)
    assert found["p"].min() == pytest.approx(-0.2)


def test_integers_and_texts_hold_the_newest_sample() -> None:
    time = np.array([0.0, 0.0025, 0.005])
    words = np.array(["a", "b", "c"], object)
    found = at_ticks(time, {"trial": np.array([1, 2, 3]), "outcome": words})[1]
    assert found["trial"].tolist() == [1, 1, 1, 2, 2, 3]
    assert "".join(found["outcome"]) == "aaabbc"


def test_missing_values_stay_missing_between_samples() -> None:
    time = np.array([0.0, 0.002, 0.004, 0.006])
    found = at_ticks(time, {"p": np.array([1.0, 1.0, np.nan, 1.0])})[1]
    assert np.isnan(found["p"]).tolist() == [False, False, False, True, True, True, False]


@given(st.lists(st.floats(-1, 1), min_size=2, max_size=30), st.floats(0, 1e6))
def test_samples_at_ticks_are_unchanged(values: list[float], begin: float) -> None:
    time = begin + np.arange(len(values)) / 1000
    found = at_ticks(time, {"left_z": np.array(values), "left_force": np.array(values)})[1]
    assert found["left_z"].tolist() == values
    assert found["left_force"].tolist() == values


def test_segments_end_at_gaps_and_single_samples_are_dropped() -> None:
    time = np.array([0.0, 0.001, 0.002, 1.0, 2.0, 2.0015, 2.003])
    found = segments(time, 0.1)
    assert [(segment.first, segment.stop, segment.exact) for segment in found] == [(0, 3, True), (4, 7, False)]
    assert [segment.ticks.tolist() for segment in found] == [[0, 1, 2], [2000, 2001, 2002, 2003]]
    with pytest.raises(ConfigError, match="no two rows"):
        segments(np.array([0.0, 1.0]), 0.1)
