"""Exact sign and permutation tests of differences, with the dyad as the unit of replication.

All arrangements are evaluated if they are at most `MAX_EXACT`: all sign flips of up to 16 units. Of more arrangements
a random sample is evaluated; without a random generator there is then a ValueError. `least_p` is the smallest p that a
test could give with this number of units, or of random arrangements.
"""

from dataclasses import dataclass
from math import comb, inf
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from netboard.analysis.statistics.estimates import ROUNDING, Estimate, known, mean

Alternative = Literal["two-sided", "greater", "less"]

MAX_EXACT = 100_000
"""Largest number of arrangements that are all evaluated [1]."""


SEED = 20_220_302
"""Seed of random arrangements where p value and confidence interval must agree [1]."""

_HALVINGS = 50

SYMMETRIC = (
    "assumes that the differences are distributed symmetrically about 0 if there is no effect; with a skewed "
    "distribution (log-normal), the test of 8 dyads has 15 % false positives at a level of 5 %"
)
"""Caution for the p value of a sign-flip test; docs/explanation/analysis-calibration.md has the simulation."""


@dataclass(frozen=True, slots=True)
class Test:
    """Test of the null hypothesis of no difference.

    Attributes
    ----------
    statistic : float
        Test statistic; NaN without data [its own].
    p : float
        p value: probability of a statistic at least as extreme under the null hypothesis; NaN without data [1].
    least_p : float
        Smallest p value that this number of units can give, or, for a random sample, this number of arrangements [1].
    n : int
        Number of units in the test [1].
    unit : str
        Name of that unit, such as ``dyad``.
    exact : bool
        Whether all arrangements were evaluated; otherwise a random sample.
    method : str
        Name of the test.
    """

    statistic: float
    p: float
    least_p: float
    n: int
    unit: str
    exact: bool
    method: str


def sign_test(differences: ArrayLike, *, alternative: Alternative = "two-sided", unit: str = "dyad") -> Test:
    """Test whether positive and negative differences are equally frequent: the exact binomial test.

    The statistic is the number of positive differences; zeros are ignored, and it is NaN if all differences are.
    """
    x = known(differences)
    x = x[x != 0.0]
    if not len(x):
        return Test(np.nan, np.nan, np.nan, 0, unit, exact=True, method="sign test")
    n, positive = len(x), int((x > 0.0).sum())
    p = float(stats.binomtest(positive, n, alternative=alternative).pvalue)
    return Test(float(positive), p, _least(2**n, alternative), n, unit, exact=True, method="sign test")


def permutation_test(
    differences: ArrayLike,
    *,
    alternative: Alternative = "two-sided",
    rng: np.random.Generator | None = None,
    resamples: int = 9999,
    unit: str = "dyad",
) -> Test:
    """Test whether the mean, the statistic, of paired differences is zero: Fisher's test by all sign flips.

    There is no p for fewer than two units.

    The test is valid for any distribution that is symmetric about zero under the null hypothesis, and not for skewed
    ones (`SYMMETRIC`).
    """
    x = known(differences)
    if len(x) < 2:
        return Test(mean(x), np.nan, np.nan, len(x), unit, exact=True, method="sign flips")
    p = float(permutation_p(x[None, :], alternative=alternative, rng=rng, resamples=resamples)[0])
    least = least_permutation_p(len(x), alternative=alternative, resamples=resamples)
    return Test(mean(x), p, least, len(x), unit, exact=_enumerated(len(x)), method="sign flips")


def permutation_p(
    differences: NDArray[np.float64],
    *,
    alternative: Alternative = "two-sided",
    rng: np.random.Generator | None = None,
    resamples: int = 9999,
) -> NDArray[np.float64]:
    """Return the p values of `permutation_test` for many samples of equal size at once, shape (k,) [1].

    NaN for samples of fewer than two units. Random arrangements are the same for all samples; the observed arrangement
    counts as one more.

    Parameters
    ----------
    differences : ndarray of float64, shape (k, n)
        One difference for each unit of each sample; NaN are ignored [any].
    """
    n = differences.shape[1]
    exact = _enumerated(n)
    if exact:  # half of the arrangements, because the others are their mirror images
        signs = 1.0 - 2.0 * (np.arange(2 ** max(n - 1, 0))[:, None] >> np.arange(n) & 1)
    elif rng is None:
        raise ValueError(f"{2**n} arrangements are too many to evaluate: give a random generator")
    else:
        signs = rng.choice([-1.0, 1.0], (resamples, n))
    p = np.full(len(differences), np.nan)
    for place, own in enumerate(np.nan_to_num(differences)):  # a difference of 0 is neutral in every arrangement
        sums, slack = signs @ own, ROUNDING * float(np.abs(own).sum())
        every = np.concatenate([sums, -sums]) if exact else sums
        extreme = _as_extreme(every, float(own.sum()), slack, alternative)
        p[place] = extreme.mean() if exact else (extreme.sum() + 1) / (resamples + 1)
    return np.where(np.isfinite(differences).sum(axis=1) < 2, np.nan, p)


