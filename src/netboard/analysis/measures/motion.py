"""Input of the paper's measures: filtered motion of styluses, board and ball, and the trials in it.

"The force and kinematic data were low-pass filtered with a tenth-order, zero-phase-lag Butterworth filter with 20 Hz
cutoff frequency"; the board's angular velocity and the ball's absolute velocity then with one of 5 Hz. A whole
recording is filtered at once and cut into trials afterwards, so that trials have no edge effects. The ball is
repositioned between two trials; `placed` lists these jumps, and no filter runs across them.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.measures.signals import Breaks, LowPass, derivative, ticks_of
from netboard.base.compiled import kernel

SpeedOrder = Literal["absolute_first", "filter_first"]
Window = Literal["to_completion", "whole"]
Inside = Literal["centre", "whole_ball"]

FAST = LowPass(20.0)
"""Filter for all force and kinematic data in the paper."""

SLOW = LowPass(5.0)
"""Filter for the board's angular velocity and the ball's absolute velocity in the paper."""

HALF_WIDTH = 0.035
"""Half-width of the target [m]."""

BALL_RADIUS = 0.025
"""Radius of the ball [m]."""

HOLD = 1.5
"""Time for which the ball must stay in the target [s]."""

FASTEST = 2.0
"""Speed between two samples above which the ball was repositioned [m/s]."""


@dataclass(frozen=True, slots=True)
class FilteredMotion:
    """A filtered recording, or a part of one.

    Attributes
    ----------
    rate : float
        Sampling rate [Hz].
    left_z, right_z : ndarray, shape (n,)
        Heights of the styluses [m].
    left_vz, right_vz : ndarray, shape (n,)
        Vertical velocities of the styluses [m/s].
    theta : ndarray, shape (n,)
        Tilt of the board, + = right end up [rad].
    omega : ndarray, shape (n,)
        Angular velocity of the board, also filtered by the slow filter [rad/s].
    p : ndarray, shape (n,)
        Ball position along the board, + = right [m].
    vp : ndarray, shape (n,)
        Ball velocity [m/s].
    speed : ndarray, shape (n,)
        Absolute velocity of the ball, also filtered by the slow filter [m/s].
    """

    rate: float
    left_z: NDArray[np.float64]
    right_z: NDArray[np.float64]
    left_vz: NDArray[np.float64]
    right_vz: NDArray[np.float64]
    theta: NDArray[np.float64]
    omega: NDArray[np.float64]
    p: NDArray[np.float64]
    vp: NDArray[np.float64]
    speed: NDArray[np.float64]


def placements(p: NDArray[np.float64], rate: float, fastest: float = FASTEST) -> NDArray[np.int64]:
    """Return the first sample after each repositioning of the ball: at 1 kHz, a jump of 2 mm or more [1].

    Parameters
    ----------
    p : ndarray, shape (n,)
        Ball position along the board, as recorded [m].
    fastest : float
        Speed between two samples above which the ball was repositioned [m/s].
    """
    return _jumps(np.ascontiguousarray(p, np.float64), rate, fastest)


@kernel
def _jumps(p: NDArray[np.float64], rate: float, fastest: float) -> NDArray[np.int64]:
    count, found = 0, np.empty(len(p), np.int64)
    for n in range(1, len(p)):
        if abs(p[n] - p[n - 1]) * rate > fastest:
            found[count] = n
            count += 1
    return found[:count].copy()


def ball_speed(
    vp: NDArray[np.float64],
    rate: float,
    *,
    order: SpeedOrder = "absolute_first",
    low_pass: LowPass = SLOW,
    breaks: Breaks = (),
) -> NDArray[np.float64]:
    """Return the low-pass filtered absolute velocity of the ball, shape (n,) [m/s].

    Ringing near rest may make it slightly negative.

    Parameters
    ----------
    order : {"absolute_first", "filter_first"}
        Whether the absolute value is filtered, as the paper words it, or taken of the filtered velocity.
    low_pass : LowPass
        Low-pass filter; by default that of the paper, 5 Hz.
    """
    return _rectified_after(low_pass(_rectified_before(vp, order), rate, breaks), order)


def _rectified_before(vp: NDArray[np.float64], order: SpeedOrder) -> NDArray[np.float64]:
    """Return the ball's velocity as it enters the filter."""
    return np.abs(vp) if order == "absolute_first" else vp


def _rectified_after(filtered: NDArray[np.float64], order: SpeedOrder) -> NDArray[np.float64]:
    """Return the ball's speed from what leaves the filter."""
    return filtered if order == "absolute_first" else np.abs(filtered)


