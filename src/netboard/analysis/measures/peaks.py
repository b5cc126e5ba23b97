"""Number of peaks (NP) of the ball's absolute velocity: the paper's measure of smoothness.

The printed equation lacks a condition on the second derivative. This module counts maxima, where it is negative, which
fits the numbers that the paper reports.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from netboard.analysis.measures.signals import is_whole
from netboard.base.compiled import kernel

Extrema = Literal["maxima", "maxima_and_minima"]
Plateau = Literal["first_sample", "midpoint"]


@dataclass(frozen=True, slots=True)
class Peaks:
    """Peaks of a speed.

    Attributes
    ----------
    samples : ndarray of int64, shape (k,)
        Samples of the peaks, counted from the start of the window [1].
    heights : ndarray, shape (k,)
        Speed at each peak [m/s].
    whole : bool
        Whether the speed has no missing sample.
    """

    samples: NDArray[np.int64]
    heights: NDArray[np.float64]
    whole: bool = True

    @property
    def count(self) -> float:
        """Number of peaks: the paper's NP; NaN if a gap may hide one [1]."""
        return len(self.samples) if self.whole else np.nan


def velocity_peaks(
    speed: NDArray[np.float64],
    *,
    extrema: Extrema = "maxima",
    plateau: Plateau = "first_sample",
    least_prominence: float = 0.0,
    least_share: float = 0.0,
) -> Peaks:
    """Find the peaks of the ball's absolute velocity; the ends of the window do not count.

    Parameters
    ----------
    speed : ndarray, shape (n,)
        Absolute velocity of the ball in the window, filtered by the slow filter [m/s].
    extrema : {"maxima", "maxima_and_minima"}
        Stationary points that count: those with a negative second derivative, or those with a non-zero one.
    plateau : {"first_sample", "midpoint"}
        Position of a peak of several equal samples: the first of them, if the next sample is not higher (``v[i-1] <
        v[i] >= v[i+1]``); or their middle, if the speed falls on both sides (as in `scipy.signal.find_peaks`). Both
        agree without equal samples.
    least_prominence : float
        Minimum prominence of a peak; 0 for none [m/s].
    least_share : float
        Minimum prominence as a fraction of the largest speed, because the filter's ringing scales with that [1].
    """
    speed = np.ascontiguousarray(speed, np.float64)
    least = max(least_prominence, least_share * _largest(speed))
    samples = _maxima(speed, plateau, least)
    if extrema == "maxima_and_minima":
        samples = np.sort(np.concatenate([samples, _maxima(-speed, plateau, least)]))
    return Peaks(samples, speed[samples], is_whole(speed))


def _maxima(speed: NDArray[np.float64], plateau: Plateau, least_prominence: float) -> NDArray[np.int64]:
    """Find the maxima with sufficient prominence."""
    samples = find_peaks(speed)[0].astype(np.int64) if plateau == "midpoint" else _first_samples(speed)
    return _prominent(speed, samples, least_prominence) if least_prominence > 0 else samples


@kernel
def _largest(speed: NDArray[np.float64]) -> float:
    """Return the largest speed, 0 without any; missing samples do not count [m/s]."""
    largest = 0.0
    for value in speed:
        largest = max(largest, value)
    return largest


@kernel
def _first_samples(speed: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the first sample of each maximum."""
    count, found = 0, np.empty(len(speed), np.int64)
    for n in range(1, len(speed) - 1):
        if speed[n - 1] < speed[n] and speed[n] >= speed[n + 1]:
            found[count] = n
            count += 1
    return found[:count].copy()


@kernel
def _prominent(speed: NDArray[np.float64], samples: NDArray[np.int64], least: float) -> NDArray[np.int64]:
    """Return the maxima whose prominence, as in `scipy.signal.peak_prominences`, is large enough."""
    count, found = 0, np.empty(len(samples), np.int64)
    for sample in samples:
        top = speed[sample]
        before, n = top, sample
        while n >= 0 and speed[n] <= top:
            before = min(before, speed[n])
            n -= 1
        after, n = top, sample
        while n < len(speed) and speed[n] <= top:
            after = min(after, speed[n])
            n += 1
        if top - max(before, after) >= least:
            found[count] = sample
            count += 1
    return found[:count].copy()
