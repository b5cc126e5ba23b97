"""First braking movement: the ball's distance and velocity when it is first slowed down before the target.

The paper calls this the strategy. The initial movement tilts the board towards the target. The braking movement is the
first one after it that makes the ball accelerate away from the target. Distance and velocity are positive towards the
target, as seen from the middle of the board; a ball past the target's midpoint has a negative distance.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.measures.motion import Trial
from netboard.analysis.measures.segments import Segments
from netboard.analysis.measures.signals import is_whole

Braking = Literal["tilt", "rotation"]


@dataclass(frozen=True, slots=True)
class Strategy:
    """First braking movement of a trial; all NaN if there is none or if a gap may hide an earlier one.

    Attributes
    ----------
    distance : float
        Distance from the ball to the midpoint of the target at onset, + = before it [m].
    velocity : float
        Velocity of the ball towards the target at onset [m/s].
    onset : float
        Onset time after the release [s].
    initial : float
        Onset of the initial movement after the release; NaN without one [s].
    wrong_way : float
        Number of board movements before the initial one that tilt the board away from the target [1].
    """

    distance: float
    velocity: float
    onset: float
    initial: float
    wrong_way: float

    @property
    def absolute_distance(self) -> float:
        """Absolute distance from the ball to the midpoint of the target [m]."""
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
    """Return the ball's distance and velocity at the onset of the first braking movement.

    Parameters
    ----------
    segments : Segments
        Movements of the board; only those that begin in the trial count.
    braking : {"tilt", "rotation"}
        Definition of a braking movement: it turns the board back until the tilt accelerates the ball away from the
        target, or it turns the board back at all, so that levelling the board counts.
    """
    movements, within = segments.of_trial(trial), theta[trial.release : trial.stop]
    whole = is_whole(within)
    if not whole:  # a movement after a gap may not be the first
        movements = movements.where(movements.first < trial.release + np.argmin(np.isfinite(within)))
    directions = movements.direction.tolist()
    initial = next((k for k, way in enumerate(directions) if way == -trial.side), None)
    if initial is None:
        return Strategy(np.nan, np.nan, np.nan, np.nan, len(movements) if whole else np.nan)
    # A braking movement raises the end of the board at the target.
    later = [k for k in range(initial + 1, len(movements)) if directions[k] == trial.side]
    if braking == "tilt":
        later = [k for k in later if trial.side * theta[movements.stop[k] - 1] > 0]
    initial_onset = float(movements.first[initial] - trial.release) / rate
    if not later:
        return Strategy(np.nan, np.nan, np.nan, initial_onset, initial)
    onset = int(movements.first[later[0]])
    return Strategy(
        distance=trial.side * (trial.target - float(p[onset])),
        velocity=trial.side * float(vp[onset]),
        onset=(onset - trial.release) / rate,
        initial=initial_onset,
        wrong_way=initial,
    )
