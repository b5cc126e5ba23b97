"""Cooperative movements of the board, and the delay between the two sides in them.

A delay is the left side's time minus the right side's: positive if the right side was first. Crossing times are
interpolated linearly between samples.

The paper uses one threshold for both sides. The side that moves farther then appears to be earlier, more so at higher
thresholds. A threshold relative to each side's own peak avoids this bias; docs/reference/measures.md gives its size.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.measures.segments import Segments
from netboard.base.compiled import kernel

Opposite = Literal["net", "majority"]
Amount = Literal["net", "path"]
Threshold = Literal["slower_side", "own_peak"]
Search = Literal["back", "inside", "before_peak"]
Velocity = Literal["own_direction", "magnitude"]

PORTIONS = (0.1, 0.2, 0.3, 0.4)
"""Fractions of a peak velocity at which the paper measures delays [1]."""

MAX_RATIO = 9.0
"""Largest ratio of the two sides' displacements in a cooperative movement [1]."""

SEARCH: Search = "back"
"""Default search for a side's threshold crossing, of every analysis, cohort and comparison.

A side is often above a low threshold before the board begins to turn (in dyads at 10 %, in nine of ten movements).
"back" finds when it crossed the threshold. "inside", the more likely reading of the paper, takes the beginning of the
board's movement for both sides in that case, so it measures the board and gives the delay a bias towards 0.
"""

SEARCH_BACK = 0.3
"""Search window before a movement of the board for a side's threshold crossing [s]."""


@dataclass(frozen=True, slots=True)
class Contributions:
    """Contribution of each side to each movement of the board.

    Attributes
    ----------
    left, right : ndarray, shape (k,)
        Displacement of each stylus, + = up [m].
    cooperative : ndarray of bool, shape (k,)
        Whether the sides move in opposite directions and neither moves more than nine times as far as the other [1].
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
    largest_ratio: float = MAX_RATIO,
) -> Contributions:
    """Find the cooperative movements of the board.

    Parameters
    ----------
    opposite : {"net", "majority"}
        Quantity that must be opposite: the net displacements, or the directions in more than half of the samples.
    amount : {"net", "path"}
        Quantity whose ratio is limited: net displacement or path length. Directions and path length are unknown in a
        movement with a gap, which then does not count as cooperative.
    largest_ratio : float
        Largest ratio of the two amounts [1].
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
    """Sum the known sample-to-sample steps over each movement."""
    total = np.concatenate([[0.0], np.nancumsum(steps)])
    return np.asarray(total[segments.stop - 1] - total[segments.first])


