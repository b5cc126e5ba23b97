"""First and last trials, learning curves and groups of trials, computed by hand."""

import numpy as np
import pytest

from made_study import Block, made_study, random_blocks, times
from netboard.analysis.topics.groups import CLASSES
from netboard.analysis.topics.learning import TeamLearning, learning, picture
from netboard.analysis.topics.result import Result, TopicResults
from netboard.participants.seat.partners import POLICIES

BLOCKS = (
    Block("D01", "D01A", "bimanual", "full", times(9, 7, 3, 1)),
    Block("D01", "D01A", "bimanual", "none", times(5, 5, 2, 2)),
    Block("D01", "D01B", "bimanual", "full", times(6, 6, 4, 4)),
    Block("D02", "D02A", "bimanual", "full", times(3, 3, 1, 1)),
)
ENDS = "summaries.ends=2"


def result(found: TopicResults[TeamLearning], quantity: str, group: str) -> Result:
    (only,) = [one for one in found.results if (one.quantity, one.group) == (quantity, group)]
    return only


def test_first_and_last_trials_report_mean_and_sd_over_trials() -> None:
    found = learning(made_study(BLOCKS, ENDS))
    first = [9, 7, 5, 5, 6, 6, 3, 3]
    one = result(found, "completion time", "bimanual, first 2")
    assert (one.value, one.n, one.of, one.interval) == (np.mean(first), 8, "trial", "SD")
    assert one.high - one.value == pytest.approx(np.std(first, ddof=1))
    assert result(found, "completion time", "bimanual, last 2").value == np.mean([3, 1, 2, 2, 4, 4, 1, 1])


def test_change_is_averaged_over_dyads() -> None:
    """D01A goes from 6.5 to 2 s, D01B from 6 to 4: D01 by -3.25 s; D02 by -2 s."""
    change = result(learning(made_study(BLOCKS, ENDS)), "change of completion time", "bimanual, last 2 vs first 2")
    assert (change.value, change.n, change.of) == (-2.625, 2, "dyad")


def test_velocity_peaks_are_summarised_like_times() -> None:
    one = result(learning(made_study(BLOCKS, ENDS)), "number of velocity peaks", "bimanual, last 2")
    assert (one.value, one.unit) == (np.mean([3, 1, 2, 2, 4, 4, 1, 1]), "1")


def test_deviation_over_participants_can_be_configured() -> None:
    one = result(
        learning(made_study(BLOCKS, ENDS, 'summaries.spread="people"')), "completion time", "bimanual, first 2"
    )
    people = [6.5, 6.0, 3.0]
    assert (one.value, one.n, one.of) == (np.mean(people), 3, "participant")
    assert one.high - one.value == pytest.approx(np.std(people, ddof=1))


def test_numbering_across_haptic_conditions_can_be_configured() -> None:
    """With it, D01A's first two trials are of the first condition only, and the last two of the second only."""
    found = learning(made_study(BLOCKS, ENDS, 'summaries.numbering="configuration"'))
    assert result(found, "completion time", "bimanual, first 2").value == np.mean([9, 7, 6, 6, 3, 3])
    assert result(found, "completion time", "bimanual, last 2").value == np.mean([2, 2, 4, 4, 1, 1])
    (one,) = found.parts
    assert one.series == 3
    assert one.courses[0].curve.count.tolist() == [3, 3, 3, 3, 1, 1, 1, 1]


@pytest.mark.parametrize(("ends", "first"), [(1, [9, 5, 6, 3]), (2, [9, 7, 5, 5, 6, 6, 3, 3])])
def test_first_and_last_windows_have_the_configured_length(ends: int, first: list[float]) -> None:
    found = learning(made_study(BLOCKS, f"summaries.ends={ends}"))
    assert result(found, "completion time", f"bimanual, first {ends}").value == np.mean(first)


def test_participants_with_too_few_trials_are_left_out_and_counted() -> None:
    found = learning(made_study([*BLOCKS, Block("D02", "D02B", "bimanual", "full", times(100, 100, 100))], ENDS))
    one = result(found, "completion time", "bimanual, first 2")
    assert (one.value, one.n) == (5.5, 8)
    assert one.note == "1 of 5 have fewer than 4 trials and are left out"


