"""Levels of dyads, computed by hand: each is the mean of its performers' means, for any numbers of trials."""

from collections import Counter
from typing import cast

import numpy as np
import pandas as pd
import pytest

from made_modern import modern_blocks, modern_study
from made_study import Block, made_study, times
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.extraction.tables import Group, number
from netboard.analysis.extraction.trials import AttemptData
from netboard.analysis.topics.measures import (
    MEASURES,
    Levels,
    _of_trials,
    levels,
    measures_of,
    overview,
    rows_of,
)
from netboard.analysis.topics.result import TopicResults, table_of


def level_of(found: TopicResults[Levels], measure: str, condition: str) -> Levels:
    (only,) = [one for one in found.parts if one.measure.name == measure and one.condition.name == condition]
    return only


def test_dyad_level_is_the_unweighted_mean_of_its_performers() -> None:
    study = made_study(
        [
            Block("D01", "D01A", "bimanual", "none", [{"completion": 2.0, "peaks": 1}] * 5),
            Block("D01", "D01B", "bimanual", "none", [{"completion": 8.0, "peaks": 4}]),
        ]
    )
    found = overview(study)
    assert level_of(found, "velocity peaks", "bimanual, haptics off").values == pytest.approx([2.5])
    assert level_of(found, "completion time", "bimanual, haptics off").values == pytest.approx([4.0])
    assert level_of(found, "velocity peaks", "bimanual, haptics off").rows == 6


def test_mean_over_dyads_has_a_t_interval_on_the_log_scale_for_times() -> None:
    study = made_study([Block(f"D0{k}", f"D0{k}", "dyadic", "none", times(2.0**k)) for k in (1, 2, 3)])
    one = level_of(overview(study), "completion time", "dyadic, haptics off")
    half = 4.302652729911275 / np.sqrt(3.0) * np.log(2.0)
    assert one.mean.value == pytest.approx(4.0)
    assert (one.mean.low, one.mean.high) == pytest.approx((4.0 * np.exp(-half), 4.0 * np.exp(half)))
    assert (one.mean.n, one.mean.unit) == (3, "dyad")


def test_falls_of_excluded_attempts_do_not_count() -> None:
    attempts = [
        *times(3.0, 3.0),
        {"outcome": "fell", "flags": ""},
        {"outcome": "fell", "flags": "lost_samples"},
        {"outcome": "timed_out"},
    ]
    study = made_study([Block("D01", "D01", "dyadic", "full", attempts)])
    assert len(study.exclusions) == 1
    assert level_of(overview(study), "falls per attempt", "dyadic, haptics on").values == pytest.approx([1 / 3])


@pytest.mark.parametrize(("reading", "share"), [("trials", 0.5), ("time", 0.18)])
def test_shares_are_weighted_by_trials_or_time_as_configured(reading: str, share: float) -> None:
    nothing = {"competitive": 0.0, "still": 0.0}
    trials = [
        {"cooperative": 0.9, "single": 0.1, **nothing},
        {"cooperative": 0.9, "single": 8.1, **nothing},
        {"cooperative": 0.0, "single": 0.0, **nothing},
    ]
    found = overview(made_study([Block("D01", "D01", "dyadic", "full", trials)], f"summaries.shares={reading}"))
    assert level_of(found, "cooperative share", "dyadic, haptics on").values == pytest.approx([share])
    assert level_of(found, "single share", "dyadic, haptics on").values == pytest.approx([1.0 - share])


def test_reaction_time_is_of_the_first_hand_unless_a_hand_anticipated() -> None:
    trials = [
        {"left_reaction": 0.4, "right_reaction": 0.3},
        {"left_reaction": np.nan, "right_reaction": 0.5, "left_anticipated": 0},
        {"left_reaction": np.nan, "right_reaction": 0.9},
        {"left_reaction": 0.05, "right_reaction": 0.3, "left_anticipated": 1},
    ]
    study = made_study([Block("D01", "D01", "dyadic", "full", trials)])
    assert level_of(overview(study), "reaction time", "dyadic, haptics on").values == pytest.approx([0.4])


def test_largest_overshoot_is_measured_and_not_compared() -> None:
    study = made_study([Block("D01", "D01", "dyadic", "full", [{"overshoot": 0.01}, {"overshoot": 0.03}])])
    one = level_of(overview(study), "largest overshoot", "dyadic, haptics on")
    assert one.values == pytest.approx([0.02])
    assert (one.measure.unit, one.measure.compared) == ("m", False)


def test_delays_use_only_cooperative_movements_of_counted_trials() -> None:
    moves = [
        {"delay_20": -0.1},
        {"delay_20": 0.3},
        {"delay_20": 9.0, "cooperative": 0},
        {"delay_20": 9.0, "trial": 2},
    ]
    trials = [*times(3.0), {"outcome": "fell"}]
    study = made_study([Block("D01", "D01", "dyadic", "full", trials, moves)])
    assert level_of(overview(study), "|delay at 20 %|", "dyadic, haptics on").values == pytest.approx([0.2])


def test_column_that_a_function_does_not_measure_is_named() -> None:
    group = Group((number("tilt", "", "rad"), number("turns", "", "1")), lambda take: {"tilt": 0.1})
    with pytest.raises(RuntimeError, match=r"analysis/extraction/attempts\.py: lacks turns; expected .* tilt, turns"):
        group.of(cast("AttemptData", None))


def test_measure_of_an_unknown_column_is_refused() -> None:
    with pytest.raises(RuntimeError, match=r'measure "tilt" in .* no column "peak_tilt"; expected one of a Group in'):
        _of_trials("tilt", "peak_tilt", "performance", "positive")


def test_every_measure_has_a_level_in_every_condition() -> None:
    found = overview(modern_study(modern_blocks()))
    assert Counter(one.measure.name for one in found.parts) == {measure.name: 4 for measure in MEASURES}
    assert all(one.mean.n == 4 and np.isfinite(one.mean.low) for one in found.parts)


@pytest.mark.slow
def test_levels_do_not_depend_on_the_names_of_dyads() -> None:
    names = {f"D0{k}": f"X{9 - k}" for k in range(1, 5)}
    blocks = modern_blocks()
    renamed = [
        Block(
            names[one.dyad],
            one.performer.replace(one.dyad, names[one.dyad]),
            one.configuration,
            one.force,
            one.trials,
            one.movements,
            one.right_by.replace(one.dyad, names[one.dyad]),
        )
        for one in blocks
    ]
    first, second = (table_of(overview(modern_study(some)).results) for some in (blocks, renamed))
    pd.testing.assert_frame_equal(first, second)


@pytest.mark.slow
@pytest.mark.parametrize("of", ["trial", "movement", "attempt"])
def test_study_without_attempts_has_no_levels(of: str) -> None:
    study: StudyData = made_study([Block("D01", "D01", "dyadic", "full", [])])
    assert overview(study).parts == ()
    assert len(rows_of(study, of)) == 0  # type: ignore[arg-type]
    assert all(len(levels(study, measure)) == 0 for measure in measures_of(study))
