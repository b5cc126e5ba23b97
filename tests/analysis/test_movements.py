"""Classes of movement: every case against the definition, and invariances."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from two_hands import time_to_portion, two_hands

from netboard.analysis.measures.movements import Movement, classify, mean_shares, movement_times, shares

velocities = arrays(np.float64, 40, elements=st.floats(-0.02, 0.02))
MIRROR = {Movement.LEFT_ONLY: Movement.RIGHT_ONLY, Movement.RIGHT_ONLY: Movement.LEFT_ONLY}


def class_by_definition(left: float, right: float) -> Movement:
    """Classify a pair of velocities by the definitions printed in the paper."""
    moves = [abs(left) >= 0.003, abs(right) >= 0.003]
    if all(moves):
        return Movement.COOPERATIVE if (left > 0) != (right > 0) else Movement.COMPETITIVE
    if any(moves):
        return Movement.LEFT_ONLY if moves[0] else Movement.RIGHT_ONLY
    return Movement.STILL


@pytest.mark.evidence("truth", classify)
def test_classes_follow_the_definition_in_all_cases() -> None:
    some = [-0.05, -0.003, -0.0029, 0.0, 0.0029, 0.003, 0.05]
    left, right = np.array(list(product(some, some))).T
    assert list(classify(left, right)) == [class_by_definition(*pair) for pair in zip(left, right, strict=True)]


def test_velocity_at_the_threshold_counts_as_configured() -> None:
    limit, none = np.array([0.003, -0.003]), np.zeros(2)
    assert list(classify(limit, none)) == [Movement.LEFT_ONLY] * 2
    assert list(classify(limit, none, at_limit="still")) == [Movement.STILL] * 2


@pytest.mark.evidence("disturbance", classify, movement_times, of="holes")
def test_missing_velocities_are_classified_as_unknown() -> None:
    classes = classify(np.array([np.nan, 0.01, np.nan]), np.array([0.01, np.nan, np.nan]))
    assert list(classes) == [Movement.UNKNOWN] * 3
    times = movement_times(classes, 1000.0)
    assert times.unknown == pytest.approx(0.003)
    assert np.isnan(times.shares).all()


@pytest.mark.evidence("properties", classify, of="mirror")
@given(velocities, velocities)
def test_swapping_sides_swaps_the_single_classes(left: np.ndarray, right: np.ndarray) -> None:
    swapped = classify(right, left)
    assert list(swapped) == [MIRROR.get(Movement(one), one) for one in classify(left, right)]
    np.testing.assert_array_equal(classify(-left, -right), classify(left, right))


@pytest.mark.evidence("properties", classify, of="unit")
@given(velocities, velocities, st.sampled_from([0.5, 2.0, 1024.0]))
def test_classes_are_independent_of_the_unit(left: np.ndarray, right: np.ndarray, unit: float) -> None:
    scaled = classify(unit * left, unit * right, still_below=0.003 * unit)
    np.testing.assert_array_equal(scaled, classify(left, right))


@pytest.mark.evidence("truth", movement_times)
@pytest.mark.parametrize(("way", "together"), [(-1, "cooperative"), (1, "competitive")])
def test_times_of_two_movements_equal_the_closed_form(way: int, together: str) -> None:
    """10 mm in 0.4 s each, the right one 0.2 s later; the time below the threshold has a closed form."""
    hands = two_hands([(0.5, 0.4, way * 0.01)], [(0.7, 0.4, 0.01)], length=2.0)
    slow = time_to_portion(0.003 / (1.875 * 0.01 / 0.4), 0.4)
    found = movement_times(classify(hands.left_vz, hands.right_vz), hands.rate)
    assert getattr(found, together) == pytest.approx(0.2 - 2 * slow, abs=2e-3)
    assert found.left_only == pytest.approx(0.2, abs=2e-3)
    assert found.right_only == pytest.approx(0.2, abs=2e-3)
    assert found.still == pytest.approx(2.0 - 0.6 + 2 * slow, abs=2e-3)


@pytest.mark.evidence("properties", movement_times, of=("rate", "balance"))
@given(velocities, velocities, st.sampled_from([2, 5]))
def test_class_times_add_up_and_are_independent_of_the_rate(left: np.ndarray, right: np.ndarray, finer: int) -> None:
    classes = classify(left, right)
    times = movement_times(classes, 100.0)
    assert times.single == pytest.approx(times.left_only + times.right_only)
    assert times.seconds.sum() + times.unknown == pytest.approx(0.4)
    assert times.shares.sum() == pytest.approx(1)
    np.testing.assert_allclose(movement_times(np.repeat(classes, finer), 100.0 * finer).seconds, times.seconds)


@pytest.mark.evidence("disturbance", shares, of="holes")
def test_empty_trial_has_no_shares() -> None:
    assert np.isnan(movement_times(np.empty(0, np.int8), 1000.0).shares).all()
    assert np.isnan(shares(np.zeros((2, 4)))).all()


@pytest.mark.evidence("truth", mean_shares)
def test_mean_shares_weight_trials_equally_or_by_time() -> None:
    seconds = np.array([[1.0, 0, 0, 0], [0, 9.0, 0, 0]])
    np.testing.assert_allclose(mean_shares(seconds), [0.5, 0.5, 0, 0])
    np.testing.assert_allclose(mean_shares(seconds, of="time"), [0.1, 0.9, 0, 0])


@pytest.mark.evidence("disturbance", mean_shares, of="holes")
def test_trial_with_unknown_shares_is_left_out_of_the_mean() -> None:
    seconds = np.array([[1.0, 3.0, 0, 0], [np.nan] * 4, [3.0, 9.0, 0, 0]])
    for average in ("trials", "time"):
        np.testing.assert_allclose(mean_shares(seconds, of=average), [0.25, 0.75, 0, 0])


@pytest.mark.evidence("truth", mean_shares)
def test_participants_are_weighted_equally_in_mean_shares() -> None:
    seconds = np.array([[1.0, 0, 0, 0]] * 3 + [[0, 1.0, 0, 0]] + [[0, 0, 0, 0]])
    people = np.array([1, 1, 1, 2, 3])
    np.testing.assert_allclose(mean_shares(seconds, people), [0.5, 0.5, 0, 0])
    np.testing.assert_allclose(mean_shares(seconds), [0.75, 0.25, 0, 0])
    assert np.isnan(mean_shares(np.zeros((0, 4)))).all()
    assert np.isnan(mean_shares(np.zeros((2, 4)), of="time")).all()
