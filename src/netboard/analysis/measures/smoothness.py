"""How smooth a movement is: its spectral arc length, and its jerk without dimensions.

Both are of the speed of one movement, or of anything that is zero, rises and is zero again. They are negative; nearer
to zero is smoother. Neither depends on amplitude or duration of a movement of one shape. The definitions are those of
Balasubramanian, Melendez-Calderon and Burdet (IEEE Trans. Biomed. Eng. 59:2126, 2012) and of Balasubramanian,
Melendez-Calderon, Roby-Brami and Burdet (J. NeuroEng. Rehabil. 12:112, 2015).

The jerk is a third derivative of the position: it says something of filtered signals, and nothing of raw ones.
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import zoom_fft

Cutoff = Literal["adaptive", "fixed"]
Scale = Literal["peak_speed", "mean_speed"]


def spectral_arc_length(
    speed: ArrayLike,
    rate: float,
    *,
    cutoff: Cutoff = "adaptive",
    highest: float = 10.0,
    threshold: float = 0.05,
    padding: int = 4,
) -> float:
    """Return the spectral arc length of a speed: SPARC, or the older SAL.

    It is minus the length of the curve of the spectrum's magnitude V over the frequency f, up to f_c::

        - integral from 0 to f_c of sqrt((1 / f_c)^2 + (d(V / V(0)) / df)^2) df

    A speed has its largest magnitude at f = 0. For a signal of both signs that is not so; the magnitude is then taken
    over its largest value up to `highest`, and the curve begins where it first reaches the threshold. The authors'
    program gives the same unless that signal is largest at a frequency that does not count.

    Only the frequencies up to `highest` are computed, as a chirp transform: those of the padded record, one in fifty of
    all at 1 kHz.

    Parameters
    ----------
    speed : array_like, shape (n,)
        Speed of the movement [m/s].
    rate : float
        Sampling rate [Hz].
    cutoff : {"adaptive", "fixed"}
        The curve ends at the last frequency up to `highest` at which the magnitude is above the threshold (SPARC,
        2015), or at `highest` (SAL, 2012).
    highest : float
        No frequency above this counts; 10 Hz with SPARC, 20 Hz was usual with SAL [Hz].
    threshold : float
        Portion of the largest magnitude, for the adaptive cutoff [1].
    padding : int
        The record is filled up with zeros to this power of two times the next power of two of its length [1].

    Returns
    -------
    float
        The arc length, negative; NaN if nothing moves or a sample is missing [1].

    Raises
    ------
    ValueError
        If the speed has fewer than two samples, or the highest frequency is beyond half the rate.
    """
    v = _checked(speed)
    if not 0.0 < highest <= rate / 2.0:
        raise ValueError(
            f"the highest frequency lies between 0 and half the rate, {rate / 2:g} Hz; found {highest:g} Hz"
        )
    if not np.isfinite(v).all() or not v.any():
        return np.nan
    size = 2 ** (int(np.ceil(np.log2(len(v)))) + padding)
    count = int(highest * size / rate) + 1
    frequencies = np.arange(count) * (rate / size)
    magnitude = np.abs(zoom_fft(v, count * rate / size, count, fs=rate))
    magnitude /= magnitude.max()
    if cutoff == "adaptive":
        above = np.flatnonzero(magnitude >= threshold)
        if len(above) < 2:
            return np.nan
        frequencies, magnitude = frequencies[above[0] : above[-1] + 1], magnitude[above[0] : above[-1] + 1]
    return float(-np.hypot(np.diff(frequencies) / (frequencies[-1] - frequencies[0]), np.diff(magnitude)).sum())


def dimensionless_jerk(speed: ArrayLike, rate: float, *, scale: Scale = "peak_speed") -> float:
    """Return the jerk of a movement, squared and without dimensions.

    It is::

        - T^3 / v^2 * integral of (d2v / dt2)^2 dt

    Of a movement of minimum jerk it is -204.8 with its peak speed, and -720 with its mean speed.

    Parameters
    ----------
    speed : array_like, shape (n,)
        Speed of the movement, from rest to rest; it lasts n samples [m/s].
    rate : float
        Sampling rate [Hz].
    scale : {"peak_speed", "mean_speed"}
        The speed v: the largest (Balasubramanian et al. 2012), or distance over duration, by which the factor is
        T^5 / distance^2 (both in Hogan and Sternad, J. Mot. Behav. 41:529, 2009).

    Returns
    -------
    float
        The jerk, negative; NaN if nothing moves or a sample is missing [1].

    Raises
    ------
    ValueError
        If the speed has fewer than three samples.
    """
    v = _checked(speed, least=3)
    duration = len(v) / rate
    size = np.abs(v).max() if scale == "peak_speed" else np.abs(v.sum()) / rate / duration
    if not np.isfinite(v).all() or not size > 0.0:
        return np.nan
    # Divided first: the square of a tiny speed is zero.
    jerk = np.diff(v / size, 2) * rate**2
    return float(-(duration**3) * np.sum(jerk**2) / rate)


def log_dimensionless_jerk(speed: ArrayLike, rate: float, *, scale: Scale = "peak_speed") -> float:
    """Return minus the logarithm of the jerk of a movement without dimensions: LDLJ.

    Of a movement of minimum jerk it is -5.322 with its peak speed, and -6.579 with its mean speed.

    Parameters
    ----------
    speed : array_like, shape (n,)
        Speed of the movement, from rest to rest; it lasts n samples [m/s].
    rate : float
        Sampling rate [Hz].
    scale : {"peak_speed", "mean_speed"}
        As in `dimensionless_jerk`.

    Returns
    -------
    float
        The logarithm, negative for all movements from rest to rest; NaN where there is no jerk [1].

    Raises
    ------
    ValueError
        If the speed has fewer than three samples.
    """
    jerk = -dimensionless_jerk(speed, rate, scale=scale)
    return float(-np.log(jerk)) if jerk > 0.0 else np.nan


def _checked(speed: ArrayLike, least: int = 2) -> NDArray[np.float64]:
    """Check that there is one record."""
    v = np.asarray(speed, dtype=float)
    if v.ndim != 1 or len(v) < least:
        raise ValueError(f"a speed has one value for each of at least {least} samples, found shape {v.shape}")
    return v
