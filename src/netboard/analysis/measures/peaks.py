"""Number of peaks in the ball's absolute velocity: the paper's measure of smoothness (its equation for NP).

The printed set lacks a condition on the second derivative. Counted are maxima, where it is negative; the numbers that
the paper reports fit that.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks, peak_prominences

Extrema = Literal["maxima", "maxima_and_minima"]
Plateau = Literal["first_sample", "midpoint"]


@dataclass(frozen=True, slots=True)
class Peaks:
    """Peaks of a speed.

    Attributes
    ----------
    samples : ndarray of int64, shape (k,)
        Where they are, counted from the beginning of what was looked at [1].
    heights : ndarray, shape (k,)
        The speed there [m/s].
    whole : bool
        Whether no sample of the speed is missing.
    """

    samples: NDArray[np.int64]
    heights: NDArray[np.float64]
    whole: bool = True

    @property
    def count(self) -> float:
        """How many there are: the paper's NP; NaN if a hole may hide one [1]."""
        return len(self.samples) if self.whole else float("nan")


def velocity_peaks(
    speed: NDArray[np.float64],
    *,
    extrema: Extrema = "maxima",
    plateau: Plateau = "first_sample",
    least_prominence: float = 0.0,
    least_share: float = 0.0,
) -> Peaks:
    """Find the peaks of the ball's absolute velocity. An end of what is looked at is none.

    Parameters
    ----------
    speed : ndarray, shape (n,)
        Absolute velocity of the ball, filtered by the slow filter, in the window that is looked at [m/s].
    extrema : {"maxima", "maxima_and_minima"}
        Which points without slope are counted: those where the second derivative is negative, or where it is not 0.
    plateau : {"first_sample", "midpoint"}
        Where a peak is that several equal samples share: at the first of them, provided that the next one is not higher
        (``v[i-1] < v[i] >= v[i+1]``), or in their middle, provided that the speed falls on both sides (that of
        `scipy.signal.find_peaks`). Without equal samples there is no difference.
    least_prominence : float
        How far a peak must stand out; 0 for any [m/s].
    least_share : float
        How far, as a share of the largest speed: the ringing of the filter is in proportion to that [1].
    """
    least = max(least_prominence, least_share * float(np.max(speed, initial=0.0, where=~np.isnan(speed))))
    samples = _maxima(speed, plateau, least)
    if extrema == "maxima_and_minima":
        samples = np.sort(np.concatenate([samples, _maxima(-speed, plateau, least)]))
    return Peaks(samples, speed[samples], not np.isnan(speed).any())


def _maxima(speed: NDArray[np.float64], plateau: Plateau, least_prominence: float) -> NDArray[np.int64]:
    """Find maxima that stand out."""
    if plateau == "midpoint":
        samples = find_peaks(speed)[0]
    else:
        samples = 1 + np.flatnonzero((speed[:-2] < speed[1:-1]) & (speed[1:-1] >= speed[2:]))
    if least_prominence > 0 and samples.size:
        samples = samples[peak_prominences(speed, samples)[0] >= least_prominence]
    return np.asarray(samples, np.int64)
