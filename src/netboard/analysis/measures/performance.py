"""Performance over trials: completion times or numbers of peaks of many trials, with the labels of their conditions.

Trials are in the order in which they were done. Values that are not a number (trials without a success) are left out
everywhere. A spread is that of single trials, as the paper's, unless people are named.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

TrialTime = Literal["successful_attempt", "all_attempts"]
Level = Literal["mean", "median", "last"]

ENDS = 30
"""How many trials at the beginning and at the end the paper compares [1]."""

LAST = 60
"""Trials that tell how well somebody does in the end: a block [1]."""


@dataclass(frozen=True, slots=True)
class Summary:
    """Mean and standard deviation.

    Attributes
    ----------
    mean : float
        NaN of no values [as given].
    deviation : float
        NaN of fewer than two [as given].
    count : int
        Values [1].
    """

    mean: float
    deviation: float
    count: int


def summarise(values: NDArray[np.float64], people: NDArray[Any] | None = None) -> Summary:
    """Mean and standard deviation of trials, or of people.

    Parameters
    ----------
    values : ndarray, shape (n,)
        One value for each trial [any].
    people : ndarray, shape (n,), optional
        Whose trial each is. With it the values are means of people; without it single trials, all together [1].
    """
    known = np.isfinite(values)
    kept = values[known]
    if people is not None:
        whose = people[known]
        kept = np.array([kept[whose == person].mean() for person in np.unique(whose)])
    mean = float(kept.mean()) if kept.size else float("nan")
    return Summary(mean, float(kept.std(ddof=1)) if kept.size > 1 else float("nan"), kept.size)


def running_number(*labels: NDArray[Any]) -> NDArray[np.int64]:
    """Place of each trial among those with the same labels, from 1, in the order given.

    With participant, configuration and haptics as labels the paper's 180 trials of a condition are counted, so that
    both haptic conditions have a first and a last trial; without haptics, the 360 of a configuration.

    Parameters
    ----------
    *labels : ndarray, shape (n,)
        What must be the same [1].

    Returns
    -------
    ndarray of int64, shape (n,)
        The numbers [1].

    Raises
    ------
    ValueError
        If there are no labels, or not one of each for every trial.
    """
    if len({label.shape for label in labels}) != 1:
        raise ValueError("every trial needs one of each label")
    codes = np.stack([np.unique(label, return_inverse=True)[1] for label in labels])
    groups = np.unique(codes, axis=1, return_inverse=True)[1].ravel()
    order = np.argsort(groups, kind="stable")
    starts = np.searchsorted(groups[order], groups[order])
    numbers = np.empty(groups.size, np.int64)
    numbers[order] = np.arange(groups.size) - starts + 1
    return numbers


def trial_times(
    trials: NDArray[np.int64],
    durations: NDArray[np.float64],
    completions: NDArray[np.float64],
    *,
    of: TrialTime = "successful_attempt",
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Completion time of each trial from its attempts.

    Parameters
    ----------
    trials : ndarray of int64, shape (n,)
        Number of the trial of each attempt [1].
    durations : ndarray, shape (n,)
        How long each attempt took, holds included [s].
    completions : ndarray, shape (n,)
        Completion time of each attempt, NaN for one that failed [s].
    of : {"successful_attempt", "all_attempts"}
        From when it counts: the release of the successful attempt, or that of the first one, the failed attempts'
        time added (but not the pauses between them).

    Returns
    -------
    tuple of ndarray, shape (k,)
        Numbers of the trials, and their times; NaN for one without a success [1, s].
    """
    numbers = np.unique(trials)
    times = np.full(len(numbers), np.nan)
    for row, number in enumerate(numbers):
        own = trials == number
        succeeded = np.flatnonzero(np.isfinite(completions[own]))
        if succeeded.size:
            success = succeeded[0]
            before = durations[own][:success].sum() if of == "all_attempts" else 0.0
            times[row] = before + completions[own][success]
    return numbers, times


