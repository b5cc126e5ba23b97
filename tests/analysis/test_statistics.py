"""Intervals, tests and effect sizes, against enumeration, other libraries and published numbers."""

from itertools import combinations, product
from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from statsmodels.stats.descriptivestats import sign_test as other_sign_test
from statsmodels.stats.meta_analysis import effectsize_smd
from statsmodels.stats.weightstats import DescrStatsW

from netboard.analysis.statistics.effect_sizes import hedges_factor, hedges_g, paired_effect
from netboard.analysis.statistics.estimates import bootstrap, cluster_mean, ratio_of_sums, t_interval
from netboard.analysis.statistics.exact_tests import (
    Alternative,
    least_permutation_p,
    permutation_p,
    permutation_test,
    permutation_test_between,
    sign_test,
)

DIFFERENCES = st.lists(st.integers(-20, 20).map(float), min_size=2, max_size=8)


def rng() -> np.random.Generator:
    return np.random.default_rng(5)


# Student's own: extra sleep of ten patients under two drugs (Biometrika 6:1, 1908).
SLEEP = np.array([1.2, 2.4, 1.3, 1.3, 0.0, 1.0, 1.8, 0.8, 4.6, 1.4])


@pytest.mark.evidence("truth", t_interval, paired_effect)
def test_t_interval_of_students_sleep_data() -> None:
    found = t_interval(SLEEP, unit="patient")
    assert found.value == pytest.approx(1.58)
    assert (found.low, found.high) == pytest.approx((0.7001142, 2.4598858), abs=1e-7)
    assert (found.n, found.unit, found.level, found.method) == (10, "patient", 0.95, "t")
    assert paired_effect(SLEEP).value == pytest.approx(1.58 / 1.229995, rel=1e-6)


@pytest.mark.evidence("independent", t_interval, by="statsmodels")
@given(DIFFERENCES, st.floats(0.5, 0.99))
def test_t_intervals_equal_those_of_statsmodels(values: list[float], level: float) -> None:
    found = t_interval(values, level=level)
    assert (found.low, found.high) == pytest.approx(DescrStatsW(values).tconfint_mean(1.0 - level), rel=1e-9, abs=1e-9)


@pytest.mark.evidence("disturbance", t_interval, cluster_mean, of="holes")
def test_fewer_than_two_units_have_no_interval() -> None:
    for found in (t_interval([3.0]), cluster_mean([[3.0, np.nan]], rng()), cluster_mean([[], [3.0]], rng())):
        assert found.value == 3.0
        assert found.n == 1
        assert np.isnan([found.low, found.high]).all()
    assert np.isnan(t_interval([]).value)
    assert np.isnan(cluster_mean([], rng()).value)
    alike = cluster_mean([[2.0, 4.0], [3.0]], rng())
    assert (alike.low, alike.value, alike.high) == (3.0, 3.0, 3.0)


@pytest.mark.evidence("truth", bootstrap)
def test_bootstrap_of_few_units_equals_enumeration_of_draws() -> None:
    means = np.array([0.3, -0.1, 0.9, 0.35])
    draws = np.array([np.mean(draw) for draw in product(means, repeat=4)])
    low, high = np.percentile(draws, [2.5, 97.5])
    found = bootstrap([means], lambda x, axis: x.mean(axis=axis), rng(), method="percentile", resamples=40_000)
    assert (found.low, found.high) == pytest.approx((low, high), abs=0.01)
    assert found.value == pytest.approx(means.mean())
    basic = bootstrap([means], lambda x, axis: x.mean(axis=axis), rng(), method="basic", resamples=40_000)
    assert (basic.low, basic.high) == pytest.approx((2 * means.mean() - high, 2 * means.mean() - low), abs=0.01)


@pytest.mark.evidence("truth", cluster_mean)
def test_bootstrap_draws_clusters_instead_of_trials() -> None:
    source = np.random.default_rng(2)
    dyads = [source.normal(mean, 0.01, count) for mean, count in ((1.0, 50), (2.0, 10), (4.0, 30), (7.0, 10))]
    units, samples = (cluster_mean(dyads, rng(), weighting=weighting) for weighting in ("units", "samples"))
    assert units.value == pytest.approx(3.5, abs=0.01)
    assert samples.value == pytest.approx(np.mean(np.concatenate(dyads)))
    assert samples.n == 4
    alone = [np.mean(dyad) for dyad in dyads]
    assert cluster_mean([[mean] for mean in alone], rng()) == units
    # With trials as units the interval would be far too short.
    assert units.high - units.low > 3.0 * 2 * 1.96 * np.std(np.concatenate(dyads)) / np.sqrt(100)


