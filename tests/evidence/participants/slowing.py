"""Why haptic feedback changes the completion time of one person with both hands: parts of the force, one by one."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from evidence.participants.trials import Population, perform_all
from netboard.base.tables.simulated import Participant
from netboard.benchmarks.harness.results import ResultPart
from netboard.nodes.rehearsal.jobs import RehearsalJob

Keys = dict[str, Any]

CASES: dict[str, tuple[str, Keys]] = {
    "full force": ("full", {}),
    "force of the other hand only": ("partner_only", {}),
    "force by the height of each hand itself only": ("own_only", {}),
    "force of ball and board only": ("environment_only", {}),
    "full force, no load compensation": ("full", {"load_skill": 0.0}),
    "full force, friction not compensated at rest": ("full", {"rest_skill": 0.0}),
    "full force, with reflex yielding": ("full", {"partner_model": "follower"}),
    "full force, with impedance adaptation": ("full", {"partner_model": "impedance"}),
}
"""Force condition and changed parameters of each case."""


def slowing_part(dyads: int, trials: int, workers: int) -> ResultPart:
    """Tabulate why haptic feedback changes the completion time of one person: mean, and ratio to that without it.

    Blocks, participants, parameters and random numbers are those of the blocks without haptic feedback; only the force
    differs. So each participant is compared with themselves, with the same practice and skill. The confidence interval
    is that of a paired t test of the logarithms.
    """
    part = ResultPart(
        "slowing",
        f"Effect of parts of the force on one person with both hands: {2 * dyads} participants, blocks of {trials}",
        "bimanual blocks | haptics off [s] | haptics on [s] | change [%] | 95 % CI low | 95 % CI high",
    )
    without: dict[str, NDArray[np.float64]] = {}
    for name, (force, keys) in CASES.items():
        if repr(keys) not in without:
            without[repr(keys)] = _means("none", keys, dyads, trials, workers)
        off, on = without[repr(keys)], _means(force, keys, dyads, trials, workers)
        ratios = np.log(on / off)
        reach = float(stats.t.ppf(0.975, len(ratios) - 1) * ratios.std(ddof=1) / np.sqrt(len(ratios)))
        change = (100.0 * float(np.expm1(ratios.mean() + way * reach)) for way in (0, -1, 1))
        part.add(name, float(off.mean()), float(on.mean()), *change)
    return part


def _with_force(job: RehearsalJob, force: str) -> RehearsalJob:
    return replace(job, config=replace(job.config, block=replace(job.config.block, force=force)))


def _means(force: str, keys: Keys, dyads: int, trials: int, workers: int) -> NDArray[np.float64]:
    """Return the mean completion time of each participant in the bimanual blocks, with a force [s]."""
    population = Population(replace(Participant(), **keys), trials=trials)
    tasks = [
        ([_with_force(job, force) for job in population.bimanual_jobs(dyad)], dyad) for dyad in range(1, dyads + 1)
    ]
    rows = np.concatenate([one.attempts for one in perform_all(tasks, workers)])
    rows = rows[rows["success"]]
    return np.array(
        [
            rows["completion"][(rows["dyad"] == dyad) & (rows["performer"] == who)].mean()
            for dyad in np.unique(rows["dyad"])
            for who in ("A", "B")
        ]
    )
