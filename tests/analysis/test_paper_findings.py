"""Comparison of a study with the paper: the paper's values, the study's, and the results."""

from math import isnan

import numpy as np
import pandas as pd
import pytest

from made_study import SMALL, Block, made_study, random_blocks, times
from netboard.analysis.topics.everything import PAPER, results_of
from netboard.analysis.topics.paper import COMPARISON, REPORTED, Kind, Reported, compare
from netboard.analysis.topics.result import RESULTS

FORCES = ["full", "partner_only", "environment_only", "none", "unrelated"]


@pytest.fixture(scope="module")
def compared() -> pd.DataFrame:
    return compare(made_study(random_blocks(), *SMALL))


def test_every_reported_value_is_compared_with_a_result(compared: pd.DataFrame) -> None:
    assert list(compared) == [field.name for field in COMPARISON]
    assert len(compared) == len(REPORTED)
    assert not (compared["verdict"] == "not in this study").any()
    assert (compared["n"] > 0).all()
    assert (compared["of"] != "").all()


def test_reported_numbers_are_those_of_the_paper() -> None:
    ends = [(one.reported, one.reported_sd) for one in REPORTED if one.topic == "learning" and one.kind == "number"]
    assert ends == [
        (5.71, 4.48),
        (3.61, 3.08),
        (4.33, 2.92),
        (3.62, 2.23),
        (3.92, 2.42),
        (3.17, 1.85),
        (4.27, 2.91),
        (3.28, 1.95),
    ]
    counts = {(one.figure, one.group): (one.reported, one.reported_of) for one in REPORTED if one.topic == "dyads"}
    assert counts == {
        ("3A", "haptics on"): (4.0, 4),
        ("3A", "haptics off"): (2.0, 4),
        ("3B", "haptics on"): (3.0, 4),
        ("3B", "haptics off"): (1.0, 4),
    }
    assert [one.reported for one in REPORTED if one.topic == "delay" and one.kind == "number"] == [0.04, 0.1]


def test_number_is_compared_in_units_of_the_papers_sd() -> None:
    study = made_study([Block("D01", "D01A", "bimanual", "full", times(1.23, 10.0))], "summaries.ends=1")
    row = compare(study).set_index(["quantity", "group"]).loc[("completion time", "bimanual, first 1")]
    assert row["difference"] == pytest.approx(1.23 - 5.71)
    assert row["difference_sd"] == pytest.approx(-1.0)
    assert row["verdict"] == "-1.00 SD"


def test_direction_verdict_follows_the_difference_and_its_interval() -> None:
    """Times of all dyads fall; a single dyad has no interval."""
    blocks = [Block(f"D0{k}", f"D0{k}", "dyadic", "none", times(5 + 0.01 * k, 3)) for k in (1, 2, 3)]
    place = ("change of completion time", "dyadic, last 1 vs first 1")
    for used, verdict in (
        (blocks, "same direction, interval excludes 0"),
        (blocks[:1], "same direction, no interval"),
        ([Block("D01", "D01", "dyadic", "none", times(3, 5))], "other direction, no interval"),
        ([*blocks[:2], Block("D03", "D03", "dyadic", "none", times(5, 5.5))], "same direction, interval includes 0"),
    ):
        compared = compare(made_study(used, "summaries.ends=1")).set_index(["quantity", "group"])
        assert compared.loc[place, "verdict"] == verdict


@pytest.mark.parametrize(("alone", "direction"), [(3.0, "same direction"), (0.5, "other direction")])
def test_reported_increase_is_compared_in_direction(alone: float, direction: str) -> None:
    """The paper reports more cooperative movement bimanually; the dyad cooperates half of the time."""
    blocks = [
        Block(
            "D01",
            performer,
            configuration,
            "none",
            [{"completion": 2.0, "cooperative": cooperative, "competitive": 0, "single": 0, "still": 1.0}],
        )
        for performer, configuration, cooperative in (("D01A", "bimanual", alone), ("D01", "dyadic", 1.0))
    ]
    compared = compare(made_study(blocks)).set_index(["quantity", "group"])
    assert (
        compared.loc[("share of cooperative movement", "dyadic vs bimanual"), "verdict"] == f"{direction}, no interval"
    )


def test_counts_are_compared_for_equality() -> None:
    def verdicts(better: int) -> dict[str, str]:
        blocks = []
        for k in range(4):
            dyad = f"D{k}"
            blocks += [Block(dyad, f"{dyad}{who}", "bimanual", "full", times(5)) for who in "AB"]
            blocks += [Block(dyad, dyad, "dyadic", "full", times(4 if k < better else 6))]
        compared = compare(made_study(blocks))
        return dict(
            compared[(compared["kind"] == "count") & (compared["group"] == "haptics on")][["figure", "verdict"]].values
        )

    assert verdicts(4) == {"3A": "same count", "3B": "other count"}
    assert verdicts(3) == {"3A": "other count", "3B": "same count"}


