"""What the paper's measures look at: the filtered movement of styluses, board and ball, and the trials within it.

"The force and kinematic data were low-pass filtered with a tenth-order, zero-phase-lag Butterworth filter with 20 Hz
cutoff frequency"; the board's angular velocity and the ball's absolute velocity then with one of 5 Hz. A whole
recording is filtered at once and trials are cut out of it afterwards, so that a trial has no ends of its own. The ball
is put somewhere else between two trials: those jumps are told as `placed`, and no filter smears them into a trial.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.measures.signals import Breaks, LowPass, derivative, lasting, runs

SpeedOrder = Literal["absolute_first", "filter_first"]
Window = Literal["to_completion", "whole"]
Inside = Literal["centre", "whole_ball"]

FAST = LowPass(20.0)
"""The paper's filter of all force and kinematic data."""

SLOW = LowPass(5.0)
"""The paper's filter of the board's angular velocity and of the ball's absolute velocity."""

HALF_WIDTH = 0.035
"""The target reaches so far to both sides of its centre [m]."""

BALL_RADIUS = 0.025
"""Radius of the ball [m]."""

HOLD = 1.5
"""The ball must stay in the target for so long [s]."""

FASTEST = 2.0
"""A ball that is faster from one sample to the next did not roll there [m/s]."""


@dataclass(frozen=True, slots=True)
class Motion:
    """A filtered recording, or a part of one.

    Attributes
    ----------
    rate : float
        Samples per second [Hz].
    left_z, right_z : ndarray, shape (n,)
        Height of the styluses [m].
    left_vz, right_vz : ndarray, shape (n,)
        Their rates [m/s].
    theta : ndarray, shape (n,)
        Tilt of the board, + = right end up [rad].
    omega : ndarray, shape (n,)
        Its rate, filtered by the slow filter as well [rad/s].
    p : ndarray, shape (n,)
        Ball along the board, + = right [m].
    vp : ndarray, shape (n,)
        Its rate [m/s].
    speed : ndarray, shape (n,)
        Absolute velocity of the ball, filtered by the slow filter as well [m/s].
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
    """Where a ball was put somewhere else: at 1 kHz, by 2 mm or more.

    Parameters
    ----------
    p : ndarray, shape (n,)
        Ball along the board, as recorded [m].
    rate : float
        Samples per second [Hz].
    fastest : float
        A ball that is faster from one sample to the next did not roll there [m/s].

    Returns
    -------
    ndarray of int64, shape (k,)
        The first sample at each new place [1].
    """
    return 1 + np.flatnonzero(np.abs(np.diff(p)) * rate > fastest)


def ball_speed(
    vp: NDArray[np.float64],
    rate: float,
    *,
    order: SpeedOrder = "absolute_first",
    low_pass: LowPass = SLOW,
    breaks: Breaks = (),
) -> NDArray[np.float64]:
    """Absolute velocity of the ball, low-pass filtered: where that rings beside a ball at rest, a little below 0.

    Parameters
    ----------
    vp : ndarray, shape (n,)
        Velocity of the ball [m/s].
    rate : float
        Samples per second [Hz].
    order : {"absolute_first", "filter_first"}
        Whether the absolute value is filtered, as the paper's words say, or taken of the filtered velocity.
    low_pass : LowPass
        The filter.
    breaks : sequence of int
        First samples after the ball was put somewhere [1].

    Returns
    -------
    ndarray, shape (n,)
        The speed [m/s].
    """
    if order == "absolute_first":
        return low_pass(np.abs(vp), rate, breaks)
    return np.abs(low_pass(vp, rate, breaks))


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
) -> Motion:
    """Filter a recording as the paper did.

    Velocities are the derivatives of the filtered positions; those of the styluses may be given instead.

    Parameters
    ----------
    rate : float
        Samples per second [Hz].
    left_z, right_z : ndarray, shape (n,)
        Height of the styluses [m].
    theta : ndarray, shape (n,)
        Tilt of the board, + = right end up [rad].
    p : ndarray, shape (n,)
        Ball along the board, + = right [m].
    left_vz, right_vz : ndarray, shape (n,), optional
        Rates of the styluses as the devices estimated them, to be filtered and used [m/s].
    placed : sequence of int
        First samples after the ball was put somewhere, as `placements` finds them [1].
    fast : LowPass
        The filter of everything.
    slow : LowPass
        The filter of the board's angular velocity and of the ball's speed.
    speed : {"absolute_first", "filter_first"}
        As for `ball_speed`.

    Raises
    ------
    ValueError
        If the arrays do not have one length.
    """
    if len({left_z.shape, right_z.shape, theta.shape, p.shape}) != 1 or left_z.ndim != 1:
        raise ValueError("heights, tilt and ball must have one value each for every sample")
    left, right, tilt, ball = fast(left_z, rate), fast(right_z, rate), fast(theta, rate), fast(p, rate, placed)
    vp = derivative(ball, rate, placed)
    return Motion(
        rate=rate,
        left_z=left,
        right_z=right,
        left_vz=derivative(left, rate) if left_vz is None else fast(left_vz, rate),
        right_vz=derivative(right, rate) if right_vz is None else fast(right_vz, rate),
        theta=tilt,
        omega=slow(derivative(tilt, rate), rate),
        p=ball,
        vp=vp,
        speed=ball_speed(vp, rate, order=speed, low_pass=slow, breaks=placed),
    )


@dataclass(frozen=True, slots=True)
class Trial:
    """Where a trial, or a failed attempt at one, lies in a recording.

    Attributes
    ----------
    release : int
        Sample at which the ball was released [1].
    stop : int
        Sample after its last one, the hold included [1].
    target : float
        Centre of the target along the board, + = right [m].
    completion : int or None
        Sample at which the hold began; None for an attempt that failed [1].
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
        """Samples that are looked at.

        Parameters
        ----------
        which : {"to_completion", "whole"}
            From the release to the beginning of the hold (for a failed attempt, to its end), or with the hold.
        """
        if which == "whole" or self.completion is None:
            return slice(self.release, self.stop)
        return slice(self.release, self.completion)


