"""Movement classes of two sides at an instant: cooperative, competitive, single, or still.

Opposite directions are cooperative and equal directions competitive, by their effect on the board's tilt. Two sides
that agree to lift the board are therefore competitive by the paper's rule.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

AtLimit = Literal["moving", "still"]
Average = Literal["trials", "time"]

STILL_BELOW = 0.003
"""Speed below which a stylus is still [m/s]."""


class Movement(IntEnum):
    """Movement class of a sample; `UNKNOWN` if a velocity is missing."""

    UNKNOWN = -1
    STILL = 0
    LEFT_ONLY = 1
    RIGHT_ONLY = 2
    COMPETITIVE = 3
    COOPERATIVE = 4


def classify(
    left_vz: NDArray[np.float64],
    right_vz: NDArray[np.float64],
    *,
    still_below: float = STILL_BELOW,
    at_limit: AtLimit = "moving",
) -> NDArray[np.int8]:
    """Return the movement class of each sample.

    Parameters
    ----------
    left_vz, right_vz : ndarray, shape (n,)
        Vertical velocities of the styluses [m/s].
    still_below : float
        Speed below which a stylus is still [m/s].
    at_limit : {"moving", "still"}
        Class of a stylus whose speed equals `still_below`.

    Returns
    -------
    ndarray of int8, shape (n,)
        `Movement` of each sample [1].
    """

    def direction(vz: NDArray[np.float64]) -> NDArray[np.float64]:
        speed = np.abs(vz)
        moves = speed >= still_below if at_limit == "moving" else speed > still_below
        return np.where(np.isnan(vz), np.nan, np.sign(vz) * moves)

    left, right = direction(left_vz), direction(right_vz)
    product = left * right
    conditions = [np.isnan(product), product < 0, product > 0, left != 0, right != 0]
    kinds = [
        Movement.UNKNOWN,
        Movement.COOPERATIVE,
        Movement.COMPETITIVE,
        Movement.LEFT_ONLY,
        Movement.RIGHT_ONLY,
    ]
    return np.select(conditions, [np.int8(kind) for kind in kinds], np.int8(Movement.STILL))


@dataclass(frozen=True, slots=True)
class MovementTimes:
    """Durations of the movement classes.

    Attributes
    ----------
    cooperative, competitive, single, still : float
        Durations of the paper's four classes [s].
    left_only, right_only : float
        Durations of the two parts of single movement [s].
    unknown : float
        Duration without known velocities [s].
    """

    cooperative: float
    competitive: float
    single: float
    still: float
    left_only: float
    right_only: float
    unknown: float

    @property
    def seconds(self) -> NDArray[np.float64]:
        """Durations of cooperative, competitive, single movement and stillness, shape (4,) [s]."""
        return np.array([self.cooperative, self.competitive, self.single, self.still])

    @property
    def shares(self) -> NDArray[np.float64]:
        """Shares of the four classes in their sum, shape (4,); NaN for a zero sum [1]."""
        return shares(self.seconds)


def movement_times(classes: NDArray[np.int8], rate: float) -> MovementTimes:
    """Return the durations of the movement classes in a trial; all NaN if no velocity is known.

    Parameters
    ----------
    classes : ndarray of int8, shape (n,)
        Classes from `classify`, of the analysed samples of one trial [1].
    """
    counts = np.bincount(classes.astype(np.int64) + 1, minlength=len(Movement)) / rate
    if counts[0] and not counts[1:].any():
        counts[1:] = np.nan
    time = {kind: float(counts[kind + 1]) for kind in Movement}
    return MovementTimes(
        cooperative=time[Movement.COOPERATIVE],
        competitive=time[Movement.COMPETITIVE],
        single=time[Movement.LEFT_ONLY] + time[Movement.RIGHT_ONLY],
        still=time[Movement.STILL],
        left_only=time[Movement.LEFT_ONLY],
        right_only=time[Movement.RIGHT_ONLY],
        unknown=time[Movement.UNKNOWN],
    )


def shares(seconds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the share of each class.

    Parameters
    ----------
    seconds : ndarray, shape (..., 4)
        Duration of each class [s].

    Returns
    -------
    ndarray, shape (..., 4)
        Shares with the sum 1; NaN for a zero duration [1].
    """
    total = seconds.sum(axis=-1, keepdims=True)
    return np.asarray(np.divide(seconds, total, out=np.full(seconds.shape, np.nan), where=total > 0))


def mean_shares(
    seconds: NDArray[np.float64], people: NDArray[np.int64] | None = None, *, of: Average = "trials"
) -> NDArray[np.float64]:
    """Return mean shares of a condition, averaged within participants or dyads and then over them.

    Parameters
    ----------
    seconds : ndarray, shape (n, 4)
        Duration of each class in each trial [s].
    people : ndarray of int64, shape (n,), optional
        Participant or dyad of each trial; without it all trials belong to one [1].
    of : {"trials", "time"}
        Weighting within a participant: every trial counts equally, or every second, so that long trials dominate.

    Returns
    -------
    ndarray, shape (4,)
        Mean shares; NaN without trials [1].
    """
    whose = np.zeros(len(seconds), np.int64) if people is None else people
    each = []
    for person in np.unique(whose):
        own = seconds[whose == person]
        if of == "time":
            each.append(shares(own[np.isfinite(own).all(axis=1)].sum(axis=0)))
        else:
            known = shares(own)[own.sum(axis=1) > 0]
            each.append(known.mean(axis=0) if len(known) else np.full(4, np.nan))
    found = np.array([row for row in each if not np.isnan(row).any()])
    return np.asarray(found.mean(axis=0)) if len(found) else np.full(4, np.nan)
