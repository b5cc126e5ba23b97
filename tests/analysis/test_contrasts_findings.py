"""Contrasts by hand: each dyad with itself, the dyad as the unit, families of tests."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from made_modern import modern_blocks, modern_study
from made_study import Block, made_study, times
from netboard.analysis.topics.contrasts import ContrastResult, comparisons, picture, questions_of
from netboard.analysis.topics.measures import MEASURES
from netboard.analysis.topics.result import TopicResults, table_of

ON_IN_DYADS = "dyadic, haptics on vs off"
COMPARED = [measure for measure in MEASURES if measure.compared]


def comparison(found: TopicResults[ContrastResult], measure: str, question: str) -> ContrastResult:
    (only,) = [one for one in found.parts if one.measure.name == measure and one.question.name == question]
    return only


def halve_times_with_haptics(row: dict[str, float], configuration: str, force: str, dyad: int) -> None:
    """Haptics halve dyadic completion times and add peaks; each dyad takes a tenth longer than the one before."""
    felt = configuration == "dyadic" and force == "full"
    row["completion"] = 4.0 * 1.1**dyad * (0.5 if felt else 1.0)
    row["peaks"] = (3 + dyad if felt else 3) + (1 if configuration == "dyadic" else 0)


@pytest.fixture(scope="module")
def found() -> TopicResults[ContrastResult]:
    return comparisons(modern_study(modern_blocks(change=halve_times_with_haptics)))


@pytest.mark.slow
def test_study_with_two_forces_and_configurations_has_five_contrasts(found: TopicResults[ContrastResult]) -> None:
    assert [one.name for one in questions_of(modern_study(modern_blocks()))] == [
        "bimanual, haptics on vs off",
        ON_IN_DYADS,
        "dyadic vs bimanual, haptics off",
        "dyadic vs bimanual, haptics on",
        "haptics on vs off, dyadic vs bimanual",
    ]
    assert len(found.parts) == 5 * len(COMPARED)
    assert all(one.contrast.n == 4 and one.contrast.unit == "dyad" for one in found.parts)


@pytest.mark.parametrize(
    ("question", "ratio"),
    [
        ("bimanual, haptics on vs off", 1.0),
        (ON_IN_DYADS, 0.5),
        ("dyadic vs bimanual, haptics off", 1.0),
        ("dyadic vs bimanual, haptics on", 0.5),
        ("haptics on vs off, dyadic vs bimanual", 0.5),
    ],
)
def test_completion_times_are_compared_by_ratio(
    found: TopicResults[ContrastResult], question: str, ratio: float
) -> None:
    one = comparison(found, "completion time", question)
    assert one.difference.value == pytest.approx(ratio)
    assert one.bootstrap.value == pytest.approx(ratio)
    assert one.unit == "1"


def test_statistics_of_differences_0_1_2_and_3_equal_hand_computed_values(found: TopicResults[ContrastResult]) -> None:
    one = comparison(found, "velocity peaks", ON_IN_DYADS)
    assert one.contrast.differences == pytest.approx((0.0, 1.0, 2.0, 3.0))
    assert one.difference.value == pytest.approx(1.5)
    half = 3.182446305284263 * np.sqrt(5.0 / 3.0) / 2.0
    assert (one.difference.low, one.difference.high) == pytest.approx((1.5 - half, 1.5 + half))
    d_z = 1.5 / np.sqrt(5.0 / 3.0)
    assert one.contrast.effect.value == pytest.approx(d_z)
    assert one.hedges.value == pytest.approx(0.7236012545582675 * d_z)
    assert one.contrast.permutation.p == pytest.approx(0.25)
    assert one.contrast.signs.p == pytest.approx(0.25)
    assert (one.contrast.permutation.least_p, one.contrast.signs.least_p) == (0.125, 0.25)


def test_contrasts_are_exploratory_and_not_corrected(found: TopicResults[ContrastResult]) -> None:
    table = table_of(found.results)
    p = table[table["quantity"].str.contains(": p, ") & np.isfinite(table["value"])]
    assert set(p["quantity"].str.partition(": ")[2]) == {"p, sign test", "p, permutation test"}
    assert p["note"].str.startswith("exploratory, not corrected; smallest possible p ").all()


def test_permutation_p_is_noted_with_its_assumption_and_the_skewness(found: TopicResults[ContrastResult]) -> None:
    table = table_of(found.results)
    p = table[table["quantity"].str.endswith("p, permutation test")]
    assert len(p)
    assert p["note"].str.contains("assumes that the differences are distributed symmetrically about 0").all()
    one = next(one for one in found.parts if one.contrast.n >= 4 and np.isfinite(one.contrast.effect.value))
    skewness = f"the skewness of these differences is {stats.skew(one.contrast.differences):z.1f}"
    own = p[(p["quantity"] == f"{one.measure.name}: p, permutation test") & (p["group"] == one.question.name)]
    assert own["note"].str.endswith(skewness).all()
    others = table[table["quantity"].str.endswith("p, sign test")]
    assert not others["note"].str.contains("symmetric").any()


def test_random_sample_of_sign_flips_is_not_called_exact() -> None:
    """17 dyads have 131 072 sign flips, of which 9999 are drawn: with the observed one, no p is below 1 / 10 000."""
    blocks = [
        Block(f"D{k:02d}", f"D{k:02d}", "dyadic", force, times(9.0 + 0.01 * k if force == "none" else 3.0))
        for k in range(1, 18)
        for force in ("none", "full")
    ]
    study = made_study(blocks)
    one = comparison(comparisons(study), "completion time", ON_IN_DYADS)
    assert one.contrast.permutation.p == one.contrast.permutation.least_p == pytest.approx(0.0001)
    table = table_of(comparisons(study).results).set_index("quantity")
    noted = table.loc["completion time: p, permutation test", "note"]
    assert noted.startswith(
        "exploratory, not corrected; smallest possible p 0.0001 with this number of random sign flips"
    )
    caption = picture(study).caption
    assert "permutation tests by random sign flips, exploratory and not corrected" in caption
    assert "The smallest possible p of one test is 0.0001" in caption
    assert "exact" not in caption


@pytest.mark.slow
def test_missing_block_of_one_participant_makes_no_effect() -> None:
    """A takes 3 s and B 9 s in both conditions; B of two dyads has no trials with haptics."""
    blocks = [
        Block(f"D{k}", f"D{k}{who}", "bimanual", force, times(3.0 if who == "A" else 9.0))
        for k in range(1, 7)
        for who in "AB"
        for force in ("none", "full")
        if (who, force) != ("B", "full") or k > 2
    ]
    one = comparison(comparisons(made_study(blocks)), "completion time", "bimanual, haptics on vs off")
    assert (one.difference.value, one.contrast.n) == (pytest.approx(1.0), 6)


def test_dyads_without_a_condition_are_named() -> None:
    """D3 has no trials with haptics, so its contrast is one of two dyads."""
    blocks = [
        Block(f"D{k}", f"D{k}", "dyadic", force, times(3.0 + k, 4.0))
        for k in range(1, 4)
        for force in ("none", "full")
        if (k, force) != (3, "full")
    ]
    rows = [one for one in comparisons(made_study(blocks)).results if one.quantity.startswith("completion time: ratio")]
    left_out = "left out, because a value is missing in a condition: D3"
    assert {(one.n, left_out in one.note.split("; ")) for one in rows} == {(2, True)}


@pytest.mark.sampled(2, of="contrasts")
def test_confidence_intervals_cover_zero_without_an_effect() -> None:
    """About 5 % of the 95 % intervals miss it; bootstrap intervals of ten dyads are slightly too narrow."""
    found = comparisons(modern_study(modern_blocks(seed=5, dyads=10, trials=4)))
    covered = []
    for one in found.parts:
        none = 1.0 if one.measure.ratio else 0.0
        covered.append(
            [one.difference.low <= none <= one.difference.high, one.bootstrap.low <= none <= one.bootstrap.high]
        )
    share = np.mean([pair for one, pair in zip(found.parts, covered, strict=True) if "falls" not in one.what], axis=0)
    assert share[0] >= 0.88
    assert share[1] >= 0.8


@pytest.mark.slow
@pytest.mark.sampled(2, of="contrasts")
def test_contrasts_do_not_depend_on_the_names_of_dyads() -> None:
    study = modern_study(modern_blocks(change=halve_times_with_haptics))
    names = {f"D0{k}": f"X{9 - k}" for k in range(1, 5)}
    tables = {name: getattr(study, name).replace({"dyad": names}) for name in ("blocks", "trials", "movements")}
    first, second = (
        table_of(comparisons(one).results).pipe(lambda table: table[~table["quantity"].str.contains("bootstrap")])
        for one in (study, replace(study, **tables))
    )
    pd.testing.assert_frame_equal(first, second)


@pytest.mark.slow
@pytest.mark.sampled(2, of="contrasts")
def test_swapping_conditions_changes_the_sign_of_differences() -> None:
    forces = {"full": "none", "none": "full"}
    blocks = modern_blocks(seed=2)
    exchanged = [replace(one, force=forces[one.force]) for one in blocks]
    one, other = (
        comparison(comparisons(modern_study(some)), "LDLJ", ON_IN_DYADS).contrast for some in (blocks, exchanged)
    )
    np.testing.assert_allclose(one.differences, [-difference for difference in other.differences])
    assert one.permutation.p == other.permutation.p


def test_single_dyad_has_differences_and_no_intervals() -> None:
    study = made_study([Block("D01", "D01", "dyadic", force, times(3.0, 4.0)) for force in ("full", "none")])
    results = table_of(comparisons(study).results)
    differences = results[results["quantity"] == "completion time: ratio"]
    assert differences["value"].tolist() == pytest.approx([1.0])
    assert differences["low"].isna().all()
    missing = results[results["value"].isna()]
    assert (missing["note"] != "").all()


def test_robot_partners_and_unpaired_conditions_are_not_compared() -> None:
    robot = [Block("D01", "D01", "dyadic", force, times(3.0), right_by="robot") for force in ("full", "none")]
    assert comparisons(made_study(robot)).parts == ()
    alone = [Block("D01", "D01A", "bimanual", "full", times(3.0)), Block("D02", "D02", "dyadic", "full", times(3.0))]
    study = made_study(alone)
    assert [one.kind for one in questions_of(study)] == ["configuration"]
    assert comparisons(study).parts == ()


def test_every_force_condition_is_compared_with_no_force() -> None:
    study = modern_study(modern_blocks(trials=2, forces=("full", "partner_only", "none", "unrelated")))
    kinds = [one.kind for one in questions_of(study)]
    assert (kinds.count("forces"), kinds.count("configuration"), kinds.count("interaction")) == (6, 4, 3)
