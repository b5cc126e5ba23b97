"""Paired contrasts of two conditions: estimates, confidence intervals, tests, and correction for families of tests.

Each dyad has one value in each condition, its mean there. The analysis uses the within-dyad differences. Confidence
intervals and tests are those of `netboard.analysis.statistics.estimates` and its neighbours.
"""

from dataclasses import dataclass
from math import nan

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from netboard.analysis.statistics.effect_sizes import paired_effect
from netboard.analysis.statistics.estimates import Estimate, cluster_mean, constant, difference, known, t_interval
from netboard.analysis.statistics.exact_tests import Test, permutation_test, sign_test

TOO_SHORT = 16
"""Number of units up to which bootstrap confidence intervals have clearly less than their nominal coverage [1]."""


@dataclass(frozen=True, slots=True)
class Contrast:
    """Contrast of one measure between two conditions.

    Attributes
    ----------
    name : str
        What differs between the conditions, such as ``haptics``.
    n : int
        Number of units with both conditions [1].
    unit : str
        Name of that unit, such as ``dyad``.
    labels : tuple
        Labels of the units, in order.
    first, second : tuple of float
        Values of the units in the two conditions [unit of the measure].
    differences : tuple of float
        First minus second [unit of the measure].
    left_out : tuple
        Units with only one of the conditions, or neither.
    means : tuple of Estimate
        Means of the first and of the second condition, with t intervals. Overlap of these intervals says little about
        the difference.
    difference : Estimate
        Mean difference, with its t interval.
    bootstrap : Estimate
        Mean difference, with its cluster-bootstrap interval.
    t, signs, permutation : Test
        Student's paired t test, exact sign test and exact permutation test of no difference.
    effect : Estimate
        Effect size d_z, with its confidence interval.
    notes : tuple of str
        Cautions for a small number of units.
    """

    name: str
    n: int
    unit: str
    labels: tuple[object, ...]
    first: tuple[float, ...]
    second: tuple[float, ...]
    differences: tuple[float, ...]
    left_out: tuple[object, ...]
    means: tuple[Estimate, Estimate]
    difference: Estimate
    bootstrap: Estimate
    t: Test
    signs: Test
    permutation: Test
    effect: Estimate
    notes: tuple[str, ...]


def condition_contrast(
    values: ArrayLike,
    units: ArrayLike,
    first: ArrayLike,
    rng: np.random.Generator,
    *,
    name: str,
    unit: str = "dyad",
    level: float = 0.95,
    resamples: int = 9999,
) -> Contrast:
    """Compare a measure between two conditions, within units; no confidence interval for fewer than two units.

    Parameters
    ----------
    values : array_like, shape (n,)
        Values of the measure for trials, participants or units; NaN are ignored [any].
    units : array_like, shape (n,)
        Unit label of each value, of any type. A unit's value in a condition is the mean of its values there.
    first : array_like of bool, shape (n,)
        Whether the value belongs to the first condition; otherwise to the second.
    """
    labels, pairs = _pairs(values, units, first)
    both = np.isfinite(pairs).all(axis=1)
    before, after = pairs[both].T
    gaps = difference(before, after)
    return Contrast(
        name=name,
        n=len(gaps),
        unit=unit,
        labels=tuple(labels[both].tolist()),
        first=tuple(before.tolist()),
        second=tuple(after.tolist()),
        differences=tuple(gaps.tolist()),
        left_out=tuple(labels[~both].tolist()),
        means=(t_interval(before, level=level, unit=unit), t_interval(after, level=level, unit=unit)),
        difference=t_interval(gaps, level=level, unit=unit),
        bootstrap=cluster_mean([[gap] for gap in gaps], rng, level=level, resamples=resamples, unit=unit),
        t=paired_t_test(gaps, unit=unit),
        signs=sign_test(gaps, unit=unit),
        permutation=permutation_test(gaps, rng=rng, resamples=resamples, unit=unit),
        effect=paired_effect(gaps, level=level, unit=unit),
        notes=_notes(gaps, unit),
    )


