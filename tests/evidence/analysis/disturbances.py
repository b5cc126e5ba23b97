"""Disturbances of recordings: noise, quantisation, lost samples, jitter, lower sampling rates, an offset.

A disturbance takes recorded columns and returns changed copies of the same length. A lost sample is NaN, as in a
recording with a gap.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from netboard.analysis.extraction.trials import RATE
from netboard.analysis.measures.signals import bridge

Columns = Mapping[str, NDArray[np.float64]]
"""Recorded columns by name [SI]."""

Changed = dict[str, NDArray[np.float64]]
Change = Callable[[Columns, Generator], Changed]
"""Takes the recorded columns and a random generator, and returns the changed columns."""

HANDS = ("left_used_z", "right_used_z")
"""Heights of the styluses."""

RATES = ("left_used_vz", "right_used_vz")
"""Velocities of the styluses, as measured by the devices."""

BALL, TILT = ("p",), ("theta",)

TOUCH = 5.5e-5
"""Position resolution of a Touch: one encoder count of 0.024 degrees at a link of 0.133 m [m]."""

MAX_BRIDGE = 0.02
"""Longest gap that is filled by linear interpolation [s]."""


@dataclass(frozen=True, slots=True)
class Disturbance:
    """A disturbance of a recording.

    - `settings`: settings with which the disturbed and the undisturbed recording are measured.
    """

    kind: str
    size: str
    change: Change
    settings: tuple[str, ...] = ()


def noise(columns: Columns, rng: Generator, *, names: tuple[str, ...], deviation: float) -> Changed:
    """Add white Gaussian noise."""
    return {name: columns[name] + rng.normal(0.0, deviation, columns[name].shape) for name in names}


def quantised(columns: Columns, rng: Generator, *, names: tuple[str, ...], step: float) -> Changed:
    """Round to multiples of a step, as an encoder does."""
    return {name: step * np.round(columns[name] / step) for name in names}


def lost(columns: Columns, rng: Generator, *, share: float, length: float = 0.0, bridged: bool = False) -> Changed:
    """Replace samples by NaN, in all columns at the same ticks.

    - `share`: share of lost samples [1].
    - `length`: duration of each gap; 0 for single samples [s].
    - `bridged`: whether gaps up to `MAX_BRIDGE` are then filled by linear interpolation.
    """
    width = max(round(length * RATE), 1)
    count = next(iter(columns.values())).size
    started = np.cumsum(rng.random(count) < share / width)
    gone = started > np.concatenate([np.zeros(width, np.int64), started])[:count]
    gapped = {name: np.where(gone, np.nan, values) for name, values in columns.items()}
    return {name: bridge(values, RATE, MAX_BRIDGE) for name, values in gapped.items()} if bridged else gapped


def downsampled(columns: Columns, rng: Generator, *, rate: float) -> Changed:
    """Sample at a lower rate without an anti-aliasing filter, and interpolate linearly to 1 kHz."""
    every = round(RATE / rate)
    if every < 1 or abs(every * rate - RATE) > 1e-6:
        raise ValueError(f"found a rate of {rate:g} Hz, expected a whole fraction of {RATE:g} Hz")
    at = np.arange(next(iter(columns.values())).size)
    return {name: np.interp(at, at[::every], values[::every]) for name, values in columns.items()}


def jitter(columns: Columns, rng: Generator, *, deviation: float) -> Changed:
    """Sample at times with Gaussian jitter, the same in all columns."""
    at = np.arange(next(iter(columns.values())).size)
    times = at + rng.normal(0.0, deviation * RATE, at.size)
    return {name: np.interp(times, at, values) for name, values in columns.items()}


def offset(columns: Columns, rng: Generator, *, names: tuple[str, ...], by: float) -> Changed:
    """Add a constant, like the offset of a stylus that was not calibrated."""
    return {name: columns[name] + by for name in names}


_PROMINENT = ("peaks.least_prominence=0.01",)
_ALL = ("peaks.least_prominence=0.0", "peaks.least_share=0.0")
_BY_DEVICE = ("filters.velocity=device",)

_PER = {"mm": 1e3, "mm/s": 1e3, "deg": float(np.degrees(1.0))}
"""Factors from SI units."""


def _noises(
    kind: str, unit: str, names: tuple[str, ...], *deviations: float, settings: tuple[str, ...] = ()
) -> tuple[Disturbance, ...]:
    return tuple(
        Disturbance(kind, f"{_PER[unit] * one:g} {unit}", partial(noise, names=names, deviation=one), settings)
        for one in deviations
    )


DISTURBANCES = (
    *_noises("noise of the styluses", "mm", HANDS, 5e-5, 2e-4, 1e-3),
    *(
        Disturbance(what, f"{1e3 * step:g} mm", partial(quantised, names=HANDS, step=step))
        for what, step in (("encoder steps of a Touch", TOUCH), ("quantisation of the styluses", 5e-4))
    ),
    *_noises("noise of the devices' velocities", "mm/s", RATES, 4e-3, 5.5e-2, settings=_BY_DEVICE),
    *_noises("noise of the ball", "mm", BALL, 3e-5, 1e-4, 3e-4),
    *_noises("noise of the ball, peaks from 10 mm/s", "mm", BALL, 3e-4, settings=_PROMINENT),
    *_noises("noise of the ball, peaks of any size", "mm", BALL, 3e-4, settings=_ALL),
    *_noises("noise of the tilt", "deg", TILT, *np.radians((0.02, 0.1, 0.5)).tolist()),
    Disturbance("single ticks lost", "0.01 %", partial(lost, share=1e-4)),
    Disturbance("single ticks lost", "0.1 %", partial(lost, share=1e-3)),
    Disturbance("single ticks lost, bridged", "0.1 %", partial(lost, share=1e-3, bridged=True)),
    Disturbance("single ticks lost, bridged", "5 %", partial(lost, share=0.05, bridged=True)),
    Disturbance("holes of 10 ms", "0.1 %", partial(lost, share=1e-3, length=0.01)),
    Disturbance("holes of 10 ms, bridged", "0.1 %", partial(lost, share=1e-3, length=0.01, bridged=True)),
    Disturbance("holes of 50 ms", "0.5 %", partial(lost, share=5e-3, length=0.05)),
    *(Disturbance("sampled at", f"{rate} Hz", partial(downsampled, rate=rate)) for rate in (500, 250, 100)),
    *(Disturbance("clock jitter", f"{1e3 * sd:g} ms", partial(jitter, deviation=sd)) for sd in (1e-5, 1e-4, 1e-3)),
    Disturbance("offset of the left stylus", "5 mm", partial(offset, names=HANDS[:1], by=5e-3)),
)
"""All disturbances."""
