"""Sampled hands, interpolated or extrapolated between samples, as drives along a trajectory.

Time is counted in ticks, integers of a small unit, so that coinciding times coincide exactly, and equal intervals are
equal to the bit.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import kernel
from netboard.base.errors import ConfigError
from netboard.physics.hands.extrapolation import between, later, moving, resting
from netboard.physics.scene.parameters import SCENE

INTERPOLATIONS = ("zoh", "cv", "ca", "hermite")
"""Motion of a stylus between samples: extrapolations and the Hermite interpolation; their number is their place."""

GAP_RATIO = 3.0
"""An interval longer than this multiple of the median interval is a gap [1]."""

MAX_FILLED_INTERVAL = 0.001
"""For "hermite", the largest interval after filling in samples from polynomials through four neighbours [s]."""

TIME_DIGITS = 11
"""Decimal digits of the time unit: 10^-11 s, or coarser where float64 has fewer digits [1]."""

_ZOH, _HERMITE = INTERPOLATIONS.index("zoh"), INTERPOLATIONS.index("hermite")


@dataclass(frozen=True)
class Hands:
    """Two styluses, sampled.

    Attributes
    ----------
    t : ndarray of float64, shape (n,)
        Times of the samples, increasing, at least two [s].
    z : ndarray of float64, shape (n, 2)
        Heights of the left and of the right stylus [m].
    vz : ndarray of float64, shape (n, 2)
        Their rates [m/s].
    """

    t: NDArray[np.float64]
    z: NDArray[np.float64]
    vz: NDArray[np.float64]


def find_gaps(t: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the indices of the last samples before gaps [1].

    Parameters
    ----------
    t : ndarray of float64, shape (n,)
        Times of the samples, increasing [s].
    """
    intervals = np.diff(t)
    return np.flatnonzero(intervals > GAP_RATIO * np.median(intervals))


@dataclass(frozen=True)
class Held:
    """Motion of two hands at all times: from each tick until the next.

    Attributes
    ----------
    hold : int
        Number of the interpolation [1].
    scale : float
        Ticks per second [1/s].
    ticks : ndarray of int64, shape (n,)
        Times, ascending [1/scale s].
    z : ndarray of float64, shape (n, 2)
        Heights of the left and of the right stylus [m].
    vz : ndarray of float64, shape (n, 2)
        Their rates [m/s].
    az : ndarray of float64, shape (n, 2)
        Accelerations, where needed [m/s2].
    """

    hold: int
    scale: float
    ticks: NDArray[np.int64]
    z: NDArray[np.float64]
    vz: NDArray[np.float64]
    az: NDArray[np.float64]


def hold_hands(hands: Hands, hold: str) -> Held:
    """Define the motion of hands between their samples.

    "hermite" interpolates heights and rates: by a cubic between close samples, by polynomials through four samples
    where they are further apart, and by one cubic across a gap. The others extrapolate from the last sample: with its
    height and rate (zoh), at constant velocity (cv), or at constant acceleration, the slope of the last two rates (ca).
    In a gap they do so for the median interval; then the stylus rests.

    Parameters
    ----------
    hands : Hands
        Samples of both styluses.
    hold : str
        ``hermite``, ``zoh``, ``cv`` or ``ca``.

    Raises
    ------
    ConfigError
        If two samples coincide.
    """
    scale = _scale_of(hands.t)
    ticks = np.rint(hands.t * scale).astype(np.int64)
    close = np.flatnonzero(np.diff(ticks) <= 0)
    if len(close):
        raise ConfigError(f"t: samples {close[0] + 1} and {close[0] + 2} are less than {1 / scale:g} s apart")
    held = Held(INTERPOLATIONS.index(hold), scale, ticks, hands.z, hands.vz, np.zeros_like(hands.vz))
    if hold == "ca":
        held.az[1:] = np.diff(hands.vz, axis=0) / (np.diff(ticks) / scale)[:, None]
    gaps = find_gaps(hands.t)
    return _filled(held, gaps) if hold == "hermite" else _rested(held, gaps)


def _scale_of(t: NDArray[np.float64]) -> float:
    """Return the number of ticks per second."""
    digits = np.floor(-np.log10(4.0 * np.spacing(np.abs(t).max())))
    return float(10.0 ** min(TIME_DIGITS, int(digits)))


def _rested(held: Held, gaps: NDArray[np.int64]) -> Held:
    """Let the hands rest in each gap, after the median interval."""
    usual = int(np.median(np.diff(held.ticks)))
    z, age = held.z[gaps], usual / held.scale
    if held.hold != _ZOH:
        z = z + held.vz[gaps] * age + 0.5 * held.az[gaps] * (age * age)
    return Held(
        held.hold,
        held.scale,
        np.insert(held.ticks, gaps + 1, held.ticks[gaps] + usual),
        np.insert(held.z, gaps + 1, z, axis=0),
        np.insert(held.vz, gaps + 1, 0.0, axis=0),
        np.insert(held.az, gaps + 1, 0.0, axis=0),
    )


def _filled(held: Held, gaps: NDArray[np.int64]) -> Held:
    """Insert samples into long intervals, but not into gaps."""
    parts = np.ceil(np.diff(held.ticks) / (MAX_FILLED_INTERVAL * held.scale) - 1e-6).astype(np.int64)
    parts[gaps] = 1
    if parts.max() == 1:
        return held
    first = np.concatenate(([0], np.cumsum(parts)))
    n = int(first[-1]) + 1
    filled = Held(held.hold, held.scale, np.empty(n, np.int64), np.empty((n, 2)), np.empty((n, 2)), np.zeros((n, 2)))
    ends = np.concatenate((gaps, [len(held.ticks) - 1]))
    _fill(held.ticks, held.z, held.vz, parts, first, ends, held.scale, filled.ticks, filled.z, filled.vz)
    return filled


