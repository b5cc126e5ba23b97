"""Why haptic feedback changes the completion time of one person with both hands: blocks with parts of the force.

Blocks, participants and random numbers are those of the blocks without haptic feedback; only the force differs. So each
participant is compared with themselves, with the same practice and skill.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from netboard.base.tables.simulated import Participant
from netboard.benchmarks.harness.results import Part, Value
from netboard.benchmarks.participants.trials import Performance, Population, perform_all
from netboard.nodes.rehearsal.jobs import Job

CASES: dict[str, tuple[str, dict[str, float]]] = {
    "haptics off": ("none", {}),
    "full force": ("full", {}),
    "force of the other hand only": ("partner_only", {}),
    "force of ball and board only": ("environment_only", {}),
    "full force, no load compensation": ("full", {"load_skill": 0.0}),
    "full force, friction not compensated at rest": ("full", {"rest_skill": 0.0}),
    "full force, with reflex yielding": ("full", {"reflex_gain": 1.0}),
    "full force, with impedance adaptation": ("full", {"impedance_gain": 20_000.0}),
}
"""Force condition and changed parameters of each case."""


def slowing_part(dyads: int, trials: int, workers: int) -> Part:
    """Tabulate the mean completion time of each case, and its ratio to that without haptic feedback."""
    means = {name: _means(list(perform_all(_tasks(name, dyads, trials), workers))) for name in CASES}
    base = means[next(iter(CASES))]
    rows: list[tuple[Value, ...]] = []
    for name, own in means.items():
        ratios = np.log(own / base)
        mean, error = float(ratios.mean()), float(ratios.std(ddof=1) / np.sqrt(len(ratios)))
        low, high = (100.0 * np.expm1(mean + way * 1.96 * error) for way in (-1, 1))
        rows.append((name, float(own.mean()), 100.0 * float(np.expm1(mean)), float(low), float(high)))
    columns = ("bimanual blocks", "completion time [s]", "change [%]", "95 % CI low", "95 % CI high")
    title = f"Effect of parts of the force on one person with both hands: {2 * dyads} participants, blocks of {trials}"
    return Part("slowing", title, columns, rows)


def _tasks(name: str, dyads: int, trials: int) -> list[tuple[Sequence[Job], int]]:
    """Return the blocks of a case: those without haptic feedback, with another force."""
    force, keys = CASES[name]
    population = Population(replace(Participant(), **keys), trials=trials)
    return [
        ([_with_force(job, force) for job in population.jobs(dyad) if _alone(job)], dyad)
        for dyad in range(1, dyads + 1)
    ]


def _alone(job: Job) -> bool:
    """Return whether a block is bimanual and without haptic feedback."""
    return job.config.block.configuration == "bimanual" and not job.config.block.haptics


def _with_force(job: Job, force: str) -> Job:
    """Return a block with another force condition."""
    return replace(job, config=replace(job.config, block=replace(job.config.block, force=force)))


def _means(performances: Sequence[Performance]) -> NDArray[np.float64]:
    """Return the mean completion time of each participant [s]."""
    rows = np.concatenate([one.attempts for one in performances])
    rows = rows[rows["success"]]
    return np.array(
        [
            rows["completion"][(rows["dyad"] == dyad) & (rows["performer"] == who)].mean()
            for dyad in np.unique(rows["dyad"])
            for who in ("A", "B")
        ]
    )
