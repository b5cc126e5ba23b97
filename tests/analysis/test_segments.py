"""Movements of the board: known movements are found with their limits, and invariances hold."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from two_hands import TwoHands, minimum_jerk_rate, two_hands

from netboard.analysis.measures.motion import Trial
from netboard.analysis.measures.segments import Segments, board_segments

DEGREE = np.pi / 180


def board(*pulses: tuple[float, float, float], length: float = 3.0, rate: float = 1000.0) -> tuple[np.ndarray, ...]:
    """Angular velocity and tilt of a board that turns at given rates: (start, duration, rate in degrees/s)."""
    omega = np.zeros(round(length * rate))
    for start, duration, degrees in pulses:
        omega[round(start * rate) : round((start + duration) * rate)] = degrees * DEGREE
    theta = np.concatenate([[0], np.cumsum((omega[1:] + omega[:-1]) / 2)]) / rate
    return omega, theta


def by_definition(omega: np.ndarray, theta: np.ndarray, rate: float) -> list[tuple[int, int]]:
    """Find the movements by the definition of the paper, sample by sample."""
    found, begun = [], None
    for k, w in enumerate([*omega, 0.0]):
        sign = 0 if abs(w) <= DEGREE else (1 if w > 0 else -1)
        if begun and sign != begun[1]:
            first = begun[0]
            if k - 1 - first >= round(0.1 * rate) and abs(theta[k - 1] - theta[first]) >= DEGREE:
                found.append((first, k))
            begun = None
        if sign and not begun:
            begun = (k, sign)
    return found


def limits(segments: Segments) -> list[tuple[int, int]]:
    return list(zip(segments.first.tolist(), segments.stop.tolist(), strict=True))


@pytest.mark.evidence("truth", board_segments)
def test_movements_must_be_fast_long_and_large_enough() -> None:
    omega, theta = board((0.2, 0.5, 4), (1.0, 0.099, 30), (1.3, 1.2, 0.9), (2.6, 0.3, -5))
    found = board_segments(omega, theta, 1000.0)
    assert limits(found) == [(200, 700), (2600, 2900)]
    np.testing.assert_allclose(found.angle / DEGREE, [2.0, -1.5], atol=0.03)
    np.testing.assert_array_equal(found.direction, [1, -1])
    assert not found.cut.any()


def test_minimum_duration_angle_and_rate_are_configurable() -> None:
    omega, theta = board((0.2, 0.101, 12), (1.0, 0.5, 1.9))
    assert limits(board_segments(omega, theta, 1000.0)) == [(200, 301)]
    assert limits(board_segments(omega, theta, 1000.0, shortest=0.101)) == []
    assert limits(board_segments(omega, theta, 1000.0, least_angle=0.9 * DEGREE)) == [(200, 301), (1000, 1500)]
    assert limits(board_segments(omega, theta, 1000.0, least_rate=2 * DEGREE)) == [(200, 301)]


def test_reversal_ends_a_movement_only_in_one_way_mode() -> None:
    omega, theta = board((0.5, 0.3, 8), (0.8, 0.5, -8))
    one, either = (board_segments(omega, theta, 1000.0, turning=turning) for turning in ("one_way", "either_way"))
    assert limits(one) == [(500, 800), (800, 1300)]
    assert limits(either) == [(500, 1300)]
    np.testing.assert_allclose(one.angle / DEGREE, [2.4, -4.0], atol=0.05)
    np.testing.assert_allclose(either.angle / DEGREE, [-1.6], atol=0.05)


def test_angle_is_net_range_or_integral() -> None:
    omega, theta = board((0.5, 0.3, 8), (0.8, 0.5, -8))
    for angle, expected in (("net", -1.6), ("range", -4.0), ("integral", -1.6)):
        found = board_segments(omega, theta, 1000.0, turning="either_way", angle=angle)
        np.testing.assert_allclose(found.angle / DEGREE, [expected], atol=0.05)
    assert len(board_segments(omega, theta, 1000.0, turning="either_way", least_angle=2 * DEGREE)) == 0
    other = board_segments(omega, 0 * theta, 1000.0, angle="integral")
    np.testing.assert_allclose(other.angle / DEGREE, [2.4, -4.0], atol=0.05)


@pytest.mark.evidence("disturbance", board_segments, of="holes")
def test_truncated_movements_are_marked() -> None:
    omega, theta = board((0.0, 0.5, 4), (1.0, 0.5, 4), (2.0, 1.0, 4))
    omega[1500] = np.nan
    np.testing.assert_array_equal(board_segments(omega, theta, 1000.0).cut, [True, True, True])
    omega[1500] = 0
    np.testing.assert_array_equal(board_segments(omega, theta, 1000.0).cut, [True, False, True])


def test_trial_owns_movements_that_begin_in_it() -> None:
    omega, theta = board((0.2, 0.5, 4), (1.0, 0.5, -4), (1.8, 0.5, 4))
    found = board_segments(omega, theta, 1000.0)
    own = found.of_trial(Trial(500, 2000, 0.15))
    assert limits(own) == [(1000, 1500), (1800, 2300)]
    np.testing.assert_array_equal(own.cut, [False, True])
    assert limits(found.of_trial(Trial(200, 1000, 0.15))) == [(200, 700)]


def test_still_board_has_no_movements() -> None:
    found = board_segments(np.zeros(100), np.zeros(100), 1000.0, angle="range")
    assert (len(found), found.angle.shape) == (0, (0,))
    assert len(board_segments(np.full(300, np.nan), np.full(300, np.nan), 1000.0)) == 0


def test_arrays_of_different_lengths_are_refused() -> None:
    with pytest.raises(ValueError, match="one value each"):
        board_segments(np.zeros(3), np.zeros(4), 1000.0)


@pytest.mark.evidence("truth", board_segments)
def test_limits_of_a_minimum_jerk_movement_equal_the_closed_form() -> None:
    """Both hands move 10 mm in 0.4 s and tilt the board by 2.29 degrees; its rate crosses 1 degree/s at a root."""
    hands = two_hands([(1.0, 0.4, -0.01)], [(1.0, 0.4, 0.01)])
    found = board_segments(hands.omega, hands.theta, hands.rate)
    fine = np.linspace(0, 0.2, 200_001)
    onset = np.interp(DEGREE, minimum_jerk_rate(fine, 0, 0.4, 0.02 / 0.5), fine)
    assert len(found) == 1
    assert hands.times[found.first[0]] == pytest.approx(1.0 + onset, abs=1e-3)
    assert hands.times[found.stop[0] - 1] == pytest.approx(1.4 - onset, abs=1e-3)


moves = st.lists(st.tuples(st.floats(0.1, 2), st.floats(0.2, 0.8), st.floats(-0.02, 0.02)), min_size=1, max_size=4)


@pytest.mark.evidence("truth", board_segments)
@given(moves, moves)
def test_segments_follow_the_definition_of_the_paper(left: list, right: list) -> None:
    hands = two_hands(left, right, rate=250.0)
    found = board_segments(hands.omega, hands.theta, hands.rate)
    assert limits(found) == by_definition(hands.omega, hands.theta, hands.rate)


def mirrored(hands: TwoHands) -> TwoHands:
    return TwoHands(hands.rate, hands.times, hands.right_z, hands.left_z, hands.right_vz, hands.left_vz)


@pytest.mark.evidence("properties", board_segments, of=("mirror", "time"))
@given(moves, moves, st.integers(1, 300), st.sampled_from(["net", "range", "integral"]))
def test_segments_are_invariant_to_mirror_and_shift(left: list, right: list, shift: int, angle: str) -> None:
    hands = two_hands(left, right, rate=250.0)
    found = board_segments(hands.omega, hands.theta, hands.rate, angle=angle)
    other = mirrored(hands)
    swapped = board_segments(other.omega, other.theta, hands.rate, angle=angle)
    assert limits(swapped) == limits(found)
    np.testing.assert_allclose(swapped.angle, -found.angle)
    omega, theta = np.pad(hands.omega, (shift, 0)), np.pad(hands.theta, (shift, 0), mode="edge")
    later = board_segments(omega, theta, hands.rate, angle=angle)
    assert limits(later) == [(a + shift, b + shift) for a, b in limits(found)]


@pytest.mark.evidence("properties", board_segments, of="rate")
@given(st.floats(0.2, 0.8), st.floats(0.008, 0.03))
def test_segments_are_independent_of_the_sampling_rate(duration: float, distance: float) -> None:
    at = {}
    for rate in (500.0, 2000.0):
        hands = two_hands([(1.0, duration, -distance)], [(1.0, duration, distance)], rate=rate)
        found = board_segments(hands.omega, hands.theta, rate)
        assert len(found) == 1
        at[rate] = np.array([found.first[0] / rate, found.stop[0] / rate, found.angle[0]])
    np.testing.assert_allclose(at[500.0], at[2000.0], atol=4e-3)
