"""Nothing younger than the delay is perceived, and noise is what it is said to be."""

from dataclasses import replace

import numpy as np
import pytest

from netboard.base.tables.simulated import Participant
from netboard.participants.senses import Glimpse, Senses, Wander

CLEAR = Participant(position_noise=0.0, velocity_noise=0.0, tilt_noise_deg=0.0)


def glimpse(time: float, p: float | None = 0.0, phase: str = "running") -> Glimpse:
    return Glimpse(time=time, phase=phase, z=0.0, theta=0.01, p=p, target=0.15, left=0.0, right=None)


def watching(positions: list[tuple[float, float | None]], phase: str = "running") -> Senses:
    senses = Senses(CLEAR, np.random.default_rng(1))
    for time, p in positions:
        senses.take(time, glimpse(time, p, phase), None)
    return senses


def test_nothing_is_seen_before_the_visual_delay() -> None:
    senses = watching([(0.0, 0.1)])
    assert senses.look(CLEAR.visual_delay - 1e-6, 0.01) is None
    seen = senses.look(CLEAR.visual_delay + 1e-6, 0.01)
    assert seen is not None
    assert seen.p == 0.1


def test_what_is_seen_is_the_newest_that_is_old_enough() -> None:
    senses = watching([(0.01 * k, 0.001 * k) for k in range(60)])
    seen = senses.look(0.59, 0.01)
    assert seen is not None
    assert 0.59 - CLEAR.visual_delay - 0.0101 < seen.glimpse.time <= 0.59 - CLEAR.visual_delay


def test_the_velocity_of_a_steady_ball_is_right() -> None:
    seen = watching([(k / 120, 0.2 * k / 120) for k in range(60)]).look(0.5, 0.01)
    assert seen is not None
    assert seen.v == pytest.approx(0.2, rel=1e-9)


def test_a_fixed_ball_has_no_velocity_and_its_jump_is_not_taken_for_one() -> None:
    senses = watching([(0.00, 0.1), (0.01, 0.2)], phase="levelling")
    senses.take(0.02, glimpse(0.02, 0.2), None)
    fixed, released = senses.look(0.01 + CLEAR.visual_delay, 0.01), senses.look(0.02 + CLEAR.visual_delay, 0.01)
    assert fixed is not None
    assert released is not None
    assert (fixed.v, released.v) == (0.0, 0.0)


def test_a_board_without_a_ball_can_be_seen() -> None:
    seen = watching([(0.0, None)]).look(1.0, 0.01)
    assert seen is not None
    assert (seen.p, seen.v) == (0.0, 0.0)


def test_forces_are_felt_late_and_forgotten_where_none_is_rendered() -> None:
    senses = Senses(CLEAR, np.random.default_rng(1))
    senses.take(0.00, None, 0.5)
    senses.take(0.01, None, 0.7)
    assert senses.force(-0.01) is None
    assert senses.force(0.005) == 0.5
    assert senses.force(0.01) == 0.7
    senses.take(0.02, None, None)
    assert senses.force(0.02) is None


def test_noise_has_its_deviation_and_its_correlation_time() -> None:
    wander = Wander(0.3, 0.2, np.random.default_rng(2))
    values = np.array([wander.step(0.05) for _ in range(40_000)])
    assert values.std() == pytest.approx(0.3, rel=0.03)
    after = np.corrcoef(values[:-4], values[4:])[0, 1]
    assert after == pytest.approx(np.exp(-1.0), abs=0.03)


def test_noise_reaches_what_is_seen() -> None:
    person = replace(CLEAR, tilt_noise_deg=0.25)
    senses = Senses(person, np.random.default_rng(4))
    senses.take(0.0, glimpse(0.0), None)
    seen = [senses.look(1.0 + 0.01 * k, 0.01) for k in range(20_000)]
    tilts = np.array([s.theta for s in seen if s is not None])
    assert np.degrees(tilts.std()) == pytest.approx(0.25, rel=0.1)
    assert tilts.mean() == pytest.approx(0.01, abs=5e-4)
