"""A rehearsed block as input of the measures, in memory and without a recording.

The ticks are processed while the block is simulated, and only the columns that the measures need are kept. Attempts,
quality flags and measures are computed by the functions that analyse a recording, with the default settings, so they
equal those of a recording of the same block.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.extraction.answers import FIELDS as ANSWERS
from netboard.analysis.extraction.attempts import PAPER
from netboard.analysis.extraction.controls import FIELDS as CONTROLS
from netboard.analysis.extraction.details import movements
from netboard.analysis.extraction.devices import always, simulated_mechanics
from netboard.analysis.extraction.recordings import ATTEMPT, BLOCKS, Measured, attempt_row, block_row, paths_of
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.tables import Group, columns_of
from netboard.analysis.extraction.trials import FORCES, PERTURBED, PLACES, BlockData
from netboard.base.safeguards import Safeguard
from netboard.nodes.rehearsal.jobs import RehearsalJob
from netboard.participants.seat.block import Rehearsal
from netboard.recording.export.runs import Run, people_in
from netboard.recording.files.offline_writer import REHEARSED, recording_name
from netboard.recording.format.summary import attempts_along
from netboard.task.trials.quality import Referee

READINGS = Readings()
"""Settings of the measures: the defaults of an analysis."""

TRIALS = (*ATTEMPT, *(field for group in PAPER for field in group.fields))
"""Columns of the attempts of a virtual study: the measures of the paper."""

PIECE = 2_000
"""Ticks that are simulated in one piece: their rows then stay in the cache of a core while they are read [1]."""


@dataclass(frozen=True, slots=True)
class Rehearsed:
    """A rehearsed block, and how its rehearsal went.

    - `flags`: quality flags of the attempts, by trial and attempt.
    - `ticks`: simulated ticks [1].
    - `given_up`: whether the block was stopped because its participants could not do it.
    """

    block: BlockData
    flags: Mapping[tuple[int, int], tuple[str, ...]]
    ticks: int
    given_up: bool


def rehearse(job: RehearsalJob, *, forces: bool = False) -> Rehearsed:
    """Rehearse a block; keep the columns of the measures of forces only if they are wanted."""
    rehearsal, referee = Rehearsal(job.config, job.people), Referee(job.config, Safeguard.CLAMPED)
    wanted = (*PLACES, *(FORCES if forces else ()), *((PERTURBED,) if job.config.perturbation.trials else ()))
    parts: dict[str, list[NDArray[np.float64]]] = {name: [] for name in wanted}
    flags: dict[tuple[int, int], tuple[str, ...]] = {}

    def portions() -> Iterator[NDArray[Any]]:
        for rows in rehearsal.pieces(PIECE):
            for name, own in parts.items():
                own.append(rows[name].copy())
            ended = referee.watch(rows, 0, len(rows))
            flags.update(((one.trial, one.attempt), one.flags) for one in ended)
            yield rows

    attempts = attempts_along(portions())
    summary = rehearsal.summary()
    columns: dict[str, NDArray[Any]] = {name: np.concatenate(own) for name, own in parts.items()}
    columns["tick"] = np.arange(summary.ticks)  # a rehearsal lacks no tick
    block = BlockData(job.config, READINGS, columns, attempts, always(simulated_mechanics(job.config)))
    return Rehearsed(block, flags, summary.ticks, summary.given_up)


def measured(job: RehearsalJob, place: int, found: Rehearsed, groups: Sequence[Group] = PAPER) -> Measured:
    """Return the tables of a rehearsed block, with paths only if it has perturbation trials.

    - `place`: place of the block among those of its dyad, from 1 [1].
    - `groups`: measures of its attempts.
    """
    run = run_of(job, place)
    name, takes = run.path.stem, list(found.block.takes())
    fields = (*ATTEMPT, *(field for group in groups for field in group.fields))
    return Measured(
        columns_of(BLOCKS, [block_row(run, found.block, repaired=False, unknown=0)]),
        columns_of(fields, [attempt_row(name, take, found.flags, groups) for take in takes]),
        movements(name, takes),
        paths_of(name, takes if job.config.perturbation.trials else ()),
        columns_of(CONTROLS, []),
        columns_of(ANSWERS, []),
    )


def run_of(job: RehearsalJob, place: int) -> Run:
    """Return a block with the metadata that its recording would have; the start is its place among the blocks."""
    config, who = job.config, job.config.session
    metadata = {**REHEARSED, "session": job.session, "part": "1", "opened_utc": f"{place:06d}"}
    metadata |= {"netboard": "", "config_sha256": ""}
    people = tuple(people_in(config, metadata))
    return Run(Path(recording_name(config, job.session)), metadata, config, who.dyad + who.name, place, people)
