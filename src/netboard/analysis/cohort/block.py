"""A rehearsed block as input of the measures, in memory and without a recording.

Each tick is processed as soon as it is simulated, while its row is in the processor's cache, and only the columns that
the measures need are kept. Attempts, quality flags and measures are computed by the functions that analyse a recording,
with the default settings, so they equal those of a recording of the same block.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from netboard.analysis.extraction.answers import FIELDS as ANSWERS
from netboard.analysis.extraction.attempts import PAPER
from netboard.analysis.extraction.controls import FIELDS as CONTROLS
from netboard.analysis.extraction.details import movements
from netboard.analysis.extraction.devices import always, simulated_mechanics
from netboard.analysis.extraction.recordings import ATTEMPT, BLOCKS, Measured, attempt_row, block_row, paths_of
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.tables import Group, columns_of
from netboard.analysis.extraction.trials import FORCES, PERTURBED, PLACES, BlockData
from netboard.base.compiled import Numbers, Records, Words, inlined
from netboard.base.safeguards import Safeguard
from netboard.base.tick import TICK, TICK_WORDS
from netboard.nodes.rehearsal.jobs import RehearsalJob
from netboard.participants.seat.block import Rehearsal, TickRing, Watcher
from netboard.recording.export.runs import Run, people_in
from netboard.recording.files.offline_writer import REHEARSED, recording_name
from netboard.recording.format.summary import find_attempts
from netboard.task.trials.quality import Referee, tally_tick

READINGS = Readings()
"""Settings of the measures: the defaults of an analysis."""

TRIALS = (*ATTEMPT, *(field for group in PAPER for field in group.fields))
"""Columns of the attempts of a virtual study: the measures of the paper."""

RING = 4
"""Rows of the newest ticks: few, so that they stay in the cache of a core [1]."""

PIECE = 8_000
"""Ticks that are simulated in one piece [1]."""

TURNS = 64
"""Rows with room for the first and the last tick of each phase in a piece, which ends when they are full [1]."""

ROOM = 2**19
"""Ticks for which the columns of a block have room at first; one of 60 trials has some 450 000 [1]."""

_TICK, _PHASE, _TRIAL, _ATTEMPT = (TICK_WORDS[name] for name in ("tick", "phase", "trial", "attempt"))


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


class _Kept(NamedTuple):
    """What is kept of the ticks of a piece."""

    places: Words  # of the columns in a row
    columns: Numbers  # (columns, PIECE)
    turns: Words  # (TURNS, words of a row) first and last row of each phase
    counts: Words  # ticks and turns so far
    tally: Any  # counts of the referee
    limits: tuple[float, int]


@inlined
def _keep(kept: _Kept, rows: Records, words: Words, numbers: Numbers, place: int, before: int) -> bool:
    """Keep what is needed of a tick; return whether an attempt has ended, or the rows of turns are full."""
    turns, counts, row, last = kept.turns, kept.counts, words[place], words[before]
    for column in range(len(kept.places)):
        kept.columns[column, counts[0]] = numbers[place, kept.places[column]]
    counts[0] += 1
    count = counts[1]
    if row[_TICK] == 0:
        turns[count] = row
        counts[1] = count + 1
    elif row[_PHASE] != last[_PHASE] or row[_TRIAL] != last[_TRIAL] or row[_ATTEMPT] != last[_ATTEMPT]:
        turns[count], turns[count + 1] = last, row
        counts[1] = count + 2
    return tally_tick(kept.tally[0], rows[place], *kept.limits) or counts[1] > len(turns) - 2


def rehearse(job: RehearsalJob, *, forces: bool = False) -> Rehearsed:
    """Rehearse a block; keep the columns of the measures of forces only if they are wanted."""
    wanted = (*PLACES, *(FORCES if forces else ()), *((PERTURBED,) if job.config.perturbation.trials else ()))
    referee, words = Referee(job.config, Safeguard.CLAMPED), len(TICK_WORDS)
    places = np.array([TICK_WORDS[name] for name in wanted])
    room, turns, counts = np.empty((len(wanted), PIECE)), np.empty((TURNS, words), np.int64), np.zeros(2, np.int64)
    kept = _Kept(places, room, turns, counts, referee.tally, referee.limits)
    rehearsal, ring = Rehearsal(job.config, job.people, Watcher(_keep, kept)), TickRing.of(RING)
    columns, done = np.empty((len(wanted), ROOM)), 0
    flags: dict[tuple[int, int], tuple[str, ...]] = {}
    ends: list[Words] = []
    while not rehearsal.over:
        counts[:] = 0
        count = rehearsal.run(ring, PIECE)
        if done + count > columns.shape[1]:
            columns = np.concatenate([columns, np.empty_like(columns)], axis=1)
        columns[:, done : done + count] = room[:, :count]
        done += count
        ends.append(turns[: counts[1]].copy())
        flags.update(((one.trial, one.attempt), one.flags) for one in referee.verdicts())
    ends.append(ring.words[(done - 1) % RING :][:1])
    found = dict(zip(wanted, columns[:, :done], strict=True)) | {"tick": np.arange(done)}  # a rehearsal lacks no tick
    attempts = find_attempts(np.concatenate(ends).view(TICK)[:, 0])
    block = BlockData(job.config, READINGS, found, attempts, always(simulated_mechanics(job.config)))
    return Rehearsed(block, flags, done, rehearsal.summary().given_up)


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
