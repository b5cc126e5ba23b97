"""Smoothness of a movement: spectral arc length and dimensionless jerk.

Both measures apply to the speed of one movement, or any signal that rises from zero and returns to zero. They are
negative; values nearer to zero are smoother. Neither depends on the amplitude or the duration of a movement of given
shape. The definitions are those of Balasubramanian, Melendez-Calderon and Burdet (IEEE Trans. Biomed. Eng. 59:2126,
2012) and of Balasubramanian, Melendez-Calderon, Roby-Brami and Burdet (J. NeuroEng. Rehabil. 12:112, 2015).

Jerk is the third derivative of position: compute it from filtered signals only.
"""

from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import fft, ifft, next_fast_len

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
    """Return the spectral arc length of a speed: SPARC, or the older SAL; negative [1].

    NaN without movement or with a missing sample.

    It is minus the arc length of the normalised magnitude spectrum V over the frequency f, up to f_c::

        - integral from 0 to f_c of sqrt((1 / f_c)^2 + (d(V / V(0)) / df)^2) df

    A speed has its largest magnitude at f = 0. A signal of both signs does not: its magnitude is normalised by the
    largest value up to `highest`, and the curve begins where it first reaches the threshold. The authors' program gives
    the same result unless that signal's largest magnitude lies above `highest`.

    Only the frequencies up to `highest` are computed, by a chirp transform: at 1 kHz one in fifty of those of the
    padded record.

    Parameters
    ----------
    cutoff : {"adaptive", "fixed"}
        The curve ends at the last frequency up to `highest` at which the magnitude is above the threshold (SPARC,
        2015), or at `highest` (SAL, 2012).
    highest : float
        Largest frequency, at most half of the sampling rate; 10 Hz for SPARC, 20 Hz was usual for SAL [Hz].
    threshold : float
        Fraction of the largest magnitude, for the adaptive cutoff [1].
    padding : int
        Zero padding: the record is extended to ``2 ** (ceil(log2(n)) + padding)`` samples [1].
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
    magnitude = np.abs(_zoomed(v, _chirp(size >> padding, count, count * rate / size / rate)))
    magnitude /= magnitude.max()
    if cutoff == "adaptive":
        above = np.flatnonzero(magnitude >= threshold)
        if len(above) < 2:
            return np.nan
        frequencies, magnitude = frequencies[above[0] : above[-1] + 1], magnitude[above[0] : above[-1] + 1]
    return float(-np.hypot(np.diff(frequencies) / (frequencies[-1] - frequencies[0]), np.diff(magnitude)).sum())


class _Chirp(NamedTuple):
    """A chirp and its inverse, for signals up to their length, and the number of frequencies [1]."""

    values: NDArray[np.complex128]
    inverse: NDArray[np.complex128]
    frequencies: int


@lru_cache(maxsize=32)
def _chirp(longest: int, count: int, span: float) -> _Chirp:
    """Return the chirp for frequencies from 0 to a share of the sampling rate; all signals of a padded length share it.

    Its exponentials take longer than the transform of a trial.
    """
    k = np.arange(max(longest, count))
    values = np.exp(-(1j * np.pi * span * k**2) / count)
    return _Chirp(values, 1 / values, count)


def _zoomed(v: NDArray[np.float64], chirp: _Chirp) -> NDArray[np.complex128]:
    """Return the spectrum that `scipy.signal.zoom_fft` returns, to the bit."""
    n, count = len(v), chirp.frequencies
    length = next_fast_len(n + count - 1)
    kernel = fft(np.concatenate((chirp.inverse[n - 1 : 0 : -1], chirp.inverse[:count])), length)
    around = ifft(kernel * fft(v * chirp.values[:n], length))
    return np.asarray(around[n - 1 : n + count - 1] * chirp.values[:count])


def dimensionless_jerk(speed: ArrayLike, rate: float, *, scale: Scale = "peak_speed") -> float:
    """Return the dimensionless squared jerk, negative; NaN without movement or with a missing sample [1].

    It is::

        - T^3 / v^2 * integral of (d2v / dt2)^2 dt

    For a minimum-jerk movement it is -204.8 with the peak speed, and -720 with the mean speed.

    Parameters
    ----------
    scale : {"peak_speed", "mean_speed"}
        Speed v: the largest (Balasubramanian et al. 2012), or distance over duration, which makes the factor T^5 /
        distance^2 (both in Hogan and Sternad, J. Mot. Behav. 41:529, 2009).
    """
    v = _checked(speed, least=3)
    duration = len(v) / rate
    size = np.abs(v).max() if scale == "peak_speed" else np.abs(v.sum()) / rate / duration
    if not np.isfinite(v).all() or not size > 0.0:
        return np.nan
    # Divide first, because the square of a tiny speed underflows to zero.
    jerk = np.diff(v / size, 2) * rate**2
    return float(-(duration**3) * np.sum(jerk**2) / rate)


def log_dimensionless_jerk(speed: ArrayLike, rate: float, *, scale: Scale = "peak_speed") -> float:
    """Return the log dimensionless jerk (LDLJ): minus the logarithm of the absolute jerk; NaN without jerk [1].

    It is negative for all movements from rest to rest; for a minimum-jerk movement it is -5.322 with the peak speed
    and -6.579 with the mean speed.

    Parameters
    ----------
    scale : {"peak_speed", "mean_speed"}
        As in `dimensionless_jerk`.
    """
    jerk = -dimensionless_jerk(speed, rate, scale=scale)
    return float(-np.log(jerk)) if jerk > 0.0 else np.nan


def _checked(speed: ArrayLike, least: int = 2) -> NDArray[np.float64]:
    """Return a speed as a float array; check its shape and length."""
    v = np.asarray(speed, dtype=float)
    if v.ndim != 1 or len(v) < least:
        raise ValueError(f"expected a speed with one value for each of at least {least} samples, found shape {v.shape}")
    return v
