"""Shares of the classes of movement, computed by hand, and the setting of the average."""

import numpy as np
import pytest

from made_study import Block, made_study, random_blocks
from netboard.analysis.topics.classes import Classes, classes


def moved(*seconds: tuple[float, float, float, float]) -> list[dict[str, float]]:
    names = ("cooperative", "competitive", "single", "still")
    return [{"completion": sum(times), **dict(zip(names, times, strict=True))} for times in seconds]


SHORT, LONG = (1.0, 0.0, 0.0, 0.0), (0.0, 3.0, 0.0, 0.0)
BLOCKS = (
    Block("D01", "D01A", "bimanual", "full", moved(SHORT, LONG)),
    Block("D01", "D01B", "bimanual", "full", moved((0.0, 0.0, 1.0, 1.0))),
    Block("D02", "D02A", "bimanual", "full", moved((0.5, 0.0, 0.0, 1.5))),
)


def values(found: Classes, group: str) -> dict[str, float]:
    return {one.quantity.removeprefix("share of "): one.value for one in found.results if one.group == group}


def test_shares_are_means_of_trials_then_of_performers_then_of_dyads() -> None:
    """D01A: half cooperative, half competitive. D01B: half single, half still. D02A: a quarter cooperative."""
    found = classes(made_study(BLOCKS))
    assert values(found, "bimanual, haptics on") == {
        "cooperative movement": pytest.approx((0.25 + 0.25) / 2),
        "competitive movement": pytest.approx(0.25 / 2),
        "single movement": pytest.approx(0.25 / 2),
        "stillness": pytest.approx((0.25 + 0.75) / 2),
    }
    assert {(one.n, one.of) for one in found.results} == {(2, "dyad")}


def test_long_trials_count_more_where_every_second_does() -> None:
    """D01A then has a quarter of cooperative movement and three quarters of competitive movement."""
    found = values(classes(made_study(BLOCKS, 'summaries.shares="time"')), "bimanual, haptics on")
    assert found["cooperative movement"] == pytest.approx((0.125 + 0.25) / 2)
    assert found["competitive movement"] == pytest.approx(0.375 / 2)


def test_shares_add_up_to_one() -> None:
    for one in classes(made_study(random_blocks())).shares:
        np.testing.assert_allclose(one.performers.sum(axis=1), 1.0)
        assert sum(mean.value for mean in one.means) == pytest.approx(1.0)


def test_differences_are_of_each_dyad_with_itself() -> None:
    blocks = [
        Block("D01", "D01", "dyadic", "none", moved((1.0, 0.0, 0.0, 1.0))),
        Block("D01", "D01", "dyadic", "full", moved((3.0, 0.0, 0.0, 1.0))),
        Block("D02", "D02", "dyadic", "none", moved((0.0, 0.0, 0.0, 1.0))),
        Block("D02", "D02", "dyadic", "full", moved((3.0, 0.0, 0.0, 1.0))),
        Block("D03", "D03", "dyadic", "full", moved((0.0, 0.0, 0.0, 1.0))),
    ]
    found = classes(made_study(blocks))
    (one,) = [
        r
        for r in found.results
        if (r.quantity, r.group) == ("share of cooperative movement", "dyadic, haptics on vs off")
    ]
    assert (one.value, one.n) == (pytest.approx((0.25 + 0.75) / 2), 2)


def test_a_condition_whose_trials_have_no_time_has_no_shares_but_a_reason() -> None:
    found = classes(made_study([*BLOCKS, Block("D01", "D01", "dyadic", "none", moved((0.0, 0.0, 0.0, 0.0)))]))
    nothing = [one for one in found.results if one.group == "dyadic, haptics off"]
    assert len(nothing) == 4
    assert all(np.isnan(one.value) and (one.n, one.note) == (0, "no dyad has it") for one in nothing)
