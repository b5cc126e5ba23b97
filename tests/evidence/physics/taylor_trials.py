"""The automatic choice of `netboard simulate` on trials of the paper's task, beside a solution with 80 bits.

The hands are those of a virtual dyad in the paper's plan, as its stage used them in each trial from the release of the
ball on. `netboard simulate` moves them by cubics between samples; the reference writes the same cubics with 80 bits,
and solves the equations of `evidence.physics.reference`, which share nothing with the kernels. Without heyoka it is
`dop853` in short steps. Both models get the same hands, so their boards and balls move differently.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.participants.trials import Population
from evidence.physics import peer_heyoka
from netboard.base.tables.scene import Physics
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.harness.results import ResultPart
from netboard.benchmarks.physics.problem import MODELS, Array, multiples
from netboard.nodes.rehearsal.jobs import RehearsalJob
from netboard.participants.seat.block import Rehearsal
from netboard.physics.hands.sampled import Hands
from netboard.physics.simulation import Steps, choose_steps, simulate
from netboard.task.trials.state_machine import Phase

CLAIM = 1e-9
"""Claimed error, relative to the range of each signal in the trial [1]."""

TRIALS, QUICK_TRIALS = 6, 1
"""Successful trials of each kind of block [1]."""

FINE = 0.000125
"""Step of the reference without heyoka [s]."""

NAMES = ("z", "vz", "theta", "omega", "p", "vp", "f_left", "f_right")
"""Signals with errors."""

_KINDS = tuple((configuration, haptics) for configuration in ("bimanual", "dyadic") for haptics in (True, False))


@dataclass(frozen=True)
class Trial:
    """Hands of a trial, from the release of the ball on, and the state of the board and the ball there."""

    hands: Hands
    start: tuple[float, ...]


def trials_of(job: RehearsalJob) -> Iterator[Trial]:
    """Rehearse a block, and yield its trials."""
    rows = np.concatenate([piece.copy() for piece in Rehearsal(job.config, job.people).pieces()])
    free = np.isin(rows["phase"], (Phase.RUNNING, Phase.HOLDING))
    ends = np.flatnonzero(np.diff(free, prepend=False, append=False)).reshape(-1, 2)
    for first, last in ends.tolist():
        here = rows[first:last]
        z, vz = (np.stack([here[f"{side}_used_{name}"] for side in ("left", "right")], axis=1) for name in ("z", "vz"))
        start = tuple(float(here[name][0]) for name in NAMES[:6])
        yield Trial(Hands(multiples(len(here), TICK_SECONDS), z, vz), start)


def drives_with_80_bits(physics: Physics, hands: Hands) -> NDArray[np.longdouble]:
    """Return the cubics of the left and of the right drive between samples, shape (n - 1, 2, 4) [SI]."""
    h = np.diff(hands.t.astype(np.longdouble))[:, None]
    z, v = hands.z.astype(np.longdouble), hands.vz.astype(np.longdouble)
    slope = (z[1:] - z[:-1]) / h
    third = (v[:-1] + v[1:] - 2 * slope) / (h * h)
    second = (slope - v[:-1]) / h - third * h
    place = [z[:-1], v[:-1], second, third]
    rate = [v[:-1], 2 * second, 3 * third, np.zeros_like(third)]
    k, c = np.longdouble(physics.k_h), np.longdouble(physics.c_h)
    return np.stack([k * one + c * other for one, other in zip(place, rate, strict=True)], axis=-1)


def reference_of(physics: Physics, trial: Trial) -> Array:
    """Return states and forces at the samples, shape (n, 8) [SI]."""
    if not peer_heyoka.installed():
        fine = Steps("dop853", FINE, 1, choose_steps(physics).fastest)
        motion = simulate(trial.hands, physics, trial.start, dt=TICK_SECONDS, steps=fine)
        return np.concatenate([motion.states, motion.forces], axis=1)
    drives = drives_with_80_bits(physics, trial.hands)
    states = peer_heyoka.precise_along(physics, trial.start, drives, np.diff(trial.hands.t.astype(np.longdouble)))
    return np.concatenate([states, _forces(physics, trial.hands, states)], axis=1).astype(np.float64)


def _forces(physics: Physics, hands: Hands, states: NDArray[Any]) -> NDArray[Any]:
    """Return the forces of both hands, in the precision of the states."""
    arm, rate = physics.l * np.sin(states[:, 2]), physics.l * states[:, 3] * np.cos(states[:, 2])
    sides = np.array([-1, 1])
    stretch = hands.z - states[:, :1] - sides * arm[:, None]
    forces: NDArray[Any] = physics.k_h * stretch + physics.c_h * (hands.vz - states[:, 1:2] - sides * rate[:, None])
    return forces


def errors_of(physics: Physics, trial: Trial) -> Array:
    """Return the largest error of each signal of a trial over its range [1]."""
    motion = simulate(trial.hands, physics, trial.start, dt=TICK_SECONDS)
    found, exact = np.concatenate([motion.states, motion.forces], axis=1), reference_of(physics, trial)
    errors: Array = np.abs(found - exact).max(axis=0) / np.ptp(exact, axis=0)
    return errors


def trials_part(count: int) -> ResultPart:
    """List the largest errors of all trials of each kind of block, for both models."""
    source = "a solution with 80 bits" if peer_heyoka.installed() else f"dop853, {FINE * 1e3:g} ms"
    part = ResultPart(
        "trials",
        f"Trials of a virtual dyad in the paper's plan, simulated by default: largest difference from {source}, over "
        "the range of each signal in its trial [1]",
        ("model", "block", "trials", "longest [s]", *NAMES),
    )
    worst, jobs = 0.0, Population(trials=count).jobs(1)
    for configuration, haptics in _KINDS:
        blocks = ((job, job.config.block) for job in jobs)
        job = next(job for job, block in blocks if (block.configuration, block.haptics) == (configuration, haptics))
        trials = list(trials_of(job))
        longest = max(float(trial.hands.t[-1]) for trial in trials)
        for model in MODELS:
            physics = replace(job.config.physics, model=model)
            errors = np.max([errors_of(physics, trial) for trial in trials], axis=0)
            name = f"{configuration}, haptics {'on' if haptics else 'off'}"
            part.add(model, name, len(trials), longest, *errors.tolist())
            worst = float(np.maximum(worst, errors.max()))  # NaN stays
    part.claim(f"errors below {CLAIM:.0e} of each range", worst < CLAIM, f"{worst:.2g}")
    return part