@kernel
def _fill(
    ticks: NDArray[np.int64],
    z: NDArray[np.float64],
    vz: NDArray[np.float64],
    parts: NDArray[np.int64],
    first: NDArray[np.int64],
    ends: NDArray[np.int64],
    scale: float,
    out_ticks: NDArray[np.int64],
    out_z: NDArray[np.float64],
    out_vz: NDArray[np.float64],
) -> None:
    """Write samples and inserted samples, from osculating polynomials through four (Newton's form, double nodes)."""
    x, c = np.empty(8), np.empty(8)
    begin, run_number = 0, 0
    for i in range(len(ticks)):
        out_ticks[first[i]], out_z[first[i]], out_vz[first[i]] = ticks[i], z[i], vz[i]
        if i == ends[run_number]:  # the last sample before a gap
            begin, run_number = i + 1, run_number + 1
            continue
        # Both samples and their neighbours on this side of a gap, unless two are close together: extrapolation from
        # these would amplify their errors.
        low = max(min(i - 1, ends[run_number] - 3), begin)
        nodes = min(low + 4, ends[run_number] + 1) - low
        for j in range(low, low + nodes - 1):
            if 3 * (ticks[j + 1] - ticks[j]) < ticks[i + 1] - ticks[i]:
                low, nodes = i, 2
                break
        for hand in range(2):
            for j in range(2 * nodes):
                x[j], c[j] = (ticks[low + j // 2] - ticks[i]) / scale, z[low + j // 2, hand]
            for order in range(1, 2 * nodes):
                for j in range(2 * nodes - 1, order - 1, -1):
                    if order == 1 and j % 2 == 1:
                        c[j] = vz[low + j // 2, hand]
                    else:
                        c[j] = (c[j] - c[j - 1]) / (x[j] - x[j - order])
            for part in range(1, parts[i]):
                tick = ticks[i] + (part * (ticks[i + 1] - ticks[i])) // parts[i]
                t, value, slope = (tick - ticks[i]) / scale, 0.0, 0.0
                for j in range(2 * nodes - 1, -1, -1):
                    slope = slope * (t - x[j]) + value
                    value = value * (t - x[j]) + c[j]
                out_ticks[first[i] + part] = tick
                out_z[first[i] + part, hand], out_vz[first[i] + part, hand] = value, slope


def drives_along(held: Held, ticks: NDArray[np.int64], scene: NDArray[Any]) -> NDArray[np.float64]:
    """Return the polynomials of both drives from each time on, until the next sample.

    Returns
    -------
    ndarray of float64, shape (n, 8)
        Coefficients of the left drive and of the right one, as `netboard.physics.hands.extrapolation.drives` takes them
        [N, N/s, N/s2, N/s3].
    """
    places = np.searchsorted(held.ticks, ticks, side="right") - 1
    out = np.empty((len(ticks), 8))
    _write_drives(ticks, places, held.ticks, held.scale, held.z, held.vz, held.az, held.hold, scene[0], out)
    return out


def styluses_along(held: Held, ticks: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return left_z, left_vz, right_z, right_vz of the styluses at the given times, shape (n, 4) [m, m/s]."""
    out, unit = np.empty((len(ticks), 4)), np.zeros(1, SCENE)
    # The drive of a coupling with stiffness 1 and no damping is the height; with damping 1 alone, the rate.
    for first, name in enumerate("kc"):
        unit["k_left"] = unit["k_right"] = name == "k"
        unit["c_left"] = unit["c_right"] = name == "c"
        out[:, first::2] = drives_along(held, ticks, unit)[:, (0, 4)]
    return out


@kernel
def _write_drives(
    knots: NDArray[np.int64],
    samples: NDArray[np.int64],
    ticks: NDArray[np.int64],
    scale: float,
    z: NDArray[np.float64],
    vz: NDArray[np.float64],
    az: NDArray[np.float64],
    hold: int,
    scene: np.void,
    out: NDArray[np.float64],
) -> None:
    """Write the drives relative to their knots."""
    k_left, c_left, k_right, c_right = scene["k_left"], scene["c_left"], scene["k_right"], scene["c_right"]
    for n in range(len(knots)):
        i = samples[n]
        if hold == _HERMITE and i + 1 < len(ticks):
            gap = (ticks[i + 1] - ticks[i]) / scale
            left = between(z[i, 0], vz[i, 0], z[i + 1, 0], vz[i + 1, 0], gap, k_left, c_left)
            right = between(z[i, 1], vz[i, 1], z[i + 1, 1], vz[i + 1, 1], gap, k_right, c_right)
        elif hold in (_HERMITE, _ZOH):
            left, right = resting(z[i, 0], vz[i, 0], k_left, c_left), resting(z[i, 1], vz[i, 1], k_right, c_right)
        else:
            left = moving(z[i, 0], vz[i, 0], az[i, 0], k_left, c_left)
            right = moving(z[i, 1], vz[i, 1], az[i, 1], k_right, c_right)
        u = later(
            (left[0], left[1], left[2], left[3], right[0], right[1], right[2], right[3]), (knots[n] - ticks[i]) / scale
        )
        for j in range(8):
            out[n, j] = u[j]
