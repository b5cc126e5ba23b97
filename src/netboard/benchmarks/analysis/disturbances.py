"""Disturbances of recordings: noise, steps, lost and delayed samples, other rates, an offset.

A disturbance takes the recorded columns and gives others of the same length; the original is not touched. A sample that
is lost is not a number, as in a recording with a hole. What is random gets its generator.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.extraction.trials import RATE
from netboard.analysis.measures.signals import bridge

Columns = Mapping[str, NDArray[np.float64]]
"""Recorded columns by name [SI]."""

Change = Callable[[Columns, np.random.Generator], dict[str, NDArray[np.float64]]]
"""Gives the columns that are changed."""

HANDS = ("left_used_z", "right_used_z")
"""Heights of the styluses."""

RATES = ("left_used_vz", "right_used_vz")
"""Their velocities, as the devices said."""

BALL, TILT = ("p",), ("theta",)

TOUCH = 5.5e-5
"""Step of a Touch's positions: an encoder count of 0.024 degrees at a link of 0.133 m [m]."""

LONGEST_BRIDGE = 0.02
"""Holes up to this are filled with straight lines, where they are [s]."""


@dataclass(frozen=True, slots=True)
class Disturbance:
    """Something that recordings suffer from.

    - `settings`: readings under which it is measured, and the undisturbed recording beside it.
    """

    kind: str
    size: str
    change: Change
    settings: tuple[str, ...] = ()


def noise(
    columns: Columns, generator: np.random.Generator, *, names: tuple[str, ...], deviation: float
) -> dict[str, NDArray[np.float64]]:
    """Add white, normal noise."""
    return {name: columns[name] + generator.normal(0.0, deviation, columns[name].shape) for name in names}


def steps(
    columns: Columns, generator: np.random.Generator, *, names: tuple[str, ...], step: float
) -> dict[str, NDArray[np.float64]]:
    """Round to multiples of a step, as an encoder does."""
    return {name: step * np.round(columns[name] / step) for name in names}


def lost(
    columns: Columns, generator: np.random.Generator, *, share: float, length: float = 0.0, bridged: bool = False
) -> dict[str, NDArray[np.float64]]:
    """Lose ticks, in all columns at once.

    - `bridged`: whether holes up to `LONGEST_BRIDGE` are filled with straight lines afterwards.
    """
    together = max(round(length * RATE), 1)
    count = next(iter(columns.values())).size
    begun = np.cumsum(generator.random(count) < share / together)
    gone = begun > np.concatenate([np.zeros(together, np.int64), begun])[:count]
    holed = {name: np.where(gone, np.nan, values) for name, values in columns.items()}
    return {name: bridge(values, RATE, LONGEST_BRIDGE) for name, values in holed.items()} if bridged else holed


def slower(columns: Columns, generator: np.random.Generator, *, rate: float) -> dict[str, NDArray[np.float64]]:
    """Record at a lower rate, without a filter before, and come back to 1 kHz by straight lines."""
    every = round(RATE / rate)
    if every < 1 or abs(every * rate - RATE) > 1e-6:
        raise ValueError(f"a rate of {rate:g} Hz is not a whole part of {RATE:g} Hz")
    at = np.arange(next(iter(columns.values())).size)
    return {name: np.interp(at, at[::every], values[::every]) for name, values in columns.items()}


def jitter(columns: Columns, generator: np.random.Generator, *, deviation: float) -> dict[str, NDArray[np.float64]]:
    """Take samples a little before or after their time, all columns at once."""
    at = np.arange(next(iter(columns.values())).size)
    really = at + generator.normal(0.0, deviation * RATE, at.size)
    return {name: np.interp(really, at, values) for name, values in columns.items()}


def offset(
    columns: Columns, generator: np.random.Generator, *, names: tuple[str, ...], by: float
) -> dict[str, NDArray[np.float64]]:
    """Add a constant, as of a stylus that was not calibrated."""
    return {name: columns[name] + by for name in names}


_PROMINENT = ("peaks.least_prominence=0.01",)
_ANY = ("peaks.least_prominence=0.0", "peaks.least_share=0.0")
_BY_DEVICE = ("filters.velocity=device",)

DISTURBANCES = (
    *(
        Disturbance("noise of the styluses", f"{1e3 * sd:g} mm", partial(noise, names=HANDS, deviation=sd))
        for sd in (5e-5, 2e-4, 1e-3)
    ),
    *(
        Disturbance(what, f"{1e3 * step:g} mm", partial(steps, names=HANDS, step=step))
        for what, step in (("steps of a Touch", TOUCH), ("steps of the styluses", 5e-4))
    ),
    *(
        Disturbance(
            "noise of the devices' velocities",
            f"{1e3 * sd:g} mm/s",
            partial(noise, names=RATES, deviation=sd),
            _BY_DEVICE,
        )
        for sd in (4e-3, 5.5e-2)
    ),
    *(
        Disturbance("noise of the ball", f"{1e3 * sd:g} mm", partial(noise, names=BALL, deviation=sd))
        for sd in (3e-5, 1e-4, 3e-4)
    ),
    Disturbance(
        "noise of the ball, peaks by 10 mm/s", "0.3 mm", partial(noise, names=BALL, deviation=3e-4), _PROMINENT
    ),
    Disturbance("noise of the ball, peaks of any size", "0.3 mm", partial(noise, names=BALL, deviation=3e-4), _ANY),
    *(
        Disturbance("noise of the tilt", f"{size:g} deg", partial(noise, names=TILT, deviation=float(np.radians(size))))
        for size in (0.02, 0.1, 0.5)
    ),
    Disturbance("single ticks lost", "0.01 %", partial(lost, share=1e-4)),
    Disturbance("single ticks lost", "0.1 %", partial(lost, share=1e-3)),
    Disturbance("single ticks lost, bridged", "0.1 %", partial(lost, share=1e-3, bridged=True)),
    Disturbance("single ticks lost, bridged", "5 %", partial(lost, share=0.05, bridged=True)),
    Disturbance("holes of 10 ms", "0.1 %", partial(lost, share=1e-3, length=0.01)),
    Disturbance("holes of 10 ms, bridged", "0.1 %", partial(lost, share=1e-3, length=0.01, bridged=True)),
    Disturbance("holes of 50 ms", "0.5 %", partial(lost, share=5e-3, length=0.05)),
    *(Disturbance("recorded at", f"{rate} Hz", partial(slower, rate=rate)) for rate in (500, 250, 100)),
    *(Disturbance("clock jitter", f"{1e3 * sd:g} ms", partial(jitter, deviation=sd)) for sd in (1e-5, 1e-4, 1e-3)),
    Disturbance("offset of the left stylus", "5 mm", partial(offset, names=HANDS[:1], by=5e-3)),
)
"""All of them."""
