"""Trials of virtual dyads: the paper's plan rehearsed in memory, with the measures that an analysis computes.

A dyad depends only on the participant's parameters, the device, the seed and its number, so every table is
reproducible. Nothing is written to disk, and no participant is excluded: unfinished blocks are counted.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.cohort.block import rehearse
from netboard.analysis.extraction.attempts import PAPER
from netboard.analysis.extraction.details import delays_of
from netboard.analysis.extraction.recordings import attempt_row
from netboard.analysis.extraction.trials import RATE, AttemptData, BlockData
from netboard.analysis.measures.cooperation import PORTIONS, Contributions, Delays, delays
from netboard.analysis.measures.movements import shares
from netboard.base.config import SIDES, Config
from netboard.base.tables.simulated import Participant
from netboard.benchmarks.harness.processes import fresh_processes
from netboard.nodes.rehearsal.jobs import RehearsalJob, jobs_of
from netboard.task.plans.plan import blocks_of, shortened
from netboard.task.studies.study import paper_study

SEED = 20
"""Seed of plans and participants [1]."""

PAPER_TRIALS = 60
"""Successful trials in a block of the paper [1]."""

ATTEMPT = np.dtype(
    [
        ("dyad", "<i8"),
        ("block", "<i8"),  # number of the block in the plan, from 1
        ("performer", "U4"),  # A, B, or dyad
        ("haptics", "?"),
        ("trial", "<i8"),  # number of the trial in the block, from 1
        ("success", "?"),
        ("completion", "<f8"),  # [s]
        ("peaks", "<f8"),  # velocity peaks to completion [1]
        ("cooperative", "<f8"),  # shares of the movement classes to completion [1]
        ("competitive", "<f8"),
        ("single", "<f8"),
        ("still", "<f8"),
        ("distance", "<f8"),  # strategy: ball to target and its velocity at the first braking movement [m, m/s]
        ("velocity", "<f8"),
        ("rest", "<f8"),  # longest time for which the reading of a hand does not change [s]
        ("segments", "<i8"),  # cooperative movements of the board [1]
        ("delay", "<f8", (len(PORTIONS),)),  # sum of their absolute delays at each portion of the peak [s]
        ("delays", "<i8", (len(PORTIONS),)),  # number of known delays [1]
        ("delay_back", "<f8", (len(PORTIONS),)),  # the same, if a side is searched for before the movement, too
        ("delays_back", "<i8", (len(PORTIONS),)),
    ]
)
"""Measures of one attempt."""

SHARES = ("cooperative", "competitive", "single", "still")


@dataclass(frozen=True)
class Population:
    """Parameters of the simulated participants, and the length of the blocks.

    - `trials`: successful trials in a block, 60 in the paper. Practice counts as if all 60 had been done [1].
    """

    participant: Participant = field(default_factory=Participant)
    trials: int = PAPER_TRIALS

    def jobs(self, dyad: int) -> list[RehearsalJob]:
        """Return the blocks of a dyad in the paper's plan."""
        config = replace(Config(), participant=self.participant)
        plan = blocks_of(config, paper_study(), SEED, dyad)
        jobs = zip(jobs_of(plan, SEED, dyad, None), shortened(plan, None, self.trials), strict=True)
        return [replace(job, config=config) for job, config in jobs]

    def bimanual_jobs(self, dyad: int) -> list[RehearsalJob]:
        """Return those in which one participant moves both hands, with haptic feedback off."""
        blocks = [(job, job.config.block) for job in self.jobs(dyad)]
        return [job for job, block in blocks if block.configuration == "bimanual" and not block.haptics]


@dataclass(frozen=True)
class Performance:
    """The attempts of a dyad in some blocks.

    - `attempts`: array of `ATTEMPT`, in the order of the blocks.
    - `given_up`: number of blocks that the participants could not finish [1].
    """

    attempts: NDArray[Any]
    given_up: int


def perform(jobs: Sequence[RehearsalJob], dyad: int) -> Performance:
    """Simulate the blocks of a dyad."""
    parts, given_up = [], 0
    for job in jobs:
        found = rehearse(job)
        parts.append(_attempts(found.block, dyad))
        given_up += found.given_up
    return Performance(np.concatenate(parts), given_up)


def perform_all(tasks: Sequence[tuple[Sequence[RehearsalJob], int]], workers: int) -> Iterator[Performance]:
    """Simulate the blocks of several dyads in parallel; yield their performances in order."""
    if workers == 1:
        yield from (perform(jobs, dyad) for jobs, dyad in tasks)
        return
    with fresh_processes(workers) as pool:
        yield from pool.map(perform, *zip(*tasks, strict=True))


def longest_rest(heights: NDArray[np.float64]) -> float:
    """Return the longest time for which a height does not change, to the bit [s]."""
    changes = np.flatnonzero(np.diff(heights))
    return float(np.diff(changes, prepend=-1, append=len(heights) - 1).max() / RATE)


def _attempts(block: BlockData, dyad: int) -> NDArray[Any]:
    takes = [take for take in block.takes() if take.attempt.outcome in ("success", "fell")]
    rows, conditions = np.zeros(len(takes), ATTEMPT), block.config.block
    rows["dyad"], rows["block"], rows["haptics"] = dyad, conditions.number, conditions.haptics
    rows["performer"] = conditions.performer if conditions.configuration == "bimanual" else "dyad"
    for row, take in zip(rows, takes, strict=True):
        measured = attempt_row("", take, {}, PAPER)  # as in the table of trials of an analysis
        row["trial"], row["success"], row["completion"] = take.attempt.trial, bool(take.source), measured["completion"]
        row["peaks"] = measured["peaks"]
        for name, share in zip(SHARES, shares(np.array([measured[name] for name in SHARES])), strict=True):
            row[name] = share
        row["distance"], row["velocity"] = measured["braking_distance"], measured["braking_velocity"]
        course = slice(take.attempt.tick - block.first, take.attempt.stop - block.first)
        row["rest"] = max(longest_rest(block.raw(f"{side}_used_z")[course]) for side in SIDES)
        moved, back = delays_of(take)
        row["segments"] = moved.cooperative.sum()
        for end, found in (("", _delays_inside(take, moved)), ("_back", back)):
            row[f"delay{end}"] = np.nansum(found.absolute, axis=0)
            row[f"delays{end}"] = np.isfinite(found.absolute).sum(axis=0)
    return rows


def _delays_inside(take: AttemptData, moved: Contributions) -> Delays:
    """Return the delays as the paper more likely measured them, within the movement of the board."""
    found, how = take.motion, take.block.readings.delays
    return delays(
        take.own_segments,
        moved,
        found.left_vz,
        found.right_vz,
        RATE,
        threshold=how.threshold,
        search="inside",
        velocity=how.velocity,
    )
