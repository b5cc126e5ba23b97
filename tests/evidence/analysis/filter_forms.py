"""Numerical error of Butterworth filters in transfer-function form, compared with second-order sections (question A3).

A pass of order 10 as one ratio of two polynomials is unstable in double precision, so the analysis filters with
second-order sections.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, filtfilt, sosfiltfilt

from netboard.analysis.extraction.trials import RATE
from netboard.benchmarks.harness.results import ResultPart

ORDERS = (2, 5, 10)
"""Filter orders of one pass [1]."""

CUTOFFS = (5.0, 20.0)
"""Cutoff frequencies of the paper [Hz]."""


@dataclass(frozen=True, slots=True)
class Form:
    """A low-pass filter in transfer-function form.

    - `radius`: magnitude of the largest pole, computed from the denominator: unstable above 1 [1].
    - `gain`: gain at 0 Hz: 1 if it is correct [1].
    - `error`: largest difference from second-order sections [unit of the signal].
    """

    order: int
    cutoff: float
    radius: float
    gain: float
    error: float


def compare_forms(values: NDArray[np.float64], breaks: NDArray[np.int64]) -> tuple[Form, ...]:
    """Compare both forms on the longest piece of a signal between breaks."""
    bounds = np.concatenate([[0], breaks, [values.size]])
    longest = int(np.argmax(np.diff(bounds)))
    return tuple(_forms(values[bounds[longest] : bounds[longest + 1]]))


def _forms(piece: NDArray[np.float64]) -> Iterator[Form]:
    """Yield a comparison for each order and cutoff."""
    for order in ORDERS:
        for cutoff in CUTOFFS:
            numerator, denominator = butter(order, cutoff, fs=RATE)
            sections = butter(order, cutoff, fs=RATE, output="sos")
            pad = min(round(RATE), piece.size - 1)
            exact = sosfiltfilt(sections, piece, padlen=pad)
            with np.errstate(over="ignore", invalid="ignore"):  # the output of an unstable filter overflows
                error = np.abs(filtfilt(numerator, denominator, piece, padlen=pad) - exact).max(initial=0.0)
            radius = float(np.abs(np.roots(denominator)).max())
            yield Form(order, cutoff, radius, float(numerator.sum() / denominator.sum()), float(error))


def forms_part(recordings: Sequence[Sequence[Form]]) -> ResultPart:
    """Tabulate the largest error over recordings, of each order and cutoff."""
    part = ResultPart(
        "forms",
        "A3: filters in transfer-function form, compared with second-order sections, on recorded ball positions",
        "order of a pass | cutoff [Hz] | largest pole [1] | gain at 0 Hz [1] | "
        "largest error of the ball's position [m]",
    )
    for same in zip(*recordings, strict=True):
        form, errors = same[0], np.array([one.error for one in same])
        largest = f"{errors.max():.2g}" if np.isfinite(errors).all() else "overflow"
        part.add(form.order, form.cutoff, f"{form.radius:.6f}", f"{form.gain:.6g}", largest)
    worst = {order: max(form.radius for form in recordings[0] if form.order == order) for order in (5, 10)}
    part.claim(
        "in transfer-function form, passes of order 5 are stable and passes of order 10 are unstable",
        worst[5] < 1 < worst[10],
        f"largest poles {worst[5]:.6f} and {worst[10]:.6f}",
    )
    return part
