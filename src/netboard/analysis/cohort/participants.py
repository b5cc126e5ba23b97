"""Simulated participants of a cohort: the only module of it that knows how they are drawn and how a block is run."""

from collections.abc import Iterator, Sequence
from dataclasses import fields

import numpy as np

from netboard.base.config import Config
from netboard.base.settings import tables
from netboard.base.tables.simulated import Participant
from netboard.nodes.rehearsal.block import Rehearsal
from netboard.nodes.rehearsal.jobs import Job, jobs_of
from netboard.nodes.rehearsal.population import LETTERS, person_of
from netboard.task.plans.plan import blocks_of
from netboard.task.studies.study import Study

SHOWN = 1000
"""Participants drawn to describe the distribution of each parameter [1]."""


def jobs_of_dyad(config: Config, study: Study, seed: int, dyad: int) -> list[Job]:
    """Return the blocks of a dyad, in order, each with its participants; nothing of them is recorded."""
    return jobs_of(blocks_of(config, study, seed, dyad), seed, dyad, None)


def rehearsal_of(job: Job) -> Rehearsal:
    """Return a block, ready to run."""
    return Rehearsal(job.config, job.people)


def compile_kernels(jobs: Sequence[Job]) -> None:
    """Compile the kernels of blocks, or load them from the cache, by running a tick of each."""
    for job in jobs:
        next(rehearsal_of(job).pieces(1))


def distributions(config: Config, seed: int) -> Iterator[tuple[str, str, float, float, float]]:
    """Yield the distribution of each parameter of the participants, from a sample of `SHOWN`.

    Yields
    ------
    tuple
        Parameter, unit, median, and the limits of the central 95 %; these are equal for a constant [its unit].
    """
    people = [person_of(config.participant, seed, dyad + 1, LETTERS[0]) for dyad in range(SHOWN)]
    (units,) = ({key.name: key.unit for key in table.keys} for table in tables(Config) if table.name == "participant")
    for field in fields(Participant):
        values = [getattr(person, field.name) for person in people]
        if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
            low, middle, high = (float(value) for value in np.percentile(values, (2.5, 50.0, 97.5)))
            yield field.name, units.get(field.name, "1"), middle, low, high