@pytest.mark.evidence("truth", cluster_mean)
def test_weighted_cluster_mean_equals_enumeration() -> None:
    dyads = [[1.0, 1.2, 0.8], [2.0], [4.0, 3.0], [0.5, 0.6]]
    draws = [np.mean(np.concatenate(draw)) for draw in product(dyads, repeat=4)]
    found = cluster_mean(dyads, rng(), weighting="samples", method="percentile", resamples=40_000)
    assert (found.low, found.high) == pytest.approx(tuple(np.percentile(draws, [2.5, 97.5])), abs=0.02)


def test_same_seed_gives_the_same_result() -> None:
    dyads = [[1.0, 2.0], [2.5], [0.5, 0.1]]
    assert cluster_mean(dyads, rng()) == cluster_mean(dyads, rng())


@pytest.mark.evidence("truth", ratio_of_sums)
def test_ratio_of_sums_and_its_bootstrap() -> None:
    assert ratio_of_sums(np.array([1.0, 2.0]), np.array([2.0, 4.0])) == 0.5
    found = bootstrap([[1.0, 2.0, 1.5], [2.0, 3.0, 4.0]], ratio_of_sums, rng(), method="percentile")
    assert found.value == 0.5
    assert found.low < 0.5 < found.high
    assert np.isnan(bootstrap([[1.0, 2.0], [1.0, -1.0]], ratio_of_sums, rng()).value)
    with pytest.raises(ValueError, match="each unit"):
        bootstrap([[1.0], [1.0, 2.0]], ratio_of_sums, rng())


@pytest.mark.evidence("disturbance", sign_test, of="holes")
@pytest.mark.evidence("truth", sign_test, permutation_test)
def test_least_p_of_four_dyads_is_0_125() -> None:
    all_four = sign_test([0.3, 0.1, 0.5, 0.2])
    assert (all_four.p, all_four.least_p) == (0.125, 0.125)
    assert sign_test([0.3, 0.1, 0.5, 0.2], alternative="greater").p == 0.0625
    flips = permutation_test([0.3, 0.1, 0.5, 0.2])
    assert (flips.p, flips.least_p, flips.exact, flips.n) == (0.125, 0.125, True, 4)
    assert flips.statistic == pytest.approx(0.275)
    with_tie = sign_test([0.3, 0.0, np.nan, -0.2])
    assert (with_tie.n, with_tie.statistic, with_tie.p) == (2, 1.0, 1.0)
    assert np.isnan(sign_test([]).p)
    assert np.isnan([permutation_test([]).p, permutation_test([1.0]).p]).all()
    assert np.isnan(permutation_test_between([1.0], [1.0, 2.0]).p)


@pytest.mark.evidence("independent", sign_test, by="statsmodels")
@given(DIFFERENCES)
def test_sign_tests_equal_those_of_statsmodels(values: list[float]) -> None:
    if any(values):
        assert sign_test(values).p == pytest.approx(other_sign_test(values)[1])


@pytest.mark.evidence("truth", permutation_test)
@given(DIFFERENCES, st.sampled_from(["two-sided", "greater", "less"]))
@settings(deadline=None)
def test_permutation_test_equals_enumeration_of_signs(values: list[float], alternative: str) -> None:
    x = np.array(values)
    sums = np.array(list(product([-1.0, 1.0], repeat=len(x)))) @ x
    above, below = np.mean(sums >= x.sum()), np.mean(sums <= x.sum())
    expected = {"greater": above, "less": below, "two-sided": min(1.0, 2.0 * min(above, below))}[alternative]
    found = permutation_test(values, alternative=alternative)
    assert found.p == pytest.approx(expected)
    assert found.p >= found.least_p - 1e-12


@pytest.mark.slow
@pytest.mark.evidence("independent", permutation_p, by="scipy")
@pytest.mark.evidence("properties", permutation_p, of=("mirror", "unit", "order"))
@pytest.mark.evidence("disturbance", permutation_p, of="holes")
@pytest.mark.parametrize("n", [4, 8, 16])
def test_vectorised_permutation_p_equals_single_tests(n: int) -> None:
    gaps = np.random.default_rng(n).lognormal(size=(6, n)) - 1.6
    expected = [permutation_test(own, rng=np.random.default_rng(0)).p for own in gaps]
    found = permutation_p(gaps)
    assert found == pytest.approx(expected)
    assert permutation_p(-3.0 * gaps[:, ::-1]) == pytest.approx(expected)
    gaps[0, 1] = np.nan
    assert permutation_p(gaps)[0] == pytest.approx(permutation_test(gaps[0]).p)
    assert np.isnan(permutation_p(np.array([[1.0, np.nan]]))).all()