def test_counts_out_of_different_totals_are_compared_as_shares() -> None:
    """In 3 of 6 dyads, or 4 of 4: equal counts, or a difference of -1, say nothing."""
    blocks = []
    for k in range(6):
        dyad = f"D{k}"
        blocks += [Block(dyad, f"{dyad}{who}", "bimanual", "full", times(5)) for who in "AB"]
        blocks += [Block(dyad, dyad, "dyadic", "full", times(4 if k < 3 else 6))]
    compared = compare(made_study(blocks))
    counts = compared[(compared["kind"] == "count") & (compared["group"] == "haptics on")].set_index("figure")
    assert counts["verdict"].to_dict() == {"3A": "50 % here, 100 % in the paper", "3B": "50 % here, 75 % in the paper"}
    assert counts["difference"].isna().all()


def test_delays_name_the_likely_search_of_the_paper_unless_it_is_set() -> None:
    for settings, named in (((), True), (("delays.search=inside",), False)):
        compared = compare(made_study(random_blocks(), *SMALL, *settings))
        of_delays = compared["figure"] == "6"
        assert compared.loc[of_delays, "note"].str.contains('"inside"').all() == named
        assert not compared.loc[~of_delays, "note"].str.contains('"inside"').any()


def test_values_missing_from_the_study_are_marked() -> None:
    compared = compare(made_study([Block("D01", "D01", "dyadic", "none", times(1))]))
    assert (compared["verdict"] == "not in this study").sum() > len(compared) / 2
    alone = compared[compared["group"].str.startswith("bimanual")]
    assert (alone["verdict"] == "not in this study").all()
    assert (alone["note"] != "").all()


def test_results_have_unique_names_units_and_n() -> None:
    found = results_of(made_study(random_blocks(), *SMALL), PAPER)
    assert list(found) == [field.name for field in RESULTS]
    assert not found.duplicated(["topic", "quantity", "group"]).any()
    assert (found["unit"] != "").all()
    assert (found["of"] != "").all()
    assert (found["n"] > 0).all()
    assert np.isfinite(found["value"]).all()
    assert set(found["topic"]) == {"learning", "dyads", "classes", "strategy", "delay"}


@pytest.mark.slow
@pytest.mark.parametrize("forces", [["full"], ["none"], ["partner_only", "unrelated"], FORCES])
@pytest.mark.parametrize("trials", [1, 2, 7])
@pytest.mark.sampled(3)
def test_small_studies_have_results_or_notes(forces: list[str], trials: int) -> None:
    found = results_of(made_study(random_blocks(dyads=1, trials=trials, forces=forces)))
    missing = found[found["value"].isna()]
    assert (missing["note"] != "").all()
    assert found.loc[found["of"] == "dyad", "low"].isna().all()


@pytest.mark.slow
def test_mirrored_study_changes_only_the_sign_of_delays() -> None:
    """Swap left and right: the targets, and the signs of the delays."""
    blocks = random_blocks(seed=3)
    mirrored = [
        Block(
            one.dyad,
            one.performer,
            one.configuration,
            one.force,
            [{**row, "target": -1} for row in one.trials],
            [{k: -v if "delay" in k else v for k, v in row.items()} for row in one.movements],
        )
        for one in blocks
    ]
    first, second = (results_of(made_study(some, *SMALL), PAPER) for some in (blocks, mirrored))
    signed = first["quantity"].str.startswith("signed delay")
    assert 0 < signed.sum() < len(first)
    pd.testing.assert_frame_equal(first[~signed], second[~signed])
    np.testing.assert_allclose(second.loc[signed, "value"], -first.loc[signed, "value"])
    np.testing.assert_allclose(second.loc[signed, "low"], -first.loc[signed, "high"])


@pytest.mark.parametrize("kind", ["number", "count", "rises", "falls", "unchanged", "words"])
def test_reported_values_include_every_kind_of_statement(kind: Kind) -> None:
    assert any(one.kind == kind for one in REPORTED)


def test_only_numbers_and_counts_have_values() -> None:
    for one in REPORTED:
        assert isinstance(one, Reported)
        assert isnan(one.reported) == (one.kind in ("rises", "falls", "unchanged", "words"))
        assert (one.reported_of > 0) == (one.kind == "count")
        assert isnan(one.reported_sd) or one.reported_sd > 0.0