@dataclass(frozen=True, slots=True)
class Completion:
    """When a trial was completed.

    Attributes
    ----------
    time : float
        From the release to the beginning of the hold; NaN without one, or if a hole may hide when it began [s].
    sample : int or None
        Sample at which the hold began; None without one, or if a hole may hide when that was [1].
    entries : float
        How often the ball came into the target, the last time included; all times, without a hold; NaN if a hole may
        hide some [1].
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
    """Completion time: from the release to the start of the time for which the ball stayed in the target.

    The server's own completion time is one tick more: it counts the tick in which the ball came in.

    Parameters
    ----------
    p : ndarray, shape (n,)
        Ball along the board from the release on, as recorded [m].
    rate : float
        Samples per second [Hz].
    target : float
        Centre of the target [m].
    inside : {"centre", "whole_ball"}
        What must be within the target, its edge included: the ball's centre, or all of the ball.
    half_width : float
        The target reaches so far to both sides of its centre [m].
    radius : float
        Of the ball [m].
    hold : float
        How long it must stay, by the definition of `netboard.analysis.measures.signals.lasting` [s].
    """
    reach = half_width if inside == "centre" else half_width - radius
    away = np.abs(p - target)
    # Where a sample is missing, the ball was in the target or it was not: what depends on that is not known.
    found, other = _first_hold(away <= reach, hold, rate), _first_hold(~(away > reach), hold, rate)
    if found.sample != other.sample:
        return Completion(float("nan"), None, float("nan"))
    return found if not np.isnan(away[: found.sample]).any() else replace(found, entries=float("nan"))


def _first_hold(within: NDArray[np.bool_], hold: float, rate: float) -> Completion:
    """Find the first stay in the target that is long enough."""
    entries = runs(within)[:, 0]
    held = lasting(within, hold, rate)
    if held.size == 0:
        return Completion(float("nan"), None, len(entries))
    sample = int(held[0, 0])
    return Completion(sample / rate, sample, int(np.searchsorted(entries, sample)) + 1)