def test_permutation_tests_of_many_units_sample_arrangements() -> None:
    gaps = np.random.default_rng(1).normal(0.4, 1.0, (3, 24))
    expected = [permutation_test(own, rng=np.random.default_rng(0)).p for own in gaps]
    assert permutation_p(gaps, rng=np.random.default_rng(2)) == pytest.approx(expected, abs=0.02)
    with pytest.raises(ValueError, match="give a random generator"):
        permutation_p(gaps)


@pytest.mark.evidence("truth", permutation_test_between)
@given(
    st.lists(st.integers(-9, 9).map(float), min_size=2, max_size=5),
    st.lists(st.integers(-9, 9).map(float), min_size=2, max_size=5),
)
@settings(deadline=None)
def test_permutation_test_between_equals_enumeration_of_divisions(first: list[float], second: list[float]) -> None:
    x, y = np.array(first), np.array(second)
    everything = np.concatenate([x, y])
    sums = np.array([everything[list(chosen)].sum() for chosen in combinations(range(len(everything)), len(x))])
    assert len(sums) == comb(len(everything), len(x))
    # A mean of the chosen rises with their sum.
    above, below = np.mean(sums >= x.sum()), np.mean(sums <= x.sum())
    found = permutation_test_between(first, second)
    assert found.p == pytest.approx(min(1.0, 2.0 * min(above, below)))
    assert permutation_test_between(first, second, alternative="greater").p == pytest.approx(above)
    assert found.least_p - 1e-12 <= found.p
    assert found.statistic == pytest.approx(x.mean() - y.mean())


def test_permutation_test_of_many_units_needs_a_generator() -> None:
    source = np.random.default_rng(4)
    x = source.normal(0.4, 1.0, 40)
    with pytest.raises(ValueError, match="random generator"):
        permutation_test(x)
    found = permutation_test(x, rng=rng(), resamples=20_000)
    assert not found.exact
    assert found.p == pytest.approx(stats.ttest_1samp(x, 0.0).pvalue, abs=0.01)
    between = permutation_test_between(x, source.normal(0.0, 1.0, 40), rng=rng())
    assert not between.exact


def test_least_p_of_a_random_sample_is_that_of_its_arrangements() -> None:
    """Among 199 random arrangements and the observed one, only the observed one may be as extreme."""
    all_positive = np.arange(1.0, 21.0)
    for alternative in ("two-sided", "greater"):
        found = permutation_test(all_positive, alternative=alternative, rng=rng(), resamples=199)
        assert found.p == found.least_p == 1 / 200
    # Of two groups scipy doubles the smaller tail.
    between = permutation_test_between(all_positive, all_positive - 100.0, rng=rng(), resamples=199)
    assert between.p == between.least_p == pytest.approx(2 / 200)


@pytest.mark.evidence("truth", least_permutation_p)
@pytest.mark.parametrize("n", [2, 5, 16, 24])
@pytest.mark.parametrize("alternative", ["two-sided", "greater"])
def test_extreme_differences_have_the_least_p(n: int, alternative: Alternative) -> None:
    x = 10.0 + np.arange(n)
    found = permutation_test(x, alternative=alternative, rng=rng())
    assert found.p == found.least_p == least_permutation_p(n, alternative=alternative)
    assert found.exact == (n <= 16)


def test_extreme_division_reaches_the_least_p() -> None:
    assert permutation_test_between([1.0, 2.0], [3.0, 4.0, 5.0], alternative="less").p == pytest.approx(0.1)
    assert permutation_test_between([1.0, 2.0], [3.0, 4.0, 5.0], alternative="less").least_p == pytest.approx(0.1)
    even = permutation_test_between([1.0, 2.0, 0.0], [3.0, 4.0, 5.0])
    assert even.p == even.least_p == pytest.approx(0.1)


@pytest.mark.evidence("independent", paired_effect, by="scipy")
@pytest.mark.parametrize(("n", "dz"), [(4, 0.8), (8, 1.2), (20, -0.5), (12, 0.0)])
def test_effect_interval_inverts_the_noncentral_t(n: int, dz: float) -> None:
    z = stats.zscore(np.arange(n, dtype=float), ddof=1)
    found = paired_effect(z + dz)
    assert found.value == pytest.approx(dz, abs=1e-12)
    t = dz * np.sqrt(n)
    assert stats.nct.sf(t, n - 1, found.low * np.sqrt(n)) == pytest.approx(0.025, abs=1e-6)
    assert stats.nct.cdf(t, n - 1, found.high * np.sqrt(n)) == pytest.approx(0.025, abs=1e-6)


