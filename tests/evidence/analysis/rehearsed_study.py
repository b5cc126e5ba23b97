"""A study to be analysed: the paper's plan with simulated participants, of any size."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np

from netboard.base.config import Config
from netboard.nodes.rehearsal.jobs import RehearsalJob, jobs_of, rehearse_all
from netboard.task.plans.plan import blocks_of, shortened
from netboard.task.studies.study import paper_study

SEED = 1
"""Seed of the plans and of the simulated participants [1]."""

FIRST_START_NS = 1_790_000_000_000_000_000
"""Recorded start of the first block, fixed so that every run writes the same files [ns]."""

HOUR_NS = 3_600_000_000_000


def rehearse_study(
    folder: Path, dyads: int, blocks: int, trials: int, workers: int, progress: Callable[[int, int], object]
) -> tuple[Path, ...]:
    """Rehearse a study and return its recordings.

    - `blocks`: number of blocks of each dyad, evenly spaced over the eighteen of the plan [1].
    - `trials`: number of trials in a block [1].
    - `progress`: called with the numbers of finished and of all blocks.
    """
    jobs = [job for dyad in range(1, dyads + 1) for job in _jobs(folder, dyad, blocks, trials)]
    finished = count(1)
    rehearse_all(jobs, workers, lambda result: progress(next(finished), len(jobs)))
    return tuple(sorted(folder.glob("*.mcap")))


def _jobs(folder: Path, dyad: int, blocks: int, trials: int) -> Iterator[RehearsalJob]:
    """Yield the blocks of a dyad, an hour apart."""
    plan = list(shortened(blocks_of(Config(), paper_study(), SEED, dyad), None, trials))
    chosen = [plan[k] for k in np.unique(np.linspace(0, len(plan) - 1, blocks).round().astype(int))]
    for job in jobs_of(chosen, SEED, dyad, folder):
        yield replace(job, begun_ns=FIRST_START_NS + job.config.block.number * HOUR_NS)
