"""From what was sampled to what is measured: low-pass filters, derivatives, other rates, samples that are missing.

Samples are evenly spaced, `rate` a second; one that is missing is not a number. Nothing here reaches over a hole or
over a break, which is the first sample after a jump: the pieces between them are filtered and differentiated by
themselves, and what was missing stays missing. To fill short holes is a decision of its own, `bridge`.

Filters are cascades of second-order sections, always: as one fraction of two polynomials a tenth-order filter with a
cutoff of 5 Hz at 1 kHz is unstable in float64.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator
from scipy.signal import butter, resample_poly, sosfiltfilt

Breaks = Sequence[int] | NDArray[np.int64]

OrderOf = Literal["both_passes", "each_pass"]
CutoffOf = Literal["design", "both_passes"]
Padding = Literal["odd", "even", "constant", "none"]
Interpolation = Literal["linear", "monotone"]

FINEST_RATIO = 1000
"""Two rates are taken as a ratio of integers up to this [1]."""


@dataclass(frozen=True, slots=True)
class LowPass:
    """A Butterworth low-pass filter, run forward and backward, so that it delays nothing.

    Attributes
    ----------
    cutoff : float
        Its cutoff frequency [Hz].
    order : int
        Its order [1].
    order_of : {"both_passes", "each_pass"}
        What has that order: both passes together, so that each has half of it (the convention of the field), or each of
        the two.
    cutoff_of : {"design", "both_passes"}
        What has its cutoff there: one pass, so that both together halve the amplitude at it, or both together, which
        then have their -3 dB there (Winter's correction).
    padding : {"odd", "even", "constant", "none"}
        What is assumed beyond the ends: the signal turned about its end point, mirrored, its last value, or nothing.
    pad : float
        For how long that is assumed [s].

    Raises
    ------
    ValueError
        If the cutoff is not positive, or there is no such order.
    """

    cutoff: float
    order: int = 10
    order_of: OrderOf = "both_passes"
    cutoff_of: CutoffOf = "design"
    padding: Padding = "odd"
    pad: float = 1.0

    def __post_init__(self) -> None:
        if not self.cutoff > 0:
            raise ValueError(f"the cutoff of a low-pass filter is positive, not {self.cutoff} Hz")
        if self.order < 1 or (self.order_of == "both_passes" and self.order % 2):
            raise ValueError(f"two equal passes cannot have the order {self.order} together")
        if self.pad < 0:
            raise ValueError(f"a signal cannot be continued for {self.pad} s")

    @property
    def pass_order(self) -> int:
        """Order of each pass [1]."""
        return self.order // 2 if self.order_of == "both_passes" else self.order

    def pass_cutoff(self, rate: float) -> float:
        """Cutoff frequency of each pass [Hz].

        Parameters
        ----------
        rate : float
            Sampling rate [Hz].

        Raises
        ------
        ValueError
            If it is not below half the rate.
        """
        cutoff = self.cutoff
        if 0 < cutoff < rate / 2 and self.cutoff_of == "both_passes":
            stretch = (np.sqrt(2) - 1) ** (-0.5 / self.pass_order)
            cutoff = float(np.arctan(np.tan(np.pi * cutoff / rate) * stretch) * rate / np.pi)
        if cutoff >= rate / 2:
            raise ValueError(f"a cutoff of {cutoff:.4g} Hz needs more than {rate:.4g} samples per second")
        return cutoff

    def __call__(self, values: NDArray[np.float64], rate: float, breaks: Breaks = ()) -> NDArray[np.float64]:
        """Filter a signal.

        Parameters
        ----------
        values : ndarray, shape (n,)
            The signal [any].
        rate : float
            Sampling rate [Hz].
        breaks : sequence of int
            First samples after a jump [1].

        Returns
        -------
        ndarray, shape (n,)
            The filtered signal [as given].
        """
        sections = _sections(self.pass_order, self.pass_cutoff(rate), rate)
        longest = round(self.pad * rate)

        def both_passes(piece: NDArray[np.float64]) -> NDArray[np.float64]:
            padded = self.padding != "none"
            length = min(longest, piece.size - 1) if padded else 0
            filtered: NDArray[np.float64] = sosfiltfilt(
                sections, piece, padtype=self.padding if padded else None, padlen=length
            )
            return filtered

        return _piecewise(both_passes, values, breaks)


def runs(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Where something is true without a break.

    Parameters
    ----------
    mask : ndarray of bool, shape (n,)
        Whether it is [1].

    Returns
    -------
    ndarray of int64, shape (k, 2)
        First sample of each run and the one after its last [1].
    """
    padded = np.concatenate([[False], mask, [False]])
    return np.flatnonzero(padded[1:] != padded[:-1]).reshape(-1, 2)


def ticks_of(seconds: float, rate: float) -> int:
    """Return how many sample intervals a time takes: the nearest whole number, as in the trial state machine [1].

    Parameters
    ----------
    seconds : float
        The time [s].
    rate : float
        Sampling rate [Hz].
    """
    return round(seconds * rate)


def lasts(first: ArrayLike, stop: ArrayLike, rate: float) -> NDArray[np.float64]:
    """Return how long stretches of samples last: from the first sample of each to its last one.

    Parameters
    ----------
    first, stop : array_like, shape (k,)
        First sample of each stretch and the one after its last, as from `runs` [1].
    rate : float
        Sampling rate [Hz].

    Returns
    -------
    ndarray, shape (k,)
        The durations: a stretch of n samples lasts ``(n - 1) / rate`` [s].
    """
    return (np.asarray(stop, np.float64) - 1.0 - np.asarray(first, np.float64)) / rate


def lasting(mask: NDArray[np.bool_], seconds: float, rate: float) -> NDArray[np.int64]:
    """Find where a condition holds for a minimum duration: the one definition of this in all measures.

    A condition has lasted for a time T when it is true at a sample and at all samples up to, and including, the one
    that is T later: at ``T rate + 1`` samples. The trial state machine counts the hold of the ball in the target in
    this way (it counts ticks from the one after the ball came in), so a hold of 1.5 s at 1 kHz takes 1501 samples.

    Parameters
    ----------
    mask : ndarray of bool, shape (n,)
        Whether the condition is true [1].
    seconds : float
        The minimum duration; a single sample lasts for 0 s [s].
    rate : float
        Sampling rate [Hz].

    Returns
    -------
    ndarray of int64, shape (k, 2)
        First sample of each run that is long enough, and the one after its last [1].
    """
    found = runs(mask)
    return found[found[:, 1] - 1 - found[:, 0] >= ticks_of(seconds, rate)]


def paired(left: ArrayLike, right: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Take two signals that go together, sample by sample.

    Parameters
    ----------
    left, right : array_like, shape (n,)
        The signals [any].

    Returns
    -------
    left, right : ndarray of float64, shape (n,)
        The same [as given].

    Raises
    ------
    ValueError
        If they are not of one length.
    """
    a, b = np.asarray(left, dtype=float), np.asarray(right, dtype=float)
    if a.ndim != 1 or a.shape != b.shape:
        raise ValueError(f"two signals of one length are expected, found shapes {a.shape} and {b.shape}")
    return a, b


@lru_cache
def _sections(order: int, cutoff: float, rate: float) -> NDArray[np.float64]:
    """Design a pass, once for all signals that it is for."""
    return np.asarray(butter(order, cutoff, fs=rate, output="sos"))


def _pieces(values: NDArray[np.float64], breaks: Breaks) -> Iterator[slice]:
    """Yield where a signal is without holes and breaks."""
    inner = sorted({int(at) for at in breaks if 0 < at < values.size})
    for begin, end in zip([0, *inner], [*inner, values.size], strict=True):
        for first, stop in runs(np.isfinite(values[begin:end])):
            yield slice(begin + int(first), begin + int(stop))


def _piecewise(
    change: Callable[[NDArray[np.float64]], NDArray[np.float64]], values: NDArray[np.float64], breaks: Breaks
) -> NDArray[np.float64]:
    """Change each piece of a signal by itself."""
    changed = np.full(values.shape, np.nan)
    for piece in _pieces(values, breaks):
        changed[piece] = change(np.asarray(values[piece], np.float64))
    return changed


def derivative(values: NDArray[np.float64], rate: float, breaks: Breaks = ()) -> NDArray[np.float64]:
    """Rate of change, by central differences; at the ends of a piece by one-sided ones that are as accurate.

    Parameters
    ----------
    values : ndarray, shape (n,)
        The signal [any].
    rate : float
        Sampling rate [Hz].
    breaks : sequence of int
        First samples after a jump [1].

    Returns
    -------
    ndarray, shape (n,)
        Its derivative; NaN for a sample that stands alone [as given, per s].
    """

    def differences(piece: NDArray[np.float64]) -> NDArray[np.float64]:
        if piece.size < 2:
            return np.full(piece.shape, np.nan)
        return np.asarray(np.gradient(piece, 1 / rate, edge_order=2 if piece.size > 2 else 1))

    return _piecewise(differences, values, breaks)


def by_number(numbers: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Put samples where their numbers say, so that missing ones leave holes.

    Parameters
    ----------
    numbers : ndarray of int64, shape (n,)
        Numbers of the samples, rising [1].
    values : ndarray, shape (n,)
        The samples [any].

    Returns
    -------
    ndarray, shape (m,)
        One sample for each number from the first to the last, NaN for those that are missing [as given].

    Raises
    ------
    ValueError
        If the numbers do not rise.
    """
    if np.any(np.diff(numbers) <= 0):
        raise ValueError("the numbers of samples must rise")
    if numbers.size == 0:
        return np.empty(0)
    whole = np.full(int(numbers[-1] - numbers[0]) + 1, np.nan)
    whole[numbers - numbers[0]] = values
    return whole


def bridge(values: NDArray[np.float64], rate: float, longest: float = 0.02) -> NDArray[np.float64]:
    """Fill short holes with straight lines.

    Parameters
    ----------
    values : ndarray, shape (n,)
        The signal, NaN where a sample is missing [any].
    rate : float
        Sampling rate [Hz].
    longest : float
        Longest hole that is filled: its missing samples times their spacing. Holes at the ends are left [s].

    Returns
    -------
    ndarray, shape (n,)
        The signal with fewer holes [as given].
    """
    missing = ~np.isfinite(values)
    filled = np.array(values, np.float64)
    if missing.all():
        return filled
    places = np.arange(values.size)
    for first, stop in runs(missing):
        if first > 0 and stop < values.size and stop - first <= longest * rate * (1 + 1e-9):
            filled[first:stop] = np.interp(places[first:stop], (first - 1, stop), (values[first - 1], values[stop]))
    return filled


def resample(values: NDArray[np.float64], rate: float, new_rate: float) -> NDArray[np.float64]:
    """Give an evenly sampled signal another rate, without aliases (a polyphase filter without delay).

    Parameters
    ----------
    values : ndarray, shape (n,)
        The signal, without holes [any].
    rate, new_rate : float
        Samples per second before and after, in a ratio of integers up to `FINEST_RATIO` [Hz].

    Returns
    -------
    ndarray, shape (m,)
        The same from the same first sample on, ``ceil(n new_rate / rate)`` samples [as given].

    Raises
    ------
    ValueError
        If samples are missing, or the rates have no such ratio.
    """
    ratio = Fraction(new_rate / rate).limit_denominator(FINEST_RATIO)
    if ratio <= 0 or ratio.numerator > FINEST_RATIO or not np.isclose(float(ratio), new_rate / rate, rtol=1e-12):
        raise ValueError(f"{new_rate} Hz and {rate} Hz are in no ratio of integers up to {FINEST_RATIO}")
    if not np.all(np.isfinite(values)):
        raise ValueError("a signal with holes cannot be resampled; bridge them or cut it there")
    # The filter's phases differ in their gain by some 1e-4, which a constant need not suffer.
    middle = values.mean() if values.size else 0.0
    return np.asarray(middle + resample_poly(values - middle, ratio.numerator, ratio.denominator, padtype="line"))


def evenly(
    times: NDArray[np.float64], values: NDArray[np.float64], rate: float, kind: Interpolation = "linear"
) -> NDArray[np.float64]:
    """Sample a signal evenly that was not.

    Nothing is filtered: where the new rate is lower than the old one, filter afterwards would be too late.

    Parameters
    ----------
    times : ndarray, shape (n,)
        When the samples were taken, rising [s].
    values : ndarray, shape (n,)
        The samples [any].
    rate : float
        Samples per second wanted, from the first time on [Hz].
    kind : {"linear", "monotone"}
        What lies between two samples: a straight line, or a cubic without overshoot (PCHIP).

    Returns
    -------
    ndarray, shape (m,)
        Samples at ``times[0] + k / rate``, as far as `times` reaches [as given].

    Raises
    ------
    ValueError
        If there are fewer than two samples or their times do not rise.
    """
    if times.size < 2 or not np.all(np.diff(times) > 0):
        raise ValueError("to sample evenly takes two samples or more, with rising times")
    count = int(np.floor((times[-1] - times[0]) * rate * (1 + 1e-12) + 1e-9)) + 1
    wanted = times[0] + np.arange(count) / rate
    if kind == "linear":
        return np.asarray(np.interp(wanted, times, values))
    return np.asarray(PchipInterpolator(times, values)(np.minimum(wanted, times[-1])))