@dataclass(frozen=True, slots=True)
class Delays:
    """Delays between the sides: one row for each movement of the board, one column for each fraction of the peak.

    Attributes
    ----------
    signed : ndarray, shape (k, q)
        Left side's time minus the right side's; NaN if the movement is not cooperative or a crossing is unknown [s].
    truncated : ndarray of bool, shape (k, q)
        Whether a side was already above the threshold at the limit of its search [1].
    left_peak, right_peak : ndarray, shape (k,)
        Peak velocity of each side in its own direction; NaN if the movement is not cooperative [m/s].
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
    search: Search = SEARCH,
    velocity: Velocity = "own_direction",
    search_back: float = SEARCH_BACK,
) -> Delays:
    """Return the differences between the times at which the sides reach fractions of a peak velocity.

    Parameters
    ----------
    moved : Contributions
        Contribution of each side, from `contributions`.
    portions : sequence of float
        Fractions of the peak, q of them, above 0 and at most 1 [1].
    threshold : {"slower_side", "own_peak"}
        Reference peak: the slower side's peak for both sides, or each side's own peak.
    search : {"back", "inside", "before_peak"}
        Where a side reaches the threshold. "inside" takes the first such sample of the movement, which is its first
        sample if the side is already above the threshold there. "back" searches up to `search_back` earlier in that
        case, and gives NaN if it finds no crossing. "before_peak" takes the last crossing before the side's peak, so
        that an earlier twitch has no influence.
    velocity : {"own_direction", "magnitude"}
        Velocity that must reach the threshold: in the side's own direction, or its magnitude.
    search_back : float
        Search window before a movement; the velocities include it [s].
    """
    if not all(0 < portion <= 1 for portion in portions):
        raise ValueError(f"a portion of a peak is above 0 and at most 1, found {tuple(portions)}")
    shape = (len(segments), len(portions))
    signed, truncated = np.full(shape, np.nan), np.zeros(shape, bool)
    peaks = np.full((2, len(segments)), np.nan)
    back = 0 if search == "inside" else round(search_back * rate)
    how = _Crossing(back, threshold == "own_peak", velocity == "magnitude", search == "inside", search == "before_peak")
    _find_delays(
        np.flatnonzero(moved.cooperative),
        np.ascontiguousarray(segments.first),
        np.ascontiguousarray(segments.stop),
        (np.sign(moved.left), np.sign(moved.right)),
        (np.ascontiguousarray(left_vz), np.ascontiguousarray(right_vz)),
        np.array(portions, np.float64),
        how,
        signed,
        truncated,
        peaks,
    )
    return Delays(signed / rate, truncated, *peaks)


class _Crossing(NamedTuple):
    """What a crossing is: samples to search before a movement, and the choices of `delays` as flags."""

    back: int
    own_peak: bool
    magnitude: bool
    inside: bool
    before_peak: bool


@kernel
def _find_delays(
    rows: NDArray[np.int64],
    first: NDArray[np.int64],
    stop: NDArray[np.int64],
    signs: tuple[NDArray[np.float64], NDArray[np.float64]],
    rates: tuple[NDArray[np.float64], NDArray[np.float64]],
    portions: NDArray[np.float64],
    how: _Crossing,
    signed: NDArray[np.float64],
    truncated: NDArray[np.bool_],
    peaks: NDArray[np.float64],
) -> None:
    """Write the delays of the movements in some rows [samples], whether truncated, and the peak velocities [m/s]."""
    for row in rows:
        begin = max(first[row] - how.back, 0)
        start = first[row] - begin
        left, right = rates[0][begin : stop[row]], rates[1][begin : stop[row]]
        if how.magnitude:
            left, right = np.abs(left), np.abs(right)
        else:
            left, right = signs[0][row] * left, signs[1][row] * right
        # numpy's max and min of an array: NaN if any value is.
        # Adding 0.0 turns a negative zero into a positive one, whichever of both `max` finds.
        peaks[0, row], peaks[1, row] = np.max(left[start:]) + 0.0, np.max(right[start:]) + 0.0
        lower = np.min(peaks[:, row])
        for column in range(len(portions)):
            left_level = portions[column] * (peaks[0, row] if how.own_peak else lower)
            right_level = portions[column] * (peaks[1, row] if how.own_peak else lower)
            left_at, left_cut = _reached(left, left_level, start, how)
            right_at, right_cut = _reached(right, right_level, start, how)
            signed[row, column] = left_at - right_at
            truncated[row, column] = left_cut or right_cut


@kernel
def _reached(u: NDArray[np.float64], level: float, start: int, how: _Crossing) -> tuple[float, bool]:
    """Return the sample at which a velocity reaches a level in a movement from `start`, and whether it is truncated."""
    if not level > 0:
        return np.nan, False
    above = start
    if how.before_peak:
        above += int(np.argmax(u[start:]))
    if u[above] < level:
        while above < len(u) - 1 and u[above] < level:
            above += 1
    elif how.inside:
        return float(above), True
    else:
        while above > 0 and u[above - 1] >= level:
            above -= 1
        if above == 0 or np.isnan(u[above - 1]):
            return np.nan, True
    return above - 1 + (level - u[above - 1]) / (u[above] - u[above - 1]), False
