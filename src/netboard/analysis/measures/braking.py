"""The first braking movement: how far the ball is from the target, and how fast it comes, when it is first slowed down.

The paper's "strategy". After the initial movement, which tilts the board towards the target, the first movement of the
board counts that makes the ball accelerate away from the target. Distances and velocities are positive towards the
target, as it lies from the middle of the board: a ball that has passed its midpoint has a negative distance.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.measures.motion import Trial
from netboard.analysis.measures.segments import Segments

Braking = Literal["tilt", "rotation"]


@dataclass(frozen=True, slots=True)
class Strategy:
    """First braking movement of a trial; NaN throughout where there is none, or where a hole may hide an earlier one.

    Attributes
    ----------
    distance : float
        From the ball to the midpoint of the target at its onset, + = before it [m].
    velocity : float
        Of the ball towards the target at its onset [m/s].
    onset : float
        When it begins, from the release on [s].
    initial : float
        When the initial movement begins, from the release on; NaN where there is none [s].
    wrong_way : float
        Movements of the board before that, which turn it the wrong way [1].
    """

    distance: float
    velocity: float
    onset: float
    initial: float
    wrong_way: float

    @property
    def absolute_distance(self) -> float:
        """The distance, whatever side of the midpoint the ball is on [m]."""
        return abs(self.distance)


def first_braking(
    segments: Segments,
    theta: NDArray[np.float64],
    p: NDArray[np.float64],
    vp: NDArray[np.float64],
    rate: float,
    trial: Trial,
    *,
    braking: Braking = "tilt",
) -> Strategy:
    """Ball's distance and velocity at the onset of the first braking movement.

    Parameters
    ----------
    segments : Segments
        Movements of the board; those that begin in the trial are looked at.
    theta : ndarray, shape (n,)
        Tilt, + = right end up [rad].
    p : ndarray, shape (n,)
        Ball along the board, + = right [m].
    vp : ndarray, shape (n,)
        Its rate [m/s].
    rate : float
        Samples per second [Hz].
    trial : Trial
        Where the trial lies in these arrays.
    braking : {"tilt", "rotation"}
        What a braking movement does after the initial one: turn the board back until its tilt accelerates the ball away
        from the target, or turn it back at all, so that levelling it counts.
    """
    own = segments.of_trial(trial)
    holes = np.flatnonzero(np.isnan(theta[trial.release : trial.stop]))
    if holes.size:  # whatever comes after one need not be the first
        own = own.where(own.first < trial.release + holes[0])
    back = own.direction == trial.side  # the end at the target goes up
    towards = np.flatnonzero(own.direction == -trial.side)
    if towards.size == 0:
        return Strategy(
            float("nan"), float("nan"), float("nan"), float("nan"), float("nan") if holes.size else len(own)
        )
    initial = int(towards[0])
    brakes = back & (np.arange(len(own)) > initial)
    if braking == "tilt":
        brakes &= trial.side * theta[own.stop - 1] > 0
    began = float(own.first[initial] - trial.release) / rate
    if not brakes.any():
        return Strategy(float("nan"), float("nan"), float("nan"), began, initial)
    onset = int(own.first[np.argmax(brakes)])
    return Strategy(
        distance=trial.side * (trial.target - float(p[onset])),
        velocity=trial.side * float(vp[onset]),
        onset=(onset - trial.release) / rate,
        initial=began,
        wrong_way=initial,
    )
