"""Families of tests: every test of a report is counted, with the smallest possible p and the correction."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.multitest import multipletests

from declared_study import DECLARED, TWO, crossed_study
from made_modern import modern_blocks, modern_study
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.report.numbers import families_grid
from netboard.analysis.topics.contrasts import comparisons
from netboard.analysis.topics.declared import DeclaredAnalysis, declared_analysis
from netboard.analysis.topics.models import fits
from netboard.analysis.topics.result import table_of
from netboard.analysis.topics.testing import GATEKEPT, PRIMARY, UNCORRECTED, FamilyOfTests, families


@pytest.fixture(scope="module")
def study() -> StudyData:
    return modern_study(modern_blocks(dyads=4, trials=5))


@pytest.fixture(scope="module")
def found(study: StudyData) -> dict[str, FamilyOfTests]:
    return {one.name: one for one in families(study).parts}


def test_contrasts_are_exploratory_and_counted_by_family_of_measures(
    study: StudyData, found: dict[str, FamilyOfTests]
) -> None:
    parts = comparisons(study).parts
    for measures in ("performance", "coordination", "forces"):
        own = [one for one in parts if one.measure.family == measures]
        p = [
            stats.permutation_test((one.contrast.differences,), np.mean, permutation_type="samples").pvalue
            for one in own
        ]
        tested = [value for value in p if np.isfinite(value)]
        family = found[f"contrasts, measures of {measures}: permutation tests"]
        assert family.p == pytest.approx(tested)
        assert (family.correction, family.least_p, family.dyads) == (UNCORRECTED, 0.125, (4, 4))
        assert family.corrected_least_p == 0.125


def test_primary_contrast_is_one_test_and_the_gate_of_the_secondary_ones() -> None:
    study = crossed_study(replace(DECLARED, method="permutation"), TWO, dyads=7)
    found = {one.name: one for one in families(study).parts}
    declared = declared_analysis(study)
    assert isinstance(declared, DeclaredAnalysis)
    contrast, *others = (*declared.primary.effects[::-1], *(one for own in declared.secondary for one in own.effects))
    primary, secondary = found["primary contrast"], found["secondary tests"]
    assert primary.p == (contrast.counts.tested.p,)
    assert (primary.correction, primary.least_p) == (PRIMARY, 2 / 2**7)
    holm = multipletests([one.counts.tested.p for one in others], method="holm")[1]
    assert sorted(secondary.p) == pytest.approx(sorted(np.maximum(holm, contrast.counts.tested.p)))
    assert (secondary.correction, secondary.least_p) == (GATEKEPT, 2 / 2**7)
    assert secondary.corrected_least_p == pytest.approx(8 * 2 / 2**7)


def test_other_tests_are_exploratory(study: StudyData, found: dict[str, FamilyOfTests]) -> None:
    assert {one.correction for one in found.values()} == {UNCORRECTED}
    others = {name: one for name, one in found.items() if "permutation" not in name}
    signs = others["contrasts, all measures: sign tests"]
    assert len(signs.p) == sum(np.isfinite(one.contrast.signs.p) for one in comparisons(study).parts)
    assert len(others["gains of dyads: sign tests"].p) == 4
    for fit in fits(study).fits[:2]:
        family = others[f"model of {fit.measure}: terms"]
        assert len(family.p) == sum(np.isfinite(one.p) for one in fit.model.effects) - 1
        assert np.isnan(family.least_p)
        assert family.below == sum(p < 0.05 for p in family.p)


def test_table_of_tests_states_number_smallest_p_and_correction(study: StudyData) -> None:
    shown = families_grid(table_of(families(study).results))
    rows = {str(row[0]): row[1:] for row in shown.rows}
    tests = sum(1 for one in comparisons(study).parts if one.measure.family == "forces")
    assert rows["contrasts, measures of forces: permutation tests"] == (f"{tests}", "0.125", "0.125", UNCORRECTED, "0")
    assert rows["model of completion time: terms"][1:4] == ("–", "–", UNCORRECTED)
    assert not families_grid(table_of([])).rows
