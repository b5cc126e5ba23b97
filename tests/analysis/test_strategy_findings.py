"""Variances and ellipses of strategies, computed by hand, with each setting."""

import numpy as np
import pytest

from made_study import Block, made_study, random_blocks
from netboard.analysis.topics.groups import short_last_group
from netboard.analysis.topics.result import TopicResults
from netboard.analysis.topics.strategy import EVERYBODY, TeamStrategy, strategy


def braked(*points: tuple[float, float]) -> list[dict[str, float]]:
    return [{"completion": 3.0, "braking_distance": x, "braking_velocity": v} for x, v in points]


WIDE, NARROW = [(0.1, 0.0), (0.2, 0.2), (0.3, 0.1)], [(0.19, 0.0), (0.2, 0.2), (0.21, 0.1)]
BLOCKS = (
    Block("D01", "D01", "dyadic", "full", braked(*WIDE, *NARROW)),
    Block("D01", "D01", "dyadic", "none", braked(*NARROW, *NARROW)),
    Block("D02", "D02", "dyadic", "none", braked(*WIDE, *WIDE)),
)
GROUP = "summaries.group=3"


def value(found: TopicResults[TeamStrategy], quantity: str, group: str) -> float:
    (only,) = [one for one in found.results if (one.quantity, one.group) == (quantity, group)]
    return only.value


def test_variances_are_within_performer_and_condition() -> None:
    """0.01 m2 for wide trials, 0.0001 m2 for narrow ones; D01 has one of each in its first groups."""
    found = strategy(made_study(BLOCKS, GROUP))
    assert value(found, "variance of distance", "dyadic, trials 1 to 3") == pytest.approx((0.00505 + 0.01) / 2)
    assert value(found, "variance of distance", "dyadic, trials 4 to 6") == pytest.approx((0.0001 + 0.01) / 2)
    assert value(found, "change of variance of distance", "dyadic, last group vs first") == pytest.approx(-0.00495 / 2)
    assert value(found, "variance of velocity", "dyadic, trials 1 to 3") == pytest.approx(0.01)


def test_ellipse_covers_all_participants_trials_of_a_group() -> None:
    (one,) = strategy(made_study(BLOCKS, GROUP)).parts
    assert [ellipse.count for ellipse in one.ellipses] == [9, 9]
    assert one.ellipses[0].centre == pytest.approx([0.2, 0.1])
    assert one.last.tolist() == [3, 6]


def test_generalised_variance_is_the_determinant() -> None:
    found = strategy(made_study(BLOCKS, GROUP, 'summaries.variance="generalised"'))
    (spread,) = found.parts[0].spreads
    assert (spread.quantity, spread.unit) == ("generalised variance", "m4/s2")
    assert spread.dyads.loc["D02"].tolist() == pytest.approx([np.linalg.det(np.cov(np.array(WIDE).T))] * 2)


@pytest.mark.slow
def test_ellipses_have_the_configured_extent_and_scaling() -> None:
    blocks = random_blocks(trials=30)
    areas = {
        (extent, scaling): strategy(
            made_study(blocks, f'summaries.extent="{extent}"', f'summaries.scaling="{scaling}"')
        )
        .parts[0]
        .ellipses[0]
        .area
        for extent in ("middle_90", "twice_p90", "p10_to_p90", "nine_tenths")
        for scaling in ("si", "standardised")
    }
    assert len({round(area, 9) for area in areas.values()}) == 8
    assert areas["p10_to_p90", "si"] < areas["middle_90", "si"] < areas["nine_tenths", "si"]


def test_groups_have_the_configured_size() -> None:
    (small,) = strategy(made_study(BLOCKS, GROUP)).parts
    (large,) = strategy(made_study(BLOCKS, "summaries.group=4")).parts
    assert small.first.tolist() == [1, 4]
    assert large.first.tolist() == [1, 5]
    assert [ellipse.count for ellipse in large.ellipses] == [12, 6]


@pytest.mark.parametrize(("size", "says"), [(3, ""), (4, "The last group has only 2 trials (5 to 6)")])
def test_short_last_group_is_named(size: int, says: str) -> None:
    found = strategy(made_study(BLOCKS, f"summaries.group={size}"))
    notes = [one.note for one in found.results if one.group.endswith("last group vs first")]
    assert all(says in note and ("last group" in note) == bool(says) for note in notes)
    (one,) = found.parts
    assert short_last_group(int(one.first[-1]), int(one.last[-1]), size) == says + "." * bool(says)


def test_group_with_too_few_trials_has_no_variance() -> None:
    (one,) = strategy(made_study(BLOCKS, "summaries.group=4")).parts
    assert np.isnan(one.spreads[0].means[1].value)
    assert one.spreads[0].means[1].n == 0


def test_several_teams_are_also_shown_together() -> None:
    found = strategy(made_study(random_blocks(), GROUP))
    assert [one.team for one in found.parts] == [EVERYBODY, "bimanual", "dyadic"]
    assert found.parts[0].ellipses[0].count == sum(one.ellipses[0].count for one in found.parts[1:])


def test_change_uses_only_series_with_first_and_last_group() -> None:
    """D01A does not change; D01B, with the wider spread, has no last group."""
    blocks = [
        Block("D01", "D01A", "bimanual", "none", braked(*NARROW, *NARROW)),
        Block("D01", "D01B", "bimanual", "none", braked(*WIDE)),
    ]
    found = strategy(made_study(blocks, GROUP))
    assert value(found, "change of variance of distance", "bimanual, last group vs first") == pytest.approx(0.0)


def test_single_group_has_no_change() -> None:
    found = strategy(made_study(BLOCKS, "summaries.group=30"))
    assert np.isnan(value(found, "change of variance of distance", "dyadic, last group vs first"))


def test_trials_without_braking_are_left_out() -> None:
    found = strategy(made_study([Block("D01", "D01", "dyadic", "none", [{"completion": 3.0}])]))
    assert (found.parts, found.results) == ((), ())
