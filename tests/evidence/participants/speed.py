"""Speed of rehearsals on one core: sessions of the paper, beside the stage alone on the ticks of one of their blocks.

The stage alone computes the same ticks from given hands, as a replay does: no hands, no devices, no participants.
"""

from collections.abc import Callable, Sequence
from statistics import median

import numpy as np

from evidence.participants.trials import Population
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.harness.results import ResultPart
from netboard.benchmarks.harness.running import Tell, timed
from netboard.nodes.rehearsal.jobs import RehearsalJob
from netboard.participants.seat.block import Rehearsal
from netboard.stage.stage import make_stage

DYADS = 4
"""Sessions that are rehearsed one after the other in a process, as a worker of a cohort does [1]."""

ROUNDS = 7
"""Rounds, in which all that is compared is timed in turn [1]."""

SINGLY, BATCHED = 2000.0, 4000.0
"""How much faster than real time one session, and sessions in a row, are to be [1]."""

_ALONE = "the stage alone: one block"


def speed_part(trials: int, rounds: int, tell: Tell) -> ResultPart:
    """Time rehearsals, with ``trials`` in each block, and the stage alone; the machine should do nothing else."""
    sessions = [Population(trials=trials).jobs(dyad) for dyad in range(1, 1 + DYADS)]
    runs: dict[str, Callable[[], int]] = {
        _ALONE: _stage_alone(sessions[0]),
        "one session": lambda: _rehearse(sessions[0]),
        f"{DYADS} sessions": lambda: sum(_rehearse(jobs) for jobs in sessions),
    }
    ticks = {name: run() for name, run in runs.items()}  # the first time, kernels are compiled or loaded
    taken: dict[str, list[float]] = {name: [] for name in runs}
    for number in range(rounds):
        tell("speed of rehearsals", number / rounds)
        for name, run in runs.items():
            taken[name].append(timed(run) / ticks[name])
    part = ResultPart(
        "speed",
        f"Speed of rehearsals on one core: sessions of the paper, {trials} trials in a block, {rounds} rounds in turn",
        "what | ticks | a tick, median [ns] | fastest [ns] | slowest [ns] | / stage alone | x real time, median",
    )
    fast = {name: TICK_SECONDS / median(times) for name, times in taken.items()}
    for name, times in taken.items():
        each = [1e9 * value for value in (median(times), min(times), max(times))]
        ratio = median(one / alone for one, alone in zip(times, taken[_ALONE], strict=True))
        part.add(name, ticks[name], *each, ratio, fast[name])
    _, one, batch = runs
    for name, wanted in ((one, SINGLY), (batch, BATCHED)):
        claim = f"{name} on one core: at least {wanted:.0f} times as fast as real time"
        part.claim(claim, fast[name] >= wanted, f"{fast[name]:.0f} times")
    return part


def _rehearse(jobs: Sequence[RehearsalJob]) -> int:
    """Rehearse blocks; return the number of their ticks."""
    return sum(len(rows) for job in jobs for rows in Rehearsal(job.config, job.people).pieces())


def _stage_alone(jobs: Sequence[RehearsalJob]) -> Callable[[], int]:
    """Return a function that computes the ticks of the first dyadic block with haptics on again."""
    job = next(one for one in jobs if one.config.block.configuration == "dyadic" and one.config.block.haptics)
    rows = np.concatenate([piece.copy() for piece in Rehearsal(job.config, job.people).pieces()])
    stage = make_stage(job.config)

    def run() -> int:
        stage.advance(stage.initial(), rows, 0, len(rows))
        return len(rows)

    return run
