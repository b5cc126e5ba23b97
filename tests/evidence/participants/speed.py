"""``make evidence ARGS=rehearsals``: speed of rehearsals and cohorts, beside the stage alone, in the same run.

The baseline computes ticks of a session's block from given hands, as a replay does: no hands, no devices, no
participants. Participants who infer nothing from the force have no observer, so the difference is what it costs.
What is taken is the processor time of this process, which hardly depends on what else the machine does.
"""

from collections.abc import Callable, Iterator, Sequence
from statistics import median
from time import process_time

import numpy as np

from evidence.participants.trials import PAPER_TRIALS, SEED, Population
from netboard.analysis.cohort.block import measured, rehearse
from netboard.analysis.cohort.virtual import VirtualDesign, packed_tables
from netboard.analysis.extraction.recordings import Measured
from netboard.base.process.workers import cores
from netboard.base.tables.simulated import Participant
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Tell
from netboard.nodes.rehearsal.jobs import RehearsalJob
from netboard.participants.seat.block import Rehearsal
from netboard.stage.stage import make_stage
from netboard.task.studies.study import paper_study

DYADS = 4
"""Sessions that are rehearsed one after the other in a process, as a worker of a cohort does [1]."""

ROUNDS, QUICK_ROUNDS = 7, 3
"""Rounds, in which all that is compared is timed in turn [1]."""

QUICK_TRIALS = 10
"""Successful trials in a block of a quick run; otherwise it is the paper's [1]."""

STUDIES = 1000
"""Virtual studies of `DYADS` dyads whose time is extrapolated from one session [1]."""

SINGLY, BATCHED = 2000.0, 4000.0
"""How much faster than real time one session, and sessions in a row, are to be [1]."""

_ALONE = "the stage alone: one block"


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Time rehearsals, and the virtual studies of a cohort."""
    trials, rounds = (QUICK_TRIALS, QUICK_ROUNDS) if quick else (PAPER_TRIALS, ROUNDS)
    yield speed_part(trials, rounds, tell)
    yield cohort_part(trials, rounds, tell)


def speed_part(trials: int, rounds: int, tell: Tell) -> ResultPart:
    """Time rehearsals, with ``trials`` in each block, and the stage alone."""
    sessions = [Population(trials=trials).jobs(dyad) for dyad in range(1, 1 + DYADS)]
    uninformed = Population(Participant(partner_model="mechanics"), trials).jobs(1)
    runs: dict[str, Callable[[], int]] = {
        _ALONE: _stage_alone(sessions[0]),
        "one session, without observers": lambda: _rehearse(uninformed),
        "one session": lambda: _rehearse(sessions[0]),
        f"{DYADS} sessions": lambda: sum(_rehearse(jobs) for jobs in sessions),
    }
    ticks = {name: run() for name, run in runs.items()}  # the first time, kernels are compiled or loaded
    taken: dict[str, list[float]] = {name: [] for name in runs}
    for number in range(rounds):
        tell("speed of rehearsals", number / rounds)
        for name, run in runs.items():
            start = process_time()
            run()
            taken[name].append((process_time() - start) / ticks[name])
    part = ResultPart(
        "speed",
        f"Processor time of rehearsals: sessions of the paper, {trials} trials in a block, {rounds} rounds in turn",
        "what | ticks | a tick, median [ns] | fastest [ns] | slowest [ns] | / stage alone | x real time, median",
    )
    fast = {name: TICK_SECONDS / median(times) for name, times in taken.items()}
    for name, times in taken.items():
        each = [1e9 * value for value in (median(times), min(times), max(times))]
        ratio = median(one / alone for one, alone in zip(times, taken[_ALONE], strict=True))
        part.add(name, ticks[name], *each, ratio, fast[name])
    *_, one, batch = runs
    for name, wanted in ((one, SINGLY), (batch, BATCHED)):
        claim = f"{name} on one core: at least {wanted:.0f} times as fast as real time"
        part.claim(claim, fast[name] >= wanted, f"{fast[name]:.0f} times")
    return part


def cohort_part(trials: int, rounds: int, tell: Tell) -> ResultPart:
    """Time the steps of a virtual study, on one of its sessions, beside the stage alone."""
    jobs = Population(trials=trials).jobs(1)
    found = [rehearse(job) for job in jobs]
    ticks = sum(one.ticks for one in found)

    design = VirtualDesign(paper_study(), jobs[0].config, dyads=1, seed=SEED)

    def measures() -> list[Measured]:
        return [measured(job, place, rehearse(job)) for place, job in enumerate(jobs, start=1)]

    alone = _stage_alone(jobs)
    steps: dict[str, tuple[Callable[[], object], int]] = {
        _ALONE: (alone, alone()),
        "simulation": (lambda: _rehearse(jobs), ticks),
        "simulation, columns, attempts, flags": (lambda: [rehearse(job) for job in jobs], ticks),
        "all of these, and measures": (measures, ticks),
        "all of these, and tables": (lambda: packed_tables(design, 1, measures(), 0, ticks, perturbed=False), ticks),
    }
    packed_tables(design, 1, measures(), 0, ticks, perturbed=False)
    taken: dict[str, list[float]] = {name: [] for name in steps}
    for number in range(rounds):
        tell("speed of cohorts", number / rounds)
        for name, (run, count) in steps.items():
            start = process_time()
            run()
            taken[name].append((process_time() - start) / count)
    part = ResultPart(
        "cohort",
        f"Processor time of a virtual study: one session, {trials} trials in a block, {rounds} rounds in turn",
        f"what | ticks | a tick, median [ns] | fastest [ns] | / stage alone | {STUDIES} studies, {cores()} cores [h]",
    )
    for name, times in taken.items():
        part.add(name, steps[name][1], *_costs(times, taken[_ALONE], ticks))
    _, simulation, _, measuring, whole = map(np.array, taken.values())
    for name, times in {"of these: measuring": measuring - simulation, "of these: tables": whole - measuring}.items():
        part.add(name, ticks, *_costs(times, taken[_ALONE], ticks))
    return part


def _costs(times: Sequence[float], alone: Sequence[float], ticks: int) -> tuple[float, float, float, float]:
    """Return median and shortest time of a tick [ns], the ratio to the stage alone, and the hours of all studies.

    ``ticks``: those of one session [1].
    """
    ratio = median(one / floor for one, floor in zip(times, alone, strict=True))
    hours = median(times) * ticks * DYADS * STUDIES / cores() / 3600.0
    return 1e9 * median(times), 1e9 * min(times), ratio, hours


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