def test_too_few_trials_of_all_participants_report_a_reason() -> None:
    one = result(learning(made_study(BLOCKS, "summaries.ends=30")), "completion time", "bimanual, first 30")
    assert np.isnan(one.value)
    assert (one.n, one.note) == (0, "4 of 4 have fewer than 60 trials and are left out")


def test_last_trials_are_each_participants_own_last_ones() -> None:
    """D01A has five trials and counts with its own last two; D01B has only four."""
    blocks = [
        Block("D01", "D01A", "bimanual", "full", times(9, 9, 9, 1, 1)),
        Block("D01", "D01B", "bimanual", "full", times(8, 8, 2, 2)),
    ]
    found = learning(made_study(blocks, ENDS))
    assert result(found, "completion time", "bimanual, last 2").value == 1.5


def test_learning_curve_is_the_mean_at_each_trial_number() -> None:
    (one,) = learning(made_study(BLOCKS, ENDS)).parts
    assert one.courses[0].curve.mean.tolist() == [5.75, 5.25, 2.5, 2.0]
    assert (one.dyads, one.performers, one.series, one.trials) == (2, 3, 4, 16)


def test_groups_of_trials_are_averaged_over_dyads() -> None:
    (one,) = learning(made_study(BLOCKS, "summaries.ends=1", "summaries.group=3")).parts
    stages = one.courses[0].stages
    assert stages.first.tolist() == [1, 4]
    assert stages.last.tolist() == [3, 4]
    of_a, of_b = np.mean([9, 7, 3, 5, 5, 2]), np.mean([6, 6, 4])
    assert stages.dyads.loc["D01"].tolist() == pytest.approx([(of_a + of_b) / 2, (1.5 + 4) / 2])
    assert [mean.n for mean in stages.means] == [2, 2]


def test_configured_kind_of_time_is_used() -> None:
    trials = [{"trial": 1, "outcome": "fell", "duration": 10.0}, {"trial": 1, "attempt": 2, "completion": 2.0}]
    blocks = [Block("D01", "D01", "dyadic", "none", [*trials, {"trial": 2, "completion": 4.0}])]
    values = [
        result(
            learning(made_study(blocks, "summaries.ends=1", f'summaries.time="{time}"')),
            "completion time",
            "dyadic, first 1",
        ).value
        for time in ("successful_attempt", "all_attempts")
    ]
    assert values == [2.0, 12.0]


def test_class_durations_add_up_to_the_completion_time() -> None:
    for one in learning(made_study(random_blocks())).parts:
        assert one.seconds.shape == (9, len(CLASSES))
        np.testing.assert_allclose(one.seconds.sum(axis=1), one.courses[0].curve.mean)


def test_robot_partner_is_a_separate_team() -> None:
    blocks = [
        Block("D01", "D01", "dyadic", "full", times(1)),
        Block("D01", "D01", "dyadic", "full", times(9), right_by="robot"),
    ]
    found = learning(made_study(blocks))
    assert [(one.team, one.courses[0].curve.mean.tolist()) for one in found.parts] == [
        ("dyadic", [1.0]),
        ("dyadic, robot partner", [9.0]),
    ]


def test_study_without_successes_has_no_results() -> None:
    found = learning(made_study([Block("D01", "D01", "dyadic", "none", [{"outcome": "fell"}])]))
    assert (found.parts, found.results) == ((), ())


def test_figures_have_a_letter_for_each_panel_of_many_partners() -> None:
    blocks = [Block("D01", "D01", "dyadic", "full", times(3, 2, 1), right_by=name) for name in sorted(POLICIES)]
    drawn = picture(made_study(blocks, ENDS))
    assert drawn.figure is not None
    titles = [axes.get_title("left").split("}")[0][-1] for axes in drawn.figure.axes]
    letters = [title for title in titles if title]
    assert len(letters) > 16
    assert len(set(letters)) == len(letters)
