"""Task performance in a trial, against synthetic movements with known results."""

from dataclasses import astuple
from itertools import groupby

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.analysis.measures.task import fall_time, falls, overshoots, reaction, time_in_target

RATE = 1000.0
PLACES = st.lists(st.sampled_from([-0.3, -0.15, 0.0, 0.12, 0.15, 0.18, 0.2, 0.3]), min_size=1, max_size=40)


def damped(record: float = 12.0) -> tuple[np.ndarray, np.ndarray]:
    """A ball in a damped oscillation about the target's centre, with a period of 2 s."""
    t = np.arange(round(record * RATE)) / RATE
    return t, 0.15 - 0.3 * np.exp(-0.4 * t) * np.cos(np.pi * t)


@pytest.mark.evidence("truth", overshoots, time_in_target)
def test_damped_swing_equals_the_closed_form() -> None:
    t, p = damped()
    # Its excursions at 1, 2, 3 ... s are 0.3 exp(-0.4 t) up to a tilt of the extrema, atan(0.4 / pi) earlier.
    early = np.arctan(0.4 / np.pi) / np.pi
    extrema = 0.3 * np.exp(-0.4 * (np.arange(1, 12) - early)) * np.cos(np.pi * early)
    found = overshoots(p, RATE, centre=0.15)
    far = extrema[::2]
    assert found.count == (far > 0.035).sum() == 3
    assert found.largest == pytest.approx(far[0] - 0.035, abs=1e-6)
    past = overshoots(p, RATE, centre=0.15, beyond="centre")
    assert past.count == 6
    assert past.largest == pytest.approx(far[0], abs=1e-6)
    assert past.time == pytest.approx(6.0, abs=0.01)
    inside = time_in_target(p, RATE, centre=0.15)
    assert inside.visits == (extrema > 0.035).sum() + 1
    assert inside.longest == pytest.approx(12.0 - t[np.abs(p - 0.15) > 0.035][-1], abs=2e-3)
    assert inside.first == pytest.approx(t[np.abs(p - 0.15) <= 0.035][0])


@pytest.mark.evidence("truth", time_in_target)
@given(PLACES)
def test_time_in_target_equals_a_plain_count(places: list[float]) -> None:
    found = time_in_target(places, 10.0, centre=0.15, half_width=0.0351)
    runs = [(inside, len(list(run))) for inside, run in groupby(abs(p - 0.15) <= 0.0351 for p in places)]
    stays = [length for inside, length in runs if inside]
    assert found.visits == len(stays)
    assert found.time == pytest.approx(sum(stays) / 10.0)
    assert found.share == pytest.approx(sum(stays) / len(places))
    assert found.longest == pytest.approx((max(stays, default=1) - 1) / 10.0)
    assert np.isnan(found.first) == (not stays)


@pytest.mark.evidence("properties", time_in_target, of="mirror")
@given(PLACES)
def test_time_in_target_is_mirror_symmetric(places: list[float]) -> None:
    there, here = (time_in_target(way * np.array(places), 10.0, centre=way * 0.15) for way in (-1.0, 1.0))
    assert astuple(there) == pytest.approx(astuple(here), nan_ok=True)


@pytest.mark.evidence("properties", overshoots, of=("mirror", "unit"))
@given(PLACES)
def test_overshoots_are_outside_the_target(places: list[float]) -> None:
    found = overshoots(places, 10.0, centre=0.15)
    assert found.time <= len(places) / 10.0 - time_in_target(places, 10.0, centre=0.15).time + 1e-12
    assert (found.count > 0) == (found.largest > 0.0)
    assert overshoots(places, 10.0, centre=0.15, beyond="centre").largest >= found.largest
    assert overshoots(-np.array(places), 10.0, centre=-0.15) == found
    assert overshoots(1e3 * np.array(places), 10.0, centre=150.0, half_width=35.0).count == found.count


def test_target_includes_its_edges() -> None:
    assert time_in_target([0.25, 0.75], 1.0, centre=0.5, half_width=0.25).time == 2.0


def test_empty_record_has_no_time_in_target() -> None:
    empty = time_in_target([], RATE, centre=0.15)
    assert (empty.time, empty.visits, empty.longest) == (0.0, 0, 0.0)
    assert np.isnan([empty.share, empty.first]).all()
    with pytest.raises(ValueError, match="sample"):
        overshoots([], RATE, centre=0.15)


@pytest.mark.evidence("truth", falls, fall_time)
def test_falls_and_fall_time_equal_hand_computed_values() -> None:
    t = np.arange(0.0, 2.0, 1 / RATE)
    assert fall_time(0.15 + 0.5 * 0.8 * t**2, RATE) == pytest.approx(np.sqrt(0.2 / 0.4), abs=1e-3)
    assert np.isnan(fall_time(np.full(10, 0.35), RATE))
    found = falls(["success", "fell", "skipped", "fell", "success", "success", "timed_out"])
    assert (found.falls, found.n, found.share, found.unit) == (2, 5, 0.4, "attempt")
    assert np.isnan(falls([]).share)


def movement(onset: float, peak: float, duration: float = 0.4) -> np.ndarray:
    s = np.clip((np.arange(2000) / RATE - onset) / duration, 0.0, 1.0)
    return peak / 1.875 * 30.0 * s**2 * (1.0 - s) ** 2


@pytest.mark.evidence("truth", reaction)
@pytest.mark.parametrize("peak", [0.02, 0.1, -0.5])
def test_reaction_time_equals_the_closed_form(peak: float) -> None:
    # Minimum jerk reaches f of its peak at (1 - sqrt(1 - sqrt f)) / 2 of its duration.
    share = lambda f: (1.0 - np.sqrt(1.0 - np.sqrt(f))) / 2.0  # noqa: E731
    sustained = reaction(movement(0.3, peak), RATE)
    assert sustained.time == pytest.approx(0.3 + 0.4 * share(0.003 / abs(peak)), abs=1.1e-3)
    before_peak = reaction(movement(0.3, peak), RATE, onset="before_peak")
    assert before_peak.time == pytest.approx(0.3 + 0.4 * share(0.05), abs=1.1e-3)
    assert not sustained.anticipated


def test_stillness_anticipation_and_twitches_are_no_reaction() -> None:
    still = reaction(np.full(500, 0.001), RATE)
    assert np.isnan(still.time)
    assert not still.anticipated
    holed = np.full(500, 0.001)
    holed[200] = np.nan
    assert np.isnan(reaction(holed, RATE).anticipated)
    moving = reaction(movement(-0.1, 0.1), RATE)
    assert np.isnan(moving.time)
    assert moving.anticipated
    soon = reaction(movement(0.05, 0.1), RATE)
    assert soon.anticipated
    assert soon.time < 0.1
    twitch = movement(0.5, 0.1)
    twitch[200:220] = 0.01
    assert reaction(twitch, RATE).time > 0.5
    assert reaction(twitch, RATE, hold=0.01).time == pytest.approx(0.2)


@pytest.mark.evidence("properties", reaction, of=("time", "mirror"))
@given(st.floats(0.15, 1.0), st.floats(0.05, 1.0), st.integers(0, 400))
def test_reaction_time_follows_shift_and_ignores_sign(onset: float, peak: float, wait: int) -> None:
    velocity = movement(onset, peak)
    for rule in ("sustained", "before_peak"):
        found = reaction(velocity, RATE, onset=rule).time
        assert reaction(np.concatenate([np.zeros(wait), velocity]), RATE, onset=rule).time == pytest.approx(
            found + wait / RATE
        )
        assert reaction(-velocity, RATE, onset=rule).time == found
