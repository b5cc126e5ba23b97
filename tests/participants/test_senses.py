"""Perception: no input newer than the delay, and noise with a set deviation and correlation time."""

from math import isnan, nan

import numpy as np
import pytest
from numpy.typing import NDArray

from netboard.base.config import parse
from netboard.base.errors import ConfigError
from netboard.participants.people.senses import (
    MEMORY,
    PERCEPT,
    SEEN,
    SENSES,
    Glimpse,
    force_at,
    ou_factors,
    perceive,
    store,
    write_glimpse,
)


def glimpse(time: float, p: float | None = 0.0, phase: str = "running") -> NDArray[np.void]:
    shown = np.zeros(1, SEEN)
    write_glimpse(Glimpse(time, phase, z=0.0, theta=0.01, p=p, target=0.15, left=0.0, right=None), shown)
    return shown


def senses_after(positions: list[tuple[float, float | None]], phase: str = "running") -> NDArray[np.void]:
    senses = np.zeros(1, SENSES)
    for time, p in positions:
        store(senses[0], time, glimpse(time, p, phase)[0], nan)
    return senses


def seen_at(senses: NDArray[np.void], until: float) -> np.void | None:
    percept = np.zeros(1, PERCEPT)
    return percept[0] if perceive(senses[0], until, 0.05, percept[0]) else None


def test_view_is_not_perceived_before_it_is_shown() -> None:
    senses = senses_after([(0.0, 0.1)])
    assert seen_at(senses, -1e-6) is None
    seen = seen_at(senses, 1e-6)
    assert seen is not None
    assert seen["p"] == 0.1
    assert seen["left"] == 0.0
    assert isnan(seen["right"]), "the partner's stylus is hidden"


def test_newest_view_older_than_the_delay_is_perceived() -> None:
    senses = senses_after([(0.01 * k, 0.001 * k) for k in range(60)])
    seen = seen_at(senses, 0.415)
    assert seen is not None
    assert seen["time"] == pytest.approx(0.41)


def test_velocity_of_a_ball_at_constant_speed_is_estimated_exactly() -> None:
    seen = seen_at(senses_after([(k / 120, 0.2 * k / 120) for k in range(60)]), 0.4)
    assert seen is not None
    assert seen["v"] == pytest.approx(0.2, rel=1e-9)


def test_fixed_ball_has_zero_velocity_despite_a_position_jump() -> None:
    senses = senses_after([(0.00, 0.1), (0.01, 0.2)], phase="levelling")
    store(senses[0], 0.02, glimpse(0.02, 0.2)[0], nan)
    fixed, released = seen_at(senses, 0.01), seen_at(senses, 0.02)
    assert fixed is not None
    assert released is not None
    assert (fixed["v"], released["v"]) == (0.0, 0.0)


def test_board_without_a_ball_is_perceived() -> None:
    seen = seen_at(senses_after([(0.0, None)]), 1.0)
    assert seen is not None
    assert (seen["p"], seen["v"]) == (0.0, 0.0)


def test_memory_is_limited_and_always_has_the_newest_view() -> None:
    senses = senses_after([(0.01 * k, 0.0) for k in range(400)])
    assert senses["seen_count"][0] == 221
    assert seen_at(senses, 3.99 - MEMORY - 0.01) is None
    for k in range(400, 600):
        store(senses[0], 0.01 * k, glimpse(3.99)[0], 0.1)
    assert senses["felt_count"][0] == 200
    for k in range(600, 700):
        store(senses[0], 0.01 * k, glimpse(3.99)[0], 0.1)
    assert senses["seen_count"][0] == 1
    assert senses["felt_count"][0] == 221
    assert seen_at(senses, 7.0) is not None


@pytest.mark.parametrize("delay", ["visual_delay", "haptic_delay"])
def test_memory_reaches_back_by_the_longest_delay(delay: str) -> None:
    longest = 2.0
    with pytest.raises(ConfigError, match=delay):
        parse(f"[participant]\n{delay} = {longest + 0.01}")
    parse(f"[participant]\n{delay} = {longest}")
    senses = np.zeros(1, SENSES)
    for k in range(400):
        store(senses[0], 0.01 * k, glimpse(0.01 * k)[0], 0.001 * k)
    then = 3.99 - longest
    seen = seen_at(senses, then)
    assert seen is not None
    assert seen["time"] == pytest.approx(then)
    assert force_at(senses[0], then) == pytest.approx(0.1 * then, abs=1e-3)


def test_force_is_perceived_after_the_delay_and_cleared_when_none_is_rendered() -> None:
    senses, nothing = np.zeros(1, SENSES), np.zeros(1, SEEN)
    write_glimpse(None, nothing)
    store(senses[0], 0.00, nothing[0], 0.5)
    store(senses[0], 0.01, nothing[0], 0.7)
    assert isnan(force_at(senses[0], -0.01))
    assert force_at(senses[0], 0.005) == 0.5
    assert force_at(senses[0], 0.01) == 0.7
    store(senses[0], 0.02, nothing[0], nan)
    assert isnan(force_at(senses[0], 0.02))
    assert seen_at(senses, 1.0) is None


def test_noise_has_the_set_deviation_and_correlation_time() -> None:
    rng, value = np.random.default_rng(2), 0.3
    keep, fresh = ou_factors(0.2, 0.05)
    values = np.array([value := keep * value + 0.3 * fresh * rng.standard_normal() for _ in range(40_000)])
    assert values.std() == pytest.approx(0.3, rel=0.03)
    after = np.corrcoef(values[:-4], values[4:])[0, 1]
    assert after == pytest.approx(np.exp(-1.0), abs=0.03)


def test_noise_is_added_to_the_perceived_state() -> None:
    senses = senses_after([(0.0, 0.1)])
    senses["noise_theta"], senses["noise_p"], senses["noise_v"] = 0.002, 0.003, 0.01
    seen = seen_at(senses, 1.0)
    assert seen is not None
    assert (seen["theta"], seen["p"], seen["v"]) == pytest.approx((0.012, 0.103, 0.01))
