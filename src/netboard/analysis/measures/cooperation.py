"""Movements of the board that both sides make together, and the delay between the sides in them.

A delay is the time of the left side less that of the right one: positive where the right side was first. It is found
between samples, on straight lines.

With one threshold for both sides, as in the paper, the side that moves farther looks earlier, the more so the higher
the threshold; with a threshold of each side's own peak it does not. How large that bias is, docs/reference/measures.md
says.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.measures.segments import Segments

Opposite = Literal["net", "majority"]
Amount = Literal["net", "path"]
Threshold = Literal["slower_side", "own_peak"]
Search = Literal["back", "inside", "before_peak"]
Velocity = Literal["own_direction", "magnitude"]

PORTIONS = (0.1, 0.2, 0.3, 0.4)
"""Portions of a peak velocity at which the paper takes delays [1]."""

LARGEST_RATIO = 9.0
"""In a cooperative movement one side moves at most so much as much as the other [1]."""

SEARCH_BACK = 0.3
"""How long before a movement of the board a side may have passed a threshold [s]."""


@dataclass(frozen=True, slots=True)
class Contributions:
    """What each side does in each movement of the board.

    Attributes
    ----------
    left, right : ndarray, shape (k,)
        How far each stylus goes, + = up [m].
    cooperative : ndarray of bool, shape (k,)
        Whether they go in opposite directions, and neither more than nine times as far as the other [1].
    """

    left: NDArray[np.float64]
    right: NDArray[np.float64]
    cooperative: NDArray[np.bool_]


def contributions(
    segments: Segments,
    left_z: NDArray[np.float64],
    right_z: NDArray[np.float64],
    *,
    opposite: Opposite = "net",
    amount: Amount = "net",
    largest_ratio: float = LARGEST_RATIO,
) -> Contributions:
    """Find the cooperative ones among the movements of the board.

    Parameters
    ----------
    segments : Segments
        The movements.
    left_z, right_z : ndarray, shape (n,)
        Height of the styluses [m].
    opposite : {"net", "majority"}
        What must be opposite: the displacements over the movement, or the directions in more than half of its samples.
    amount : {"net", "path"}
        What is compared with nine times that of the other: displacement, or length of path. Neither directions nor a
        path are known of a movement with a hole: it is not cooperative then.
    largest_ratio : float
        The nine [1].
    """
    ends = segments.stop - 1
    left, right = left_z[ends] - left_z[segments.first], right_z[ends] - right_z[segments.first]
    opposed = left * right < 0
    if opposite == "majority":
        against = np.diff(left_z) * np.diff(right_z) < 0
        opposed = _summed(against, segments) > (ends - segments.first) / 2
    amounts = np.abs([left, right])
    if amount == "path":
        amounts = np.array([_summed(np.abs(np.diff(z)), segments) for z in (left_z, right_z)])
    if opposite == "majority" or amount == "path":
        opposed &= _summed(np.isnan(np.diff(left_z) + np.diff(right_z)), segments) == 0
    balanced = (amounts.max(axis=0) <= largest_ratio * amounts.min(axis=0)) & (amounts.min(axis=0) > 0)
    return Contributions(left, right, opposed & balanced)


def _summed(steps: NDArray[np.bool_] | NDArray[np.float64], segments: Segments) -> NDArray[np.float64]:
    """Add up what is known of each step from one sample to the next, over each movement."""
    total = np.concatenate([[0.0], np.nancumsum(steps)])
    return np.asarray(total[segments.stop - 1] - total[segments.first])


@dataclass(frozen=True, slots=True)
class Delays:
    """Delays between the sides, a row for each movement of the board and a column for each portion of the peak.

    Attributes
    ----------
    signed : ndarray, shape (k, q)
        Time of the left side less that of the right one; NaN where the movement is not cooperative or a side's crossing
        is not known [s].
    truncated : ndarray of bool, shape (k, q)
        Whether a side was above the threshold already where its search ended [1].
    left_peak, right_peak : ndarray, shape (k,)
        Peak velocity of each side in the direction it went; NaN where the movement is not cooperative [m/s].
    """

    signed: NDArray[np.float64]
    truncated: NDArray[np.bool_]
    left_peak: NDArray[np.float64]
    right_peak: NDArray[np.float64]

    @property
    def absolute(self) -> NDArray[np.float64]:
        """Absolute delays, as the paper reports them, shape (k, q) [s]."""
        return np.abs(self.signed)


def delays(
    segments: Segments,
    moved: Contributions,
    left_vz: NDArray[np.float64],
    right_vz: NDArray[np.float64],
    rate: float,
    *,
    portions: Sequence[float] = PORTIONS,
    threshold: Threshold = "slower_side",
    search: Search = "back",
    velocity: Velocity = "own_direction",
    search_back: float = SEARCH_BACK,
) -> Delays:
    """Difference of the times at which each side reaches a portion of the peak velocity of the slower side.

    Parameters
    ----------
    segments : Segments
        The movements of the board.
    moved : Contributions
        What each side did in them, from `contributions`.
    left_vz, right_vz : ndarray, shape (n,)
        Rates of the styluses' heights, also before the movements [m/s].
    rate : float
        Samples per second [Hz].
    portions : sequence of float
        Portions of the peak, q of them [1].
    threshold : {"slower_side", "own_peak"}
        Of which peak: that of the slower side for both, or that of each side for itself.
    search : {"back", "inside", "before_peak"}
        Where a side has reached the threshold: where it did first in the movement. If it is above it when the movement
        begins: where it did before, up to `search_back` earlier, and nowhere if it did not; or at the beginning of the
        movement. Or where it did last before its peak, which a twitch before the movement proper does not change.
    velocity : {"own_direction", "magnitude"}
        What must reach the threshold: the velocity in the direction in which that side went, or its magnitude.
    search_back : float
        How long before a movement is searched [s].

    Raises
    ------
    ValueError
        If a portion is not above 0 and up to 1.
    """
    if not all(0 < portion <= 1 for portion in portions):
        raise ValueError(f"a portion of a peak is above 0 and at most 1, found {tuple(portions)}")
    shape = (len(segments), len(portions))
    signed, truncated = np.full(shape, np.nan), np.zeros(shape, bool)
    peaks = np.full((2, len(segments)), np.nan)
    back = 0 if search == "inside" else round(search_back * rate)
    for row in np.flatnonzero(moved.cooperative):
        begin = max(int(segments.first[row]) - back, 0)
        start, stop = int(segments.first[row]) - begin, int(segments.stop[row])
        sides = [
            np.abs(vz[begin:stop]) if velocity == "magnitude" else np.sign(went[row]) * vz[begin:stop]
            for vz, went in ((left_vz, moved.left), (right_vz, moved.right))
        ]
        peaks[:, row] = [side[start:].max() for side in sides]
        of_peaks = peaks[:, row] if threshold == "own_peak" else np.full(2, peaks[:, row].min())
        for column, portion in enumerate(portions):
            (left, left_cut), (right, right_cut) = (
                _reached(side, portion * peak, start, search) for side, peak in zip(sides, of_peaks, strict=True)
            )
            signed[row, column] = (left - right) / rate
            truncated[row, column] = left_cut or right_cut
    return Delays(signed, truncated, *peaks)


def _reached(u: NDArray[np.float64], level: float, start: int, search: Search) -> tuple[float, bool]:
    """Sample at which a velocity rises to a level in a movement that begins at `start`, and whether that is cut off."""
    if not level > 0:
        return float("nan"), False
    if search == "before_peak":
        start += int(np.argmax(u[start:]))
    if u[start] < level:
        above = start + int(np.argmax(u[start:] >= level))
    elif search == "inside":
        return float(start), True
    else:
        below = np.flatnonzero(~(u[:start] >= level))
        if below.size == 0 or np.isnan(u[below[-1]]):
            return float("nan"), True
        above = int(below[-1]) + 1
    return above - 1 + float((level - u[above - 1]) / (u[above] - u[above - 1])), False
