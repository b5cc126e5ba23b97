"""Directed influence between partners: Granger causality, transfer entropy and a chance level from surrogate dyads.

Both measures ask whether the past of one partner improves the prediction of the other beyond the other's own past.
Trials are embedded one by one: no past crosses the start of a trial or a gap. The past is sampled at every `step`
samples, because neighbours at 1 kHz are redundant and a response is at least a reaction time old.

Partners who watch the same ball move alike without any influence. Three precautions help: condition on what both see
(`given`); compare with surrogate dyads, which pair each participant with another dyad's partner in the same task; and
do not interpret the result as causation.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats
from scipy.spatial import KDTree
from scipy.special import digamma

Estimator = Literal["gaussian", "binned", "nearest"]
Measure = Callable[[Sequence[NDArray[np.float64]], Sequence[NDArray[np.float64]]], float]
"""Function of the trials of a source and of a target; returns the influence of the one on the other."""

MAX_UNITS = 8
"""Largest number of dyads for which all permutations of partners are evaluated [1]."""


@dataclass(frozen=True, slots=True)
class Past:
    """Samples of the past that enter the prediction.

    Attributes
    ----------
    step : int
        Spacing of the samples [sample].
    own, other : int
        Number of samples of the target's own past and of the source's past [1].
    delay : int
        Lag of the newest sample of the source [sample].
    """

    step: int = 20
    own: int = 3
    other: int = 3
    delay: int = 20

    def __post_init__(self) -> None:
        if min(self.step, self.own, self.other, self.delay) < 1:
            raise ValueError(f"orders and step must be 1 or more, found {self}")


@dataclass(frozen=True, slots=True)
class Granger:
    """Improvement of the prediction of a target by the past of a source.

    Attributes
    ----------
    strength : float
        Logarithm of the ratio of the residual variances; twice the transfer entropy for Gaussian variables [nat].
    f : float
        F statistic of the null hypothesis of no improvement [1].
    p : float
        p value; it assumes independent normal residuals, which movements hardly ever have [1].
    numerator, denominator : int
        Degrees of freedom of the F statistic [1].
    n : int
        Number of predicted samples [1].
    unit : str
        Unit that n counts.
    """

    strength: float
    f: float
    p: float
    numerator: int
    denominator: int
    n: int
    unit: str = "sample"


@dataclass(frozen=True, slots=True)
class SurrogateComparison:
    """A measure in true dyads and in surrogate dyads of partners who never met.

    Attributes
    ----------
    value : float
        Mean over the true dyads [unit of the measure].
    level : float
        Mean over the surrogates: the chance level that the shared task alone produces [unit of the measure].
    excess : float
        `value` minus `level` [unit of the measure].
    p : float
        p value: proportion of all permutations of partners, the true dyads included, with a mean at least as large; NaN
        if the measure is undefined for any pairing [1].
    least_p : float
        Smallest p value that this number of permutations can give [1].
    surrogates : ndarray of float64, shape (m,)
        Mean of each permutation in which nobody keeps the true partner [unit of the measure].
    n : int
        Number of units of replication [1].
    unit : str
        Name of that unit, such as ``dyad``.
    exact : bool
        Whether all permutations were evaluated; otherwise a random sample.
    """

    value: float
    level: float
    excess: float
    p: float
    least_p: float
    surrogates: NDArray[np.float64]
    n: int
    unit: str
    exact: bool


class _Embedded(NamedTuple):
    """Predicted values, their own past with the given signals, and the source's past; one row for each sample."""

    now: NDArray[np.float64]
    own: NDArray[np.float64]
    other: NDArray[np.float64]


def granger(
    sources: Sequence[ArrayLike],
    targets: Sequence[ArrayLike],
    *,
    past: Past | None = None,
    given: Sequence[Sequence[ArrayLike]] = (),
) -> Granger:
    """Predict a target linearly, with and without the past of a source (Geweke, J. Am. Stat. Assoc. 77:304, 1982).

    The strength is ``ln(RSS_without / RSS_with)`` of linear regressions with an intercept; NaN for too few samples or a
    target that its own past predicts exactly.
    """
    past = past or Past()
    e = _embedded(sources, targets, past, given)
    without = np.column_stack([np.ones(len(e.now)), e.own])
    rest, full = _residual(e.now, without), _residual(e.now, np.column_stack([without, e.other]))
    free = len(e.now) - without.shape[1] - past.other
    if free < 1 or not full > 1e-20 * float(e.now @ e.now):
        return Granger(np.nan, np.nan, np.nan, past.other, max(free, 0), len(e.now))
    f = (rest - full) / past.other / (full / free)
    return Granger(float(np.log(rest / full)), f, float(stats.f.sf(f, past.other, free)), past.other, free, len(e.now))


