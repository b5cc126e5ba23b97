"""Differences between two conditions within dyads, against other libraries and direct computation."""

import gc
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from statsmodels.stats.multitest import multipletests

from netboard.analysis.statistics.contrasts import Contrast, condition_contrast, gatekept, holm, paired_t_test
from netboard.analysis.statistics.effect_sizes import paired_effect
from netboard.analysis.statistics.estimates import cluster_mean, t_interval
from netboard.analysis.statistics.exact_tests import permutation_test, sign_test

# Completion times of four dyads, with and without forces.
WITH = np.array([3.1, 2.8, 4.0, 3.3])
WITHOUT = np.array([3.6, 3.0, 4.9, 3.4])
NAMES = ["D01", "D02", "D03", "D04"]


def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def contrast(first: np.ndarray, second: np.ndarray, names: list[str]) -> Contrast:
    condition = np.repeat([True, False], len(names))
    return condition_contrast(np.r_[first, second], [*names, *names], condition, rng(), name="haptics", resamples=999)


@pytest.mark.evidence("truth", condition_contrast)
def test_contrast_combines_intervals_tests_and_effect_size() -> None:
    found = contrast(WITH, WITHOUT, NAMES)
    gaps = WITH - WITHOUT
    assert (found.name, found.n, found.unit, found.labels, found.left_out) == ("haptics", 4, "dyad", tuple(NAMES), ())
    assert found.differences == pytest.approx(gaps)
    assert found.means == (t_interval(WITH), t_interval(WITHOUT))
    assert found.difference == t_interval(gaps)
    assert found.bootstrap == cluster_mean([[gap] for gap in gaps], rng(), resamples=999)
    assert found.signs == sign_test(gaps)
    assert found.permutation == permutation_test(gaps)
    assert found.effect == paired_effect(gaps)
    other = stats.ttest_rel(WITH, WITHOUT)
    assert (found.t.statistic, found.t.p) == pytest.approx((other.statistic, other.pvalue), rel=1e-12)
    assert any("below 0.125" in note for note in found.notes)


def test_a_difference_of_nothing_but_rounding_is_a_tie() -> None:
    """The mean of 0.1, 0.2 and 0.3 is not 0.2 in binary numbers."""
    values, units = [0.1, 0.2, 0.3, 1.0, 2.0, 0.2, 2.0, 1.0], ["D1", "D1", "D1", "D2", "D3", "D1", "D2", "D3"]
    found = condition_contrast(values, units, [True] * 5 + [False] * 3, rng(), name="haptics", resamples=99)
    assert found.differences == (0.0, -1.0, 1.0)
    assert (found.signs.statistic, found.signs.n) == (1.0, 2)


def test_unit_counts_once_however_many_values_it_has() -> None:
    values = [*np.repeat(WITH, 7), 3.5, 3.7, *WITHOUT[1:]]
    units = [*np.repeat(NAMES, 7), "D01", "D01", *NAMES[1:]]
    found = condition_contrast(values, units, [True] * 28 + [False] * 5, rng(), name="haptics", resamples=999)
    assert found.differences == pytest.approx(contrast(WITH, WITHOUT, NAMES).differences)
    assert found.difference.value == pytest.approx(float((WITH - WITHOUT).mean()))


@pytest.mark.evidence("properties", condition_contrast, of="order")
@given(st.permutations(range(8)))
def test_contrast_does_not_depend_on_the_order_of_rows(by: list[int]) -> None:
    values, units, condition = np.r_[WITH, WITHOUT], np.array([*NAMES, *NAMES]), np.repeat([True, False], 4)
    found = condition_contrast(values[by], units[by], condition[by], rng(), name="haptics", resamples=99)
    assert found == condition_contrast(values, units, condition, rng(), name="haptics", resamples=99)


@pytest.mark.evidence("properties", condition_contrast, of="mirror")
def test_swapping_conditions_reverses_the_differences() -> None:
    one, other = contrast(WITH, WITHOUT, NAMES), contrast(WITHOUT, WITH, NAMES)
    assert other.differences == pytest.approx([-gap for gap in one.differences])
    assert (other.difference.low, other.difference.high) == pytest.approx((-one.difference.high, -one.difference.low))
    assert (one.first, one.second) == (other.second, other.first)
    assert (one.t.p, one.signs.p, one.permutation.p) == (other.t.p, other.signs.p, other.permutation.p)


@pytest.mark.evidence("disturbance", condition_contrast, of="holes")
def test_unit_without_one_of_the_conditions_is_left_out_and_named() -> None:
    found = contrast(WITH, np.array([3.6, np.nan, 4.9, 3.4]), NAMES)
    assert (found.n, found.labels, found.left_out) == (3, ("D01", "D03", "D04"), ("D02",))
    assert found.difference == t_interval((WITH - WITHOUT)[[0, 2, 3]])
    assert found.means[0] == t_interval(WITH[[0, 2, 3]])


@pytest.mark.parametrize("n", [0, 1])
def test_fewer_than_two_units_give_no_test(n: int) -> None:
    found = contrast(WITH[:n], WITHOUT[:n], NAMES[:n])
    assert found.n == n
    ends = [found.difference.low, found.bootstrap.high, found.t.p, found.permutation.p, found.effect.value]
    assert np.isnan(ends).all()
    assert ["no confidence interval" in note for note in found.notes] == [True]