def window_sizes(trials: int) -> tuple[int, int]:
    """Choose how many trials the first and the last ones are, and how many a group has: the paper's 30, or fewer.

    Parameters
    ----------
    trials : int
        How many there are in a condition [1].

    Returns
    -------
    ends : int
        At most half of them, at least one [1].
    group : int
        At least three, and if possible a number that divides them [1].
    """
    ends = max(min(ENDS, trials // 2), 1)
    return ends, next((size for size in range(ends, 2, -1) if trials % size == 0), max(ends, 3))


@dataclass(frozen=True, slots=True)
class FirstAndLast:
    """How it was in the first trials and in the last ones.

    Attributes
    ----------
    first, last : Summary
        Of the first trials and of the last ones.
    """

    first: Summary
    last: Summary

    @property
    def change(self) -> float:
        """Last mean less the first one [as given]."""
        return self.last.mean - self.first.mean


def first_and_last(
    values: NDArray[np.float64],
    order: NDArray[np.int64],
    *,
    count: int = ENDS,
    length: int | None = None,
    people: NDArray[Any] | None = None,
) -> FirstAndLast:
    """Compare the first 30 trials of each condition with the last 30.

    Parameters
    ----------
    values : ndarray, shape (n,)
        One value for each trial [any].
    order : ndarray of int64, shape (n,)
        Place of each trial in its condition, from 1, from `running_number` [1].
    count : int
        Trials at each end [1].
    length : int, optional
        Trials in a condition; without it the largest number in `order` [1].
    people : ndarray, shape (n,), optional
        Whose trial each is, for means and deviations of people instead of trials [1].

    Raises
    ------
    ValueError
        If the two ends overlap.
    """
    whole = length if length is not None else int(order.max(initial=0))
    if 2 * count > whole > 0:
        raise ValueError(f"the first and the last {count} trials of {whole} overlap")

    def part(chosen: NDArray[np.bool_]) -> Summary:
        return summarise(values[chosen], None if people is None else people[chosen])

    return FirstAndLast(part(order <= count), part((order > whole - count) & (order <= whole)))


@dataclass(frozen=True, slots=True)
class LearningCurve:
    """Mean over everybody at each place in a condition.

    Attributes
    ----------
    order : ndarray of int64, shape (k,)
        Place in the condition, from 1 [1].
    mean : ndarray, shape (k,)
        Mean; NaN where there is no value [as given].
    deviation : ndarray, shape (k,)
        Standard deviation; NaN of fewer than two values [as given].
    count : ndarray of int64, shape (k,)
        Values [1].
    """

    order: NDArray[np.int64]
    mean: NDArray[np.float64]
    deviation: NDArray[np.float64]
    count: NDArray[np.int64]


def learning_curve(values: NDArray[np.float64], order: NDArray[np.int64]) -> LearningCurve:
    """Average trials with the same place in their condition, over people and conditions.

    Parameters
    ----------
    values : ndarray, shape (n,)
        One value for each trial [any].
    order : ndarray of int64, shape (n,)
        Place of each trial in its condition, from 1 [1].
    """
    places = np.arange(1, int(order.max(initial=0)) + 1)
    parts = [summarise(values[order == place]) for place in places]
    return LearningCurve(
        places,
        np.array([part.mean for part in parts]),
        np.array([part.deviation for part in parts]),
        np.array([part.count for part in parts], np.int64),
    )


def level(values: NDArray[np.float64], *, of: Level = "mean", last: int = LAST) -> float:
    """One number for how well a person or dyad does in a condition [as given].

    Parameters
    ----------
    values : ndarray, shape (n,)
        One value for each trial, in order [any].
    of : {"mean", "median", "last"}
        Mean of all trials, their median, or the mean of the last ones.
    last : int
        How many are the last ones [1].
    """
    known = values[np.isfinite(values)]
    if known.size == 0:
        return float("nan")
    if of == "median":
        return float(np.median(known))
    return float((known[-last:] if of == "last" else known).mean())


@dataclass(frozen=True, slots=True)
class RelativePerformance:
    """A participant beside the partner and the dyad (the paper's figure of dyadic improvement); less is better.

    Attributes
    ----------
    against_partner : float
        The figure's x, half of what the partner needs more; + = better than the partner [as given].
    of_dyad : float
        The figure's y, what the dyad needs more; + = worse together than alone [as given].
    """

    against_partner: float
    of_dyad: float

    @property
    def gain(self) -> float:
        """What the dyad needs less than the mean of the two; + = below the figure's diagonal [as given]."""
        return self.against_partner - self.of_dyad


def relative_performance(own: float, partner: float, dyad: float) -> RelativePerformance:
    """Relate a participant's bimanual level to the partner's and to that of both together.

    Parameters
    ----------
    own, partner : float
        Level of each of the two alone, from `level` [any].
    dyad : float
        Level of both together [as the others].
    """
    return RelativePerformance((partner - own) / 2, dyad - own)


def better_dyads(pairs: Sequence[RelativePerformance]) -> tuple[int, int]:
    """Count the dyads that do better than the mean of their two participants.

    Parameters
    ----------
    pairs : sequence of RelativePerformance
        One of each dyad: it does not matter whose, for both have the same gain.

    Returns
    -------
    tuple of int
        How many do, of how many whose gain is known [1].
    """
    gains = np.array([pair.gain for pair in pairs])
    return int(np.count_nonzero(gains > 0)), int(np.count_nonzero(np.isfinite(gains)))
