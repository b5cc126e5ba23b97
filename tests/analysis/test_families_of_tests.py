"""Families of tests: every test of a report is counted, with the smallest possible p and the correction."""

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.multitest import multipletests

from made_modern import modern_blocks, modern_study
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.report.numbers import families_grid
from netboard.analysis.topics.contrasts import comparisons
from netboard.analysis.topics.models import fits
from netboard.analysis.topics.result import table_of
from netboard.analysis.topics.testing import HOLM, UNCORRECTED, FamilyOfTests, families


@pytest.fixture(scope="module")
def study() -> StudyData:
    return modern_study(modern_blocks(dyads=4, trials=5))


@pytest.fixture(scope="module")
def found(study: StudyData) -> dict[str, FamilyOfTests]:
    return {one.name: one for one in families(study).parts}


def test_contrasts_of_a_family_of_measures_are_corrected_together(
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
        assert family.p == pytest.approx(multipletests(tested, method="holm")[1])
        assert (family.correction, family.least_p, family.dyads) == (HOLM, 0.125, (4, 4))
        assert family.corrected_least_p == min(1.0, 0.125 * len(tested))


def test_other_tests_are_exploratory(study: StudyData, found: dict[str, FamilyOfTests]) -> None:
    others = {name: one for name, one in found.items() if "permutation" not in name}
    assert {one.correction for one in others.values()} == {UNCORRECTED}
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
    assert rows["contrasts, measures of forces: permutation tests"] == (f"{tests}", "0.125", "1", HOLM, "0")
    assert rows["model of completion time: terms"][1:4] == ("–", "–", UNCORRECTED)
    assert not families_grid(table_of([])).rows