def test_constant_differences_have_no_effect_size() -> None:
    found = contrast(np.arange(6.0), np.arange(6.0) + 2.0, [f"D{i}" for i in range(6)])
    assert (found.bootstrap.low, found.bootstrap.high) == (-2.0, -2.0)
    assert np.isnan([found.t.p, found.effect.value]).all()
    assert found.permutation.p == pytest.approx(2.0 / 64)
    assert any("equal" in note for note in found.notes)


@pytest.mark.parametrize("off", [0.1, -1e7])
def test_differences_that_vary_only_by_rounding_count_as_constant(off: float) -> None:
    gaps = off * (1.0 + np.array([0.0, 1.0, -1.0, 2.0]) * np.finfo(float).eps)
    assert np.ptp(gaps) > 0.0
    assert np.isnan([paired_t_test(gaps).statistic, paired_t_test(gaps).p]).all()
    assert paired_t_test(off * np.array([1.0, 1.0, 1.0 + 1e-9])).p < 1e-6
    found = contrast(gaps, np.zeros(4), NAMES)
    assert np.isnan([found.t.p, found.effect.value]).all()
    assert any("equal" in note for note in found.notes)


def test_contrast_of_many_units_has_no_notes() -> None:
    source = np.random.default_rng(1)
    found = contrast(source.normal(size=24), source.normal(size=24), [f"D{i:02}" for i in range(24)])
    assert found.notes == ()
    assert not found.permutation.exact
    assert found.permutation.p == pytest.approx(found.t.p, abs=0.05)


def test_numbers_of_labels_and_values_must_agree() -> None:
    with pytest.raises(ValueError, match="one unit and one condition for each"):
        condition_contrast([1.0, 2.0], ["D01"], [True, False], rng(), name="haptics")


@pytest.mark.evidence("properties", paired_t_test, of=("mirror", "unit"))
def test_t_test_is_invariant_to_sign_and_unit() -> None:
    found, turned = paired_t_test([1.0, 2.0, 4.0]), paired_t_test([-1e3, -2e3, -4e3])
    assert turned.p == pytest.approx(found.p)
    assert turned.statistic == pytest.approx(-found.statistic)


@pytest.mark.evidence("independent", paired_t_test, by="scipy")
@pytest.mark.evidence("disturbance", paired_t_test, of="holes")
def test_t_test_leaves_out_missing_values() -> None:
    assert paired_t_test([1.0, np.nan, 2.0, 4.0]) == paired_t_test([1.0, 2.0, 4.0])
    assert paired_t_test([1.0, 2.0, 4.0]).p == pytest.approx(stats.ttest_1samp([1.0, 2.0, 4.0], 0.0).pvalue)


@pytest.mark.evidence("independent", holm, by="statsmodels")
@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12))
def test_holm_correction_equals_that_of_statsmodels(p: list[float]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gc, "collect", lambda: 0)  # the other library collects all garbage of this process each time
        theirs = multipletests(p, method="holm")[1]
    assert holm(p) == pytest.approx(theirs, rel=1e-12, abs=1e-300)


@pytest.mark.evidence("truth", holm)
def test_holm_correction_equals_hand_computed_values() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.01, np.nan, 0.03]) == pytest.approx([0.02, np.nan, 0.03], nan_ok=True)
    assert len(holm([])) == 0
    with pytest.raises(ValueError, match="probabilities are expected"):
        holm([0.5, 1.5])


@pytest.mark.evidence("truth", gatekept)
def test_secondary_p_values_are_those_of_holm_and_at_least_the_primary_one() -> None:
    assert gatekept(0.001, [0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert gatekept(0.025, [0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.025])
    assert gatekept(0.2, [0.01, 0.04]) == pytest.approx([0.2, 0.2])
    assert gatekept(0.01, [0.01, np.nan]) == pytest.approx([0.01, np.nan], nan_ok=True)
    assert np.isnan(gatekept(np.nan, [0.01, 0.04])).all()
    assert len(gatekept(0.01, [])) == 0


@pytest.mark.evidence("properties", gatekept, of="order")
@given(st.floats(0.0, 1.0), st.lists(st.floats(0.0, 1.0), min_size=1, max_size=8), st.randoms(use_true_random=False))
def test_adjusted_p_values_follow_the_order_of_the_tests(primary: float, p: list[float], random: Random) -> None:
    places = list(range(len(p)))
    random.shuffle(places)
    shuffled = gatekept(primary, [p[place] for place in places])
    assert shuffled.tolist() == gatekept(primary, p)[places].tolist()


@pytest.mark.evidence("truth", gatekept)
@pytest.mark.parametrize("true", [(), (0,), (1, 2)])
def test_gate_keeps_the_level_for_any_false_rejection(true: tuple[int, ...]) -> None:
    """Four correlated normal tests, of which those in `true` have a large effect: at most 5 % reject another."""
    source = np.random.default_rng(4)
    z = 0.6 * source.normal(size=(4000, 1)) + 0.8 * source.normal(size=(4000, 4))
    z[:, list(true)] += 5.0
    p = 2.0 * stats.norm.sf(np.abs(z))
    null = [k for k in range(4) if k not in true]
    decided = np.array([[one[0], *gatekept(one[0], one[1:])] for one in p])
    assert (decided[:, null] <= 0.05).any(axis=1).mean() <= 0.05 + 3.0 * np.sqrt(0.05 * 0.95 / 4000)
    assert (decided[:, list(true)] <= 0.05).mean(axis=0) == pytest.approx(
        np.full(len(true), 1.0 if 0 in true else 0.05), abs=0.02
    )
