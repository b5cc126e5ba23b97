"""Trials of virtual dyads: the paper's plan rehearsed in memory, with the paper's measures of each trial.

A dyad depends only on the participant's parameters, the device, the seed and its number, so every table is
reproducible. Nothing is written to disk, and no participant is excluded: unfinished blocks are counted.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.measures.braking import first_braking
from netboard.analysis.measures.cooperation import PORTIONS, contributions, delays
from netboard.analysis.measures.motion import Motion, Trial, find_completion, motion, placements
from netboard.analysis.measures.movements import classify, movement_times
from netboard.analysis.measures.peaks import velocity_peaks
from netboard.analysis.measures.segments import Segments, board_segments
from netboard.analysis.measures.smoothness import spectral_arc_length
from netboard.base.config import Config
from netboard.base.tables.simulated import Participant
from netboard.base.tick import TICK_SECONDS
from netboard.nodes.rehearsal.block import Rehearsal
from netboard.nodes.rehearsal.jobs import Job, jobs_of
from netboard.recording.format.summary import attempts_along
from netboard.task.plans.plan import blocks_of, shortened
from netboard.task.studies.study import paper_study

RATE = 1.0 / TICK_SECONDS
"""Sampling rate [Hz]."""

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
        ("first_move", "<f8"),  # onset of the initial movement of the board [s]
        ("sparc", "<f8"),  # spectral arc length of the ball's speed to completion [1]
        ("segments", "<i8"),  # cooperative movements of the board [1]
        ("delay", "<f8", (len(PORTIONS),)),  # sum of their absolute delays at each portion of the peak [s]
        ("delays", "<i8", (len(PORTIONS),)),  # number of known delays [1]
    ]
)
"""Measures of one attempt."""

SHARES = ("cooperative", "competitive", "single", "still")

_KEPT = ("p", "theta", "left_used_z", "right_used_z")


@dataclass(frozen=True)
class Population:
    """Parameters of the simulated participants, and the length of the blocks.

    - `trials`: successful trials in a block, 60 in the paper. Practice counts as if all 60 had been done [1].
    """

    participant: Participant = field(default_factory=Participant)
    trials: int = PAPER_TRIALS

    def jobs(self, dyad: int) -> list[Job]:
        """Return the blocks of a dyad in the paper's plan."""
        config = replace(Config(), participant=self.participant)
        plan = blocks_of(config, paper_study(), SEED, dyad)
        jobs = zip(jobs_of(plan, SEED, dyad, None), shortened(plan, None, self.trials), strict=True)
        return [replace(job, config=config) for job, config in jobs]


@dataclass(frozen=True)
class Performance:
    """The attempts of a dyad in some blocks.

    - `attempts`: array of `ATTEMPT`, in the order of the blocks.
    - `given_up`: number of blocks that the participants could not finish [1].
    """

    attempts: NDArray[Any]
    given_up: int


def perform(jobs: Sequence[Job], dyad: int) -> Performance:
    """Simulate the blocks of a dyad."""
    parts, given_up = [], 0
    for job in jobs:
        rehearsal = Rehearsal(job.config, job.people)
        parts.append(_attempts(job.config, dyad, rehearsal))
        given_up += rehearsal.summary().given_up
    return Performance(np.concatenate(parts), given_up)


def perform_all(tasks: Sequence[tuple[Sequence[Job], int]], workers: int) -> Iterator[Performance]:
    """Simulate the blocks of several dyads in parallel; yield their performances in order."""
    if workers == 1:
        yield from (perform(jobs, dyad) for jobs, dyad in tasks)
        return
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        yield from pool.map(perform, *zip(*tasks, strict=True))


def _attempts(config: Config, dyad: int, rehearsal: Rehearsal) -> NDArray[Any]:
    """Run a block and return its attempts with their measures."""
    kept: dict[str, list[NDArray[np.float64]]] = {name: [] for name in _KEPT}

    def pieces() -> Iterator[NDArray[Any]]:
        for piece in rehearsal.pieces():
            for name, parts in kept.items():
                parts.append(piece[name].copy())
            yield piece.copy()

    attempts = [one for one in attempts_along(pieces()) if one.outcome in ("success", "fell")]
    p, theta, left, right = (np.concatenate(kept[name]) for name in _KEPT)
    found = motion(RATE, left, right, theta, p, placed=placements(p, RATE))
    turns = board_segments(found.omega, found.theta, RATE)
    rows = np.zeros(len(attempts), ATTEMPT)
    rows["dyad"], rows["block"], rows["haptics"] = dyad, config.block.number, config.block.haptics
    rows["performer"] = config.block.performer if config.block.configuration == "bimanual" else "dyad"
    for row, one in zip(rows, attempts, strict=True):
        target = one.target * config.geometry.target_distance
        done = find_completion(p[one.tick : one.stop], RATE, target)
        held = one.outcome == "success" and done.sample is not None
        trial = Trial(one.tick, one.stop, target, one.tick + round(done.time * RATE) if held else None)
        row["trial"], row["success"], row["completion"] = one.trial, held, done.time if held else np.nan
        _measure(row, found, turns, trial)
    return rows


def _measure(row: Any, found: Motion, turns: Segments, trial: Trial) -> None:
    """Fill a row with the measures of an attempt."""
    window, own = trial.window(), turns.of_trial(trial)
    speed = found.speed[window]
    row["peaks"] = velocity_peaks(speed).count
    row["sparc"] = spectral_arc_length(speed, RATE) if len(speed) > 1 else np.nan
    shares = movement_times(classify(found.left_vz[window], found.right_vz[window]), RATE).shares
    for name, share in zip(SHARES, shares, strict=True):
        row[name] = share
    strategy = first_braking(turns, found.theta, found.p, found.vp, RATE, trial)
    row["distance"], row["velocity"], row["first_move"] = strategy.distance, strategy.velocity, strategy.initial
    moved = contributions(own, found.left_z, found.right_z)
    absolute = delays(own, moved, found.left_vz, found.right_vz, RATE).absolute
    row["segments"] = moved.cooperative.sum()
    row["delay"], row["delays"] = np.nansum(absolute, axis=0), np.isfinite(absolute).sum(axis=0)
