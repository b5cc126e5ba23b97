"""Response to a push: how far what was pushed goes, and when it is half-way back.

A deviation is the difference between a course with a push and the same course without it, from the onset of the push.
"""

from dataclasses import dataclass
from math import nan

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class PushResponse:
    """Response to a push; all NaN if the deviation has gaps.

    Attributes
    ----------
    peak : float
        Largest deviation in the direction of the push; 0 if there is none [its own].
    at : float
        Time of the peak after the onset; NaN without a peak [s].
    half_back : float
        Time after the onset at which the deviation has fallen to half of the peak; NaN if it has not [s].
    """

    peak: float
    at: float
    half_back: float


def push_response(deviation: NDArray[np.float64], rate: float) -> PushResponse:
    """Return the response to a push.

    The time at which the deviation is half-way back is interpolated linearly between two samples.

    Parameters
    ----------
    deviation : ndarray, shape (n,)
        Deviation from the course without the push, + = in the direction of the push, from the onset on [any].
    """
    if not len(deviation) or not np.isfinite(deviation).all():
        return PushResponse(nan, nan, nan)
    top = int(np.argmax(deviation))
    peak = float(deviation[top])
    if peak <= 0.0:
        return PushResponse(0.0, nan, nan)
    below = np.flatnonzero(deviation[top:] <= 0.5 * peak)
    if not below.size:
        return PushResponse(peak, top / rate, nan)
    after = top + int(below[0])
    high, low = float(deviation[after - 1]), float(deviation[after])
    return PushResponse(peak, top / rate, (after - 1 + (high - 0.5 * peak) / (high - low)) / rate)