def transfer_entropy(
    sources: Sequence[ArrayLike],
    targets: Sequence[ArrayLike],
    *,
    past: Past | None = None,
    given: Sequence[Sequence[ArrayLike]] = (),
    estimator: Estimator = "gaussian",
    bins: int = 3,
    neighbours: int = 4,
) -> float:
    """Estimate the transfer entropy from a source to a target (Schreiber, Phys. Rev. Lett. 85:461, 2000) [nat].

    It is the mutual information of the target's present and the source's past, conditional on the target's past; NaN
    for too few samples. Without influence an estimate may lie slightly below 0.

    Parameters
    ----------
    estimator : {"gaussian", "binned", "nearest"}
        "gaussian" assumes normal variables and equals half of `granger`'s strength (Barnett et al., Phys. Rev. Lett.
        103:238701, 2009). "binned" is the plug-in estimator with equally filled bins; it is biased upwards. "nearest"
        uses distances to nearest neighbours and assumes no model (Frenzel and Pompe, Phys. Rev. Lett. 99:204101, 2007,
        after Kraskov et al., Phys. Rev. E 69:066138, 2004).
    bins : int
        For "binned", bins of each variable; ``bins ** variables`` should stay well below the number of samples [1].
    neighbours : int
        For "nearest", number of neighbours [1].
    """
    past = past or Past()
    if estimator == "gaussian":
        return granger(sources, targets, past=past, given=given).strength / 2.0
    e = _embedded(sources, targets, past, given)
    if len(e.now) <= neighbours + 1:
        return np.nan
    return _binned(e, bins) if estimator == "binned" else _nearest(e, neighbours)


def chance_level(
    sources: Sequence[Sequence[ArrayLike]],
    targets: Sequence[Sequence[ArrayLike]],
    measure: Measure,
    rng: np.random.Generator,
    *,
    true: ArrayLike | None = None,
    most: int = 999,
    unit: str = "dyad",
) -> SurrogateComparison:
    """Compare true dyads with surrogate dyads, which pair each source with the target of another dyad.

    Trials are paired in order and cut to the shorter one. Match trials with the same demands first, for example by
    mirroring trials whose target is on the left.

    In a surrogate nobody keeps the true partner; the chance level is the mean of the surrogates. The test uses all
    permutations of partners, including those in which some keep theirs: with surrogates only, four true dyads would
    rank first by chance 1 time in 6 instead of the nominal 1 in 10. With up to eight dyads all permutations are
    evaluated. Four dyads have 23 permutations besides the true one, nine of them surrogates, so p cannot be below 1 /
    24.

    Parameters
    ----------
    sources, targets : sequence of sequence of array_like, shape (n_k,)
        Trials of each dyad; at least two dyads [any].
    measure : callable
        Function of the trials of a source and of a target that returns a float, such as `granger`, `transfer_entropy`
        or a correlation.
    rng : numpy.random.Generator
        Random generator, used for more than eight dyads.
    true : array_like, shape (k,), optional
        The measure in the true dyads, if known already [unit of the measure].
    most : int
        Number of random permutations then, of which more than a third are surrogates [1].
    """
    n = len(sources)
    if n < 2 or len(targets) != n:
        raise ValueError(f"expected two or more dyads, found {n} and {len(targets)}")
    own = np.arange(n)
    exchanges = _exchanges(n, rng, most)
    values = np.full((n, n), np.nan)
    pairs = {(i, int(j)) for exchange in (own, *exchanges) for i, j in enumerate(exchange)}
    if true is not None:
        values[own, own] = true
        pairs -= {(i, i) for i in range(n)}
    for i, j in sorted(pairs):
        values[i, j] = measure(*_matched(sources[i], targets[j]))
    mean, means = float(values[own, own].mean()), values[own, exchanges].mean(axis=1)
    surrogates = means[(exchanges != own).all(axis=1)]
    level, least = float(surrogates.mean()), 1 / (1 + len(means))
    p = (1 + int((means >= mean).sum())) * least if np.isfinite(mean + means.sum()) else np.nan
    return SurrogateComparison(mean, level, mean - level, p, least, surrogates, n, unit, n <= MAX_UNITS)


# --- embedding ---------------------------------------------------------------------------------------------------


