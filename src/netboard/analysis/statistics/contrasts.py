"""Two conditions compared, dyad by dyad: everything that can be said of one difference, and of a family of them.

Each dyad has one value in each condition, the mean of what it did there; what is compared are the differences of a dyad
with itself. The intervals and tests are those of `netboard.analysis.statistics.estimates` and its neighbours.
"""

from dataclasses import dataclass
from math import nan

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from netboard.analysis.statistics.effect_sizes import paired_effect
from netboard.analysis.statistics.estimates import ROUNDING, Estimate, cluster_mean, t_interval
from netboard.analysis.statistics.exact_tests import Test, permutation_test, sign_test

TOO_SHORT = 16
"""Bootstrap intervals of so few units, or fewer, contain the truth clearly less often than they say [1]."""


@dataclass(frozen=True, slots=True)
class Contrast:
    """One measure in two conditions.

    Attributes
    ----------
    name : str
        What is compared.
    n : int
        Units that have both conditions [1].
    unit : str
        What they are.
    labels : tuple
        The units, in order.
    first, second : tuple of float
        Their values in the two conditions [the measure's own].
    differences : tuple of float
        First less second [the measure's own].
    left_out : tuple
        Units that have one of the conditions only, or neither.
    means : tuple of Estimate
        Of the first and of the second condition, with t intervals. Whether these overlap says little of the difference.
    difference : Estimate
        The mean difference, with its t interval.
    bootstrap : Estimate
        The same, with the interval of the cluster bootstrap.
    t, signs, permutation : Test
        Student's paired test, the exact sign test and the exact permutation test of no difference.
    effect : Estimate
        d_z, with its interval.
    notes : tuple of str
        What so few units do to these numbers.
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
    """Compare a measure between two conditions, within units.

    Parameters
    ----------
    values : array_like, shape (n,)
        The measure, of trials, of people or of units; NaN are left out [any].
    units : array_like, shape (n,)
        Whose value it is: labels of any kind. A unit's value in a condition is the mean of its values there.
    first : array_like of bool, shape (n,)
        It is of the first condition; otherwise of the second.
    rng : numpy.random.Generator
        Source of chance for the bootstrap, and for permutations of more than 16 units.
    name : str
        What is compared.
    unit : str
        What a unit is.
    level : float
        Confidence [1].
    resamples : int
        How many sets of units, and how many permutations where not all can be, are drawn [1].

    Returns
    -------
    Contrast
        Without intervals for fewer than two units.

    Raises
    ------
    ValueError
        If there is not one label and one condition for each value.
    """
    labels, pairs = _pairs(values, units, first)
    both = np.isfinite(pairs).all(axis=1)
    before, after = pairs[both].T
    gaps = before - after
    return Contrast(
        name,
        len(gaps),
        unit,
        tuple(labels[both].tolist()),
        tuple(before.tolist()),
        tuple(after.tolist()),
        tuple(gaps.tolist()),
        tuple(labels[~both].tolist()),
        (t_interval(before, level=level, unit=unit), t_interval(after, level=level, unit=unit)),
        t_interval(gaps, level=level, unit=unit),
        cluster_mean([[gap] for gap in gaps], rng, level=level, resamples=resamples, unit=unit),
        paired_t_test(gaps, unit=unit),
        sign_test(gaps, unit=unit),
        permutation_test(gaps, rng=rng, resamples=resamples, unit=unit),
        paired_effect(gaps, level=level, unit=unit),
        _notes(gaps, unit),
    )


def paired_t_test(differences: ArrayLike, *, unit: str = "dyad") -> Test:
    """Test whether paired differences are zero on average, if they are normal: Student's test, two-sided.

    Parameters
    ----------
    differences : array_like, shape (n,)
        One for each unit; NaN are left out [any].
    unit : str
        What the differences are of.

    Returns
    -------
    Test
        The statistic is t; without p for fewer than two units, or differences that do not vary but for rounding.
    """
    x = np.asarray(differences, dtype=float)
    x = x[np.isfinite(x)]
    if len(x) < 2 or _equal(x):
        return Test(nan, nan, nan, len(x), unit, False, "paired t")
    t = float(x.mean() / stats.sem(x))
    return Test(t, float(2.0 * stats.t.sf(abs(t), len(x) - 1)), 0.0, len(x), unit, False, "paired t")


def holm(p: ArrayLike) -> NDArray[np.float64]:
    """Correct the p values of a family of tests, so that one false finding in the family is as rare as in one test.

    Holm, Scand. J. Statist. 6:65, 1979: the smallest is multiplied by the number of tests, the next by one less, and
    none gets smaller than those before it. It holds however the tests depend on each other.

    Parameters
    ----------
    p : array_like, shape (n,)
        One for each test; NaN, a test without a result, is none of the family [1].

    Returns
    -------
    ndarray of float64, shape (n,)
        Corrected, in the same order [1].

    Raises
    ------
    ValueError
        If a value is no probability.
    """
    given = np.asarray(p, dtype=float)
    if given.ndim != 1 or ((given < 0.0) | (given > 1.0)).any():
        raise ValueError(f"p: probabilities are expected, found {given}")
    corrected = np.full(given.shape, np.nan)
    known = np.flatnonzero(np.isfinite(given))
    by = known[np.argsort(given[known], kind="stable")]
    corrected[by] = np.minimum(1.0, np.maximum.accumulate(given[by] * np.arange(len(by), 0, -1)))
    return corrected


def _pairs(values: ArrayLike, units: ArrayLike, first: ArrayLike) -> tuple[NDArray[np.generic], NDArray[np.float64]]:
    """Return the units, and the mean of each in the first and in the second condition."""
    x, whose, condition = np.asarray(values, dtype=float), np.asarray(units), np.asarray(first)
    if x.ndim != 1 or whose.shape != x.shape or condition.shape != x.shape:
        shapes = f"{whose.shape} and {condition.shape}"
        raise ValueError(f"one unit and one condition for each of {x.shape} values are expected, found {shapes}")
    labels, index = np.unique(whose, return_inverse=True)
    pairs = np.full((len(labels), 2), np.nan)
    for column, own in enumerate((condition.astype(bool), ~condition.astype(bool))):
        kept = own & np.isfinite(x)
        counts = np.bincount(index[kept], minlength=len(labels))
        sums = np.bincount(index[kept], weights=x[kept], minlength=len(labels))
        pairs[counts > 0, column] = sums[counts > 0] / counts[counts > 0]
    return labels, pairs


def _equal(x: NDArray[np.float64]) -> bool:
    """Say whether values differ by no more than rounding."""
    return not np.ptp(x) > ROUNDING * np.abs(x).max()


def _notes(differences: NDArray[np.float64], unit: str) -> tuple[str, ...]:
    """Say what few units do."""
    n = len(differences)
    if n < 2:
        return (f"{'one' if n else 'no'} {unit} with both conditions: no interval and no test of a mean",)
    notes = []
    if n < 6:
        notes.append(f"{n} {unit}s: exact two-sided tests cannot have a p below {2.0 / 2**n:.3g}")
    if n <= TOO_SHORT:
        notes.append(f"{n} {unit}s: the bootstrap's interval is too short")
    if _equal(differences):
        notes.append("all differences are equal: no size of the effect and no t")
    return tuple(notes)