def least_permutation_p(n: int, *, alternative: Alternative = "two-sided", resamples: int = 9999) -> float:
    """Return the smallest p that `permutation_test` can have with a number of units [1].

    All sign flips: one of them, and its mirror image for a two-sided test. A random sample: the observed arrangement
    alone.

    Parameters
    ----------
    n : int
        Number of units [1].
    """
    return _least(2**n, alternative) if _enumerated(n) else 1.0 / (resamples + 1)


def _enumerated(n: int) -> bool:
    """Return whether all sign flips of a number of units are evaluated."""
    return bool(2**n <= MAX_EXACT)


def _as_extreme(
    sums: NDArray[np.float64], observed: float, slack: float, alternative: Alternative
) -> NDArray[np.bool_]:
    """Return which sums are as extreme as the observed one, or equal it but for rounding."""
    if alternative == "two-sided":
        return np.abs(sums) >= abs(observed) - slack
    return sums >= observed - slack if alternative == "greater" else sums <= observed + slack


def permutation_interval(
    differences: ArrayLike, *, level: float = 0.95, unit: str = "dyad", resamples: int = 9999
) -> Estimate:
    """Estimate the mean with the confidence interval of all values that `permutation_test` does not reject.

    Lehmann and Romano, Testing Statistical Hypotheses, 2005, 5.12. There is no interval for so few units that the test
    cannot reject at this level.
    """
    x = known(differences)
    if len(x) < 2 or least_permutation_p(len(x), resamples=resamples) > 1.0 - level:
        return Estimate(mean(x), np.nan, np.nan, level, len(x), unit, "sign flips")

    def rejected(value: float) -> bool:
        """Return whether a mean is rejected; random arrangements are the same for all."""
        rng = np.random.default_rng(SEED)
        return bool(permutation_p((x - value)[None, :], rng=rng, resamples=resamples)[0] <= 1.0 - level + ROUNDING)

    far = float(np.ptp(x)) + float(np.abs(x).max()) * ROUNDING
    ends = []
    for direction in (-1.0, 1.0):
        inside, outside = mean(x), mean(x) + direction * far
        for _ in range(_HALVINGS):
            middle = (inside + outside) / 2.0
            inside, outside = (inside, middle) if rejected(middle) else (middle, outside)
        ends.append(inside)
    return Estimate(mean(x), ends[0], ends[1], level, len(x), unit, "sign flips")


def permutation_test_between(
    first: ArrayLike,
    second: ArrayLike,
    *,
    alternative: Alternative = "two-sided",
    rng: np.random.Generator | None = None,
    resamples: int = 9999,
    unit: str = "dyad",
) -> Test:
    """Test whether two groups of different units have equal means, by all divisions of the units into such groups.

    The statistic is the difference of the means, first minus second; no p for fewer than two units in a group.
    """
    x, y = known(first), known(second)
    n = len(x) + len(y)
    if len(x) < 2 or len(y) < 2:
        return Test(mean(x) - mean(y), np.nan, np.nan, n, unit, exact=True, method="divisions")
    divisions = comb(n, len(x))
    exact = divisions <= MAX_EXACT
    if not exact and rng is None:
        raise ValueError(f"{divisions} arrangements are too many to evaluate: give a random generator")
    found = stats.permutation_test(
        (x, y),
        _difference_along,
        permutation_type="independent",
        vectorized=True,
        n_resamples=inf if exact else resamples,
        alternative=alternative,
        rng=rng,
    )
    # Of a random sample scipy doubles the smaller tail, in which the observed arrangement counts as one.
    least = _least(divisions if exact else resamples + 1, alternative)
    return Test(mean(x) - mean(y), float(found.pvalue), least, n, unit, exact=exact, method="divisions")


def _difference_along(x: NDArray[np.float64], y: NDArray[np.float64], axis: int) -> Any:
    return np.mean(x, axis=axis) - np.mean(y, axis=axis)


def _least(arrangements: int, alternative: Alternative) -> float:
    """Return the smallest p value of a symmetric distribution of equally probable arrangements."""
    return min(1.0, (2.0 if alternative == "two-sided" else 1.0) / arrangements)
