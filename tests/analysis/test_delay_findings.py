"""Delays, computed by hand: units of intervals, signs, and the common peak."""

import numpy as np
import pytest

from made_study import Block, made_study, random_blocks, times
from netboard.analysis.topics.delay import APART, RISE, ConditionDelay, delay
from netboard.analysis.topics.result import Result, TopicResults


def moves(*delays: float, own: float = 0.0, rise: float = 0.0, **columns: float) -> list[dict[str, float]]:
    return [
        {
            **{f"delay_{q}": value + k * rise for k, q in enumerate((10, 20, 30, 40))},
            **{f"own_delay_{q}": own for q in (10, 20, 30, 40)},
            **columns,
        }
        for value in delays
    ]


def block(dyad: str, performer: str, movements: list[dict[str, float]], force: str = "full") -> Block:
    configuration = "dyadic" if dyad == performer else "bimanual"
    return Block(dyad, performer, configuration, force, times(1.0), movements)


BLOCKS = (
    block("D01", "D01A", moves(0.1, -0.1, -0.1, own=-0.04)),
    block("D01", "D01B", moves(0.3, own=0.04)),
    block("D02", "D02A", moves(0.4, own=0.04)),
)


def result(found: TopicResults[ConditionDelay], quantity: str, group: str = "bimanual, haptics on") -> Result:
    (only,) = [one for one in found.results if (one.quantity, one.group) == (quantity, group)]
    return only


@pytest.mark.parametrize(
    ("intervals", "units", "of"),
    [
        ("dyads", [0.2, 0.4], "dyad"),
        ("people", [0.1, 0.3, 0.4], "participant"),
        ("movements", [0.1, 0.1, 0.1, 0.3, 0.4], "movement"),
    ],
)
def test_means_and_intervals_use_the_configured_unit(intervals: str, units: list[float], of: str) -> None:
    found = delay(made_study(BLOCKS, f'summaries.intervals="{intervals}"'))
    one = result(found, "delay at 20 %")
    assert (one.n, one.of) == (len(units), of)
    assert one.value == pytest.approx(np.mean(units))
    assert np.isfinite([one.low, one.high]).all()


def test_dyad_counts_as_one_participant() -> None:
    study = made_study(
        [block("D01", "D01", moves(0.1)), block("D02", "D02", moves(0.3))], 'summaries.intervals="people"'
    )
    one = result(delay(study), "delay at 20 %", "dyadic, haptics on")
    assert (one.value, one.n, one.of) == (pytest.approx(0.2), 2, "dyad")


def test_signed_delays_are_always_reported() -> None:
    absolute, signed = (delay(made_study(BLOCKS, f'summaries.delay="{kind}"')) for kind in ("absolute", "signed"))
    of_sign = ((-0.1 / 3 + 0.3) / 2 + 0.4) / 2
    assert result(absolute, "delay at 10 %").value == pytest.approx(0.3)
    assert result(signed, "delay at 10 %").value == pytest.approx(of_sign)
    assert result(absolute, "signed delay at 10 %").value == pytest.approx(of_sign)
    assert result(absolute, "delay at 10 % of own peaks").value == pytest.approx(0.04)
    assert result(signed, "delay at 10 % of own peaks").value == pytest.approx(0.02)


def test_deviation_is_that_of_movements_within_a_performer() -> None:
    one = result(delay(made_study(BLOCKS)), "SD of the signed delay at 10 %")
    assert one.value == pytest.approx(np.std([0.1, -0.1, -0.1], ddof=1))
    assert one.n == 1


def test_rise_of_delays_with_the_threshold_is_reported() -> None:
    found = delay(made_study([block("D01", "D01", moves(0.1, rise=0.01)), block("D02", "D02", moves(0.3, rise=0.03))]))
    assert result(found, RISE, "dyadic, haptics on").value == pytest.approx((0.03 + 0.09) / 2)
    overall = result(found, "delay, mean of 10 to 40 %", "dyadic, haptics on")
    assert overall.value == pytest.approx((0.115 + 0.345) / 2)


def test_delays_use_only_cooperative_movements_of_counted_trials() -> None:
    movements = [*moves(0.1), *moves(9.0, cooperative=0), *moves(9.0, trial=2)]
    trials = [{"completion": 1.0}, {"outcome": "fell"}]
    found = delay(made_study([Block("D01", "D01", "dyadic", "full", trials, movements)]))
    assert found.parts[0].movements == 1
    assert result(found, "delay at 10 %", "dyadic, haptics on").value == pytest.approx(0.1)


def test_truncated_searches_are_counted() -> None:
    movements = [*moves(0.1, truncated_10=1), *moves(0.1), *moves(0.1), *moves(0.1)]
    found = delay(made_study([block("D01", "D01", movements)]))
    one = result(found, "share of searches cut off at 10 %", "dyadic, haptics on")
    assert (one.value, one.n, one.of) == (0.25, 4, "movement")
    assert result(found, "share of searches cut off at 20 %", "dyadic, haptics on").value == 0.0


@pytest.mark.parametrize(("felt", "apart"), [(0.1, 4.0), (0.295, 0.0), (0.5, 4.0)])
def test_thresholds_with_non_overlapping_intervals_are_counted(felt: float, apart: float) -> None:
    blocks = [
        block(f"D{k:02}", f"D{k:02}", moves(value + 0.01 * k), force)
        for k in range(3)
        for force, value in (("none", 0.3), ("full", felt))
    ]
    found = delay(made_study(blocks))
    one = result(found, APART, "dyadic, haptics on vs off")
    assert (one.value, one.n, one.of) == (apart, 4, "threshold")
    difference = result(found, "delay, mean of 10 to 40 %", "dyadic, haptics on vs off")
    assert difference.value == pytest.approx(felt - 0.3)


def test_condition_without_cooperative_movements_reports_why_it_has_no_delay() -> None:
    found = delay(made_study([block("D01", "D01", [])]))
    one = result(found, "delay at 10 %", "dyadic, haptics on")
    assert np.isnan(one.value)
    assert (one.n, one.note) == (0, "absolute; no dyad has a value")


def test_study_without_successes_has_no_delays() -> None:
    found = delay(made_study([Block("D01", "D01", "dyadic", "full", [{"outcome": "fell"}])]))
    assert all(np.isnan(one.value) and one.n == 0 for one in found.results)


def test_differences_are_within_dyads_for_every_unit_of_intervals() -> None:
    for unit in ("dyads", "people", "movements"):
        found = delay(made_study(random_blocks(), f'summaries.intervals="{unit}"'))
        one = result(found, "delay, mean of 10 to 40 %", "dyadic vs bimanual")
        assert (one.n, one.of) == (3, "dyad")
