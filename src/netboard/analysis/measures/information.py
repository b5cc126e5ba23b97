"""Who influences whom: Granger causality, transfer entropy, and surrogate dyads as the level of chance.

Both ask whether the past of one partner helps to foretell the other beyond the other's own past. Trials are embedded
one by one, and no past reaches over the beginning of a trial or has a hole. The past is taken at every `step` samples:
neighbours at 1 kHz say the same, and only what is some reaction time old can be an answer.

Partners who watch one ball are alike without any influence. Three things guard against that: give what both see as
`given`; compare with surrogate dyads, in which everybody is with somebody else's partner in the same task; and do not
call it a cause.
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
"""Takes the trials of a source and of a target; returns how much the one says of the other."""

MOST_UNITS = 8
"""Of up to so many dyads all exchanges of partners are looked at [1]."""


@dataclass(frozen=True, slots=True)
class Past:
    """Which samples of the past count.

    Attributes
    ----------
    step : int
        From one to the next [sample].
    own, other : int
        How many there are of the target's own and of the source's [1].
    delay : int
        How far the newest one of the source lies back [sample].
    """

    step: int = 20
    own: int = 3
    other: int = 3
    delay: int = 20

    def __post_init__(self) -> None:
        if min(self.step, self.own, self.other, self.delay) < 1:
            raise ValueError(f"a past has at least one sample of each, in steps of at least one; found {self}")


@dataclass(frozen=True, slots=True)
class Granger:
    """How much better a target is foretold with the past of a source than without.

    Attributes
    ----------
    strength : float
        Logarithm of the ratio of the residual variances; twice the transfer entropy of normal variables [nat].
    f : float
        Statistic of the test that it is none [1].
    p : float
        Its probability by chance, if residuals are normal and independent: hardly ever true of movements [1].
    numerator, denominator : int
        Degrees of freedom [1].
    n : int
        Foretold samples [1].
    unit : str
        What is counted by n.
    """

    strength: float
    f: float
    p: float
    numerator: int
    denominator: int
    n: int
    unit: str = "sample"


@dataclass(frozen=True, slots=True)
class Chance:
    """A measure of true partners beside that of partners who never met.

    Attributes
    ----------
    value : float
        Mean over the true dyads [its own].
    level : float
        Mean over the surrogates: what the task alone makes of it [its own].
    excess : float
        The one less the other [its own].
    p : float
        Share of all exchanges of partners, the true dyads counted in, of which the mean is at least as large; NaN if
        one has none [1].
    least_p : float
        The smallest p that so many exchanges could give [1].
    surrogates : ndarray of float64, shape (m,)
        Mean of each pairing in which nobody has the own partner [its own].
    n : int
        Units of replication [1].
    unit : str
        What they are.
    exact : bool
        All exchanges were looked at; otherwise a random sample.
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
    """What is foretold, its own past with what is given, and the source's past; a row is a sample."""

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
    """Foretell a target linearly, with and without the past of a source (Geweke, J. Am. Stat. Assoc. 77:304, 1982).

    The strength is ``ln(RSS_without / RSS_with)`` of regressions with a constant.

    Parameters
    ----------
    sources, targets : sequence of array_like, shape (n_k,)
        Trials of both, such as the velocities of two styluses [any].
    past : Past or None
        Which samples of the past count; None for three of each in steps of 20.
    given : sequence of sequence of array_like, shape (n_k,)
        Further signals whose past is known in any case, such as the ball's: for each, its trials [any].

    Returns
    -------
    Granger
        Strength and test; NaN for too few samples, or a target that its own past tells already.

    Raises
    ------
    ValueError
        If trials do not go together.
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
    """Estimate the information that the past of a source has of a target beyond the target's own (Schreiber 2000).

    It is the mutual information of the target now and the source's past, given the target's past.

    Parameters
    ----------
    sources, targets : sequence of array_like, shape (n_k,)
        Trials of both, such as the velocities of two styluses [any].
    past : Past or None
        Which samples of the past count; None for three of each in steps of 20.
    given : sequence of sequence of array_like, shape (n_k,)
        Further signals whose past is known in any case: for each, its trials [any].
    estimator : {"gaussian", "binned", "nearest"}
        That of normal variables, half of `granger`'s strength (Barnett et al., Phys. Rev. Lett. 103:238701, 2009); of
        equally filled bins, plugged in, which is biased upwards; or of distances to nearest neighbours, without any
        model (Frenzel and Pompe, Phys. Rev. Lett. 99:204101, 2007, after Kraskov et al. 2004).
    bins : int
        For "binned", bins of each variable; keep bins to the power of all variables well below the samples [1].
    neighbours : int
        For "nearest", how many [1].

    Returns
    -------
    float
        The transfer entropy; estimates may be a little below 0 where there is none; NaN for too few samples [nat].

    Raises
    ------
    ValueError
        If trials do not go together.
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
    most: int = 999,
    unit: str = "dyad",
) -> Chance:
    """Compare true dyads with surrogate ones, in which each source is paired with the target of another dyad.

    Trials are paired in their order and cut to the shorter one: bring those together that ask for the same, by
    mirroring trials whose target is at the left. In a surrogate nobody keeps the own partner. The test is that of all
    exchanges of partners, those too in which some keep theirs: without them true dyads would come out first too often,
    1 time in 6 instead of 10 with four dyads. Of up to eight dyads all exchanges are looked at: with four there are 23
    and nine surrogates, and p cannot be below 1 / 24.

    Parameters
    ----------
    sources, targets : sequence of sequence of array_like, shape (n_k,)
        For each dyad, its trials: at least two dyads [any].
    measure : callable
        Takes the trials of a source and of a target; returns a float: `granger`, `transfer_entropy`, a correlation.
    rng : numpy.random.Generator
        Source of chance, for more than eight dyads.
    most : int
        How many exchanges are drawn then, of which more than a third are surrogates [1].
    unit : str
        What is paired.

    Returns
    -------
    Chance
        The mean of the true dyads, that of the surrogates, and how extreme it is among them.

    Raises
    ------
    ValueError
        If there are fewer than two dyads, or no equal numbers.
    """
    n = len(sources)
    if n < 2 or len(targets) != n:
        raise ValueError(f"partners of at least two dyads are expected, found {n} and {len(targets)}")
    own = np.arange(n)
    exchanges = _exchanges(n, rng, most)
    values = np.full((n, n), np.nan)
    for i, j in sorted({(i, int(j)) for exchange in (own, *exchanges) for i, j in enumerate(exchange)}):
        values[i, j] = measure(*_matched(sources[i], targets[j]))
    true, means = float(values[own, own].mean()), values[own, exchanges].mean(axis=1)
    surrogates = means[(exchanges != own).all(axis=1)]
    level, least = float(surrogates.mean()), 1 / (1 + len(means))
    p = (1 + int((means >= true).sum())) * least if np.isfinite(true + means.sum()) else np.nan
    return Chance(true, level, true - level, p, least, surrogates, n, unit, n <= MOST_UNITS)


