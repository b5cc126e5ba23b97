"""Why filters are second-order sections always: the same ones as a fraction of two polynomials, on a recorded ball."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, filtfilt, sosfiltfilt

from netboard.analysis.extraction.trials import RATE

ORDERS = (2, 5, 10)
"""Filter orders of one pass [1]."""

CUTOFFS = (5.0, 20.0)
"""The paper's [Hz]."""


@dataclass(frozen=True, slots=True)
class Form:
    """A filter as a fraction of two polynomials.

    - `cutoff`: its cutoff [Hz].
    - `radius`: magnitude of its largest pole, as the polynomial has it: unstable above 1 [1].
    - `gain`: what it makes of a constant: 1 if it is right [1].
    - `error`: largest difference from the sections, on what was given [as given].
    """

    order: int
    cutoff: float
    radius: float
    gain: float
    error: float


def compared(values: NDArray[np.float64], breaks: NDArray[np.int64]) -> tuple[Form, ...]:
    """Compare both forms on the longest piece of a signal."""
    bounds = np.concatenate([[0], breaks, [values.size]])
    longest = int(np.argmax(np.diff(bounds)))
    return tuple(_forms(values[bounds[longest] : bounds[longest + 1]]))


def _forms(piece: NDArray[np.float64]) -> Iterator[Form]:
    """Yield each order and cutoff."""
    for order in ORDERS:
        for cutoff in CUTOFFS:
            above, below = butter(order, cutoff, fs=RATE)
            sections = butter(order, cutoff, fs=RATE, output="sos")
            pad = min(round(RATE), piece.size - 1)
            right = sosfiltfilt(sections, piece, padlen=pad)
            with np.errstate(over="ignore", invalid="ignore"):  # an unstable filter leaves the range of numbers
                error = np.abs(filtfilt(above, below, piece, padlen=pad) - right).max(initial=0.0)
            radius = float(np.abs(np.roots(below)).max())
            yield Form(order, cutoff, radius, float(above.sum() / below.sum()), float(error))
