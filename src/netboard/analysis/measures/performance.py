"""Performance over trials: completion times or numbers of peaks, with the labels of their conditions.

Trials are in the order in which they were performed. NaN values (trials without a success) are ignored everywhere.
Standard deviations are those of single trials, as in the paper, unless participants are named.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isclose
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

TrialTime = Literal["successful_attempt", "all_attempts"]
Level = Literal["mean", "median", "last"]

ENDS = 30
"""Number of trials at the start and at the end of a condition that the paper compares [1]."""

ROUNDING = 1e-12
"""Relative difference up to which levels are equal but for rounding [1]."""

LAST = 60
"""Number of last trials that define final performance: one block [1]."""


@dataclass(frozen=True, slots=True)
class PerformanceSummary:
    """Mean and standard deviation.

    Attributes
    ----------
    mean : float
        Mean; NaN without values [as given].
    deviation : float
        Standard deviation; NaN for fewer than two values [as given].
    count : int
        Number of values [1].
    """

    mean: float
    deviation: float
    count: int


def summarise(values: NDArray[np.float64], people: NDArray[Any] | None = None) -> PerformanceSummary:
    """Return mean and standard deviation over single trials; with `people`, over the means of participants or dyads."""
    known = np.isfinite(values)
    kept = values[known]
    if people is not None:
        labels = people[known]
        kept = np.array([kept[labels == person].mean() for person in np.unique(labels)])
    mean = float(kept.mean()) if kept.size else np.nan
    return PerformanceSummary(mean, float(kept.std(ddof=1)) if kept.size > 1 else np.nan, kept.size)


def running_number(*labels: NDArray[Any]) -> NDArray[np.int64]:
    """Return the position of each trial among those with the same labels, from 1, in the order given [1].

    The labels participant, configuration and haptics number the paper's 180 trials of a condition, so that both haptic
    conditions have a first and a last trial. Without haptics they number the 360 trials of a configuration.

    Parameters
    ----------
    *labels : ndarray, shape (n,)
        One or more labels of each trial [1].
    """
    if len({label.shape for label in labels}) != 1:
        raise ValueError("expected one of each label for every trial")
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
    """Return trial numbers and completion times from attempts, shape (k,) each; NaN without a success [1, s].

    Parameters
    ----------
    trials : ndarray of int64, shape (n,)
        Trial number of each attempt [1].
    durations : ndarray, shape (n,)
        Duration of each attempt, including the hold [s].
    completions : ndarray, shape (n,)
        Completion time of each attempt, NaN for a failed one [s].
    of : {"successful_attempt", "all_attempts"}
        Start of the completion time: the release of the successful attempt, or that of the first attempt, so that the
        durations of failed attempts are added (but not the pauses between them).
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
    """Return the number of first and last trials and the group size: the paper's 30, or fewer.

    Parameters
    ----------
    trials : int
        Number of trials in a condition [1].

    Returns
    -------
    ends : int
        Number of first and of last trials: at most half of the condition, at least one [1].
    group : int
        Group size: at least three; in a short condition it divides the number of trials if a size from half of `ends`
        on does, otherwise the last group is a part [1].
    """
    ends = max(min(ENDS, trials // 2), 1)
    sizes = range(ends, max(ends // 2, 2), -1) if ends < ENDS else ()
    return ends, next((size for size in sizes if trials % size == 0), max(ends, 3))


@dataclass(frozen=True, slots=True)
class FirstAndLast:
    """Performance in the first and in the last trials.

    Attributes
    ----------
    first, last : Summary
        Summaries of the first and of the last trials.
    """

    first: PerformanceSummary
    last: PerformanceSummary

    @property
    def change(self) -> float:
        """Last mean minus first mean [as given]."""
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
    count : int
        Number of trials at each end, at most half of a condition [1].
    length : int, optional
        Number of trials in a condition; by default the largest number in `order` [1].
    """
    whole = length if length is not None else int(order.max(initial=0))
    if 2 * count > whole > 0:
        raise ValueError(f"the first and the last {count} trials of {whole} overlap")

    def part(chosen: NDArray[np.bool_]) -> PerformanceSummary:
        return summarise(values[chosen], None if people is None else people[chosen])

    return FirstAndLast(part(order <= count), part((order > whole - count) & (order <= whole)))


@dataclass(frozen=True, slots=True)
class LearningCurve:
    """Learning curve: the mean over participants and conditions at each position.

    Attributes
    ----------
    order : ndarray of int64, shape (k,)
        Position in the condition, from 1 [1].
    mean : ndarray, shape (k,)
        Mean; NaN without values [as given].
    deviation : ndarray, shape (k,)
        Standard deviation; NaN for fewer than two values [as given].
    count : ndarray of int64, shape (k,)
        Number of values [1].
    """

    order: NDArray[np.int64]
    mean: NDArray[np.float64]
    deviation: NDArray[np.float64]
    count: NDArray[np.int64]


def learning_curve(values: NDArray[np.float64], order: NDArray[np.int64]) -> LearningCurve:
    """Average trials at the same position in their condition, over participants and conditions."""
    places = np.arange(1, int(order.max(initial=0)) + 1)
    parts = [summarise(values[order == place]) for place in places]
    return LearningCurve(
        places,
        np.array([part.mean for part in parts]),
        np.array([part.deviation for part in parts]),
        np.array([part.count for part in parts], np.int64),
    )


def level(values: NDArray[np.float64], *, of: Level = "mean", last: int = LAST) -> float:
    """Return the performance level of a participant or dyad in a condition [as given].

    Parameters
    ----------
    of : {"mean", "median", "last"}
        Mean of all trials, their median, or the mean of the last trials.
    last : int
        Number of last trials [1].
    """
    known = values[np.isfinite(values)]
    if known.size == 0:
        return np.nan
    if of == "median":
        return float(np.median(known))
    return float((known[-last:] if of == "last" else known).mean())


@dataclass(frozen=True, slots=True)
class RelativePerformance:
    """A participant relative to the partner and to the dyad (the paper's figure of dyadic improvement); less is better.

    Attributes
    ----------
    against_partner : float
        The figure's x: half of the partner's level minus the participant's; + = better than the partner [as given].
    of_dyad : float
        The figure's y: the dyad's level minus the participant's; + = worse together than alone [as given].
    """

    against_partner: float
    of_dyad: float

    @property
    def gain(self) -> float:
        """Mean level of the two participants minus the dyad's; + = below the figure's diagonal [as given]."""
        return self.against_partner - self.of_dyad


def relative_performance(own: float, partner: float, dyad: float) -> RelativePerformance:
    """Compare a participant's bimanual level with the partner's and with the dyad's.

    Parameters
    ----------
    own, partner : float
        Level of each participant alone, from `level` [any].
    dyad : float
        Level of the dyad; if it is the mean of the two but for rounding, the gain is exactly 0 [as the others].
    """
    against_partner = (partner - own) / 2
    tie = isclose(dyad, (own + partner) / 2, rel_tol=ROUNDING)
    return RelativePerformance(against_partner, against_partner if tie else dyad - own)


def better_dyads(pairs: Sequence[RelativePerformance]) -> tuple[int, int]:
    """Count the dyads better than the mean of their two participants, and those with a known gain [1].

    Parameters
    ----------
    pairs : sequence of RelativePerformance
        One entry for each dyad, of either participant, because both have the same gain.
    """
    gains = np.array([pair.gain for pair in pairs])
    return int(np.count_nonzero(gains > 0)), int(np.count_nonzero(np.isfinite(gains)))