def motion(
    rate: float,
    left_z: NDArray[np.float64],
    right_z: NDArray[np.float64],
    theta: NDArray[np.float64],
    p: NDArray[np.float64],
    *,
    left_vz: NDArray[np.float64] | None = None,
    right_vz: NDArray[np.float64] | None = None,
    placed: Breaks = (),
    fast: LowPass = FAST,
    slow: LowPass = SLOW,
    speed: SpeedOrder = "absolute_first",
) -> FilteredMotion:
    """Filter a recording as the paper did.

    Velocities are derivatives of the filtered positions, unless stylus velocities are given.

    Parameters
    ----------
    left_vz, right_vz : ndarray, shape (n,), optional
        Stylus velocities as the devices estimated them; they are filtered and used instead [m/s].
    placed : sequence of int
        First samples after each repositioning of the ball, from `placements` [1].
    fast : LowPass
        First filter, for all signals.
    slow : LowPass
        Second filter for the board's angular velocity and the ball's speed.
    speed : {"absolute_first", "filter_first"}
        As for `ball_speed`.
    """
    if len({left_z.shape, right_z.shape, theta.shape, p.shape}) != 1 or left_z.ndim != 1:
        raise ValueError("heights, tilt and ball must have one value each for every sample")
    left, right, tilt, ball = fast.together([left_z, right_z, theta, p], rate, [(), (), (), placed])
    vp = derivative(ball, rate, placed)
    rolling = _rectified_before(vp, speed)
    omega, rolled = slow.together([derivative(tilt, rate), rolling], rate, [(), placed])
    return FilteredMotion(
        rate=rate,
        left_z=left,
        right_z=right,
        left_vz=derivative(left, rate) if left_vz is None else fast(left_vz, rate),
        right_vz=derivative(right, rate) if right_vz is None else fast(right_vz, rate),
        theta=tilt,
        omega=omega,
        p=ball,
        vp=vp,
        speed=_rectified_after(rolled, speed),
    )


@dataclass(frozen=True, slots=True)
class Trial:
    """Sample range of a trial, or of a failed attempt, in a recording.

    Attributes
    ----------
    release : int
        Sample of the ball's release [1].
    stop : int
        Sample after the last one, including the hold in the target [1].
    target : float
        Centre of the target along the board, + = right [m].
    completion : int or None
        Sample at which the hold in the target began; None for a failed attempt [1].
    """

    release: int
    stop: int
    target: float
    completion: int | None = None

    @property
    def side(self) -> float:
        """Direction from the board's centre to the target: -1 left, +1 right [1]."""
        return float(np.sign(self.target))

    def window(self, which: Window = "to_completion") -> slice:
        """Return the samples to analyse.

        Parameters
        ----------
        which : {"to_completion", "whole"}
            From the release to the start of the hold (for a failed attempt, to its end), or including the hold.
        """
        if which == "whole" or self.completion is None:
            return slice(self.release, self.stop)
        return slice(self.release, self.completion)


@dataclass(frozen=True, slots=True)
class Completion:
    """Completion of a trial.

    Attributes
    ----------
    time : float
        Time from the release to the start of the hold; NaN without a hold, or if a gap may hide its start [s].
    sample : int or None
        Sample at which the hold began; None without a hold, or if a gap may hide its start [1].
    entries : float
        Number of entries into the target up to and including the one that led to the hold; all entries without a hold;
        NaN if a gap may hide some [1].
    """

    time: float
    sample: int | None
    entries: float


def find_completion(
    p: NDArray[np.float64],
    rate: float,
    target: float,
    *,
    inside: Inside = "centre",
    half_width: float = HALF_WIDTH,
    radius: float = BALL_RADIUS,
    hold: float = HOLD,
) -> Completion:
    """Find the completion time: from the release to the start of the uninterrupted stay in the target.

    The server's completion time is one tick longer, because it counts the tick in which the ball enters.

    Parameters
    ----------
    p : ndarray, shape (n,)
        Ball position along the board from the release, as recorded [m].
    inside : {"centre", "whole_ball"}
        Part of the ball that must be in the target, edges included: its centre, or all of it.
    radius : float
        Radius of the ball, which only ``whole_ball`` uses [m].
    """
    reach = half_width if inside == "centre" else half_width - radius
    ball, least = np.ascontiguousarray(p, np.float64), ticks_of(hold, rate)
    # A missing sample may lie in or outside the target: only a result common to both cases is known.
    sample, entries, gap = _first_hold(ball, target, reach, least, False)
    if gap and _first_hold(ball, target, reach, least, True)[0] != sample:
        return Completion(np.nan, None, np.nan)
    known = np.nan if gap else entries
    return Completion(np.nan, None, known) if sample < 0 else Completion(sample / rate, sample, known)


@kernel
def _first_hold(
    p: NDArray[np.float64], target: float, reach: float, least: int, gaps_inside: bool
) -> tuple[int, int, bool]:
    """Find the first sufficiently long stay in the target, of ``least`` intervals as `lasting` defines it.

    Returns its first sample, or -1; the entries up to and including it; and whether a sample before it is missing.
    """
    entries, first, gap, before = 0, -1, False, False
    for n in range(len(p)):
        away = abs(p[n] - target)
        missing = np.isnan(away)
        within = gaps_inside if missing else away <= reach
        if within and first < 0:
            entries, first, before = entries + 1, n, gap
        gap = gap or missing
        if not within:
            first = -1
        elif n - first >= least:
            return first, entries, before
    return -1, entries, gap
