"""Who moved first, and by how much: delays between the two sides of one movement or one stretch of time.

A delay is the time of the left side less that of the right one: positive where the right side was first. Two sides that
tilt the board move in opposite directions, so by default the left side is compared with the mirrored right one. Delays
are found between samples: a millisecond is too coarse for a difference of a few.

Delays by thresholds, the paper's, are those of `netboard.analysis.measures.cooperation`.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import correlate

from netboard.analysis.measures.signals import paired

Relation = Literal["mirrored", "alike"]
Overlap = Literal["pearson", "full"]

_SIGNS = {"mirrored": -1.0, "alike": 1.0}


@dataclass(frozen=True, slots=True)
class Lag:
    """The delay at which two signals are most alike.

    Attributes
    ----------
    delay : float
        Time of the left less that of the right, + = right first; NaN where there is none within reach [s].
    coefficient : float
        Correlation at that delay [1].
    at_once : float
        Correlation without a delay [1].
    n : int
        Samples of each side [1].
    unit : str
        What is counted by n.
    """

    delay: float
    coefficient: float
    at_once: float
    n: int
    unit: str = "sample"


@dataclass(frozen=True, slots=True)
class Leadership:
    """How evenly two sides took the lead.

    Attributes
    ----------
    index : float
        Right first less left first, over both: -1 = always left, 0 = even, +1 = always right; NaN without a leader [1].
    left_first, right_first, together : int
        How often each was first, and neither [1].
    mean, deviation : float
        Mean and standard deviation of the signed delays; NaN for too few [s].
    n : int
        Delays that exist [1].
    unit : str
        What is counted by n.
    """

    index: float
    left_first: int
    right_first: int
    together: int
    mean: float
    deviation: float
    n: int
    unit: str


def lag_of(
    left: ArrayLike,
    right: ArrayLike,
    rate: float,
    *,
    longest: float = 0.5,
    relation: Relation = "mirrored",
    overlap: Overlap = "pearson",
) -> Lag:
    """Find the delay at which both sides are most alike, by cross-correlation.

    The best of all delays of whole samples is refined by the parabola through it and its neighbours (for instance
    Jacovitti and Scarano, IEEE Trans. Signal Process. 41:525, 1993).

    Parameters
    ----------
    left, right : array_like, shape (n,)
        Velocities of both sides, or any other signal of theirs [any].
    rate : float
        Samples per second [Hz].
    longest : float
        No longer delay is looked for [s].
    relation : {"mirrored", "alike"}
        Whether the sides agree when they go in opposite directions, as in a tilt, or in the same.
    overlap : {"pearson", "full"}
        At each delay, the correlation of the samples that overlap, or their covariance over that of the whole record,
        which favours short delays.

    Returns
    -------
    Lag
        All NaN if a side does not vary; no delay if the best one is at the end of the search, and no maximum.

    Raises
    ------
    ValueError
        If the sides have no equal length, or fewer than two samples overlap at the longest delay.
    """
    a, b = paired(left, right)
    b = _SIGNS[relation] * b
    reach = round(longest * rate)
    if reach < 1 or len(a) - reach < 2:
        raise ValueError(f"a delay of {longest} s takes more than {reach + 1} samples, found {len(a)}")
    if not (np.isfinite(a).all() and np.isfinite(b).all() and np.ptp(a) > 0.0 and np.ptp(b) > 0.0):
        return Lag(np.nan, np.nan, np.nan, len(a))
    values = _correlations(a, b, reach, overlap)
    best = int(np.nanargmax(values))
    place, height = _vertex(values, best)
    return Lag(float((place - reach) / rate), height, float(values[reach]), len(a))


def windowed_lags(
    left: ArrayLike,
    right: ArrayLike,
    rate: float,
    *,
    window: float = 1.0,
    step: float = 0.25,
    longest: float = 0.3,
    relation: Relation = "mirrored",
) -> tuple[NDArray[np.float64], tuple[Lag, ...]]:
    """Follow the delay through a record, window by window (Boker et al., Psychol. Methods 7:338, 2002).

    Parameters
    ----------
    left, right : array_like, shape (n,)
        Velocities of both sides, or any other signal of theirs [any].
    rate : float
        Samples per second [Hz].
    window : float
        Length of a window [s].
    step : float
        From one window to the next [s].
    longest : float
        No longer delay is looked for [s].
    relation : {"mirrored", "alike"}
        As in `lag_of`.

    Returns
    -------
    centres : ndarray of float64, shape (m,)
        Middles of the windows that are whole, from the first sample on [s].
    lags : tuple of Lag
        The delay in each [s].

    Raises
    ------
    ValueError
        If the sides have no equal length, or the window is too short for the delay.
    """
    a, b = paired(left, right)
    size, every = round(window * rate), max(1, round(step * rate))
    starts = range(0, len(a) - size + 1, every)
    lags = tuple(lag_of(a[i : i + size], b[i : i + size], rate, longest=longest, relation=relation) for i in starts)
    return (np.array(starts) + (size - 1) / 2) / rate, lags


def peak_delay(left: ArrayLike, right: ArrayLike, rate: float) -> float:
    """Take the delay between the peaks of both sides' velocities, each in its own direction.

    Parameters
    ----------
    left, right : array_like, shape (n,)
        Velocities of both sides in one movement [m/s].
    rate : float
        Samples per second [Hz].

    Returns
    -------
    float
        Left less right, + = right first; NaN where a side has its largest velocity at the first or last sample, or one
        is missing [s].

    Raises
    ------
    ValueError
        If the sides have no equal length.
    """
    sides = [_forward(side) for side in paired(left, right)]
    if not len(sides[0]):
        return np.nan
    places = [_vertex(side, int(np.argmax(side)))[0] for side in sides]
    return float((places[0] - places[1]) / rate)


def leadership(delays: ArrayLike, *, tolerance: float = 0.0, unit: str = "movement") -> Leadership:
    """Count who was first.

    Parameters
    ----------
    delays : array_like, shape (n,)
        Signed delays, + = right first; NaN are left out [s].
    tolerance : float
        Up to this both were first together [s].
    unit : str
        What each delay is of.

    Returns
    -------
    Leadership
        Counts, their index, and the mean delay with its spread.
    """
    signed = np.asarray(delays, dtype=float).ravel()
    signed = signed[np.isfinite(signed)]
    right, left = int((signed > tolerance).sum()), int((signed < -tolerance).sum())
    return Leadership(
        index=(right - left) / (right + left) if right + left else np.nan,
        left_first=left,
        right_first=right,
        together=len(signed) - left - right,
        mean=float(signed.mean()) if len(signed) else np.nan,
        deviation=float(signed.std(ddof=1)) if len(signed) > 1 else np.nan,
        n=len(signed),
        unit=unit,
    )


def _correlations(a: NDArray[np.float64], b: NDArray[np.float64], reach: int, overlap: Overlap) -> NDArray[np.float64]:
    """Correlate at delays of -reach to reach samples: element ``reach + k`` compares ``a[i + k]`` with ``b[i]``."""
    a, b = a - a.mean(), b - b.mean()
    n, lags = len(a), np.arange(-reach, reach + 1)
    products = correlate(a, b, method="fft")[n - 1 - reach : n + reach]
    # Not `a @ a`: its last bits depend on how many threads the linear algebra library may use.
    square_a, square_b = np.sum(a * a), np.sum(b * b)
    if overlap == "full":
        return np.asarray(products / np.sqrt(square_a * square_b))
    count, first, other = n - np.abs(lags), np.maximum(lags, 0), np.maximum(-lags, 0)
    sum_a, sum_b = _sums(a, first, count), _sums(b, other, count)
    vary_a = _sums(a * a, first, count) - sum_a**2 / count
    vary_b = _sums(b * b, other, count) - sum_b**2 / count
    # What is left of a constant stretch by rounding is not a variance.
    vary = np.where((vary_a > 1e-12 * square_a) & (vary_b > 1e-12 * square_b), vary_a * vary_b, np.nan)
    return np.asarray((products - sum_a * sum_b / count) / np.sqrt(vary))


def _sums(x: NDArray[np.float64], first: NDArray[np.int64], count: NDArray[np.int64]) -> NDArray[np.float64]:
    """Sum stretches of a signal."""
    total = np.concatenate([[0.0], np.cumsum(x)])
    return np.asarray(total[first + count] - total[first])


def _vertex(values: NDArray[np.float64], best: int) -> tuple[float, float]:
    """Return place and height of the parabola through a maximum and its neighbours; none at an end [sample, any]."""
    if not 0 < best < len(values) - 1 or not np.isfinite(values[best - 1 : best + 2]).all():
        return np.nan, float(values[best])
    before, here, after = values[best - 1 : best + 2]
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return float(best + shift), float(here - 0.25 * (before - after) * shift)


def _forward(velocity: NDArray[np.float64]) -> NDArray[np.float64]:
    """Count a velocity in the direction of the whole movement."""
    return velocity if velocity.sum() >= 0.0 else -velocity