def _embedded(
    sources: Sequence[ArrayLike], targets: Sequence[ArrayLike], past: Past, given: Sequence[Sequence[ArrayLike]]
) -> _Embedded:
    """Align the predicted samples with their past, trial by trial."""
    if len({len(sources), len(targets), *map(len, given)}) > 1:
        raise ValueError("sources, targets and conditioning signals must have the same number of trials")
    parts = [
        _embedded_trial(*(np.asarray(signal, dtype=float) for signal in signals), past=past)
        for signals in zip(sources, targets, *given, strict=True)
    ]
    columns = past.own * (1 + len(given))
    empty = _Embedded(np.empty(0), np.empty((0, columns)), np.empty((0, past.other)))
    return _Embedded(*(np.concatenate(part) for part in zip(empty, *parts, strict=True)))


def _embedded_trial(
    source: NDArray[np.float64], target: NDArray[np.float64], *given: NDArray[np.float64], past: Past
) -> _Embedded:
    """Align one trial; rows are `past.step` samples apart, because samples in between are redundant."""
    if any(signal.shape != target.shape or signal.ndim != 1 for signal in (source, *given)):
        raise ValueError(f"the signals of a trial must have the same length; found {source.shape} and {target.shape}")
    first = max(past.own * past.step, past.delay + (past.other - 1) * past.step)
    now = np.arange(first, len(target), past.step)
    own = now[:, None] - past.step * np.arange(1, past.own + 1)
    other = now[:, None] - past.delay - past.step * np.arange(past.other)
    e = _Embedded(target[now], np.concatenate([signal[own] for signal in (target, *given)], axis=1), source[other])
    known = np.isfinite(np.column_stack(e)).all(axis=1)
    return _Embedded(*(part[known] for part in e))


def _matched(
    sources: Sequence[ArrayLike], targets: Sequence[ArrayLike]
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Pair trials in order, each cut to the shorter one."""
    pairs = [(np.asarray(a, dtype=float), np.asarray(b, dtype=float)) for a, b in zip(sources, targets, strict=False)]
    lengths = [min(len(a), len(b)) for a, b in pairs]
    return [a[:n] for (a, _), n in zip(pairs, lengths, strict=True)], [
        b[:n] for (_, b), n in zip(pairs, lengths, strict=True)
    ]


def _exchanges(n: int, rng: np.random.Generator, most: int) -> NDArray[np.int64]:
    """Return all permutations of partners except the identity, or a random sample of them."""
    if n <= MAX_UNITS:
        return np.array(list(permutations(range(n)))[1:])
    drawn = (rng.permutation(n) for _ in range(most))
    return np.array([exchange for exchange in drawn if (exchange != np.arange(n)).any()])


# --- estimators --------------------------------------------------------------------------------------------------


def _residual(y: NDArray[np.float64], x: NDArray[np.float64]) -> float:
    """Return the residual sum of squares of a regression."""
    left = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    return float(left @ left)


def _binned(e: _Embedded, bins: int) -> float:
    """Return the conditional mutual information, H(now, own) - H(own) - H(all) + H(own, other), of binned ranks."""
    everything = np.column_stack([e.now, e.own, e.other])
    ranks = stats.rankdata(everything, axis=0, method="average")
    symbols = np.minimum((ranks - 0.5) * bins / len(everything), bins - 1).astype(np.int64)
    own = 1 + e.own.shape[1]
    return _entropy(symbols[:, :own]) - _entropy(symbols[:, 1:own]) - _entropy(symbols) + _entropy(symbols[:, 1:])


def _entropy(symbols: NDArray[np.int64]) -> float:
    share = np.unique(symbols, axis=0, return_counts=True)[1] / len(symbols)
    return float(-(share * np.log(share)).sum())


def _nearest(e: _Embedded, k: int) -> float:
    """Return the conditional mutual information from neighbour counts within the k-th neighbour distance."""
    now, own, other = (_standard(part) for part in (e.now[:, None], e.own, e.other))
    distance = KDTree(np.hstack([now, own, other])).query(np.hstack([now, own, other]), k + 1, p=np.inf)[0][:, k]
    with_now, with_other, alone = (
        digamma(_within(np.hstack(parts), distance)) for parts in ((now, own), (own, other), (own,))
    )
    return float(digamma(k) - np.mean(with_now + with_other - alone))


def _within(points: NDArray[np.float64], distance: NDArray[np.float64]) -> NDArray[np.int64]:
    """Count the points nearer than a distance, including the point itself."""
    nearer = np.nextafter(distance, 0.0)
    return np.asarray(np.maximum(1, KDTree(points).query_ball_point(points, nearer, p=np.inf, return_length=True)))


def _standard(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    spread = columns.std(axis=0)
    return np.asarray((columns - columns.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0))
