"""Velocity from encoder positions: first-order adaptive windowing (Janabi-Sharifi, Hayward, Chen 2000).

The velocity is the slope from the newest position back to the oldest one for which all positions in between lie within
one encoder step of the straight line. Fast movements therefore use few samples, with little delay; slow ones use many,
with little noise. The estimate lags by half the window.

The longest window is a compromise. At 1 kHz, `SAMPLES` readings turn a single encoder step of a Touch into 7 mm/s,
which no longer shakes the paper's light board. The estimate is at most 4 ms late, which leaves the virtual coupling its
delay margin (CHAI3D's 15 ms window would halve it).
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.physics.arithmetic.simd import gathered, lanes_at, larger, put, smaller, where_within

SAMPLES = 9
"""Number of stored positions, one more than the intervals in the longest window [1]."""

AXES = 4
"""Axes of a stored position: x, y, z, and one that fills a vector register [1]."""

SLACK = 1.01
"""Width of the band in encoder steps, slightly more than one to allow for rounding [1]."""


def make_windowed(LANES: int) -> Callable[..., tuple[int, Any]]:
    """Compile the estimator for a number of lanes: one for each axis of one stylus or of several read at once."""

    @inlined
    def windowed(
        stamps: NDArray[np.int64], places: NDArray[np.float64], count: int, band: float, stamp_ns: int, newest: Any
    ) -> tuple[int, Any]:
        """Add a position to the stored ones; return their number and the velocities [m/s].

        ``stamps``, ``places``: times [ns] and positions [m] of the last `SAMPLES`, newest first, changed in place;
        ``count`` of them are valid. ``band``: largest deviation of a position from the line [m]. ``stamp_ns``: time of
        the new position ``newest``; one that is not later than the newest replaces it.

        A line from the newest position fits an older one if its slope is within ``band / elapsed time`` of the slope
        between the two. So one pass suffices, which narrows the interval of the slopes that fit all positions so far,
        and moves each position to the next place. ``ended`` is not 0 for an axis whose window has ended. There are no
        branches, because a processor predicts the ends of several windows badly.
        """
        if count > 0 and stamp_ns <= stamps[0]:
            stamp_ns = stamps[0]
            count -= 1
            for k in range(count):
                stamps[k] = stamps[k + 1]
                put(places, LANES * k, lanes_at(places, LANES * (k + 1), LANES))
        best = ended = gathered((0.0,), LANES)
        lowest, highest = best - np.inf, best + np.inf
        following, following_ns = lanes_at(places, 0, LANES), stamps[0]
        put(places, 0, newest)
        stamps[0] = stamp_ns
        count = min(count + 1, SAMPLES)
        for last in range(1, count):
            older, older_ns = following, following_ns
            following, following_ns = lanes_at(places, LANES * last, LANES), stamps[last]
            put(places, LANES * last, older)
            stamps[last] = older_ns
            per_second = 1e9 / (stamp_ns - older_ns)
            rate = (newest - older) * per_second
            ended = where_within(rate, lowest, highest, ended, 1.0)
            best = where_within(ended, 0.0, 0.0, rate, best)
            lowest = larger(lowest, rate - band * per_second)
            highest = smaller(highest, rate + band * per_second)
        return count, best

    return windowed
