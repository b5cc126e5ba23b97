"""What sampling costs: the same run from samples at 1 kHz, with each way of filling in what is between them.

Live, a hold knows the newest sample only; offline, the next one too. The errors are against hands that never stop
moving smoothly, so that they have everything in them: sampling, hold and method.
"""

from dataclasses import dataclass

import numpy as np

from netboard.benchmarks.physics.horizons import sampled_run
from netboard.benchmarks.physics.problem import Array, Problem, Reference, largest
from netboard.benchmarks.physics.tick_cost import live_run

OFFLINE = (("rk4", 1), ("etdrk4", 1), ("dop853", 2))
"""Methods of runs offline, and their steps between two samples."""


@dataclass(frozen=True)
class HoldRow:
    """Errors of one way of running a problem from samples.

    - `problem`, `hold`, `run`: which problem, how the hands move between samples, and what ran it.
    - `errors`: largest error of each of `SIGNALS` [m, rad, m, N].
    - `force_rms`: root mean square of the error of both forces [N].
    """

    problem: str
    hold: str
    run: str
    errors: tuple[float, ...]
    force_rms: float


def hold_rows(problem: Problem, reference: Reference) -> list[HoldRow]:
    """Run a problem from samples: through the server's own ticks with each hold, and offline."""
    rows = [
        _row(problem, reference, hold, "the server's tick", *live_run(problem, hold)) for hold in ("zoh", "cv", "ca")
    ]
    for method, substeps in OFFLINE:
        found = sampled_run(problem, "hermite", method, substeps)
        rows.append(_row(problem, reference, "hermite", f"offline, {method}, {1.0 / substeps:g} ms", *found))
    return rows


def _row(problem: Problem, reference: Reference, hold: str, name: str, states: Array, forces: Array) -> HoldRow:
    """Compare a run, tick by tick, with the points of the reference that it meets."""
    states, forces = states[::2], forces[::2]
    wrong = states - reference.states[: len(states)], forces - reference.forces[: len(forces)]
    rms = float(np.sqrt(np.mean(wrong[1] ** 2)))
    return HoldRow(problem.name, hold, name, tuple(largest(*wrong).tolist()), rms)
