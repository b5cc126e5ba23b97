"""Blocks to rehearse: the participants of each, its recording and its results.

They run one after the other in this process, or several at once, each in its own process.
"""

import hashlib
import time
from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import fmean

from netboard.base.config import Config, digest
from netboard.base.process.stopping import uninterrupted
from netboard.base.process.workers import interrupt_workers, interrupted, worker_processes
from netboard.base.system.interrupts import ctrl_c
from netboard.base.tables.simulated import Participant
from netboard.base.terminal.compiling import workers_compilation
from netboard.base.tick import TICK_SECONDS
from netboard.participants.people.population import people_of
from netboard.participants.policy import SIMULATED_PARTICIPANT, identity_of
from netboard.participants.seat.block import PIECE, Rehearsal
from netboard.recording.files.offline_writer import REHEARSED, BlockWriter

SECOND = round(1.0 / TICK_SECONDS)
"""Ticks in a piece of a rehearsal in real time: its progress is shown every second [1]."""


@dataclass(frozen=True)
class RehearsalJob:
    """One block to rehearse."""

    config: Config
    people: dict[str, Participant]
    session: str
    folder: Path | None
    fast: bool = True
    begun_ns: int | None = None  # start time that its recording states; None for the real one [ns]


@dataclass(frozen=True)
class BlockResult:
    """Results of a block, as they are shown and written as JSON."""

    session: str
    block: int
    label: str
    configuration: str
    force: str
    successes: int
    failures: int
    mean_completion: float | None  # mean completion time of the successful trials; None without one [s]
    ticks: int
    seconds: float  # computing time [s]
    given_up: bool
    recording: str

    @property
    def factor(self) -> float:
        """Speed relative to real time [1]."""
        return self.ticks * TICK_SECONDS / self.seconds


def jobs_of(
    blocks: Sequence[Config], seed: int, dyad: int, folder: Path | None, fast: bool = True
) -> list[RehearsalJob]:
    """Make the jobs of a dyad, in the order in which they are practised; session ids depend on blocks and seed only."""
    ids = {
        name: hashlib.sha256(" ".join([str(seed), *(digest(b) for b in blocks if b.session.name == name)]).encode())
        for name in dict.fromkeys(block.session.name for block in blocks)
    }
    return [
        RehearsalJob(
            replace(config, session=replace(config.session, pilot=True)),
            people,
            ids[config.session.name].hexdigest()[:32],
            folder,
            fast,
        )
        for config, people in zip(blocks, people_of(blocks, seed, dyad), strict=True)
    ]


def rehearse(job: RehearsalJob, progress: Callable[[int], object] = lambda successes: None) -> BlockResult:
    """Rehearse one block. ``progress``: called with the number of successful trials so far, after each of them."""
    began = time.perf_counter()
    rehearsal = Rehearsal(job.config, job.people)
    begun_ns = time.time_ns() if job.begun_ns is None else job.begun_ns
    movers = {letter: identity_of(SIMULATED_PARTICIPANT, person) for letter, person in job.people.items()}
    movers |= {side: dict(own) for side, own in rehearsal.partners.items()}
    metadata = REHEARSED | {f"{mover}_{name}": text for mover, own in movers.items() for name, text in own.items()}
    writer: BlockWriter | None = None
    ticks = successes = 0
    try:
        if job.folder is not None:
            with uninterrupted():  # else nobody could abandon a file that has just been made
                writer = BlockWriter(job.folder, job.config, job.session, begun_ns, metadata)
        for rows in rehearsal.pieces(PIECE if job.fast else SECOND):
            if interrupted.is_set():
                raise KeyboardInterrupt
            if writer is not None:
                writer.take(rows)
            ticks += len(rows)
            if rehearsal.successes > successes:
                successes = rehearsal.successes
                progress(successes)
            if not job.fast:
                time.sleep(max(0.0, began + ticks * TICK_SECONDS - time.perf_counter()))
        if writer is not None:
            writer.finish()
    except BaseException:
        if writer is not None:
            with uninterrupted():
                writer.abandon()
        raise
    summary, block = rehearsal.summary(), job.config.block
    return BlockResult(
        session=job.config.session.name,
        block=block.number,
        label=block.label or f"{block.configuration}, {block.force}",
        configuration=block.configuration,
        force=block.force,
        successes=len(summary.completions),
        failures=summary.failures,
        mean_completion=fmean(summary.completions) if summary.completions else None,
        ticks=summary.ticks,
        seconds=time.perf_counter() - began,
        given_up=summary.given_up,
        recording="" if writer is None else str(writer.path),
    )


def rehearse_all(
    jobs: Sequence[RehearsalJob], workers: int, done: Callable[[BlockResult], object] = lambda block_result: None
) -> list[BlockResult]:
    """Rehearse blocks, one after the other or in several worker processes. ``done``: called with each result."""
    if workers == 1:
        results = []
        for job in jobs:
            results.append(rehearse(job))
            done(results[-1])
        return results
    with workers_compilation(), worker_processes(workers, interruptible=True) as pool:
        futures = [pool.submit(_rehearse_in_worker, job) for job in jobs]
        try:
            for future in as_completed(futures):
                done(future.result())
        except KeyboardInterrupt:
            interrupt_workers(pool)  # the signal may have reached this process only
            raise
        finally:
            pool.shutdown(cancel_futures=True)
        return [future.result() for future in futures]


def _rehearse_in_worker(job: RehearsalJob) -> BlockResult:
    """Rehearse one block in a worker."""
    with ctrl_c(blocked=False):
        return rehearse(job)
