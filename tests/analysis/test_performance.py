"""Performance over trials: by hand, by loops, and properties for any numbers."""

import statistics

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from netboard.analysis.measures.performance import (
    RelativePerformance,
    better_dyads,
    first_and_last,
    learning_curve,
    level,
    relative_performance,
    running_number,
    summarise,
    trial_times,
    window_sizes,
)

NAN = float("nan")
values = st.lists(st.floats(0.1, 60), min_size=2, max_size=50)


@pytest.mark.evidence("disturbance", summarise, of="holes")
@pytest.mark.evidence("independent", summarise, by="statistics")
@given(values)
def test_summary_equals_the_statistics_module(some: list[float]) -> None:
    found = summarise(np.array([*some, NAN]))
    assert found.mean == pytest.approx(statistics.mean(some))
    assert found.deviation == pytest.approx(statistics.stdev(some), abs=1e-9)
    assert found.count == len(some)


@pytest.mark.evidence("truth", summarise)
def test_summary_over_participants_weights_them_equally() -> None:
    found = summarise(np.array([1.0, 2, 3, 10, NAN]), np.array(["A", "A", "A", "B", "C"]))
    assert (found.mean, found.count) == (6.0, 2)
    assert found.deviation == pytest.approx(np.sqrt(32))
    assert np.isnan([summarise(np.array([NAN])).mean, summarise(np.array([1.0])).deviation]).all()


@pytest.mark.evidence("truth", running_number)
def test_running_number_counts_trials_within_each_label() -> None:
    people = np.array(list("ABABAABB"))
    haptics = np.array([1, 1, 0, 1, 1, 0, 0, 1], bool)
    np.testing.assert_array_equal(running_number(people), [1, 1, 2, 2, 3, 4, 3, 4])
    np.testing.assert_array_equal(running_number(people, haptics), [1, 1, 1, 2, 2, 2, 1, 3])
    with pytest.raises(ValueError, match="each label"):
        running_number(people, haptics[1:])
    with pytest.raises(ValueError, match="each label"):
        running_number()
    assert running_number(np.empty(0, np.int64)).size == 0


@given(st.lists(st.tuples(st.integers(0, 3), st.booleans()), max_size=40))
def test_running_number_equals_a_plain_count(labels: list[tuple[int, bool]]) -> None:
    person, haptics = np.array([one[0] for one in labels], np.int64), np.array([one[1] for one in labels], bool)
    expected = [labels[: k + 1].count(one) for k, one in enumerate(labels)]
    np.testing.assert_array_equal(running_number(person, haptics), expected)


@pytest.mark.evidence("disturbance", trial_times, of="holes")
@pytest.mark.evidence("truth", trial_times)
def test_trial_times_use_the_success_or_all_attempts() -> None:
    trials = np.array([1, 1, 2, 3, 3, 3, 4])
    durations = np.array([7.0, 4.5, 5.0, 1.0, 2.0, 6.0, 9.0])
    completions = np.array([NAN, 3.0, 3.5, NAN, NAN, 4.5, NAN])
    numbers, times = trial_times(trials, durations, completions)
    np.testing.assert_array_equal(numbers, [1, 2, 3, 4])
    np.testing.assert_array_equal(times, [3.0, 3.5, 4.5, NAN])
    all_of_it = trial_times(trials, durations, completions, of="all_attempts")[1]
    np.testing.assert_array_equal(all_of_it, [10.0, 3.5, 7.5, NAN])


@pytest.mark.evidence("truth", first_and_last)
def test_first_and_last_pool_both_conditions() -> None:
    """Times fall by 10 ms per trial, from 5 s in one condition and 6 s in the other."""
    order = np.concatenate([np.arange(1, 181)] * 2)
    times = np.where(np.arange(360) < 180, 5.0, 6.0) - 0.01 * order
    found = first_and_last(times, order)
    assert (found.first.count, found.last.count) == (60, 60)
    assert found.first.mean == pytest.approx(5.5 - 0.155)
    assert found.last.mean == pytest.approx(5.5 - 1.655)
    assert found.change == pytest.approx(-1.5)
    people = np.repeat(["A", "B"], 180)
    by_person = first_and_last(times, order, people=people)
    assert by_person.first.mean == pytest.approx(found.first.mean)
    assert by_person.first.deviation == pytest.approx(np.sqrt(0.5))
    assert by_person.first.count == 2


def test_overlapping_first_and_last_windows_are_refused() -> None:
    with pytest.raises(ValueError, match="overlap"):
        first_and_last(np.zeros(59), np.arange(1, 60))
    assert first_and_last(np.zeros(50), np.arange(1, 51), length=180).last.count == 0
    assert np.isnan(first_and_last(np.zeros(0), np.zeros(0, np.int64)).change)


