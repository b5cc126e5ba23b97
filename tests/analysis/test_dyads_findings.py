"""Dyads compared with their participants: every point and count, computed by hand."""

import numpy as np
import pytest

from made_study import Block, made_study, times
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.topics.dyads import DyadComparison, dyads


def blocks(*levels: tuple[float, float, float], force: str = "full") -> list[Block]:
    """A dyad for each triple of levels: participant A alone, B alone, and both together."""
    made = []
    for k, (first, second, both) in enumerate(levels, start=1):
        dyad = f"D{k:02}"
        who = ((f"{dyad}A", "bimanual", first), (f"{dyad}B", "bimanual", second), (dyad, "dyadic", both))
        made += [Block(dyad, name, configuration, force, times(level, level)) for name, configuration, level in who]
    return made


def of_time(study: StudyData, force: str = "full") -> DyadComparison:
    (only,) = [one for one in dyads(study).parts if (one.quantity.column, one.condition.force) == ("completion", force)]
    return only


def test_points_equal_the_definition_of_the_paper() -> None:
    found = of_time(made_study(blocks((4.0, 6.0, 3.0), (2.0, 2.0, 5.0))))
    points = [(one.participant, one.relative.against_partner, one.relative.of_dyad) for one in found.points]
    assert points == [("D01A", 1.0, -1.0), ("D01B", -1.0, -3.0), ("D02A", 0.0, 3.0), ("D02B", 0.0, 3.0)]
    assert found.gains.to_dict() == {"D01": 2.0, "D02": -3.0}
    assert (found.better, found.known) == (1, 2)
    assert (found.gain.value, found.gain.n, found.gain.unit) == (-0.5, 2, "dyad")


def test_counts_are_reported_with_the_least_possible_p() -> None:
    study = made_study(blocks(*[(4.0, 6.0, 3.0)] * 4))
    (one,) = [r for r in dyads(study).results if r.quantity == "completion time: dyads better than the mean of the two"]
    assert (one.value, one.n, one.of) == (4.0, 4, "dyad")
    assert one.note == "sign test: p = 0.125; 4 dyads can give no p below 0.125"


def test_dyads_are_compared_with_individuals_under_the_same_force() -> None:
    """Without haptics both are slower alone, so the same time together is a gain."""
    study = made_study(blocks((4.0, 4.0, 5.0)) + blocks((8.0, 8.0, 5.0), force="none"))
    assert of_time(study).gain.value == -1.0
    assert of_time(study, "none").gain.value == 3.0


def test_force_without_individual_trials_reports_why_it_has_no_gain() -> None:
    study = made_study([*blocks((4.0, 4.0, 5.0)), Block("D01", "D01", "dyadic", "unrelated", times(1, 1))])
    found = of_time(study, "unrelated")
    assert (found.points, found.known) == ((), 0)
    reported = [one for one in dyads(study).results if one.group == "unrelated force"]
    assert all(np.isnan(one.value) and one.n == 0 for one in reported)
    assert all("no dyad has trials that count in both configurations in this" in one.note for one in reported)


def test_dyad_lacking_individual_trials_of_a_partner_is_left_out() -> None:
    found = of_time(made_study([*blocks((4.0, 6.0, 3.0)), *blocks((1.0, 1.0, 1.0), (2.0, 2.0, 1.0))[4:]]))
    assert [one.dyad for one in found.points] == ["D01", "D01"]


def test_trials_with_a_robot_partner_are_ignored() -> None:
    study = made_study([*blocks((4.0, 6.0, 3.0)), Block("D01", "D01", "dyadic", "full", times(99), right_by="robot")])
    assert len(dyads(study).parts) == 2
    assert of_time(study).gain.value == 2.0


@pytest.mark.parametrize(("level", "gain"), [("mean", (40 / 61 + 0) - 1.0), ("median", -1.0), ("last", 40 / 60 - 1.0)])
def test_level_is_the_mean_the_median_or_the_last_60_trials(level: str, gain: float) -> None:
    """Of 61 individual trials, the last takes 40 s and all others 0 s."""
    alone = times(*[0.0] * 60, 40.0)
    study = made_study(
        [
            Block("D01", "D01A", "bimanual", "full", alone),
            Block("D01", "D01B", "bimanual", "full", alone),
            Block("D01", "D01", "dyadic", "full", times(1.0)),
        ],
        f'summaries.level="{level}"',
    )
    assert of_time(study).gain.value == pytest.approx(gain)
