"""Power of the declared analysis: virtual studies are decided exactly as the report decides a real one."""

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest
from statsmodels.stats.power import TTestPower

from declared_study import DECLARED, TWO, crossed_study
from netboard.analysis.cohort.decisions import CohortDecision, DeclaredScores, decided, decision_of, declared_powers
from netboard.analysis.cohort.power import levels_of_cohort
from netboard.analysis.cohort.report import Assumptions, parts, sentence
from netboard.analysis.cohort.rows import group_rows
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.topics.declared import DeclaredAnalysis, declared_analysis
from netboard.base.tables.outcomes import Declaration


def decision(study: StudyData, declaration: Declaration) -> CohortDecision:
    return decision_of(levels_of_cohort([group_rows(study, 1)]), study.factors, declaration)


@pytest.mark.parametrize(
    ("declaration", "between"),
    [
        (DECLARED, ()),
        (replace(DECLARED, method="permutation"), ()),
        (replace(DECLARED, contrast="mass: heavy vs light"), ()),
        (DECLARED, ("mass",)),
    ],
)
def test_power_decides_a_study_as_its_report_does(declaration: Declaration, between: tuple[str, ...]) -> None:
    study = crossed_study(declaration, TWO, dyads=8, between=between, seed=3)
    found = declared_analysis(study)
    assert isinstance(found, DeclaredAnalysis)
    mine = decision(study, declaration)
    names = [(one.measure, one.effect) for one in mine.scores]
    effects = [(found.primary, found.contrast)]
    effects += [
        (own, one) for own in (found.primary, *found.secondary) for one in own.effects if one is not found.contrast
    ]
    assert names == [(own.measure.name, one.name) for own, one in effects]
    for place, (_, effect) in enumerate(effects):
        for level, rejects in ((effect.adjusted * (1 + 1e-9), 1.0), (effect.adjusted * (1 - 1e-9), 0.0)):
            one = list(declared_powers(mine, [8], level, 0))[place]
            assert one.power.value == rejects
            assert one.role == ("secondary" if place else "primary")


def test_power_of_the_primary_contrast_equals_the_closed_form_and_secondary_ones_are_below_it() -> None:
    source = np.random.default_rng(5)
    scores = tuple(
        DeclaredScores("peaks", name, "1", "difference", (source.normal(mean, 1.0, (300, 8)),), (1.0,))
        for name, mean in (("first", 1.0), ("second", 2.0), ("third", 0.0))
    )
    first, second, third = declared_powers(CohortDecision("t", scores, (), 0, ""), [8], 0.05, 0)
    exact = TTestPower().power(1.0, 8, 0.05)
    assert first.power.value == pytest.approx(exact, abs=4 * sqrt(exact * (1 - exact) / 300))
    assert second.power.value <= first.power.value
    assert third.power.value <= 0.05
    assert first.false_positives.value == pytest.approx(0.05, abs=4 * sqrt(0.05 * 0.95 / 300))


def test_absent_secondary_tests_count_with_a_p_of_1() -> None:
    p = np.array([[0.01], [0.02]])
    assert decided(p)[:, 0] == pytest.approx([0.01, 0.02])
    assert decided(p, absent=3)[:, 0] == pytest.approx([0.01, 0.08])
    study = crossed_study(DECLARED, TWO)
    mine = decision(study, replace(DECLARED, secondary=("SPARC", "velocity peaks")))
    assert (mine.missing, mine.absent, len(mine.scores)) == (("SPARC",), 3, 6)
    assert mine.text.endswith("t test; 8 secondary tests")


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"primary": ""}, "none: the study declares no primary outcome"),
        ({"primary": "SPARC"}, "not decided: a cohort has no values of the primary outcome SPARC"),
        ({"method": "model"}, "not decided: its method is the model of all trials"),
        ({"contrast": "age: old vs young"}, "not decided: no recording has the factor age"),
    ],
)
def test_declaration_that_a_cohort_cannot_decide_gives_the_reason(changes: dict[str, str], why: str) -> None:
    found = decision(crossed_study(DECLARED, TWO), replace(DECLARED, **changes))  # type: ignore[arg-type]
    assert not found.scores
    assert found.text.startswith(why)


def test_results_name_the_role_of_each_test_and_the_smallest_adjusted_p() -> None:
    mine = decision(crossed_study(DECLARED, TWO, dyads=8), replace(DECLARED, method="permutation"))
    found = list(declared_powers(mine, [4, 8], 0.05, 0))
    assumed = Assumptions("crossed", "0.1.0", "a" * 64, 1, 1, 8, 0.05, [], mine)
    about = dict(parts(found, assumed)[0]["rows"])
    least = "0.125; above 0.05, so the test cannot reject"
    assert about["smallest possible p, primary permutation test, 4 dyads"] == least
    assert about["smallest possible adjusted p, secondary permutation test, 4 dyads"].startswith("1; above 0.05")
    assert about["smallest possible adjusted p, secondary permutation test, 8 dyads"].startswith("0.0625; above 0.05")
    assert {row[0] for row in parts(found, assumed)[1]["rows"]} == {"primary", "secondary"}
    assert ", the primary contrast, at the level 0.05 has a power of" in sentence(found[:1], assumed)
    assert "a secondary test that is adjusted for the primary one" in sentence(found[1:2], assumed)
