"""The passive partner, computed by hand: an effect, a passive effect, and their ratio."""

import numpy as np
import pytest

from made_modern import modern_blocks, modern_study
from made_study import Block, made_study
from netboard.analysis.statistics.estimates import mean_interval
from netboard.analysis.topics.passive import Control, controls, picture
from netboard.analysis.topics.result import table_of
from netboard.analysis.topics.units import PERCENT, POINTS, read_in

OFF = (0.40, 0.42, 0.38, 0.44)


def shares(row: dict[str, float], configuration: str, force: str, dyad: int) -> None:
    """Forces add 0.2, 0.22, ... to the cooperative share, of which half is mechanics at 150 N/m."""
    effect = 0.2 + 0.02 * dyad
    share = OFF[dyad % 4] + (effect if force == "full" else 0.0)
    row |= {"cooperative": 2.0 * share, "single": 2.0 * (1.0 - share), "competitive": 0.0, "still": 0.0}
    if configuration == "dyadic" and force == "full":
        row |= {"passive_50": effect, "passive_150": effect / 2.0, "passive_300": 0.0}
        row |= {"passive_50_device": effect / 4.0, "passive_150_device": effect / 10.0, "passive_300_device": 0.0}


def control(stiffness: int, dyads: int = 4, device: bool = False) -> Control:
    found = controls(modern_study(modern_blocks(dyads=dyads, change=shares)))
    (only,) = [one for one in found.parts if (one.stiffness, one.with_device) == (stiffness, device)]
    return only


@pytest.mark.parametrize(("stiffness", "share"), [(50, 1.0), (150, 0.5), (300, 0.0)])
def test_passive_share_is_the_ratio_of_passive_effect_to_effect(stiffness: int, share: float) -> None:
    one = control(stiffness)
    assert one.effect == pytest.approx([0.2, 0.22, 0.24, 0.26])
    assert one.mean_effect.value == pytest.approx(0.23)
    assert one.mean_passive.value == pytest.approx(0.23 * share)
    assert one.share.value == pytest.approx(share)
    assert one.share.low <= share + 1e-12
    assert one.share.high >= share - 1e-12
    assert (one.share.n, one.share.unit) == (4, "dyad")


def test_passive_effect_is_reported_with_and_without_the_device() -> None:
    one = control(150, device=True)
    assert one.friction == pytest.approx(0.26)
    assert one.mean_passive.value == pytest.approx(0.023)
    assert one.share.value == pytest.approx(0.1)
    results = table_of(controls(modern_study(modern_blocks(change=shares))).results).set_index("quantity")
    bound = results.loc["passive effect on cooperative share, 150 N/m, no friction"]
    held = results.loc["passive effect on cooperative share, 150 N/m, with the device"]
    assert (bound["value"], held["value"]) == (pytest.approx(0.115), pytest.approx(0.023))
    assert "an upper bound" in bound["note"]
    assert "holds the recorded device, friction 0.26 N" in held["note"]


def test_effect_falls_into_a_passive_and_a_communicative_part() -> None:
    for stiffness, device in ((50, False), (150, False), (150, True)):
        one = control(stiffness, device=device)
        parts = one.mean_passive.value + one.mean_communicative.value
        assert parts == pytest.approx(one.mean_effect.value)
        expected = mean_interval(one.effect - one.passive, "balance")
        assert one.mean_communicative == expected
    results = table_of(controls(modern_study(modern_blocks(change=shares))).results).set_index("quantity")
    rest = results.loc["communicative part of the effect on cooperative share, 150 N/m, with the device"]
    assert rest["value"] == pytest.approx(0.23 - 0.023)
    assert rest["low"] < rest["value"] < rest["high"]
    assert "no proof of communication" in rest["note"]
    caption = picture(modern_study(modern_blocks(change=shares))).caption
    assert "Communicative part" in caption
    assert "haptics on, 150 N/m, with the device: 20.7 points (" in caption


def test_unknown_device_gives_only_the_frictionless_result() -> None:
    def unknown(row: dict[str, float], configuration: str, force: str, dyad: int) -> None:
        shares(row, configuration, force, dyad)
        row |= {f"passive_{k}_device": np.nan for k in (50, 150, 300)} | {"passive_friction": np.nan}

    study = modern_study(modern_blocks(change=unknown))
    assert not any(one.with_device for one in controls(study).parts)
    assert "The friction of the device is unknown." in picture(study).caption


def test_device_without_friction_is_reported_as_a_device() -> None:
    def smooth(row: dict[str, float], configuration: str, force: str, dyad: int) -> None:
        shares(row, configuration, force, dyad)
        row |= {"passive_friction": 0.0}

    found = controls(modern_study(modern_blocks(change=smooth)))
    quantities = table_of(found.results)["quantity"].tolist()
    assert len(quantities) == len(set(quantities))
    assert quantities.count("passive effect on cooperative share, 50 N/m, with the device") == 1
    assert sum(one.with_device for one in found.parts) == 3


def test_passive_share_is_in_percent_and_passive_effect_in_points() -> None:
    group = "dyadic, haptics on vs off"
    assert read_in("1", "passive share of the effect, 50 N/m, no friction", group) == PERCENT
    assert read_in("1", "passive effect on cooperative share, 50 N/m, no friction", group) == POINTS


def test_uncertain_effect_has_no_passive_share() -> None:
    def nothing(row: dict[str, float], configuration: str, force: str, dyad: int) -> None:
        shares(row, configuration, "none", dyad)
        row["cooperative"] += 0.02 * (-1.0) ** dyad * (force == "full")

    found = controls(modern_study(modern_blocks(change=nothing)))
    assert not any(one.has_effect for one in found.parts)
    results = table_of(found.results)
    shown_shares = results[results["quantity"].str.startswith("passive share of the effect")]
    assert shown_shares["value"].isna().all()
    assert shown_shares["note"].str.contains("interval includes 0").all()
    assert results.loc[results["quantity"].str.startswith("passive effect"), "value"].notna().all()


def test_single_dyad_has_no_passive_share() -> None:
    """With one dyad, a chance effect of 0.001 would give a share of a hundred."""
    one = control(150, dyads=1)
    assert one.share.value == pytest.approx(0.5)
    assert np.isnan(one.share.low)
    assert not one.has_effect
    results = table_of(controls(modern_study(modern_blocks(change=shares, dyads=1))).results).set_index("quantity")
    assert np.isnan(results.loc["passive share of the effect, 150 N/m, no friction", "value"])
    assert "or there is none" in results.loc["passive share of the effect, 150 N/m, no friction", "note"]


@pytest.mark.slow
def test_no_control_without_two_people_and_both_conditions() -> None:
    row = {"completion": 3.0, "cooperative": 1.0, "single": 1.0, "competitive": 0.0, "still": 0.0, "passive_50": 0.1}
    alone = [Block("D01", "D01A", "bimanual", force, [row]) for force in ("full", "none")]
    robot = [Block("D01", "D01", "dyadic", force, [row], right_by="robot") for force in ("full", "none")]
    one_force = [Block("D01", "D01", "dyadic", "full", [row])]
    for blocks in (alone, robot, one_force):
        assert controls(made_study(blocks)).parts == ()
        assert controls(made_study(blocks)).results == ()
