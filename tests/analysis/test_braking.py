"""First braking movements of synthetic trials with known movements of the board."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from two_hands import ARM, Movement, TwoHands, rolled, two_hands

from netboard.analysis.measures.braking import Strategy, first_braking
from netboard.analysis.measures.motion import Trial, motion
from netboard.analysis.measures.segments import board_segments

RELEASE = 500
TARGET = 0.15


def tilting(*movements: Movement) -> tuple[list[Movement], list[Movement]]:
    """Movements of both hands that tilt the board (start, duration, degrees), + = right end up."""
    heights = [(start, duration, ARM * np.radians(degrees)) for start, duration, degrees in movements]
    return [(start, duration, -height) for start, duration, height in heights], heights


def trial_of(*movements: Movement, side: float = 1, rate: float = 1000.0) -> tuple[TwoHands, np.ndarray, np.ndarray]:
    """Board and ball of a trial with these tilts, towards a target on one side."""
    hands = two_hands(
        *tilting(*[(start, duration, side * degrees) for start, duration, degrees in movements]), rate=rate
    )
    release = round(RELEASE * rate / 1000)
    return hands, *rolled(hands.theta, rate, -side * TARGET, release)


def strategy(*movements: Movement, side: float = 1, braking: str = "tilt", rate: float = 1000.0) -> Strategy:
    hands, p, vp = trial_of(*movements, side=side, rate=rate)
    segments = board_segments(hands.omega, hands.theta, rate)
    trial = Trial(round(RELEASE * rate / 1000), p.size, side * TARGET)
    return first_braking(segments, hands.theta, p, vp, rate, trial, braking=braking)


START = (0.7, 0.3, -3.0)
BRAKE = (1.3, 0.4, 5.0)


@pytest.mark.evidence("truth", first_braking)
@pytest.mark.parametrize("side", [-1, 1])
def test_first_braking_reports_distance_and_velocity_at_its_onset(side: float) -> None:
    found = strategy(START, BRAKE, side=side)
    hands, p, vp = trial_of(START, BRAKE)
    assert (found.initial, found.onset) == pytest.approx((0.2, 0.8), abs=0.03)
    at = round(found.onset * 1000) + RELEASE
    assert found.distance == pytest.approx(TARGET - p[at])
    assert found.velocity == pytest.approx(vp[at])
    assert found.velocity == pytest.approx(9.81 * np.sin(np.radians(3)) * (hands.times[at] - 0.85), rel=0.02)
    assert found.wrong_way == 0


@pytest.mark.evidence("truth", first_braking)
def test_initial_tilt_away_from_the_target_is_counted() -> None:
    found = strategy((0.6, 0.2, 2.0), (0.9, 0.3, -5.0), BRAKE)
    assert found.wrong_way == 1
    assert (found.initial, found.onset) == pytest.approx((0.4, 0.8), abs=0.03)


@pytest.mark.evidence("truth", first_braking)
def test_levelling_the_board_is_braking_by_rotation_only() -> None:
    level_then_brake = (START, (1.1, 0.3, 2.5), (1.6, 0.3, 4.0))
    assert strategy(*level_then_brake).onset == pytest.approx(1.1, abs=0.03)
    assert strategy(*level_then_brake, braking="rotation").onset == pytest.approx(0.6, abs=0.03)


def test_later_movement_towards_the_target_is_not_braking() -> None:
    """The board may still tilt away from the target, which brakes the ball, after a movement towards the target."""
    found = strategy((0.55, 0.2, 6.0), (0.8, 0.2, -2.0), (1.05, 0.2, -2.0), (1.4, 0.2, 3.0))
    assert found.onset == pytest.approx(0.9, abs=0.03)
    assert found.wrong_way == 1


@pytest.mark.evidence("truth", first_braking)
def test_distance_is_negative_when_the_ball_is_past_the_target() -> None:
    found = strategy((0.7, 0.3, -8.0), (1.7, 0.4, 12.0))
    assert found.distance < 0 < found.velocity
    assert found.absolute_distance == -found.distance


def test_missing_initial_movement_or_braking_is_nan() -> None:
    no_brake = strategy(START)
    assert no_brake.initial == pytest.approx(0.2, abs=0.03)
    assert np.isnan([no_brake.onset, no_brake.distance, no_brake.velocity]).all()
    no_start = strategy((0.7, 0.3, 3.0))
    assert np.isnan([no_start.initial, no_start.onset, no_start.distance, no_start.velocity]).all()
    assert no_start.wrong_way == 1
    assert strategy().wrong_way == 0


def test_movements_of_other_trials_are_ignored() -> None:
    hands, p, vp = trial_of((0.1, 0.3, -3.0), (0.7, 0.3, -2.0), (1.3, 0.4, 8.0), (2.2, 0.3, 3.0))
    segments = board_segments(hands.omega, hands.theta, 1000.0)
    found = first_braking(segments, hands.theta, p, vp, 1000.0, Trial(RELEASE, 1250, TARGET))
    assert found.initial == pytest.approx(0.2, abs=0.03)
    assert np.isnan(found.onset)


def test_filters_hardly_change_the_first_braking() -> None:
    hands, p, vp = trial_of(START, BRAKE)
    found = motion(1000.0, hands.left_z, hands.right_z, hands.theta, p)
    trial = Trial(RELEASE, p.size, TARGET)
    segments = board_segments(found.omega, found.theta, 1000.0)
    filtered = first_braking(segments, found.theta, found.p, found.vp, 1000.0, trial)
    exact = strategy(START, BRAKE)
    assert filtered.onset == pytest.approx(exact.onset, abs=0.04)
    assert filtered.distance == pytest.approx(exact.distance, abs=0.01)
    assert filtered.velocity == pytest.approx(exact.velocity, abs=0.02)
    assert vp[RELEASE] == 0


courses = st.lists(st.floats(-8, 8), min_size=1, max_size=5).map(
    lambda angles: [(0.55 + 0.45 * k, 0.4, angle) for k, angle in enumerate(angles)]
)


@pytest.mark.slow
@pytest.mark.evidence("properties", first_braking, of="mirror")
@given(courses, st.sampled_from(["tilt", "rotation"]))
def test_first_braking_is_mirror_symmetric(course: list[Movement], braking: str) -> None:
    left, right = (strategy(*course, side=side, braking=braking) for side in (-1, 1))
    np.testing.assert_allclose(
        [left.distance, left.velocity, left.onset, left.initial],
        [right.distance, right.velocity, right.onset, right.initial],
        atol=1e-12,
    )
    assert left.wrong_way == right.wrong_way


@given(courses)
def test_onset_by_rotation_is_never_later_than_onset_by_tilt(course: list[Movement]) -> None:
    rotation, tilt = (strategy(*course, braking=braking).onset for braking in ("rotation", "tilt"))
    assert np.isnan(tilt) or rotation <= tilt
