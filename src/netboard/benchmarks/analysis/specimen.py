"""A study to analyse: the paper's plan with simulated participants and any number of dyads, blocks and trials."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np

from netboard.base.config import Config
from netboard.nodes.rehearsal.jobs import Job, jobs_of, rehearse_all
from netboard.task.plans.plan import blocks_of, shortened
from netboard.task.studies.study import paper_study

SEED = 1
"""Seed of the plans and of the simulated participants [1]."""

OPENED_NS = 1_790_000_000_000_000_000
"""When the first block was begun, as the recordings say [ns]."""

HOUR_NS = 3_600_000_000_000


def make_study(
    folder: Path, dyads: int, blocks: int, trials: int, workers: int, done: Callable[[int, int], object]
) -> tuple[Path, ...]:
    """Rehearse a study.

    - `dyads`, `blocks`, `trials`: how many dyads, blocks of the eighteen of each, evenly spread, and trials in a block
      [1].
    """
    jobs = [job for dyad in range(1, dyads + 1) for job in _jobs(folder, dyad, blocks, trials)]
    ended = count(1)
    rehearse_all(jobs, workers, lambda sheet: done(next(ended), len(jobs)))
    return tuple(sorted(folder.glob("*.mcap")))


def _jobs(folder: Path, dyad: int, blocks: int, trials: int) -> Iterator[Job]:
    """Yield the blocks of a dyad, begun at times that are the same whenever they are made."""
    chosen = _spread(list(shortened(blocks_of(Config(), paper_study(), SEED, dyad), None, trials)), blocks)
    for job in jobs_of(chosen, SEED, dyad, folder):
        yield replace(job, begun_ns=OPENED_NS + job.config.block.number * HOUR_NS)


def _spread(blocks: Sequence[Config], few: int) -> list[Config]:
    """Choose some of a row, evenly spread."""
    return [blocks[k] for k in np.unique(np.linspace(0, len(blocks) - 1, few).round().astype(int))]
