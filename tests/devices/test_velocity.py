"""Adaptive windowing: exact on lines, low noise at rest, and low lag in fast movement."""

from math import isnan, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.devices.contract.velocity import Velocimeter
from netboard.participants.body.velocity_window import SAMPLES, SLACK

STEP = 0.055e-3
MS = 1_000_000


def feed(heights: np.ndarray, resolution: float = STEP) -> np.ndarray:
    velocimeter = Velocimeter(resolution)
    quantised = np.round(heights / resolution) * resolution if resolution else heights
    return np.array([velocimeter.update(k * MS, 0.0, 0.0, float(z))[2] for k, z in enumerate(quantised)])


def test_first_position_gives_zero_velocity() -> None:
    assert feed(np.array([0.01]))[0] == 0.0


@given(st.floats(-0.5, 0.5))
def test_constant_velocity_is_accurate_to_a_step_over_the_window(speed: float) -> None:
    velocity = feed(speed * 1e-3 * np.arange(60))
    assert np.abs(velocity[20:] - speed).max() <= 2.1 * STEP / ((SAMPLES - 1) * 1e-3)


def test_single_encoder_step_is_spread_over_the_window() -> None:
    heights = np.zeros(60)
    heights[30:] = STEP
    assert np.abs(feed(heights)).max() == pytest.approx(STEP / ((SAMPLES - 1) * 1e-3))


def test_adaptive_window_beats_a_fixed_one_of_equal_noise_in_movement() -> None:
    t = 1e-3 * np.arange(500)
    speed = 0.02 * 4 * np.pi * 2 * np.cos(8 * np.pi * t)
    heights = 0.02 * np.sin(8 * np.pi * t)
    quantised = np.round(heights / STEP) * STEP
    n = SAMPLES - 1
    fixed = (quantised[n:] - quantised[:-n]) / (n * 1e-3)
    adaptive = np.sqrt(np.mean((feed(heights)[n:] - speed[n:]) ** 2))
    assert adaptive < 0.8 * np.sqrt(np.mean((fixed - speed[n:]) ** 2))


def test_zero_resolution_gives_the_last_difference_on_a_curved_path() -> None:
    heights = np.array([0.0, 0.001, 0.003, 0.006])
    assert feed(heights, 0.0)[-1] == pytest.approx(3.0)


def test_second_reading_at_the_same_time_replaces_the_first() -> None:
    velocimeter = Velocimeter(0.0)
    velocimeter.update(0, 0.0, 0.0, 0.0)
    velocimeter.update(MS, 0.0, 0.0, 0.5)
    assert velocimeter.update(MS, 0.0, 0.0, 0.001)[2] == pytest.approx(1.0)


@given(st.lists(st.integers(-3, 3), min_size=2, max_size=40))
def test_window_is_the_longest_that_a_straight_line_fits(steps: list[int]) -> None:
    """Compared with the definition: every window is tried, and every position in it."""
    places = STEP * np.cumsum(steps)
    velocity = feed(places)
    for now in range(len(places)):
        best = 0.0
        for last in range(1, min(now, SAMPLES - 1) + 1):
            rate = (places[now] - places[now - last]) / (last * 1e-3)
            line = places[now] - rate * 1e-3 * np.arange(last + 1)
            if np.abs(line - places[now - last : now + 1][::-1]).max() > SLACK * STEP:
                break
            best = rate
        assert velocity[now] == pytest.approx(best, abs=1e-9)


def test_nan_position_makes_the_velocity_nan_along_its_axis_only() -> None:
    velocity = Velocimeter(STEP)
    velocity.update(0, 0.0, 0.0, 0.0)
    vx, vy, vz = velocity.update(MS, nan, 0.0, 0.0)
    assert isnan(vx)
    assert vy == vz == 0.0


def test_unknown_position_before_a_jump_does_not_affect_the_velocity_after_it() -> None:
    velocity, places = Velocimeter(STEP), [0.0, nan, 0.0, 0.0, 0.001, 0.002]
    found = [velocity.update(k * MS, x, 0.0, 0.0)[0] for k, x in enumerate(places)]
    assert found[-1] == pytest.approx(1.0)