@pytest.mark.evidence("disturbance", learning_curve, of="holes")
@pytest.mark.evidence("truth", learning_curve)
def test_learning_curve_is_the_mean_at_each_trial_number() -> None:
    order = np.array([1, 2, 3, 1, 2, 4])
    found = learning_curve(np.array([5.0, 4, NAN, 7, 2, 1]), order)
    np.testing.assert_array_equal(found.order, [1, 2, 3, 4])
    np.testing.assert_array_equal(found.mean, [6, 3, NAN, 1])
    np.testing.assert_allclose(found.deviation, [np.sqrt(2), np.sqrt(2), NAN, NAN])
    np.testing.assert_array_equal(found.count, [2, 2, 0, 1])


@pytest.mark.evidence("disturbance", level, of="holes")
@pytest.mark.evidence("truth", level)
def test_level_is_the_mean_the_median_or_the_last_trials() -> None:
    times = np.array([9.0, 3, NAN, 3, 1])
    assert level(times) == 4
    assert level(times, of="median") == 3
    assert level(times, of="last", last=2) == 2
    assert level(times, of="last") == 4
    assert np.isnan(level(np.array([NAN]), of="median"))


@pytest.mark.evidence("truth", relative_performance)
def test_relative_performance_follows_the_definition_of_the_paper() -> None:
    """Alone 3 s and 5 s, together 3.5 s: worse than the better one, better than their mean."""
    better, worse = relative_performance(3, 5, 3.5), relative_performance(5, 3, 3.5)
    assert (better.against_partner, better.of_dyad) == (1, 0.5)
    assert (worse.against_partner, worse.of_dyad) == (-1, -1.5)
    assert better.gain == worse.gain == 0.5


def test_a_dyad_at_the_mean_of_its_participants_has_no_gain() -> None:
    """Their mean is not exact in binary numbers: 99, 139 and 119 velocity peaks in 24 trials each."""
    first, second = relative_performance(99 / 24, 139 / 24, 119 / 24), relative_performance(139 / 24, 99 / 24, 119 / 24)
    assert first.gain == second.gain == 0.0
    assert better_dyads([first]) == better_dyads([second]) == (0, 1)


@pytest.mark.evidence("properties", relative_performance, of=("mirror", "constant"))
@given(*[st.floats(0.5, 30)] * 4)
def test_both_partners_have_the_same_gain(own: float, partner: float, dyad: float, added: float) -> None:
    one, other = relative_performance(own, partner, dyad), relative_performance(partner, own, dyad)
    assert one.against_partner == -other.against_partner
    assert one.gain == pytest.approx(other.gain, abs=1e-9)
    assert one.gain == pytest.approx((own + partner) / 2 - dyad, abs=1e-9)
    later = relative_performance(own + added, partner + added, dyad + added)
    np.testing.assert_allclose([later.against_partner, later.of_dyad], [one.against_partner, one.of_dyad], atol=1e-9)


@pytest.mark.evidence("disturbance", better_dyads, of="holes")
@pytest.mark.evidence("truth", better_dyads)
def test_better_dyads_are_counted_among_those_known() -> None:
    points = [RelativePerformance(0.5, -0.1), RelativePerformance(-0.5, 0.1), RelativePerformance(0.0, NAN)]
    assert better_dyads(points) == (1, 2)
    assert better_dyads([]) == (0, 0)


@pytest.mark.evidence("properties", first_and_last, of="unit")
@given(arrays(np.float64, st.integers(60, 200), elements=st.floats(0.5, 30)), st.floats(0.1, 10))
def test_first_and_last_follow_the_unit_of_time(times: np.ndarray, unit: float) -> None:
    order = 1 + np.arange(times.size)
    found, scaled = first_and_last(times, order), first_and_last(unit * times, order)
    assert scaled.first.mean == pytest.approx(unit * found.first.mean)
    assert scaled.last.deviation == pytest.approx(unit * found.last.deviation, abs=1e-6)
    assert scaled.change == pytest.approx(unit * found.change, abs=1e-6)


@pytest.mark.evidence("truth", window_sizes)
@pytest.mark.parametrize(
    ("trials", "sizes"),
    [
        *((trials, (30, 30)) for trials in (180, 177, 172, 155, 93, 60)),
        *((58, (29, 29)), (50, (25, 25)), (49, (24, 24)), (45, (22, 15)), (12, (6, 6)), (9, (4, 3)), (1, (1, 3))),
    ],
)
def test_windows_are_those_of_the_paper_or_fit_the_trials(trials: int, sizes: tuple[int, int]) -> None:
    assert window_sizes(trials) == sizes


@pytest.mark.evidence("properties", window_sizes, of="balance")
@given(st.integers(2, 1000))
def test_windows_never_overlap(trials: int) -> None:
    ends, group = window_sizes(trials)
    assert 1 <= ends <= min(30, trials // 2)
    assert max(ends / 2, 3) <= group <= max(ends, 3)
