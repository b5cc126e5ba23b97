"""Movements of the board: segments with one direction and at least a minimum rate, duration and angle.

Segments are found in a whole recording, so that the limits of a trial cut none. A trial owns those that begin in it.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from netboard.analysis.measures.motion import Trial
from netboard.analysis.measures.signals import lasting

Turning = Literal["one_way", "either_way"]
Angle = Literal["net", "range", "integral"]

MIN_RATE = float(np.radians(1.0))
"""Minimum angular speed of a movement of the board [rad/s]."""

SHORTEST = 0.1
"""Minimum duration of a movement of the board [s]."""

MIN_ANGLE = float(np.radians(1.0))
"""Minimum angle of a movement of the board [rad]."""


@dataclass(frozen=True, slots=True)
class Segments:
    """Movements of the board, in order.

    Attributes
    ----------
    first, stop : ndarray of int64, shape (k,)
        First sample of each, and the sample after its last [1].
    angle : ndarray, shape (k,)
        Angle of each movement, + = counter-clockwise, right end up [rad].
    cut : ndarray of bool, shape (k,)
        Whether it may begin earlier or end later than known: it touches an end of the recording or a gap, or (in
        `of_trial`) ends after the trial [1].
    """

    first: NDArray[np.int64]
    stop: NDArray[np.int64]
    angle: NDArray[np.float64]
    cut: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.first)

    @property
    def direction(self) -> NDArray[np.float64]:
        """Direction of each movement: +1 counter-clockwise, -1 clockwise [1]."""
        return np.sign(self.angle)

    def where(self, chosen: NDArray[np.bool_]) -> "Segments":
        """Return the chosen movements.

        Parameters
        ----------
        chosen : ndarray of bool, shape (k,)
            Mask of the chosen movements [1].
        """
        return Segments(self.first[chosen], self.stop[chosen], self.angle[chosen], self.cut[chosen])

    def of_trial(self, trial: Trial) -> "Segments":
        """Return the movements that begin in a trial."""
        own = slice(*np.searchsorted(self.first, (trial.release, trial.stop)).tolist())
        stop = self.stop[own]
        return Segments(self.first[own], stop, self.angle[own], self.cut[own] | (stop > trial.stop))


def _angles(
    theta: NDArray[np.float64], omega: NDArray[np.float64], bounds: NDArray[np.int64], rate: float, angle: Angle
) -> NDArray[np.float64]:
    first, last = bounds[:, 0], bounds[:, 1] - 1
    if angle == "net":
        return np.asarray(theta[last] - theta[first])
    turned = cumulative_trapezoid(np.nan_to_num(omega), dx=1 / rate, initial=0)
    integral = turned[last] - turned[first]
    if angle == "integral":
        return np.asarray(integral)
    ranges = np.array([np.ptp(theta[begin:stop]) for begin, stop in bounds])
    return np.asarray(np.sign(integral) * ranges)


def board_segments(
    omega: NDArray[np.float64],
    theta: NDArray[np.float64],
    rate: float,
    *,
    turning: Turning = "one_way",
    angle: Angle = "net",
    least_rate: float = MIN_RATE,
    shortest: float = SHORTEST,
    least_angle: float = MIN_ANGLE,
) -> Segments:
    """Find the movements of the board: faster than 1 degree/s for at least 100 ms, over at least 1 degree.

    Parameters
    ----------
    omega : ndarray, shape (n,)
        Angular velocity, filtered by the slow filter [rad/s].
    turning : {"one_way", "either_way"}
        Whether a movement ends where the board reverses, or only where it is slow. A filtered velocity passes zero in
        between, so the two hardly differ.
    angle : {"net", "range", "integral"}
        Angle of a movement: final minus initial tilt, largest minus smallest tilt, or the integral of `omega`.
    least_rate : float
        Minimum angular speed of a movement of the board [rad/s].
    shortest : float
        Minimum duration, as defined by `netboard.analysis.measures.signals.lasting` [s].
    least_angle : float
        Minimum angle of a movement, measured as `angle` says [rad].
    """
    if omega.shape != theta.shape or omega.ndim != 1:
        raise ValueError("the board's tilt and its rate must have one value each for every sample")
    fast = np.abs(omega) > least_rate
    if turning == "one_way":
        bounds = np.concatenate([lasting(fast & way, shortest, rate) for way in (omega > 0, omega < 0)])
        bounds = bounds[np.argsort(bounds[:, 0])]
    else:
        bounds = lasting(fast, shortest, rate)
    angles = _angles(theta, omega, bounds, rate, angle)
    far = np.abs(angles) >= least_angle
    bounds, angles = bounds[far], angles[far]
    beyond = np.concatenate([[np.nan], omega, [np.nan]])
    cut = np.isnan(beyond[bounds[:, 0]]) | np.isnan(beyond[bounds[:, 1] + 1])
    return Segments(bounds[:, 0], bounds[:, 1], angles, cut)
