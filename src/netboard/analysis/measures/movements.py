"""How two sides move at one instant: in opposite directions, in the same one, one of them only, or not at all.

The paper calls the first cooperative and the second competitive, by what they do to the tilt of the board. Two sides
that agree to lift the board are competitive by that rule.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

AtLimit = Literal["moving", "still"]
Average = Literal["trials", "time"]

STILL_BELOW = 0.003
"""A stylus that is slower does not move [m/s]."""


class Movement(IntEnum):
    """Class of a sample; `UNKNOWN` where a velocity is missing."""

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
    """Class of the movement at each sample.

    Parameters
    ----------
    left_vz, right_vz : ndarray, shape (n,)
        Rates of the styluses' heights [m/s].
    still_below : float
        A stylus that is slower does not move [m/s].
    at_limit : {"moving", "still"}
        What a stylus does that is exactly as fast.

    Returns
    -------
    ndarray of int8, shape (n,)
        A `Movement` each [1].
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
    """For how long there was each class of movement.

    Attributes
    ----------
    cooperative, competitive, single, still : float
        Time in the paper's four classes [s].
    left_only, right_only : float
        The two parts of the single movement [s].
    unknown : float
        Time without velocities [s].
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
        """Time of cooperative, competitive, single movement and stillness, shape (4,) [s]."""
        return np.array([self.cooperative, self.competitive, self.single, self.still])

    @property
    def shares(self) -> NDArray[np.float64]:
        """The same as shares of their sum, shape (4,); NaN if there is nothing [1]."""
        return shares(self.seconds)


def movement_times(classes: NDArray[np.int8], rate: float) -> MovementTimes:
    """Time of each class of movement in a trial; NaN for all of them if no velocity is known.

    Parameters
    ----------
    classes : ndarray of int8, shape (n,)
        From `classify`, of the samples of one trial that are looked at [1].
    rate : float
        Samples per second [Hz].
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
    """Share of each class.

    Parameters
    ----------
    seconds : ndarray, shape (..., 4)
        Time of each class [s].

    Returns
    -------
    ndarray, shape (..., 4)
        Shares with the sum 1; NaN where there is no time at all [1].
    """
    total = seconds.sum(axis=-1, keepdims=True)
    return np.asarray(np.divide(seconds, total, out=np.full(seconds.shape, np.nan), where=total > 0))


def mean_shares(
    seconds: NDArray[np.float64], people: NDArray[np.int64] | None = None, *, of: Average = "trials"
) -> NDArray[np.float64]:
    """Mean shares of a condition: of trials within a person or dyad, then of those.

    Parameters
    ----------
    seconds : ndarray, shape (n, 4)
        Time of each class in each trial [s].
    people : ndarray of int64, shape (n,), optional
        Whose trial it is; without it all are one person's [1].
    of : {"trials", "time"}
        What counts the same within a person: every trial, or every second, by which long trials dominate.

    Returns
    -------
    ndarray, shape (4,)
        The shares; NaN without a trial [1].
    """
    whose = np.zeros(len(seconds), np.int64) if people is None else people
    each = []
    for person in np.unique(whose):
        own = seconds[whose == person]
        if of == "time":
            each.append(shares(own.sum(axis=0)))
        else:
            known = shares(own)[own.sum(axis=1) > 0]
            each.append(known.mean(axis=0) if len(known) else np.full(4, np.nan))
    found = np.array([row for row in each if not np.isnan(row).any()])
    return np.asarray(found.mean(axis=0)) if len(found) else np.full(4, np.nan)
