"""Delays between the two sides of a movement or period, and leadership.

A delay is the left side's time minus the right side's: positive if the right side was first. Two sides that tilt the
board move in opposite directions, so by default the left side is compared with the mirrored right side. Delays are
interpolated between samples, because 1 ms is too coarse for differences of a few milliseconds.

The paper's threshold delays are in `netboard.analysis.measures.cooperation`.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import irfft, next_fast_len, rfft

from netboard.analysis.measures.signals import paired
from netboard.base.compiled import kernel

Relation = Literal["mirrored", "alike"]
Overlap = Literal["pearson", "full"]

_SIGNS = {"mirrored": -1.0, "alike": 1.0}


@dataclass(frozen=True, slots=True)
class Lag:
    """Delay at which two signals correlate most.

    Attributes
    ----------
    delay : float
        Left time minus right time, + = right first; NaN without a maximum in the search range [s].
    coefficient : float
        Correlation at that delay [1].
    at_once : float
        Correlation at zero delay [1].
    n : int
        Number of samples of each side [1].
    unit : str
        Unit that n counts.
    """

    delay: float
    coefficient: float
    at_once: float
    n: int
    unit: str = "sample"


@dataclass(frozen=True, slots=True)
class Leadership:
    """Balance of leadership between two sides.

    Attributes
    ----------
    index : float
        (Right first - left first) / (right first + left first): -1 = always left, 0 = even, +1 = always right; NaN
        without a leader [1].
    left_first, right_first, together : int
        Counts of left first, right first, and neither [1].
    mean, deviation : float
        Mean and standard deviation of the signed delays; NaN for too few delays [s].
    n : int
        Number of known delays [1].
    unit : str
        Unit that n counts.
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
    """Find the delay of largest cross-correlation between both sides.

    The best whole-sample delay is refined by the parabola through it and its neighbours (for instance Jacovitti and
    Scarano, IEEE Trans. Signal Process. 41:525, 1993).

    Parameters
    ----------
    longest : float
        Largest delay in the search; two or more samples must overlap there [s].
    overlap : {"pearson", "full"}
        At each delay, the correlation of the overlapping samples, or their covariance divided by that of the whole
        record, which favours short delays.

    Returns
    -------
    Lag
        All NaN if a side does not vary; the delay is NaN if the best one lies at the end of the search range and is no
        maximum.
    """
    a, b = paired(left, right)
    b = _SIGNS[relation] * b
    reach = round(longest * rate)
    if reach < 1 or len(a) - reach < 2:
        raise ValueError(f"a delay of {longest} s takes more than {reach + 1} samples, found {len(a)}")
    if not (np.isfinite(a).all() and np.isfinite(b).all() and np.ptp(a) > 0.0 and np.ptp(b) > 0.0):
        return Lag(np.nan, np.nan, np.nan, len(a))
    values = _correlations(a, b, reach, overlap)
    if np.isnan(values).all():  # a side varies by so little that its variance is rounded to 0
        return Lag(np.nan, np.nan, np.nan, len(a))
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
    """Compute the delay in sliding windows (Boker et al., Psychol. Methods 7:338, 2002).

    Parameters
    ----------
    window : float
        Length of a window; a window that the signals do not fill is left out [s].
    step : float
        Time from the start of a window to that of the next; they overlap if it is shorter than `window` [s].
    longest : float
        Largest delay in the search, shorter than the window [s].

    Returns
    -------
    centres : ndarray of float64, shape (m,)
        Centre times of the complete windows, from the first sample [s].
    lags : tuple of Lag
        Delay in each window [s].
    """
    a, b = paired(left, right)
    size, every = round(window * rate), max(1, round(step * rate))
    starts = range(0, len(a) - size + 1, every)
    lags = tuple(lag_of(a[i : i + size], b[i : i + size], rate, longest=longest, relation=relation) for i in starts)
    return (np.array(starts) + (size - 1) / 2) / rate, lags


def peak_delay(left: ArrayLike, right: ArrayLike, rate: float) -> float:
    """Return left minus right time of the velocity peaks of both sides, each in its own direction, + = right first [s].

    NaN if a side has its largest velocity at the first or last sample, or a sample is missing.
    """
    sides = [_forward(side) for side in paired(left, right)]
    if not len(sides[0]):
        return np.nan
    places = [_vertex(side, int(np.argmax(side)))[0] for side in sides]
    return float((places[0] - places[1]) / rate)


def leadership(delays: ArrayLike, *, tolerance: float = 0.0, unit: str = "movement") -> Leadership:
    """Count how often each side was first.

    Parameters
    ----------
    delays : array_like, shape (n,)
        Signed delays, + = right first; NaN are ignored [s].
    tolerance : float
        Largest absolute delay that counts as simultaneous [s].
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
    size = next_fast_len(len(a) + reach, real=True)  # so that no delay of the search wraps around
    around = irfft(rfft(a, size) * np.conj(rfft(b, size)), size)
    products = np.concatenate([around[size - reach :], around[: reach + 1]])
    # Not `a @ a`: its last bits depend on the number of threads of the linear algebra library.
    square_a, square_b = np.sum(a * a), np.sum(b * b)
    if overlap == "full":
        return np.asarray(products / np.sqrt(square_a * square_b))
    values = np.empty(2 * reach + 1)
    _normalise(products, a, b, float(square_a), float(square_b), values)
    return values


@kernel
def _normalise(
    products: NDArray[np.float64],
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    square_a: float,
    square_b: float,
    values: NDArray[np.float64],
) -> None:
    """Write Pearson's coefficient of the overlapping samples at each delay, from the sums of products."""
    n, reach = len(a), len(products) // 2
    total_a, total_b, total_aa, total_bb = np.empty(n + 1), np.empty(n + 1), np.empty(n + 1), np.empty(n + 1)
    total_a[0] = total_b[0] = total_aa[0] = total_bb[0] = 0.0
    total_a[1], total_b[1], total_aa[1], total_bb[1] = a[0], b[0], a[0] * a[0], b[0] * b[0]
    for k in range(1, n):
        total_a[k + 1], total_aa[k + 1] = total_a[k] + a[k], total_aa[k] + a[k] * a[k]
        total_b[k + 1], total_bb[k + 1] = total_b[k] + b[k], total_bb[k] + b[k] * b[k]
    for place in range(len(products)):
        lag = place - reach
        count, first, other = n - abs(lag), max(lag, 0), max(-lag, 0)
        sum_a, sum_b = total_a[first + count] - total_a[first], total_b[other + count] - total_b[other]
        vary_a = total_aa[first + count] - total_aa[first] - sum_a * sum_a / count
        vary_b = total_bb[other + count] - total_bb[other] - sum_b * sum_b / count
        # Rounding leaves a residue on constant signals, which is not a variance.
        varies = vary_a > 1e-12 * square_a and vary_b > 1e-12 * square_b
        vary = vary_a * vary_b if varies else np.nan
        values[place] = (products[place] - sum_a * sum_b / count) / np.sqrt(vary)


def _vertex(values: NDArray[np.float64], best: int) -> tuple[float, float]:
    """Return vertex and height of the parabola through a maximum and its neighbours; none at an end [sample, any]."""
    if not 0 < best < len(values) - 1 or not np.isfinite(values[best - 1 : best + 2]).all():
        return np.nan, float(values[best])
    before, here, after = values[best - 1 : best + 2]
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return float(best + shift), float(here - 0.25 * (before - after) * shift)


def _forward(velocity: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a velocity with the sign of the whole movement."""
    return velocity if velocity.sum() >= 0.0 else -velocity
