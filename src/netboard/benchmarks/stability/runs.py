"""Runs of the test motion in any scene, by any method, with any step, for the stability studies.

The hands are those of `netboard.benchmarks.physics.problem`, which tilt the paper's board by 10 degrees to either side;
their movement against each other can be scaled. Between times at most a tick apart, each hand moves on one cubic, the
same for every method.

To find where a method is bounded, the ball is fixed off the board's centre, so it loads the board and does not roll
away. A run is bounded if it stays finite and, after the initial transient, near a reference run. Velocities count as
well as positions: with too large a step the board may vibrate or stay tilted without diverging.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from netboard.base.tables.scene import Physics
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.physics.problem import BALL, hermite_drives, styluses_at
from netboard.physics.arithmetic.vectors import State
from netboard.physics.methods.catalogue import METHODS
from netboard.physics.methods.march import forces_along, make_grid, run
from netboard.physics.scene.parameters import pack_scene, parts_of
from netboard.physics.stability.step_matrix import spectral_radius

Array = NDArray[np.float64]

STUDIED = tuple(method.name for method in METHODS if method.name != "exact")
"""All methods but the exact one, which requires a board that cannot tilt."""

DURATION = 3.0
"""Minimum duration of a run [s]."""

SHOWS = 1e6
"""Theoretical growth over a run with a step that is too long by `OFF`; it determines the duration of a run [1]."""

OFF = 1.03
"""Relative error of a largest step that most runs should detect [1]."""

MAX_STEPS = 1_000_000
"""Largest number of steps of a run [1]."""

FIXED_PLACE = 0.15
"""Position of the fixed ball: where trials start [m]."""

FARTHER, FASTER = 1.5, 10.0
"""Factors over the reference, of positions and of velocities, above which a run is not bounded [1]."""

WIDE = 4.0
"""The search ends at this factor times the guess [1]."""

LONGEST = 0.250
"""Longest step that is tried [s]."""

NARROW = 1.002
"""Relative distance of the largest stable and the smallest unstable step at which the search ends [1]."""

COLD: State = (0.0, 0.0, 0.0, 0.0, *BALL["paper", "cold"])
"""Initial state: a board at rest between moving hands, which excites every mode [SI]."""

_FIXED: State = (0.0, 0.0, 0.0, 0.0, FIXED_PLACE, 0.0)


@dataclass(frozen=True)
class StabilityRun:
    """A run.

    - `times` (shape (n,)): ends of the intervals [s].
    - `states` (shape (n, length)): the states there [SI].
    - `forces` (shape (n, 2)): of the left and the right hand on the board there [N].
    """

    times: Array
    states: Array
    forces: Array


def scaled(physics: Physics, **factors: float) -> Physics:
    """Return a scene with some of its numbers multiplied."""
    return replace(physics, **{name: getattr(physics, name) * factor for name, factor in factors.items()})


def make_run(
    physics: Physics,
    method: str,
    h: float,
    duration: float = DURATION,
    x: State = COLD,
    start: float = 0.0,
    spread: float = 1.0,
    free: bool = True,
) -> StabilityRun:
    """Run the test motion; states are at the ends of intervals: single steps, or all steps of a tick.

    - `duration`: duration of the run, rounded down to whole intervals [s].
    """
    steps = max(1, math.floor(TICK_SECONDS / h + 1e-9))
    count = max(1, math.floor(duration / (steps * h) + 1e-9))
    times: Array = start + np.arange(count + 1, dtype=np.float64) * (steps * h)
    z, vz = styluses_at(times, spread)
    parts, scene = parts_of(physics, free), pack_scene(physics)
    lengths, counts = np.full(count, steps * h), np.full(count, steps, np.int64)
    grid = make_grid(method, lengths, counts, parts, len(x), scene)
    states = run(method, x, hermite_drives(physics, times, z, vz), grid, parts, scene)
    return StabilityRun(times, states, forces_along(states, physics.k_h * z + physics.c_h * vz, parts, scene))


@cache
def _reference_reach(physics: Physics, duration: float) -> Array:
    """Return the reach of the board by an exponential method, which is stable in every scene."""
    return _reach(make_run(physics, "etdrk4", TICK_SECONDS, duration, _FIXED, free=False))


def _reach(run_: StabilityRun) -> Array:
    """Return the largest magnitudes of height, tilt and their velocities in the second half of a run."""
    late: Array = np.abs(run_.states[len(run_.states) // 2 :, :4]).max(axis=0)
    return late


def is_bounded(physics: Physics, method: str, h: float, duration: float = DURATION) -> bool:
    """Return whether a run is bounded."""
    limits = np.tile([FARTHER, FASTER], 2) * _reference_reach(physics, duration)
    with np.errstate(invalid="ignore"):
        return bool(np.all(_reach(make_run(physics, method, h, duration, _FIXED, free=False)) <= limits))


def telling_duration(method: str, a: Array, h: float) -> float:
    """Return the duration of a run that shows whether a step is too long.

    - `h`: the largest step, in theory; infinite if there is none [s].
    """
    if math.isinf(h):
        return DURATION
    growth = math.log(spectral_radius(method, a, OFF * h))
    steps = min(math.log(SHOWS) / growth if growth > 0.0 else math.inf, MAX_STEPS)
    return max(DURATION, math.ceil(2.0 * steps * h))


def largest_bounded(physics: Physics, method: str, guess: float, duration: float = DURATION) -> float:
    """Return the largest bounded step near a guess; infinite if none up to `LONGEST` or `WIDE` times the guess [s]."""

    def holds(h: float) -> bool:
        return is_bounded(physics, method, h, duration)

    if math.isinf(guess):
        return largest_stable(holds, ladder())
    good, factor = guess, OFF
    while not holds(good):
        good, factor = good / factor, factor**1.5
    bad, factor = good, OFF
    while holds(bad):
        if bad > WIDE * guess:
            return math.inf
        good, bad, factor = bad, bad * factor, factor**1.5
    return edge(holds, good, bad)


def ladder() -> list[float]:
    """Return steps up to `LONGEST`, each a quarter longer than the last."""
    count = math.ceil(math.log(LONGEST / TICK_SECONDS) / math.log(1.25))
    return [min(TICK_SECONDS * 1.25**i, LONGEST) for i in range(count + 1)]


def largest_stable(holds: Callable[[float], bool], values: Iterable[float], narrow: float = NARROW) -> float:
    """Return the largest stable value below the first unstable one of rising values: 0 or infinite if there is none.

    - `narrow`: ratio at which the search between both ends; infinite for the last stable one of these values [1].
    """
    good = 0.0
    for value in values:
        if not holds(value):
            return edge(holds, good, value, narrow) if good > 0.0 else 0.0
        good = value
    return math.inf


def edge(holds: Callable[[float], bool], good: float, bad: float, narrow: float = NARROW) -> float:
    """Return the largest stable value between a stable and an unstable one, by bisection to a ratio."""
    while bad > narrow * good:
        middle = math.sqrt(good * bad)
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good