def paired_t_test(differences: ArrayLike, *, unit: str = "dyad") -> Test:
    """Test whether the mean of paired normal differences is zero: Student's paired t test, two-sided.

    There is no p for fewer than two units, or if the differences vary only by rounding.
    """
    x = known(differences)
    if len(x) < 2 or constant(x):
        return Test(nan, nan, nan, len(x), unit, exact=False, method="paired t")
    t = float(x.mean() / stats.sem(x))
    return Test(t, float(2.0 * stats.t.sf(abs(t), len(x) - 1)), 0.0, len(x), unit, exact=False, method="paired t")


def holm(p: ArrayLike) -> NDArray[np.float64]:
    """Correct the p values of a family of tests for multiple testing (family-wise error rate), in the same order [1].

    Holm, Scand. J. Statist. 6:65, 1979: the smallest p is multiplied by the number of tests m, the next by m - 1, and
    so on; corrected values never decrease in this order. It holds for any dependence between the tests.

    Parameters
    ----------
    p : array_like, shape (n,)
        One p value for each test; NaN, a test without a result, is not part of the family [1].
    """
    given = np.asarray(p, dtype=float)
    if given.ndim != 1 or ((given < 0.0) | (given > 1.0)).any():
        raise ValueError(f"p: probabilities are expected, found {given}")
    corrected = np.full(given.shape, np.nan)
    tested = np.flatnonzero(np.isfinite(given))
    order = tested[np.argsort(given[tested], kind="stable")]
    corrected[order] = np.minimum(1.0, np.maximum.accumulate(given[order] * np.arange(len(order), 0, -1)))
    return corrected


def gatekept(primary: float, secondary: ArrayLike) -> NDArray[np.float64]:
    """Adjust the p values of secondary tests for a gate: the primary test, in the same order [1].

    Serial gatekeeping (Westfall and Krishen, J. Stat. Plan. Inference 99:25, 2001). The primary test has the whole
    level. Each secondary one has the larger of the primary p and of its p by `holm` within the secondary tests: it can
    reject only if the primary one does. The chance of any false rejection is at most the level, for any dependence. Of
    smallest possible p values it gives the smallest possible adjusted ones.

    Parameters
    ----------
    primary : float
        p of the primary test; NaN, a test without a result, leaves the gate closed: all adjusted p are NaN [1].
    secondary : array_like, shape (n,)
        One p value for each secondary test; NaN, a test without a result, is not part of the family [1].
    """
    return np.maximum(primary, holm(secondary))


def _pairs(values: ArrayLike, units: ArrayLike, first: ArrayLike) -> tuple[NDArray[np.generic], NDArray[np.float64]]:
    """Return the units, and the mean of each in the first and in the second condition."""
    x, unit, condition = np.asarray(values, dtype=float), np.asarray(units), np.asarray(first)
    if x.ndim != 1 or unit.shape != x.shape or condition.shape != x.shape:
        shapes = f"{unit.shape} and {condition.shape}"
        raise ValueError(f"one unit and one condition for each of {x.shape} values are expected, found {shapes}")
    labels, index = np.unique(unit, return_inverse=True)
    pairs = np.full((len(labels), 2), np.nan)
    for column, chosen in enumerate((condition.astype(bool), ~condition.astype(bool))):
        kept = chosen & np.isfinite(x)
        counts = np.bincount(index[kept], minlength=len(labels))
        sums = np.bincount(index[kept], weights=x[kept], minlength=len(labels))
        pairs[counts > 0, column] = sums[counts > 0] / counts[counts > 0]
    return labels, pairs


def _notes(differences: NDArray[np.float64], unit: str) -> tuple[str, ...]:
    """Return cautions for a small number of units."""
    n = len(differences)
    if n < 2:
        return (f"{'one' if n else 'no'} {unit} with both conditions: no confidence interval and no test",)
    notes = []
    if n < 6:
        notes.append(f"{n} {unit}s: exact two-sided tests cannot have a p below {2.0 / 2**n:.3g}")
    if n <= TOO_SHORT:
        notes.append(f"{n} {unit}s: the bootstrap confidence interval is too short")
    if constant(differences):
        notes.append("all differences are equal: no effect size and no t test")
    return tuple(notes)
