"""Resamples data of any rate to ticks of 1 ms. Arrays in, arrays out.

There are no ticks within a gap, where samples are further apart than the gap option. Samples at tick times stay
bit-identical. Others are interpolated: positions by a cubic spline (or linearly, on request), other numbers linearly;
integers, words and values of an attempt keep the newest sample. No filter is applied, so frequencies above the Nyquist
limit of the ticks alias.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import Akima1DInterpolator, CubicHermiteSpline, CubicSpline

from netboard.base.errors import ConfigError
from netboard.base.tick import TICK_SECONDS
from netboard.recording.importing.columns import OF_ATTEMPT, RATES

Interpolation = Literal["cubic", "linear"]

NEAR = 1e-3
"""Tolerance, in ticks, for a sample at a tick: a microsecond, the rounding of times [1]."""

HANDS = ("left_z", "right_z")
"""Positions that never jump. Board and ball jump when they are reset between trials."""

Columns = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, slots=True)
class Segment:
    """A range of samples without gaps."""

    first: int
    stop: int
    ticks: NDArray[np.int64]  # tick numbers of the range; the first sample of the data is at tick 0
    exact: bool


def segments(time: NDArray[np.float64], gap: float) -> list[Segment]:
    """Split samples at gaps."""
    at = (time - time[0]) / TICK_SECONDS
    cuts = np.flatnonzero(np.diff(time) > gap) + 1
    found = []
    for first, stop in zip([0, *cuts.tolist()], [*cuts.tolist(), time.size], strict=True):
        if stop - first < 2:  # a single sample has no velocity
            continue
        low, high = np.ceil(at[first] - NEAR), np.floor(at[stop - 1] + NEAR)
        ticks = np.arange(int(low), int(high) + 1)
        if not ticks.size:
            continue
        exact = ticks.size == stop - first and bool(np.all(np.abs(at[first:stop] - ticks) <= NEAR))
        found.append(Segment(first, stop, ticks, exact))
    if not found:
        raise ConfigError(f"no two rows are within {gap:g} s of each other: is time in another unit? (--unit time=ms)")
    return found


def resampled(time: NDArray[np.float64], columns: Columns, segment: Segment, kind: Interpolation) -> Columns:
    """Return the columns of a range at its ticks, with the velocities of positions.

    ``columns``: the samples: int64, strings and `OF_ATTEMPT` keep the newest value, float64 is interpolated [SI].
    Returns the columns at the ticks, with the `RATES` of all positions [SI].
    """
    here = slice(segment.first, segment.stop)
    t = time[here]
    x = np.clip(time[0] + segment.ticks * TICK_SECONDS, t[0], t[-1])
    newest = np.searchsorted(t, x + NEAR * TICK_SECONDS, "right") - 1
    found: dict[str, NDArray[Any]] = {}
    for name, values in ((name, column[here]) for name, column in columns.items()):
        if segment.exact or values.dtype.kind != "f" or name in OF_ATTEMPT:
            found[name] = values[newest]
        elif name not in RATES:
            found[name] = np.interp(x, t, values)
    for name, rate in RATES.items():
        if name not in columns:
            continue
        rates = columns[rate][here] if rate in columns else None
        place, speed = _along(name, t, columns[name][here], rates, kind, x)
        found.setdefault(name, place)
        found.setdefault(rate, speed)
    return found


def _along(
    name: str,
    t: NDArray[np.float64],
    values: NDArray[np.float64],
    rates: NDArray[np.float64] | None,
    kind: Interpolation,
    x: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a position and its rate at given times."""
    if kind == "linear" or not np.isfinite(values).all():
        return np.interp(x, t, values), np.interp(x, t, np.gradient(values, t))
    if rates is not None and np.isfinite(rates).all():
        curve = CubicHermiteSpline(t, values, rates)
    elif name in HANDS:
        curve = CubicSpline(t, values)
    else:  # positions that jump must not overshoot
        curve = Akima1DInterpolator(t, values, method="makima")
    return curve(x), curve.derivative()(x)
