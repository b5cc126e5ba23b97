"""Signal processing for all measures: low-pass filters, derivatives, resampling and missing samples.

Samples are evenly spaced at `rate`; a missing sample is NaN. No function crosses a gap or a break, which is the first
sample after a jump. The pieces in between are filtered and differentiated separately, and missing samples remain
missing. Filling short gaps is a separate decision: `bridge`.

Filters are always cascades of second-order sections: as a single transfer function, a tenth-order filter with a cutoff
of 5 Hz at 1 kHz is unstable in float64.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator
from scipy.signal import butter, resample_poly, sosfilt_zi

from netboard.base.compiled import kernel

Breaks = Sequence[int] | NDArray[np.int64]

OrderOf = Literal["both_passes", "each_pass"]
CutoffOf = Literal["design", "both_passes"]
Padding = Literal["odd", "even", "constant", "none"]
Interpolation = Literal["linear", "monotone"]

FINEST_RATIO = 1000
"""Largest integer in the ratio of two rates [1]."""


@dataclass(frozen=True, slots=True)
class LowPass:
    """A zero-phase Butterworth low-pass filter, applied forward and backward.

    Attributes
    ----------
    cutoff : float
        Cutoff frequency, above 0 and below half of the sampling rate [Hz].
    order : int
        Filter order; even if both passes share it [1].
    order_of : {"both_passes", "each_pass"}
        Whether the order is that of both passes together, so that each has half of it (the convention of the field), or
        of each pass.
    cutoff_of : {"design", "both_passes"}
        Whether the cutoff is that of each pass, so that both together halve the amplitude there, or of both together,
        which then have their -3 dB point there (Winter's correction).
    padding : {"odd", "even", "constant", "none"}
        Assumed signal beyond the ends: reflected through the end point, mirrored, constant at the last value, or no
        padding.
    pad : float
        Duration of the padding [s].
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
            raise ValueError(f"two equal passes cannot have an odd order, found {self.order} together")
        if self.pad < 0:
            raise ValueError(f"a signal cannot be continued for {self.pad} s")

    @property
    def pass_order(self) -> int:
        """Order of each pass [1]."""
        return self.order // 2 if self.order_of == "both_passes" else self.order

    def pass_cutoff(self, rate: float) -> float:
        """Return the cutoff frequency of each pass [Hz]."""
        cutoff = self.cutoff
        if 0 < cutoff < rate / 2 and self.cutoff_of == "both_passes":
            stretch = (np.sqrt(2) - 1) ** (-0.5 / self.pass_order)
            cutoff = float(np.arctan(np.tan(np.pi * cutoff / rate) * stretch) * rate / np.pi)
        if cutoff >= rate / 2:
            raise ValueError(f"a cutoff of {cutoff:.4g} Hz needs more than {rate:.4g} samples per second")
        return cutoff

    def __call__(self, values: NDArray[np.float64], rate: float, breaks: Breaks = ()) -> NDArray[np.float64]:
        """Filter a signal [as given]."""
        sections, steady = _sections(self.pass_order, self.pass_cutoff(rate), rate)
        longest = round(self.pad * rate) if self.padding != "none" else 0

        def both_passes(piece: NDArray[np.float64]) -> NDArray[np.float64]:
            length = min(longest, piece.size - 1)
            filtered = _passed_twice(sections, steady, _padded(piece, length, self.padding))
            return filtered[length : length + piece.size]

        return _piecewise(both_passes, values, breaks)


def _padded(piece: NDArray[np.float64], length: int, padding: Padding) -> NDArray[np.float64]:
    """Return a signal with some samples, fewer than it has, at each end; at this size `numpy.pad` takes longer."""
    if padding in ("constant", "none"):
        return np.concatenate([np.full(length, piece[0]), piece, np.full(length, piece[-1])])
    before, after = piece[length:0:-1], piece[-2 : -length - 2 : -1]
    if padding == "odd":
        before, after = 2 * piece[0] - before, 2 * piece[-1] - after
    return np.concatenate([before, piece, after])


@kernel
def _passed_twice(
    sections: NDArray[np.float64], steady: NDArray[np.float64], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Filter forward, then backward, each from the steady state of its first sample, as `scipy.signal.sosfilt` does."""
    filtered = values.copy()
    _passed(sections, steady * filtered[0], filtered)
    filtered = filtered[::-1].copy()
    _passed(sections, steady * filtered[0], filtered)
    return filtered[::-1].copy()


@kernel
def _passed(sections: NDArray[np.float64], state: NDArray[np.float64], values: NDArray[np.float64]) -> None:
    """Filter values in place by a cascade of second-order sections (direct form II, transposed).

    Each value passes all sections before the next one, so that the processor can overlap the sections.
    """
    for n in range(len(values)):
        x = values[n]
        for s in range(len(sections)):
            b0, b1, b2, a1, a2 = sections[s, 0], sections[s, 1], sections[s, 2], sections[s, 4], sections[s, 5]
            y = b0 * x + state[s, 0]
            state[s, 0], state[s, 1] = b1 * x - a1 * y + state[s, 1], b2 * x - a2 * y
            x = y
        values[n] = x


def runs(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the first sample of each run of true values, and the sample after its last, shape (k, 2) [1]."""
    padded = np.concatenate([[False], mask, [False]])
    return np.flatnonzero(padded[1:] != padded[:-1]).reshape(-1, 2)


def ticks_of(seconds: float, rate: float) -> int:
    """Return the number of sample intervals in a duration, rounded as in the trial state machine [1]."""
    return round(seconds * rate)


def lasts(first: ArrayLike, stop: ArrayLike, rate: float) -> NDArray[np.float64]:
    """Return the durations of runs, from first to last sample: a run of n samples lasts ``(n - 1) / rate`` [s]."""
    return (np.asarray(stop, np.float64) - 1.0 - np.asarray(first, np.float64)) / rate


def lasting(mask: NDArray[np.bool_], seconds: float, rate: float) -> NDArray[np.int64]:
    """Return the runs of true values of a minimum duration, as `runs` does. All measures use this definition [1].

    A condition has lasted for a time T when it is true at a sample and at all samples up to and including the one T
    later: at ``T rate + 1`` samples. A single sample lasts 0 s. The trial state machine counts the hold of the ball in
    the target in the same way (it counts ticks from the one after the ball entered), so a hold of 1.5 s at 1 kHz takes
    1501 samples.
    """
    found = runs(mask)
    return found[found[:, 1] - 1 - found[:, 0] >= ticks_of(seconds, rate)]


def paired(left: ArrayLike, right: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return two signals as float arrays of equal length [as given]."""
    a, b = np.asarray(left, dtype=float), np.asarray(right, dtype=float)
    if a.ndim != 1 or a.shape != b.shape:
        raise ValueError(f"expected two signals of the same length, found shapes {a.shape} and {b.shape}")
    return a, b


@lru_cache
def _sections(order: int, cutoff: float, rate: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Design a pass, with its steady state for an input of one; cached for all signals.

    Finding the steady state, as `scipy.signal.sosfiltfilt` does for each signal, takes longer than filtering a trial.
    """
    sections = np.asarray(butter(order, cutoff, fs=rate, output="sos"))
    return sections, np.asarray(sosfilt_zi(sections))


def _pieces(values: NDArray[np.float64], breaks: Breaks) -> Iterator[slice]:
    """Yield the pieces of a signal between gaps and breaks."""
    inner = sorted({int(at) for at in breaks if 0 < at < values.size})
    for begin, end in zip([0, *inner], [*inner, values.size], strict=True):
        for first, stop in runs(np.isfinite(values[begin:end])):
            yield slice(begin + int(first), begin + int(stop))


def _piecewise(
    change: Callable[[NDArray[np.float64]], NDArray[np.float64]], values: NDArray[np.float64], breaks: Breaks
) -> NDArray[np.float64]:
    """Apply a function to each piece of a signal separately."""
    changed = np.full(values.shape, np.nan)
    for piece in _pieces(values, breaks):
        changed[piece] = change(np.asarray(values[piece], np.float64))
    return changed


def derivative(values: NDArray[np.float64], rate: float, breaks: Breaks = ()) -> NDArray[np.float64]:
    """Return the derivative by central differences, shape (n,); NaN for an isolated sample [as given, per s].

    At the ends of a piece it takes one-sided differences of equal order.
    """

    def differences(piece: NDArray[np.float64]) -> NDArray[np.float64]:
        if piece.size < 2:
            return np.full(piece.shape, np.nan)
        return np.asarray(np.gradient(piece, 1 / rate, edge_order=2 if piece.size > 2 else 1))

    return _piecewise(differences, values, breaks)


def by_number(numbers: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Place samples at their numbers, from the first to the last, with NaN for missing ones, shape (m,) [as given].

    Parameters
    ----------
    numbers : ndarray of int64, shape (n,)
        Sample numbers, increasing [1].
    """
    if np.any(np.diff(numbers) <= 0):
        raise ValueError("the sample numbers must increase")
    if numbers.size == 0:
        return np.empty(0)
    whole = np.full(int(numbers[-1] - numbers[0]) + 1, np.nan)
    whole[numbers - numbers[0]] = values
    return whole


def bridge(values: NDArray[np.float64], rate: float, longest: float = 0.02) -> NDArray[np.float64]:
    """Fill short gaps by linear interpolation, shape (n,) [as given].

    Parameters
    ----------
    longest : float
        Longest gap to fill: its missing samples times their spacing. Gaps at the ends remain [s].
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
    """Resample an evenly sampled signal without aliasing (zero-phase polyphase filter) [as given].

    The signal has no missing samples. The first one stays; there are ``ceil(n new_rate / rate)`` samples.

    Parameters
    ----------
    rate, new_rate : float
        Old and new sampling rates, in a ratio of integers up to `FINEST_RATIO` [Hz].
    """
    ratio = Fraction(new_rate / rate).limit_denominator(FINEST_RATIO)
    if ratio <= 0 or ratio.numerator > FINEST_RATIO or not np.isclose(float(ratio), new_rate / rate, rtol=1e-12):
        raise ValueError(f"{new_rate} Hz and {rate} Hz do not have a ratio of integers up to {FINEST_RATIO}")
    if not np.all(np.isfinite(values)):
        raise ValueError(
            "a signal with missing samples cannot be resampled; bridge the gaps, or cut the signal at them"
        )
    # The filter's phases differ in gain by about 1e-4; subtracting the mean keeps a constant exact.
    middle = values.mean() if values.size else 0.0
    return np.asarray(middle + resample_poly(values - middle, ratio.numerator, ratio.denominator, padtype="line"))


def evenly(
    times: NDArray[np.float64], values: NDArray[np.float64], rate: float, kind: Interpolation = "linear"
) -> NDArray[np.float64]:
    """Resample an unevenly sampled signal evenly, at ``times[0] + k / rate`` within the range of `times` [as given].

    There is no anti-aliasing filter: at a rate below the old one the result is aliased, and filtering it afterwards is
    too late.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Two or more sample times, increasing [s].
    rate : float
        New sampling rate, from the first time [Hz].
    kind : {"linear", "monotone"}
        Interpolation between two samples: linear, or a monotone cubic without overshoot (PCHIP).
    """
    if times.size < 2 or not np.all(np.diff(times) > 0):
        raise ValueError("even sampling needs two or more samples with increasing times")
    count = int(np.floor((times[-1] - times[0]) * rate * (1 + 1e-12) + 1e-9)) + 1
    wanted = times[0] + np.arange(count) / rate
    if kind == "linear":
        return np.asarray(np.interp(wanted, times, values))
    return np.asarray(PchipInterpolator(times, values)(np.minimum(wanted, times[-1])))
