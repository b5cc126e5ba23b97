"""A board between resting hands: energy drift of each method without damping, and the cost of steps at rest."""

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from netboard.base.tables.scene import Physics
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.harness.results import ResultPart
from netboard.benchmarks.harness.running import Tell, no_progress, timed
from netboard.benchmarks.physics.problem import hermite_drives, styluses_at
from netboard.benchmarks.stability.maps import board_matrix
from netboard.benchmarks.stability.runs import STUDIED
from netboard.physics.arithmetic.vectors import State
from netboard.physics.methods.catalogue import NUMBER
from netboard.physics.methods.march import make_grid, make_march, run
from netboard.physics.scene.energy import stored_along
from netboard.physics.scene.parameters import pack_scene, parts_of, state_length
from netboard.physics.stability.step_matrix import ROUNDING, spectral_radius

Array = NDArray[np.float64]

UNDAMPED = Physics(c_h=0.0, balls=0, g=0.0)
HEAVED: State = (0.005, 0.0, 0.0, 0.0)
TILTED: State = (0.005, 0.0, math.radians(10.0), 0.0)

DENORMAL = 2.2250738585072014e-308
"""Smallest normal number; a processor takes many times as long for nonzero numbers below it [1]."""

KEPT = 0.02
"""Energy change below which energy counts as conserved; that of symplectic methods oscillates [1]."""


# --- no damping --------------------------------------------------------------------------------------------------


def energies(method: str, start: State, steps: int) -> Array:
    """Return energies of an undamped board between resting hands every 100 steps; not finite where it diverged [J]."""
    count = steps // 100
    parts, scene = parts_of(UNDAMPED), pack_scene(UNDAMPED)
    lengths, counts = np.full(count, 100 * TICK_SECONDS), np.full(count, 100, np.int64)
    grid = make_grid(method, lengths, counts, parts, 4, scene)
    states = run(method, start, np.zeros((count, 8)), grid, parts, scene)
    with np.errstate(invalid="ignore", over="ignore"):
        total: Array = stored_along(states, np.zeros((len(states), 4)), parts, scene).sum(axis=1)
    return total


def energy_drift(steps: int = 10_000_000, methods: Sequence[str] = STUDIED, tell: Tell = no_progress) -> ResultPart:
    """Measure by method whether the energy of an undamped board falls or grows."""
    heave = board_matrix(UNDAMPED)[:2, :2]
    part = ResultPart(
        "energy-drift",
        "Change of the energy of an undamped board between hands at rest, as a share of it, steps of 1 ms",
        f"method | heave: theory, in a step [1] | found, in a step [1] | after {steps:.0e} steps [1] | "
        "10 deg tilt: after as many [1] | which",
    )
    for i, method in enumerate(methods):
        tell(f"energy of an undamped board: {method}", i / len(methods))
        radius = spectral_radius(method, heave, TICK_SECONDS)
        theory = 2.0 * math.log(radius)
        straight, tilted = energies(method, HEAVED, steps), energies(method, TILTED, steps)
        found = _rate(straight)
        end = _drift(tilted)
        sign = _word(theory, 2 * ROUNDING)
        part.claim(
            f"{method} {sign} energy in heave, as theory has it",
            abs(found - theory) <= max(0.02 * abs(theory), 1e-2 / steps),
            f"{found:+.3g} of it in a step, theory {theory:+.3g}",
        )
        part.add(method, theory, found, _drift(straight), end, _word(end, KEPT))
    return part


def _word(change: float, nothing: float) -> str:
    """Describe a change of energy in a word."""
    if abs(change) <= nothing:
        return "keeps"
    return "adds" if change > 0.0 or math.isnan(change) else "takes"


def _rate(energy: Array) -> float:
    """Return the growth rate of the energy per step, from its logarithm while it is neither huge nor tiny."""
    fine = np.isfinite(energy) & (energy > 1e-12 * energy[0]) & (energy < 1e12 * energy[0])
    known = energy[: len(energy) if fine.all() else int(np.argmin(fine))]
    if len(known) < 3:
        return math.inf
    middle = max(len(known) // 2, 1)
    before, after = np.log(known[:middle]).mean(), np.log(known[middle : 2 * middle]).mean()
    return float((after - before) / (100 * middle))


def _drift(energy: Array) -> float:
    """Return the relative change from the first tenth of a run to the last; infinite if it did not stay finite."""
    if not np.isfinite(energy).all():
        return math.inf
    share = max(len(energy) // 10, 1)
    return float(energy[-share:].mean() / energy[:share].mean() - 1.0)


# --- perfect rest ------------------------------------------------------------------------------------------------


def perfect_rest(steps: int = 100_000, methods: Sequence[str] = STUDIED, tell: Tell = no_progress) -> ResultPart:
    """Check that steps are not slower when the state decays to zero (denormal numbers)."""
    physics = Physics(g=0.0)
    parts, scene, length = parts_of(physics), pack_scene(physics), state_length(physics)
    times: Array = np.arange(steps + 1, dtype=np.float64) * TICK_SECONDS
    moving, still = hermite_drives(physics, times, *styluses_at(times)), np.zeros((steps, 8))
    part = ResultPart(
        "perfect-rest",
        "A board that comes to perfect rest: nothing slows down (denormal numbers)",
        "method | largest number left [SI] | a step, moving [s] | at rest [s] | at rest / moving [1]",
    )
    found, slowest = 0, 0.0
    for i, method in enumerate(methods):
        tell(f"perfect rest: {method}", i / len(methods))
        grid = make_grid(method, np.full(steps, TICK_SECONDS), np.ones(steps, np.int64), parts, length, scene)
        march, none = make_march(NUMBER[method], parts), np.empty((0, length))
        rest = (grid.lengths, grid.counts, grid.kinds, grid.tables, scene, none)
        first: State = (0.005, 0.0, 0.1, 0.0, 0.0, 0.0)
        last = np.array(march(first, still, *rest))
        found += int(np.count_nonzero((np.abs(last) < DENORMAL) & (last != 0.0)))
        busy = _quickest(partial(march, first, moving, *rest)) / steps
        idle = _quickest(partial(march, tuple(last.tolist()), still, *rest)) / steps
        slowest = max(slowest, idle / busy)
        part.add(method, float(np.abs(last).max()), busy, idle, idle / busy)
    part.claim("no denormal number is left", found == 0, f"{found} found")
    part.claim("no step takes three times as long at rest", slowest < 3.0, f"at most {slowest:.2g} times")
    return part


def _quickest(go: Callable[[], object]) -> float:
    """Return the shortest of several run times [s]."""
    return min(timed(go) for _ in range(5))