def test_interval_of_a_huge_effect_stays_proportional_to_it() -> None:
    z = stats.zscore(np.arange(6.0), ddof=1)
    near, far = paired_effect(z + 400.0), paired_effect(z + 1e7)
    assert (far.low / far.value, far.high / far.value) == pytest.approx(
        (near.low / near.value, near.high / near.value), rel=1e-4
    )
    assert paired_effect(z - 1e7).low == pytest.approx(-far.high, rel=1e-6)


def test_effect_interval_excludes_zero_when_the_t_test_does() -> None:
    for values in (SLEEP, SLEEP - 1.0, SLEEP - 0.7001, SLEEP - 0.7002):
        excluded = stats.ttest_1samp(values, 0.0).pvalue < 0.05
        found = paired_effect(values)
        assert (found.low > 0.0 or found.high < 0.0) == excluded


@pytest.mark.evidence("independent", hedges_g, by="statsmodels")
def test_hedges_g_equals_statsmodels_and_the_t_statistic() -> None:
    source = np.random.default_rng(8)
    x, y = source.normal(1.0, 2.0, 9), source.normal(0.0, 2.0, 14)
    found = hedges_g(x, y, unit="participant")
    # The other library has the factor's approximation, 1 - 3 / (4 f - 1).
    theirs, _ = effectsize_smd(x.mean(), x.std(ddof=1), 9, y.mean(), y.std(ddof=1), 14)
    assert found.value == pytest.approx(theirs, rel=1e-3)
    assert (found.n, found.unit) == (23, "participant")
    plain = hedges_g(x, y, correction="none")
    assert plain.value * np.sqrt(9 * 14 / 23) == pytest.approx(stats.ttest_ind(x, y).statistic)
    assert found.value == pytest.approx(plain.value * hedges_factor(21))
    assert (found.low, found.high) == (plain.low, plain.high)


def test_undefined_effects_and_tests_are_nan() -> None:
    """A regression: with two dyads g_z was exactly 0, with an interval from 0 to 0."""
    assert np.isnan(hedges_factor(1))
    for found in (
        paired_effect([1.0, 2.0], correction="hedges"),
        hedges_g([1.0], [2.0, 3.0]),
        paired_effect([1.0], correction="none"),
    ):
        assert np.isnan([found.value, found.low, found.high]).all()
    assert np.isfinite(paired_effect([1.0, 2.0], correction="none").value)
    for test in (sign_test([0.0, 0.0]), sign_test([]), permutation_test([1.0])):
        assert np.isnan([test.p, test.least_p]).all()


@pytest.mark.evidence("truth", hedges_factor)
def test_hedges_factor_equals_the_published_table() -> None:
    # Table of Hedges (1981): c(2) = 0.5642, c(10) = 0.9228, c(20) = 0.9619.
    assert [hedges_factor(free) for free in (2, 10, 20)] == pytest.approx([0.5642, 0.9228, 0.9619], abs=1e-4)
    assert np.isnan(hedges_factor(1))
    assert hedges_factor(100) == pytest.approx(1 - 3 / 399, abs=1e-5)
    # It takes the bias away.
    source = np.random.default_rng(11).normal(0.8, 1.0, (40_000, 5))
    raw = source.mean(axis=1) / source.std(axis=1, ddof=1)
    assert hedges_factor(4) * raw.mean() == pytest.approx(0.8, abs=0.02)


@pytest.mark.evidence("disturbance", paired_effect, of="holes")
def test_effects_without_variance_or_units_are_nan() -> None:
    for found in (paired_effect([1.0]), paired_effect([1.0, 1.0]), hedges_g([1.0], [2.0]), hedges_g([], [1.0, 2.0])):
        assert np.isnan([found.value, found.low, found.high]).all()
    assert paired_effect([1.0, np.nan, 3.0]).n == 2
    with pytest.raises(ValueError, match="shape"):
        t_interval(np.ones((2, 2)))


@pytest.mark.evidence("properties", paired_effect, of="mirror")
@pytest.mark.evidence("properties", sign_test, paired_effect, of="unit")
@given(DIFFERENCES, st.floats(0.1, 100.0))
@settings(deadline=None)
def test_tests_and_effects_are_independent_of_the_unit(values: list[float], scale: float) -> None:
    x = np.array(values)
    assert sign_test(scale * x).p == pytest.approx(sign_test(x).p, nan_ok=True)
    here, there = paired_effect(x), paired_effect(scale * x)
    assert (there.value, there.low, there.high) == pytest.approx(
        (here.value, here.low, here.high), nan_ok=True, rel=1e-6
    )
    mirrored = paired_effect(-x)
    assert (mirrored.low, mirrored.high) == pytest.approx((-here.high, -here.low), nan_ok=True, abs=1e-6)
    assert paired_effect(x, correction="hedges").value == pytest.approx(
        here.value * hedges_factor(len(x) - 1), nan_ok=True
    )
