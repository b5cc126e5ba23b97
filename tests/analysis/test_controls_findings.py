"""Controls of the effects of haptic feedback, computed by hand: parts, intervals, and reasons why there are none."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from made_modern import MOVED, control_rows, modern_blocks, modern_study
from made_study import Block, made_study
from netboard.analysis.extraction.controls import FIELDS
from netboard.analysis.report.controls import controls_section
from netboard.analysis.statistics.estimates import mean_interval, t_interval
from netboard.analysis.topics.controls import NO_ROWS, UNLIKE, ControlledEffect, controls, picture
from netboard.analysis.topics.measures import MEASURES, OF_THE_BALL, Measure
from netboard.analysis.topics.result import table_of
from netboard.analysis.topics.units import POINTS, read_in

OFF = (0.40, 0.42, 0.38, 0.44)
EFFECTS = np.array([0.2, 0.22, 0.24, 0.26])
DEVICE, BARE = "150 N/m, with the device", "150 N/m, no friction"


def shares(row: dict[str, float], configuration: str, force: str, dyad: int) -> None:
    """Forces add 0.2, 0.22, ... to the cooperative share of dyads, and nothing to that of one person."""
    share = OFF[dyad % 4] + (0.2 + 0.02 * dyad if force == "full" and configuration == "dyadic" else 0.0)
    row |= {"cooperative": 2.0 * share, "single": 2.0 * (1.0 - share), "competitive": 0.0, "still": 0.0}


def effect(blocks: list[Block], measure: str = "cooperative share", group: str = "dyadic") -> ControlledEffect:
    found = controls(modern_study(blocks)).parts
    (only,) = [one for one in found if one.measure.name == measure and one.condition.configuration == group]
    return only


def test_effect_falls_into_a_passive_part_and_the_rest_with_each_arm() -> None:
    one = effect(modern_blocks(change=shares))
    expected = mean_interval(EFFECTS, "balance")
    assert [one.effect.value, one.effect.low, one.effect.high] == pytest.approx([0.23, expected.low, expected.high])
    assert one.effect.method == expected.method
    assert [each.arm.name for each in one.passive if each.arm] == list(MOVED)
    for each, moved in zip(one.passive, MOVED.values(), strict=True):
        assert each.predicted.value == pytest.approx(moved)
        expected = t_interval(EFFECTS - moved)
        assert [each.rest.value, each.rest.low] == pytest.approx([expected.value, expected.low])
        assert each.predicted.value + each.rest.value == pytest.approx(each.effect.value)
        assert (each.rest.n, each.rest.unit) == (4, "dyad")


def test_interval_of_all_arms_contains_that_of_each() -> None:
    one = effect(modern_blocks(change=shares))
    whole = one.over_arms("rest")
    assert whole is not None
    assert whole.low == min(each.rest.low for each in one.passive)
    assert whole.high == max(each.rest.high for each in one.passive)
    assert one.range_of("rest") == (pytest.approx(0.23 - 0.12), pytest.approx(0.23 - 0.02))
    assert "all of 6 arms" in whole.method
    assert one.remains


def test_results_name_the_parts_and_their_units() -> None:
    results = table_of(controls(modern_study(modern_blocks(change=shares))).results)
    dyadic = results[results["group"] == "dyadic, haptics on vs off"].set_index("quantity")
    what = "cooperative share: difference"
    assert dyadic.loc[f"{what}, effect", "value"] == pytest.approx(0.23)
    assert dyadic.loc[f"{what}, passive part, {DEVICE}", "value"] == pytest.approx(MOVED[DEVICE])
    assert "no proof of communication" in dyadic.loc[f"{what}, communicative part, {DEVICE}", "note"]
    assert dyadic.loc[f"{what}, environment only, {BARE}", "value"] == pytest.approx(MOVED[BARE])
    assert f"{what}, communicative part, all arms" in dyadic.index
    alone = results[results["group"] == "bimanual, haptics on vs off"]["quantity"]
    assert f"{what}, active part, {DEVICE}" in alone.to_numpy()
    assert not results.duplicated(["quantity", "group"]).any()
    assert read_in("1", f"{what}, passive part, {DEVICE}", "dyadic, haptics on vs off") == POINTS


def test_measures_without_a_control_say_why() -> None:
    results = table_of(controls(modern_study(modern_blocks(change=shares))).results)
    rows = results[results["quantity"] == "completion time: ratio, passive part"]
    assert rows["value"].isna().all()
    assert set(rows["note"]) == {OF_THE_BALL}
    section = controls_section(modern_study(modern_blocks(change=shares)))
    assert section.notes == (OF_THE_BALL,)
    assert ("completion time [ratio]", "note 1") in [(row[0], row[2]) for row in section.comparisons[0].parts.rows]


@pytest.mark.parametrize("measure", [one for one in MEASURES if one.compared], ids=lambda one: one.name)
def test_each_measure_has_a_control_or_a_reason(measure: Measure) -> None:
    columns = pd.DataFrame({field.name: np.full(2, 0.3) for field in FIELDS})
    if measure.uncontrolled:
        with pytest.raises(KeyError):
            measure.values(columns)
    else:
        assert np.isfinite(np.asarray(measure.values(columns), float)).all()


def test_delay_of_a_control_is_weighted_by_its_movements() -> None:
    blocks = modern_blocks(change=shares)
    for block in blocks:
        for place, row in enumerate(block.controls):
            row |= {"movements": 1 + place % 2, "delay_20": 0.1 + 0.03 * (place % 2)}  # type: ignore[operator]
    one = effect(blocks, "|delay at 20 %|")
    assert one.usual[0].predicted.value == pytest.approx(0.0, abs=0.03)
    assert one.usual[0].rest.value == pytest.approx(one.effect.value - one.usual[0].predicted.value)


def test_unknown_device_leaves_the_arms_without_friction() -> None:
    blocks = [
        replace(block, controls=[row for row in block.controls if "device" not in row["arm"]])
        for block in modern_blocks(change=shares)
    ]
    one = effect(blocks)
    assert [each.arm.device for each in one.passive if each.arm] == [False] * 3
    assert "without a device, which is unknown" in picture(modern_study(blocks)).caption
    parts = controls_section(modern_study(blocks)).comparisons[0].details["Parts with the usual arm"]
    assert {row[1] for row in parts.rows} == {"–"}


def test_condition_with_the_force_of_the_environment_is_a_control() -> None:
    """Completion times are 0.5 and 0.8 of those with haptics off: the rest is 0.625."""
    blocks = modern_blocks(forces=("full", "environment_only", "none"))
    factor = {"full": 0.5, "environment_only": 0.8, "none": 1.0}
    blocks = [
        replace(one, trials=[{**row, "completion": 4.0 * factor[one.force]} for row in one.trials]) for one in blocks
    ]
    one = effect(blocks, "completion time")
    (only,) = one.predictions
    assert only.measured
    assert only.name == "environment's force, measured"
    assert [only.effect.value, only.predicted.value, only.rest.value] == pytest.approx([0.5, 0.8, 0.625])
    assert one.why == OF_THE_BALL
    assert {each.condition.force for each in controls(modern_study(blocks)).parts} == {"full"}


def test_still_partner_is_a_control() -> None:
    times = {("", "full"): 2.0, ("", "none"): 4.0, ("still", "full"): 3.0, ("still", "none"): 4.0}
    blocks = [
        Block(dyad, f"{dyad}{who}", "dyadic", force, [{"completion": times[by, force]}] * 2, right_by=by)
        for dyad in ("D1", "D2", "D3")
        for who, by in (("", ""), ("A", "still"), ("B", "still"))
        for force in ("full", "none")
    ]
    found = [one for one in controls(made_study(blocks)).parts if one.measure.name == "completion time"]
    (only,) = [each for one in found for each in one.predictions]
    assert only.name == "still partner, measured"
    assert [only.effect.value, only.predicted.value, only.rest.value] == pytest.approx([0.5, 0.75, 2 / 3])
    (compared,) = controls_section(made_study(blocks)).comparisons
    assert compared.measured is not None
    assert ["completion time [ratio]", "0.750", "0.667", "3"] in [list(row) for row in compared.measured.rows]
    assert compared.details == {}


def test_other_forces_and_missing_rows_are_reasons() -> None:
    partial = effect(modern_blocks(forces=("partner_only", "none")))
    assert "for haptics on only, not for partner's force" in partial.why
    assert not partial.passive
    delayed = modern_study(modern_blocks(change=shares))
    delayed.blocks["force_delay"] = 0.05 * (delayed.blocks["force"] != "none")
    assert {one.why for one in controls(delayed).parts} == {OF_THE_BALL, UNLIKE}
    none = effect([replace(one, controls=()) for one in modern_blocks(change=shares)])
    assert none.why == NO_ROWS
    assert "No controls" in picture(modern_study([replace(one, controls=()) for one in modern_blocks()])).caption


def test_no_control_without_both_conditions() -> None:
    one_force = [Block("D01", "D01", "dyadic", "full", [{"completion": 3.0}])]
    assert controls(made_study(one_force)).parts == ()
    assert controls_section(made_study(one_force)).comparisons == ()


def test_one_dyad_has_parts_without_intervals() -> None:
    one = effect(modern_blocks(dyads=1, change=shares))
    assert one.usual[0].rest.value == pytest.approx(0.2 - MOVED[DEVICE])
    assert np.isnan(one.usual[0].rest.low)
    assert not one.remains
    assert len(control_rows([])) == 0