# --- embedding ---------------------------------------------------------------------------------------------------


def _embedded(
    sources: Sequence[ArrayLike], targets: Sequence[ArrayLike], past: Past, given: Sequence[Sequence[ArrayLike]]
) -> _Embedded:
    """Line up what is foretold with its past, trial by trial."""
    if len({len(sources), len(targets), *map(len, given)}) > 1:
        raise ValueError("sources, targets and what is given have the same trials; found different numbers of them")
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
    """Line up one trial; rows follow each other by `past.step`, for samples in between say the same."""
    if any(signal.shape != target.shape or signal.ndim != 1 for signal in (source, *given)):
        raise ValueError(f"signals of a trial have one length; found {source.shape} and {target.shape}")
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
    """Pair trials in their order, each cut to the shorter one."""
    pairs = [(np.asarray(a, dtype=float), np.asarray(b, dtype=float)) for a, b in zip(sources, targets, strict=False)]
    lengths = [min(len(a), len(b)) for a, b in pairs]
    return [a[:n] for (a, _), n in zip(pairs, lengths, strict=True)], [
        b[:n] for (_, b), n in zip(pairs, lengths, strict=True)
    ]


def _exchanges(n: int, rng: np.random.Generator, most: int) -> NDArray[np.int64]:
    """Return exchanges of partners but for the one that changes nothing: all, or a sample."""
    if n <= MOST_UNITS:
        return np.array(list(permutations(range(n)))[1:])
    drawn = (rng.permutation(n) for _ in range(most))
    return np.array([exchange for exchange in drawn if (exchange != np.arange(n)).any()])


# --- estimators --------------------------------------------------------------------------------------------------


def _residual(y: NDArray[np.float64], x: NDArray[np.float64]) -> float:
    """Return the sum of squares that a regression leaves."""
    left = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    return float(left @ left)


def _binned(e: _Embedded, bins: int) -> float:
    """Conditional mutual information of equally filled bins: H(now, own) - H(own) - H(all) + H(own, other)."""
    everything = np.column_stack([e.now, e.own, e.other])
    ranks = stats.rankdata(everything, axis=0, method="average")
    symbols = np.minimum((ranks - 0.5) * bins / len(everything), bins - 1).astype(np.int64)
    own = 1 + e.own.shape[1]
    return _entropy(symbols[:, :own]) - _entropy(symbols[:, 1:own]) - _entropy(symbols) + _entropy(symbols[:, 1:])


def _entropy(symbols: NDArray[np.int64]) -> float:
    """Entropy of the rows that occur."""
    share = np.unique(symbols, axis=0, return_counts=True)[1] / len(symbols)
    return float(-(share * np.log(share)).sum())


def _nearest(e: _Embedded, k: int) -> float:
    """Conditional mutual information from how many neighbours lie within the distance of the k-th in all variables."""
    now, own, other = (_standard(part) for part in (e.now[:, None], e.own, e.other))
    distance = KDTree(np.hstack([now, own, other])).query(np.hstack([now, own, other]), k + 1, p=np.inf)[0][:, k]
    with_now, with_other, alone = (
        digamma(_within(np.hstack(parts), distance)) for parts in ((now, own), (own, other), (own,))
    )
    return float(digamma(k) - np.mean(with_now + with_other - alone))


def _within(points: NDArray[np.float64], distance: NDArray[np.float64]) -> NDArray[np.int64]:
    """Count the points nearer than a distance, the point itself counted in."""
    nearer = np.nextafter(distance, 0.0)
    return np.asarray(np.maximum(1, KDTree(points).query_ball_point(points, nearer, p=np.inf, return_length=True)))


def _standard(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bring variables to one scale."""
    spread = columns.std(axis=0)
    return np.asarray((columns - columns.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0))
