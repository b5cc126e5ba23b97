"""Planned contrasts of means of dyads: an effect of one factor, or the interaction of two, with one test.

Each dyad has one score, a combination of its values in the conditions that it has: for a factor within dyads a
difference, for an interaction a difference of differences. Dyads are in one group, or, with factors between dyads, in
one for each combination of levels. A contrast is a weighted sum of the groups' mean scores. Its t test is that of an
analysis of variance with repeated measures in which each effect has its own error term: F is the square of t.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan, sqrt

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from netboard.analysis.statistics.effect_sizes import contrast_effect
from netboard.analysis.statistics.estimates import Estimate, constant, known
from netboard.analysis.statistics.exact_tests import SEED, least_permutation_p, permutation_interval, permutation_p
from netboard.base.plural import plural

NORMAL = (
    "assumes that the effects of dyads are normal; if they are strongly skewed (log-normal), the test of 4 dyads has "
    "18 % false positives at a level of 5 %, and that of 16 dyads 14 %"
)
"""Caution for the p value of a t test; docs/explanation/analysis-calibration.md has the simulation."""


@dataclass(frozen=True, slots=True)
class Tested:
    """A contrast with its only test.

    Attributes
    ----------
    estimate : Estimate
        Contrast with the confidence interval of the test's method [unit of the scores].
    statistic : float
        t; NaN for a permutation test [1].
    free : float
        Degrees of freedom; NaN for a permutation test [1].
    p : float
        Two-sided p value of no effect [1].
    note : str
        Reason why a number is missing, or a caution; empty for none.
    caution : str
        Caution that belongs beside p; empty for none.
    least_p : float
        Smallest possible p with this number of dyads; 0 for a test without a limit [1].
    """

    estimate: Estimate
    statistic: float
    free: float
    p: float
    note: str = ""
    caution: str = ""
    least_p: float = 0.0


def planned_t(groups: Sequence[ArrayLike], weights: Sequence[float], *, level: float, unit: str = "dyad") -> Tested:
    """Test a contrast of group means by Student's t with the pooled variance; of one group, its mean against 0.

    Parameters
    ----------
    groups : sequence of array_like, shape (n_k,)
        Scores of the dyads of each group; NaN are ignored [any].
    weights : sequence of float
        Weight of the mean of each group [1].
    """
    scores = [known(group) for group in groups]
    n, free = sum(map(len, scores)), sum(map(len, scores)) - len(scores)
    if free < 1 or not all(map(len, scores)):
        why = f"{n} {unit}s in {plural(len(scores), 'group')}: too few for a confidence interval and a test"
        value = _combined(scores, weights) if all(map(len, scores)) else nan
        return Tested(Estimate(value, nan, nan, level, n, unit, "t"), nan, nan, nan, why)
    value = _combined(scores, weights)
    if all(constant(one) for one in scores):
        return Tested(Estimate(value, nan, nan, level, n, unit, "t"), nan, nan, nan, "the scores do not vary")
    spread = sum(float(((one - one.mean()) ** 2).sum()) for one in scores)
    error = sqrt(spread / free * sum(w * w / len(one) for w, one in zip(weights, scores, strict=True)))
    half, t = float(stats.t.ppf(0.5 + level / 2.0, free)) * error, value / error
    estimate = Estimate(value, value - half, value + half, level, n, unit, "t")
    return Tested(estimate, t, float(free), float(2.0 * stats.t.sf(abs(t), free)))


def planned_permutation(scores: ArrayLike, *, level: float, unit: str = "dyad") -> Tested:
    """Test the mean score of one group by sign flips; the interval has the values that the same test does not reject.

    Parameters
    ----------
    scores : array_like, shape (n,)
        Scores of the dyads; NaN are ignored [any].
    """
    x = known(scores)
    p = float(permutation_p(x[None, :], rng=np.random.default_rng(SEED))[0])
    estimate = permutation_interval(x, level=level, unit=unit)
    note = "" if np.isfinite(estimate.low) else f"{len(x)} {unit}s: too few for a confidence interval of this test"
    return Tested(estimate, nan, nan, p, note, least_p=least_permutation_p(len(x)) if len(x) > 1 else nan)


def planned_effect(groups: Sequence[ArrayLike], weights: Sequence[float], *, level: float) -> Estimate:
    """Return the effect size of a contrast with Hedges' correction: its estimate over the pooled SD of the scores [1].

    Parameters
    ----------
    groups : sequence of array_like, shape (n_k,)
        Scores of the dyads of each group; NaN are ignored [any].
    weights : sequence of float
        Weight of the mean of each group [1].
    """
    return contrast_effect(groups, weights, correction="hedges", level=level)


def _combined(groups: Sequence[np.ndarray], weights: Sequence[float]) -> float:
    """Return the weighted sum of the groups' means."""
    return float(sum(w * group.mean() for w, group in zip(weights, groups, strict=True)))
