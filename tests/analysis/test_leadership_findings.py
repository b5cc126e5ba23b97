"""Leadership, computed by hand: signs, the index, mirrored studies, and exchanged seats."""

import numpy as np
import pytest

from made_modern import modern_blocks, modern_study
from made_study import Block, made_study, times
from netboard.analysis.topics.leadership import QUESTIONS, changed_seats, leaders
from netboard.analysis.topics.measures import Levels
from netboard.analysis.topics.result import TopicResults


def lead_of(found: TopicResults[Levels], question: str, condition: str) -> Levels:
    (only,) = [one for one in found.parts if one.measure.name == question and one.condition.name == condition]
    return only


def moves(*delays: float) -> list[dict[str, float]]:
    return [{"delay_20": 2.0 * delay, "own_delay_20": delay} for delay in delays]


def test_signed_delays_and_leadership_index_equal_hand_computed_values() -> None:
    trials = [{"lag": 0.1, "completion": 3.0}, {"lag": np.nan, "completion": 3.0}]
    block = Block("D01", "D01", "dyadic", "full", trials, moves(0.1, 0.3, 0.2, -0.2))
    found = leaders(made_study([block]))
    assert lead_of(found, "signed delay at 20 %", "dyadic, haptics on").values == pytest.approx([0.2])
    assert lead_of(found, "signed delay at 20 % of each side's own peak", "dyadic, haptics on").values == pytest.approx(
        [0.1]
    )
    assert lead_of(found, "leadership index", "dyadic, haptics on").values == pytest.approx([0.5])
    assert lead_of(found, "signed lag", "dyadic, haptics on").values == pytest.approx([0.1])
    assert lead_of(found, "signed lag", "dyadic, haptics on").rows == 1


def test_bimanual_index_is_the_mean_of_both_participants() -> None:
    study = made_study(
        [
            Block("D01", "D01A", "bimanual", "none", times(3.0), moves(0.1, 0.1, 0.1)),
            Block("D01", "D01B", "bimanual", "none", times(3.0), moves(-0.1)),
        ]
    )
    assert lead_of(leaders(study), "leadership index", "bimanual, haptics off").values == pytest.approx([0.0])


def test_mirrored_study_has_the_opposite_sign() -> None:
    blocks = modern_blocks(seed=4)
    signs = ("delay_10", "delay_20", "delay_30", "delay_40")
    mirrored = [
        Block(
            one.dyad,
            one.performer,
            one.configuration,
            one.force,
            [{**row, "lag": -row["lag"]} for row in one.trials],
            [
                {name: -value if name.removeprefix("own_") in signs else value for name, value in row.items()}
                for row in one.movements
            ],
            one.right_by,
        )
        for one in blocks
    ]
    first, second = leaders(modern_study(blocks)), leaders(modern_study(mirrored))
    assert len(first.parts) == 4 * len(QUESTIONS)
    for one, other in zip(first.parts, second.parts, strict=True):
        np.testing.assert_allclose(one.values, -other.values)
        np.testing.assert_allclose((one.mean.low, one.mean.high), (-other.mean.high, -other.mean.low))


def test_intervals_cover_zero_without_a_leader() -> None:
    found = leaders(modern_study(modern_blocks(seed=6, dyads=8)))
    assert np.mean([one.mean.low <= 0.0 <= one.mean.high for one in found.parts]) >= 0.85


def test_results_note_where_partners_changed_seats() -> None:
    blocks = [
        Block("D01", "D01A", "dyadic", "full", times(3.0), moves(0.1), "D01B"),
        Block("D01", "D01B", "dyadic", "full", times(3.0), moves(0.1), "D01A"),
        Block("D01", "D01A", "bimanual", "full", times(3.0), moves(0.1)),
        Block("D02", "D02A", "dyadic", "full", times(3.0), moves(0.1), "D02B"),
        Block("D02", "D02B", "dyadic", "full", times(3.0), moves(0.1), "robot"),
    ]
    found = leaders(made_study(blocks))
    assert changed_seats(made_study(blocks)) == ("D01",)
    noted = {row.group for row in found.results if "changed seats" in row.note}
    assert noted == {"dyadic, haptics on, D01"}
