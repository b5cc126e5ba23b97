"""Movement classes of two sides at an instant: cooperative, competitive, single, or still.

Opposite directions are cooperative and equal directions competitive, by their effect on the board's tilt. Two sides
that agree to lift the board are therefore competitive by the paper's rule.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.measures.signals import paired
from netboard.base.compiled import inlined, kernel

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


# Plain integers, which Numba folds into the kernel below.
_UNKNOWN, _STILL, _LEFT_ONLY, _RIGHT_ONLY, _COMPETITIVE, _COOPERATIVE = map(int, Movement)


def classify(
    left_vz: NDArray[np.float64],
    right_vz: NDArray[np.float64],
    *,
    still_below: float = STILL_BELOW,
    at_limit: AtLimit = "moving",
) -> NDArray[np.int8]:
    """Return the `Movement` of each sample, shape (n,) [1].

    Parameters
    ----------
    still_below : float
        Speed below which a stylus is still [m/s].
    at_limit : {"moving", "still"}
        Class of a stylus whose speed equals `still_below`.
    """
    left, right = paired(left_vz, right_vz)
    kinds = np.empty(left.size, np.int8)
    _classify(np.ascontiguousarray(left), np.ascontiguousarray(right), float(still_below), at_limit == "moving", kinds)
    return kinds


@kernel
def _classify(
    left: NDArray[np.float64],
    right: NDArray[np.float64],
    still_below: float,
    limit_moves: bool,
    kinds: NDArray[np.int8],
) -> None:
    for n in range(len(left)):
        one, other = _direction(left[n], still_below, limit_moves), _direction(right[n], still_below, limit_moves)
        if np.isnan(left[n]) or np.isnan(right[n]):
            kinds[n] = _UNKNOWN
        elif one * other != 0:
            kinds[n] = _COOPERATIVE if one * other < 0 else _COMPETITIVE
        else:
            kinds[n] = _LEFT_ONLY if one != 0 else _RIGHT_ONLY if other != 0 else _STILL


@inlined
def _direction(vz: float, still_below: float, limit_moves: bool) -> int:
    """Return in which direction a side moves: -1 or 1, or 0 if it does not [1]."""
    speed = abs(vz)
    moves = speed >= still_below if limit_moves else speed > still_below
    return int(moves) * (int(vz > 0.0) - int(vz < 0.0))


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
    counts = _counted(np.ascontiguousarray(classes), len(Movement)) / rate
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


@kernel
def _counted(classes: NDArray[np.int8], count: int) -> NDArray[np.int64]:
    """Return the number of samples of each class, of the unknown ones first."""
    counts = np.zeros(count, np.int64)
    for kind in classes:
        counts[kind + 1] += 1
    return counts


def shares(seconds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the share of each class, shape (..., 4), with the sum 1; NaN for a zero duration [1].

    Parameters
    ----------
    seconds : ndarray, shape (..., 4)
        Duration of each class [s].
    """
    total = seconds.sum(axis=-1, keepdims=True)
    return np.asarray(np.divide(seconds, total, out=np.full(seconds.shape, np.nan), where=total > 0))


def mean_shares(
    seconds: NDArray[np.float64], people: NDArray[np.int64] | None = None, *, of: Average = "trials"
) -> NDArray[np.float64]:
    """Return the mean shares of a condition, shape (4,); NaN without trials [1].

    They are averaged within participants or dyads and then over them; without `people`, all trials belong to one.

    Parameters
    ----------
    seconds : ndarray, shape (n, 4)
        Duration of each class in each trial [s].
    of : {"trials", "time"}
        Weighting within a participant: every trial counts equally, or every second, so that long trials dominate.
    """
    labels = np.zeros(len(seconds), np.int64) if people is None else people
    means = []
    for person in np.unique(labels):
        trials = seconds[labels == person]
        if of == "time":
            means.append(shares(trials[np.isfinite(trials).all(axis=1)].sum(axis=0)))
        else:
            known = shares(trials)[trials.sum(axis=1) > 0]
            means.append(known.mean(axis=0) if len(known) else np.full(4, np.nan))
    finite = np.array([row for row in means if not np.isnan(row).any()])
    return np.asarray(finite.mean(axis=0)) if len(finite) else np.full(4, np.nan)
