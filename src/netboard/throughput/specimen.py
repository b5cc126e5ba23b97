"""A study to be analysed: the paper's plan with simulated people, of as many dyads, blocks and trials as are wanted."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from netboard.config import Config
from netboard.design.plan import config_of, plan_of, seated
from netboard.design.study import paper_study
from netboard.rehearsal.block import Rehearsal
from netboard.rehearsal.keeping import Keeper
from netboard.rehearsal.people import LETTERS, person_of

SEED = 1
"""Of plans and people [1]."""

OPENED_NS = 1_790_000_000_000_000_000
"""When the first block was begun, as the recordings say [ns]."""

HOUR_NS = 3_600_000_000_000


@dataclass(frozen=True, slots=True)
class Job:
    """A block to be rehearsed.

    Attributes
    ----------
    config : Config
        Rig and experiment.
    dyad : int
        Number of the dyad [1].
    folder : Path
        Where its recording goes.
    """

    config: Config
    dyad: int
    folder: Path


def make_study(
    folder: Path, dyads: int, blocks: int, trials: int, workers: int, done: Callable[[int, int], object]
) -> tuple[Path, ...]:
    """Rehearse a study.

    Parameters
    ----------
    folder : Path
        An empty folder.
    dyads, blocks, trials : int
        How many dyads, blocks of the eighteen of each, evenly spread, and trials in a block [1].
    workers : int
        How many processes [1].
    done : callable
        Hears how many blocks are done, and of how many.

    Returns
    -------
    tuple of Path
        The recordings, dyad by dyad.
    """
    jobs = [job for dyad in range(1, dyads + 1) for job in _jobs(folder, dyad, blocks, trials)]
    if workers == 1:
        for number, job in enumerate(jobs):
            done(number, len(jobs))
            rehearse(job)
    else:
        with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
            for number, future in enumerate(as_completed([pool.submit(rehearse, job) for job in jobs])):
                done(number, len(jobs))
                future.result()
    return tuple(sorted(folder.glob("*.mcap")))


def _jobs(folder: Path, dyad: int, blocks: int, trials: int) -> Iterator[Job]:
    """Yield the blocks of a dyad."""
    default = Config()
    plan = plan_of(paper_study(), SEED, dyad)
    rig = seated(default, plan)
    who = replace(rig.session, name="S01", dyad=f"D{dyad:02d}", pilot=True)
    for number in _spread([block.number for block in plan.sessions[0].blocks], blocks):
        config = config_of(replace(rig, session=who), plan.sessions[0], number)
        yield Job(replace(config, block=replace(config.block, trials=trials)), dyad, folder)


def _spread(numbers: Sequence[int], count: int) -> list[int]:
    """Choose some of a row, evenly spread."""
    return [numbers[k] for k in np.unique(np.linspace(0, len(numbers) - 1, count).round().astype(int))]


def rehearse(job: Job) -> Path:
    """Rehearse a block, as fast as the machine allows.

    Parameters
    ----------
    job : Job
        The block.

    Returns
    -------
    Path
        Its recording.
    """
    config, people = job.config, job.config.participant
    session = hashlib.sha256(f"{SEED} {job.dyad}".encode()).hexdigest()[:32]
    keeper = Keeper(job.folder, config, session, OPENED_NS + config.block.number * HOUR_NS)
    for rows in Rehearsal(config, {letter: person_of(people, SEED, job.dyad, letter) for letter in LETTERS}).pieces():
        keeper.take(rows)
    keeper.finish()
    return keeper.path
