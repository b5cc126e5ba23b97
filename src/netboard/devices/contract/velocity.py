"""Velocity from encoder positions: first-order adaptive windowing (Janabi-Sharifi, Hayward, Chen 2000).

The velocity is the slope from the newest position back to the oldest one for which all positions in between lie within
one encoder step of the straight line. Fast movements therefore use few samples, with little delay; slow ones use many,
with little noise. The estimate lags by half the window.

The longest window is a compromise. At 1 kHz, `SAMPLES` readings turn a single encoder step of a Touch into 7 mm/s,
which no longer shakes the paper's light board. The estimate is at most 4 ms late, which leaves the virtual coupling its
delay margin (CHAI3D's 15 ms window would halve it). `netboard.devices.contract.estimators` has other estimators for
comparison.
"""

from collections.abc import Callable, Mapping
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, inlined, kernel
from netboard.devices.contract import estimators
from netboard.devices.contract.estimators import Estimator
from netboard.physics.arithmetic.simd import gathered, lane, lanes_at, larger, put, smaller, where_within

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


_windowed = make_windowed(AXES)

WINDOW = np.dtype(
    [
        ("band", "<f8"),  # largest deviation of a position from the line [m]
        ("count", "<i8"),  # stored positions [1]
        ("stamps", "<i8", (SAMPLES,)),  # times of the last positions, newest first [ns]
        ("places", "<f8", (SAMPLES, AXES)),  # these positions [m]
    ]
)
"""Positions from which the velocity of one stylus is estimated."""


@kernel
def windowed_velocity(window: Records, stamp_ns: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Add a position to an array of one `WINDOW`, and return the velocity x, y, z; see `Estimator.update` [m/s]."""
    w = window[0]
    newest = gathered((x, y, z), AXES)
    w["count"], velocity = _windowed(w["stamps"], w["places"], w["count"], w["band"], stamp_ns, newest)
    return lane(velocity, 0), lane(velocity, 1), lane(velocity, 2)


@final
class Velocimeter(Estimator):
    """Adaptive-windowing estimator of stylus velocity; the velocity is 0 until the second position.

    ``resolution``: size of one encoder step, 0 for none [m].
    """

    def __init__(self, resolution: float) -> None:
        window = np.zeros(1, WINDOW)
        window["band"] = SLACK * resolution
        super().__init__(windowed_velocity, window)

    def forget(self) -> None:
        """Forget all positions."""
        self.state["count"] = 0


KINDS: Mapping[str, Callable[[float], Estimator]] = {
    "adaptive": Velocimeter,
    "chai3d": lambda resolution: estimators.chai3d(),
    "difference": lambda resolution: estimators.difference(),
    "alpha_beta": lambda resolution: estimators.alpha_beta(),
    "kalman": estimators.kalman,
}
"""Constructor of each kind of estimator, called with the encoder step [m]."""


def make(kind: str, resolution: float) -> Estimator | None:
    """Create the estimator named by ``agents.<side>.velocity``; None for ``device``, which has its own estimate.

    ``resolution``: size of one encoder step, 0 for none [m].
    """
    return None if kind == "device" else KINDS[kind](resolution)
