"""Planned contrasts of groups of dyads: t test, permutation test with its interval, and effect size."""

import numpy as np
import pytest
from scipy import stats

from netboard.analysis.statistics.effect_sizes import contrast_effect, hedges_g, paired_effect
from netboard.analysis.statistics.exact_tests import permutation_interval, permutation_test
from netboard.analysis.statistics.planned import planned_effect, planned_permutation, planned_t

FIRST = np.array([1.2, 2.4, 1.3, 0.7, 1.9, 1.1])
SECOND = np.array([0.4, 1.0, 0.2, 0.9, 0.3])


@pytest.mark.evidence("independent", planned_t, by="scipy")
def test_planned_t_tests_equal_those_of_scipy() -> None:
    one, two = stats.ttest_1samp(FIRST, 0.0), stats.ttest_ind(FIRST, SECOND)
    tests = planned_t([FIRST], [1.0], level=0.9), planned_t([FIRST, SECOND], [1, -1], level=0.9)
    for found, other in zip(tests, (one, two), strict=True):
        low, high = other.confidence_interval(0.9)
        assert (found.statistic, found.free, found.p) == pytest.approx((other.statistic, other.df, other.pvalue))
        assert (found.estimate.low, found.estimate.high) == pytest.approx((low, high))


@pytest.mark.evidence("independent", contrast_effect, planned_effect, by="scipy")
def test_effect_of_a_contrast_has_the_noncentral_t_of_its_test() -> None:
    t = stats.ttest_ind(FIRST, SECOND)
    found = contrast_effect([FIRST, SECOND], [1.0, -1.0], correction="none")
    scale = np.sqrt(1.0 / len(FIRST) + 1.0 / len(SECOND))
    assert found.value == pytest.approx(t.statistic * scale)
    for end, p in ((found.low, 0.975), (found.high, 0.025)):
        assert stats.nct.cdf(t.statistic, t.df, end / scale) == pytest.approx(p, abs=1e-6)
    assert planned_effect([FIRST, SECOND], [1.0, -1.0], level=0.95) == contrast_effect([FIRST, SECOND], [1.0, -1.0])


@pytest.mark.evidence("truth", permutation_interval, planned_permutation)
def test_permutation_interval_has_the_means_that_the_test_does_not_reject() -> None:
    found = permutation_interval(FIRST, level=0.9)
    for end, inside in ((found.low, 1e-6), (found.high, -1e-6)):
        assert permutation_test(FIRST - (end + inside)).p > 0.1
        assert permutation_test(FIRST - (end - inside)).p <= 0.1
    planned = planned_permutation(FIRST, level=0.9)
    assert planned.estimate == found
    assert planned.p == pytest.approx(permutation_test(FIRST).p)


@pytest.mark.evidence("properties", planned_t, planned_effect, contrast_effect, of=("mirror", "order", "unit"))
@pytest.mark.evidence("properties", planned_permutation, permutation_interval, of=("mirror", "order", "unit"))
@pytest.mark.parametrize("unit", [0.25, 8.0])
def test_planned_contrasts_follow_mirror_order_and_unit(unit: float) -> None:
    one = planned_t([FIRST, SECOND], [1, -1], level=0.95)
    other = planned_t([-FIRST[::-1], -SECOND], [1, -1], level=0.95)
    assert (other.estimate.low, other.estimate.high) == pytest.approx((-one.estimate.high, -one.estimate.low))
    scaled = planned_t([unit * FIRST, unit * SECOND], [1, -1], level=0.95)
    assert (scaled.p, scaled.estimate.low) == pytest.approx((one.p, unit * one.estimate.low))
    sizes = [contrast_effect([u * FIRST, u * SECOND], [1, -1]).value for u in (1.0, unit, -unit)]
    assert sizes == pytest.approx([sizes[0], sizes[0], -sizes[0]])
    found, turned = permutation_interval(FIRST, level=0.9), permutation_interval(-unit * FIRST[::-1], level=0.9)
    assert (turned.low, turned.high) == pytest.approx((-unit * found.high, -unit * found.low))
    assert planned_permutation(-unit * FIRST, level=0.9).p == pytest.approx(planned_permutation(FIRST, level=0.9).p)
    assert contrast_effect([FIRST], [1.0]).value == pytest.approx(paired_effect(FIRST, correction="hedges").value)
    assert contrast_effect([FIRST, SECOND], [1, -1]).low == pytest.approx(hedges_g(FIRST, SECOND).low)


@pytest.mark.evidence("disturbance", planned_t, planned_permutation, planned_effect, of="holes")
@pytest.mark.evidence("disturbance", contrast_effect, permutation_interval, of="holes")
def test_planned_contrasts_leave_out_missing_scores() -> None:
    holes = np.append(FIRST, np.nan)
    assert planned_t([holes, SECOND], [1, -1], level=0.95) == planned_t([FIRST, SECOND], [1, -1], level=0.95)
    assert planned_permutation(holes, level=0.9).estimate == planned_permutation(FIRST, level=0.9).estimate
    assert planned_effect([holes], [1.0], level=0.95) == planned_effect([FIRST], [1.0], level=0.95)
    assert contrast_effect([holes, SECOND], [1, -1]) == contrast_effect([FIRST, SECOND], [1, -1])
    assert np.isnan(permutation_interval(FIRST[:4]).low)
