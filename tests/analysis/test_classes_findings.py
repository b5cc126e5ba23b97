"""Shares of the classes of movement, computed by hand, and the setting of the average."""

import numpy as np
import pytest

from made_study import Block, made_study, random_blocks
from netboard.analysis.topics.classes import Shares, classes
from netboard.analysis.topics.result import TopicResults


def rows_of_seconds(*seconds: tuple[float, float, float, float]) -> list[dict[str, float]]:
    names = ("cooperative", "competitive", "single", "still")
    return [{"completion": sum(times), **dict(zip(names, times, strict=True))} for times in seconds]


SHORT, LONG = (1.0, 0.0, 0.0, 0.0), (0.0, 3.0, 0.0, 0.0)
BLOCKS = (
    Block("D01", "D01A", "bimanual", "full", rows_of_seconds(SHORT, LONG)),
    Block("D01", "D01B", "bimanual", "full", rows_of_seconds((0.0, 0.0, 1.0, 1.0))),
    Block("D02", "D02A", "bimanual", "full", rows_of_seconds((0.5, 0.0, 0.0, 1.5))),
)


def values(found: TopicResults[Shares], group: str) -> dict[str, float]:
    return {one.quantity.removeprefix("share of "): one.value for one in found.results if one.group == group}


def test_shares_are_averaged_over_trials_then_performers_then_dyads() -> None:
    """D01A: half cooperative, half competitive. D01B: half single, half still. D02A: a quarter cooperative."""
    found = classes(made_study(BLOCKS))
    assert values(found, "bimanual, haptics on") == {
        "cooperative movement": pytest.approx((0.25 + 0.25) / 2),
        "competitive movement": pytest.approx(0.25 / 2),
        "single movement": pytest.approx(0.25 / 2),
        "stillness": pytest.approx((0.25 + 0.75) / 2),
    }
    assert {(one.n, one.of) for one in found.results} == {(2, "dyad")}


def test_long_trials_count_more_when_shares_are_weighted_by_time() -> None:
    """D01A then has a quarter of cooperative movement and three quarters of competitive movement."""
    found = values(classes(made_study(BLOCKS, 'summaries.shares="time"')), "bimanual, haptics on")
    assert found["cooperative movement"] == pytest.approx((0.125 + 0.25) / 2)
    assert found["competitive movement"] == pytest.approx(0.375 / 2)


def test_shares_add_up_to_one() -> None:
    for one in classes(made_study(random_blocks())).parts:
        np.testing.assert_allclose(one.performers.sum(axis=1), 1.0)
        assert sum(mean.value for mean in one.means) == pytest.approx(1.0)


def test_differences_are_within_dyads() -> None:
    blocks = [
        Block("D01", "D01", "dyadic", "none", rows_of_seconds((1.0, 0.0, 0.0, 1.0))),
        Block("D01", "D01", "dyadic", "full", rows_of_seconds((3.0, 0.0, 0.0, 1.0))),
        Block("D02", "D02", "dyadic", "none", rows_of_seconds((0.0, 0.0, 0.0, 1.0))),
        Block("D02", "D02", "dyadic", "full", rows_of_seconds((3.0, 0.0, 0.0, 1.0))),
        Block("D03", "D03", "dyadic", "full", rows_of_seconds((0.0, 0.0, 0.0, 1.0))),
    ]
    found = classes(made_study(blocks))
    (one,) = [
        r
        for r in found.results
        if (r.quantity, r.group) == ("share of cooperative movement", "dyadic, haptics on vs off")
    ]
    assert (one.value, one.n) == (pytest.approx((0.25 + 0.75) / 2), 2)


def test_condition_with_trials_of_zero_duration_reports_why_it_has_no_shares() -> None:
    found = classes(made_study([*BLOCKS, Block("D01", "D01", "dyadic", "none", rows_of_seconds((0.0, 0.0, 0.0, 0.0)))]))
    nothing = [one for one in found.results if one.group == "dyadic, haptics off"]
    assert len(nothing) == 4
    assert all(np.isnan(one.value) and (one.n, one.note) == (0, "no dyad has a value") for one in nothing)
