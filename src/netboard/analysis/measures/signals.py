"""Signal processing for all measures: low-pass filters, derivatives, resampling and missing samples.

Samples are evenly spaced at `rate`; a missing sample is NaN. No function crosses a gap or a break, which is the first
sample after a jump. The pieces in between are filtered and differentiated separately, and missing samples remain
missing. Filling short gaps is a separate decision: `bridge`.

Filters are always cascades of second-order sections: as a single transfer function, a tenth-order filter with a cutoff
of 5 Hz at 1 kHz is unstable in float64.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator
from scipy.signal import butter, resample_poly, sosfilt_zi

from netboard.analysis.measures.zero_phase import zero_phase
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
        return self.together([values], rate, [breaks])[0]

    def together(
        self, signals: Sequence[NDArray[np.float64]], rate: float, breaks: Sequence[Breaks]
    ) -> list[NDArray[np.float64]]:
        """Filter several signals, each as if alone; four together take the time of one [as given].

        Parameters
        ----------
        signals : sequence of ndarray, shape (n_k,)
            Signals of one sampling rate, which may differ in length [as given].
        breaks : sequence of sequence of int
            For each signal, the first samples after its jumps; empty for none [1].
        """
        sections, steady = _sections(self.pass_order, self.pass_cutoff(rate), rate)
        longest = round(self.pad * rate) if self.padding != "none" else 0
        bounds = [_bounds_of(values, own) for values, own in zip(signals, breaks, strict=True)]
        pieces = [
            np.ascontiguousarray(values[first:stop], np.float64)
            for values, own in zip(signals, bounds, strict=True)
            for first, stop in own.tolist()
        ]
        filtered = iter(zero_phase(pieces, sections, steady, longest, self.padding) if pieces else ())
        return [_joined(values.size, own, filtered) for values, own in zip(signals, bounds, strict=True)]


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


def _bounds_of(values: NDArray[np.float64], breaks: Breaks) -> NDArray[np.int64]:
    """Return first sample and stop of each piece of a signal between gaps and breaks, shape (k, 2) [1]."""
    inner = np.unique(np.asarray(breaks, np.int64))
    inner = inner[(inner > 0) & (inner < values.size)]
    if values.size and is_whole(values):
        edges = np.concatenate([[0], inner, [values.size]])
        return np.stack([edges[:-1], edges[1:]], axis=1)
    return _bounds(np.asarray(values, np.float64), inner)


def is_whole(values: NDArray[np.float64]) -> bool:
    """Return whether a signal has no missing sample, none that is not finite [1]."""
    return bool(_is_whole(np.ascontiguousarray(values, np.float64)))


@kernel
def _is_whole(values: NDArray[np.float64]) -> bool:
    missing = 0
    for n in range(len(values)):
        missing += not np.isfinite(values[n])
    return missing == 0


@kernel
def _bounds(values: NDArray[np.float64], breaks: NDArray[np.int64]) -> NDArray[np.int64]:
    """Find the pieces between missing samples, and the breaks, which increase and lie within the signal."""
    count, following = 0, 0
    found = np.empty((len(values) + 1, 2), np.int64)
    inside = False
    for n in range(len(values)):
        broken = following < len(breaks) and breaks[following] == n
        following += broken
        known = np.isfinite(values[n])
        if inside and (broken or not known):
            found[count - 1, 1] = n
        if known and (broken or not inside):
            found[count, 0] = n
            count += 1
        inside = known
    if inside:
        found[count - 1, 1] = len(values)
    return found[:count].copy()


def _joined(size: int, bounds: NDArray[np.int64], pieces: Iterator[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return a signal of its next pieces, with missing samples between them."""
    if len(bounds) == 1 and bounds[0, 1] - bounds[0, 0] == size:
        return next(pieces)
    whole = np.full(size, np.nan)
    for first, stop in bounds.tolist():
        whole[first:stop] = next(pieces)
    return whole


def derivative(values: NDArray[np.float64], rate: float, breaks: Breaks = ()) -> NDArray[np.float64]:
    """Return the derivative by central differences, shape (n,); NaN for an isolated sample [as given, per s].

    At the ends of a piece it takes one-sided differences of equal order.
    """
    rates = np.empty(values.shape)
    _differences(np.asarray(values, np.float64), _bounds_of(values, breaks), 1 / rate, rates)
    return rates


@kernel
def _differences(
    values: NDArray[np.float64], bounds: NDArray[np.int64], step: float, rates: NDArray[np.float64]
) -> None:
    """Write the differences of each piece, as `numpy.gradient` computes them, and NaN where there are none."""
    done = 0
    for first, stop in bounds:
        rates[done:first] = np.nan
        done, size, last = stop, stop - first, stop - 1
        if size == 1:
            rates[first] = np.nan
        elif size == 2:
            rates[first] = rates[last] = (values[last] - values[first]) / step
        else:
            one, two, half = 1.5 / step, 2.0 / step, 0.5 / step
            rates[first] = -one * values[first] + two * values[first + 1] + -half * values[first + 2]
            for n in range(first + 1, last):
                rates[n] = (values[n + 1] - values[n - 1]) / (2.0 * step)
            rates[last] = half * values[last - 2] + -two * values[last - 1] + one * values[last]
    rates[done:] = np.nan


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
    """Fill short gaps by linear interpolation, shape (n,); a signal without any is returned as it is [as given].

    Parameters
    ----------
    longest : float
        Longest gap to fill: its missing samples times their spacing. Gaps at the ends remain [s].
    """
    if is_whole(values):
        return np.asarray(values, np.float64)
    missing, filled = ~np.isfinite(values), np.array(values, np.float64)
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
