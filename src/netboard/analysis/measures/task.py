"""Task performance beyond completion time: time in target, overshoots, falls, and reaction time.

Positions are those of the ball along the board, + = right, from the release; the target may be on either side. A total
time counts each sample as one sampling interval; a single stay lasts from its first to its last sample. Where a gap
could change a result, the result is NaN: bridge short gaps first (`netboard.analysis.measures.signals.bridge`).
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from netboard.analysis.measures.motion import HALF_WIDTH
from netboard.analysis.measures.movements import STILL_BELOW
from netboard.analysis.measures.signals import lasting, lasts, runs, ticks_of

Beyond = Literal["far_edge", "centre"]
Onset = Literal["sustained", "before_peak"]


@dataclass(frozen=True, slots=True)
class InTarget:
    """The ball's stays in the target; all NaN if a sample is missing.

    Attributes
    ----------
    time : float
        Total time in the target [s].
    share : float
        Share of the record's duration; NaN for an empty record [1].
    visits : float
        Number of stays [1].
    longest : float
        Duration of the longest stay, from its first to its last sample [s].
    first : float
        Start of the first stay after the release; NaN without a stay [s].
    """

    time: float
    share: float
    visits: float
    longest: float
    first: float


@dataclass(frozen=True, slots=True)
class Overshoots:
    """Number and size of the ball's overshoots; all NaN if a sample is missing.

    Attributes
    ----------
    count : float
        Number of times that it passed the limit, away from its starting side [1].
    largest : float
        Largest distance beyond the limit; 0 without an overshoot [m].
    time : float
        Time beyond the limit [s].
    """

    count: float
    largest: float
    time: float


@dataclass(frozen=True, slots=True)
class Falls:
    """Attempts that ended with a fall of the ball.

    Attributes
    ----------
    falls : int
        Number of falls [1].
    n : int
        Number of attempts that ended with success or a fall [1].
    share : float
        Share of falls; NaN without attempts [1].
    unit : str
        Unit that n counts.
    """

    falls: int
    n: int
    share: float
    unit: str = "attempt"


@dataclass(frozen=True, slots=True)
class Reaction:
    """Movement onset of a stylus.

    Attributes
    ----------
    time : float
        Reaction time after the release; NaN if the stylus never moved, was already moving, or may have begun in a gap
        [s].
    anticipated : float
        1: the stylus was moving at the release, or began earlier than any reaction; 0: not; NaN if a gap may hide it
        [1].
    """

    time: float
    anticipated: float


def time_in_target(p: ArrayLike, rate: float, *, centre: float, half_width: float = HALF_WIDTH) -> InTarget:
    """Find the ball's stays in the target."""
    ball = np.asarray(p, dtype=float)
    if np.isnan(ball).any():
        return InTarget(np.nan, np.nan, np.nan, np.nan, np.nan)
    inside = np.abs(ball - centre) <= half_width
    starts, stops = runs(inside).T
    lengths = stops - starts
    return InTarget(
        time=float(lengths.sum() / rate),
        share=float(inside.mean()) if len(inside) else np.nan,
        visits=len(starts),
        longest=float(lasts(starts, stops, rate).max(initial=0.0)),
        first=float(starts[0] / rate) if len(starts) else np.nan,
    )


def overshoots(
    p: ArrayLike, rate: float, *, centre: float, half_width: float = HALF_WIDTH, beyond: Beyond = "far_edge"
) -> Overshoots:
    """Find where the ball overshot: past the target, as seen from its initial position.

    There must be a first sample. If it is exactly at the target's centre, the board's middle replaces it.

    Parameters
    ----------
    beyond : {"far_edge", "centre"}
        Limit: the target's far edge, beyond which the hold restarts, or its centre.
    """
    ball = np.asarray(p, dtype=float)
    if not len(ball):
        raise ValueError("at least one sample is needed to know on which side the ball started")
    if np.isnan(ball).any():
        return Overshoots(np.nan, np.nan, np.nan)
    way = np.sign(centre - ball[0]) or np.sign(centre)
    excess = way * (ball - centre) - (half_width if beyond == "far_edge" else 0.0)
    starts, stops = runs(excess > 0.0).T
    return Overshoots(len(starts), float(np.max(excess, initial=0.0)), float((stops - starts).sum() / rate))


def fall_time(p: ArrayLike, rate: float, *, edge: float = 0.35) -> float:
    """Return when the ball's distance from the board's middle first exceeds the edge, from the first sample [s].

    NaN if the ball stayed on the board, or may have fallen in a gap.

    Parameters
    ----------
    edge : float
        Distance from the board's middle to its end [m].
    """
    ball = np.asarray(p, dtype=float)
    off = np.flatnonzero(~(np.abs(ball) <= edge))
    return float(off[0] / rate) if len(off) and not np.isnan(ball[off[0]]) else np.nan


def falls(outcomes: Iterable[str]) -> Falls:
    """Count the attempts that ended with a fall.

    Parameters
    ----------
    outcomes : iterable of str
        Outcome of each attempt, as in a recording's summary: "success" and "fell" count; other outcomes, such as an
        operator's stop, do not.
    """
    ends = list(outcomes)
    fell, count = ends.count("fell"), ends.count("fell") + ends.count("success")
    return Falls(fell, count, fell / count if count else np.nan)


def reaction(
    velocity: ArrayLike,
    rate: float,
    *,
    onset: Onset = "sustained",
    threshold: float = STILL_BELOW,
    hold: float = 0.03,
    portion: float = 0.05,
    soonest: float = 0.1,
) -> Reaction:
    """Find the movement onset of a stylus after the release.

    Parameters
    ----------
    velocity : array_like, shape (n,)
        Velocity of the stylus; the first sample is the release [m/s].
    onset : {"sustained", "before_peak"}
        Definition of the onset. "sustained": the speed reaches the threshold and stays above it for `hold`.
        "before_peak": in such a movement, the speed's last rise through a fraction of its first peak, which does not
        depend on the speed of the movement.
    threshold : float
        Minimum speed of a moving stylus [m/s].
    portion : float
        Fraction of the first peak [1].
    soonest : float
        Shortest possible reaction time; an earlier onset is an anticipation [s].
    """
    speed = np.abs(np.asarray(velocity, dtype=float))
    moves = lasting(speed >= threshold, hold, rate)
    if not len(moves):
        return Reaction(np.nan, anticipated=np.nan if np.isnan(speed).any() else 0.0)
    begin, end = map(int, moves[0])
    if np.isnan(speed[: begin + ticks_of(hold, rate) + 1 if onset == "sustained" else end + 1]).any():
        return Reaction(np.nan, anticipated=np.nan)
    if begin == 0:
        return Reaction(np.nan, anticipated=1.0)
    if onset == "before_peak":
        begin = _rise_to_first_peak(speed, begin, end, portion)
    return Reaction(begin / rate, anticipated=float(begin / rate < soonest))


def _rise_to_first_peak(speed: NDArray[np.float64], begin: int, end: int, portion: float) -> int:
    """Return the sample before the first peak of a run where the speed last rises through a fraction of it."""
    falling = np.flatnonzero(np.diff(speed[begin:end]) < 0.0)
    peak = begin + int(falling[0]) if len(falling) else end - 1
    below = np.flatnonzero(speed[:peak] < portion * speed[peak])
    return int(below[-1]) + 1 if len(below) else 0
