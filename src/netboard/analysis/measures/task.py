"""How well a trial went, beyond its completion time: time in the target, overshoots, falls, and the time to react.

Positions are the ball's along the board, + = right, from the release on; the target may be at either side. An amount of
time counts each sample as the time until the next one; a single stay lasts from its first sample to its last. Of a
record with a hole nothing is known that the hole could change: bridge short ones first
(`netboard.analysis.measures.signals.bridge`).
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
    """The ball's stays in the target; NaN throughout if a sample is missing.

    Attributes
    ----------
    time : float
        All of them together [s].
    share : float
        Of the record; NaN for an empty one [1].
    visits : float
        How many there are [1].
    longest : float
        The longest of them, from its first sample to its last [s].
    first : float
        When the first begins, from the release; NaN without one [s].
    """

    time: float
    share: float
    visits: float
    longest: float
    first: float


@dataclass(frozen=True, slots=True)
class Overshoots:
    """How often and how far the ball went too far; NaN throughout if a sample is missing.

    Attributes
    ----------
    count : float
        How often it passed the limit, away from where it came from [1].
    largest : float
        How far beyond the limit it came; 0 without an overshoot [m].
    time : float
        How long it was beyond [s].
    """

    count: float
    largest: float
    time: float


@dataclass(frozen=True, slots=True)
class Falls:
    """Attempts that ended with the ball over the edge.

    Attributes
    ----------
    falls : int
        How many [1].
    n : int
        Attempts that ended with success or a fall [1].
    share : float
        Of those; NaN without any [1].
    unit : str
        What is counted by n.
    """

    falls: int
    n: int
    share: float
    unit: str = "attempt"


@dataclass(frozen=True, slots=True)
class Reaction:
    """When a stylus began to move.

    Attributes
    ----------
    time : float
        From the release; NaN if it never did, was moving already, or may have begun in a hole [s].
    anticipated : float
        1: it was moving at the release, or began sooner than anybody reacts; 0: not; NaN if a hole may hide it [1].
    """

    time: float
    anticipated: float


def time_in_target(p: ArrayLike, rate: float, *, centre: float, half_width: float = HALF_WIDTH) -> InTarget:
    """Find the ball's stays in the target.

    Parameters
    ----------
    p : array_like, shape (n,)
        The ball along the board [m].
    rate : float
        Sampling rate [Hz].
    centre : float
        Middle of the target [m].
    half_width : float
        Half its width; its edges belong to it [m].

    Returns
    -------
    InTarget
        Their time, share, number, and the longest.
    """
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
    """Find where the ball went too far: past the target, seen from where it was at first.

    Where it was in the target's very middle, it is seen from the board's.

    Parameters
    ----------
    p : array_like, shape (n,)
        The ball along the board, the first from the release; at least one [m].
    rate : float
        Sampling rate [Hz].
    centre : float
        Middle of the target [m].
    half_width : float
        Half its width [m].
    beyond : {"far_edge", "centre"}
        The limit: the target's edge, after which the hold begins anew, or its middle.

    Returns
    -------
    Overshoots
        Their number, the largest, and their time.

    Raises
    ------
    ValueError
        If there is no sample.
    """
    ball = np.asarray(p, dtype=float)
    if not len(ball):
        raise ValueError("where the ball came from is not known without a sample")
    if np.isnan(ball).any():
        return Overshoots(np.nan, np.nan, np.nan)
    way = np.sign(centre - ball[0]) or np.sign(centre)
    excess = way * (ball - centre) - (half_width if beyond == "far_edge" else 0.0)
    starts, stops = runs(excess > 0.0).T
    return Overshoots(len(starts), float(np.max(excess, initial=0.0)), float((stops - starts).sum() / rate))


def fall_time(p: ArrayLike, rate: float, *, edge: float = 0.35) -> float:
    """Return when the ball fell off the board: when its place along it was first beyond the edge.

    Parameters
    ----------
    p : array_like, shape (n,)
        The ball along the board [m].
    rate : float
        Sampling rate [Hz].
    edge : float
        From the board's middle to its end [m].

    Returns
    -------
    float
        Time from the first sample; NaN if it stayed on the board, or may have fallen in a hole [s].
    """
    ball = np.asarray(p, dtype=float)
    off = np.flatnonzero(~(np.abs(ball) <= edge))
    return float(off[0] / rate) if len(off) and not np.isnan(ball[off[0]]) else np.nan


def falls(outcomes: Iterable[str]) -> Falls:
    """Count the attempts that ended with a fall.

    Parameters
    ----------
    outcomes : iterable of str
        How each attempt ended, in the words of a recording's summary: "success" and "fell" count, other ends, such as
        an operator's, do not.

    Returns
    -------
    Falls
        Their number and share.
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
    """Find when a stylus began to move after the release.

    Parameters
    ----------
    velocity : array_like, shape (n,)
        Its velocity, the first sample that of the release [m/s].
    rate : float
        Sampling rate [Hz].
    onset : {"sustained", "before_peak"}
        A movement begins where the speed reaches the threshold for a while; or, once one is found so, where its speed
        last rose through a portion of its first peak, which does not depend on how fast the movement is.
    threshold : float
        Speed from which a stylus moves [m/s].
    hold : float
        Time for which it must, without a break, by the definition of `netboard.analysis.measures.signals.lasting` [s].
    portion : float
        Of the first peak [1].
    soonest : float
        An earlier onset is no reaction to the release but a guess at it [s].

    Returns
    -------
    Reaction
        The time of the onset, and whether it was anticipated.
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
    """Walk from the first peak of a run back to where the speed rose through a portion of it."""
    falling = np.flatnonzero(np.diff(speed[begin:end]) < 0.0)
    peak = begin + int(falling[0]) if len(falling) else end - 1
    below = np.flatnonzero(speed[:peak] < portion * speed[peak])
    return int(below[-1]) + 1 if len(below) else 0
