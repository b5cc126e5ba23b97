"""Rehearsal of blocks with simulated participants and the live stage, with progress bars and a table of the results."""

import json
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich.progress import MofNCompleteColumn
from rich.text import Text

from netboard.base.config import Config
from netboard.base.errors import NetboardError
from netboard.base.plural import plural
from netboard.base.terminal.bars import progress_bars
from netboard.base.terminal.output import FittedTable, numbers, plain_console
from netboard.base.tick import TICK_SECONDS
from netboard.nodes.rehearsal.jobs import BlockResult, RehearsalJob, jobs_of, rehearse, rehearse_all
from netboard.participants.seat.block import Rehearsal

console = plain_console()


def rehearse_blocks(
    blocks: Sequence[Config],
    seed: int,
    dyad: int,
    *,
    folder: Path | None,
    fast: bool = True,
    workers: int = 1,
    as_json: bool = False,
) -> int:
    """Rehearse blocks, one after the other or several at once."""
    if folder is not None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise NetboardError(f"{folder}: cannot be created: {error.strerror}") from error
    jobs = jobs_of(blocks, seed, dyad, folder, fast)
    for job in jobs:  # compiles before the time is taken
        next(Rehearsal(job.config, job.people).pieces(1))
    began = time.perf_counter()
    results = in_parallel(jobs, workers) if workers > 1 else in_turn(jobs)
    took = time.perf_counter() - began
    if as_json:
        console.file.write(json.dumps(as_data(results, took)) + "\n")
    else:
        console.print(table_of(results))
        console.print(in_total(results, took))
    return 1 if any(result.given_up for result in results) else 0


def in_turn(jobs: Sequence[RehearsalJob]) -> list[BlockResult]:
    """Rehearse in this process, with a bar for the block and one for all."""
    results = []
    with progress_bars(console, MofNCompleteColumn()) as progress:
        whole = progress.add_task("all trials", total=sum(job.config.block.trials for job in jobs))
        done = 0
        for job in jobs:
            block = job.config.block
            task = progress.add_task(f"{job.config.session.name} block {block.number}", total=block.trials)

            def update(successes: int, task: object = task, before: int = done) -> None:
                progress.update(task, completed=successes)  # type: ignore[arg-type]
                progress.update(whole, completed=before + successes)

            results.append(rehearse(job, update))
            done += results[-1].successes
            progress.remove_task(task)
    return results


def in_parallel(jobs: Sequence[RehearsalJob], workers: int) -> list[BlockResult]:
    """Rehearse several at once, with a bar for all."""
    with progress_bars(console, MofNCompleteColumn()) as progress:
        whole = progress.add_task("all trials", total=sum(job.config.block.trials for job in jobs))
        return rehearse_all(jobs, workers, lambda result: progress.advance(whole, result.successes))


def table_of(results: Sequence[BlockResult]) -> FittedTable:
    """Return a table with a row for each block."""
    counted = numbers("trials", "failed", "mean time", "ticks", "speed")
    table = FittedTable("block", "condition", *counted, title="Rehearsal")
    for result in results:
        mean = "-" if result.mean_completion is None else f"{result.mean_completion:.2f} s"
        table.add_row(
            f"{result.session} {result.block}",
            Text(result.label).append(" given up" if result.given_up else "", "red"),
            str(result.successes),
            str(result.failures),
            mean,
            str(result.ticks),
            f"{result.factor:.0f} x",
        )
    return table


def in_total(results: Sequence[BlockResult], took: float) -> str:
    """Return a summary of one line, with the time that it took."""
    ticks = sum(result.ticks for result in results)
    successes, failures = sum(result.successes for result in results), sum(result.failures for result in results)
    seconds = ticks * TICK_SECONDS
    blocks, done = plural(len(results), "block"), plural(successes, "successful trial")
    return (
        f"{blocks}, {done}, {plural(failures, 'failed attempt')}, {seconds / 3600:.2f} h of simulated time\n"
        f"{ticks} ticks in {took:.1f} s: {ticks / took:.0f} ticks/s, {seconds / took:.0f} x real time"
    )


def as_data(results: Sequence[BlockResult], took: float) -> dict[str, object]:
    """Return the results for JSON."""
    ticks = sum(result.ticks for result in results)
    return {
        "blocks": [{**asdict(result), "real_time_factor": result.factor} for result in results],
        "ticks": ticks,
        "seconds": took,
        "ticks_per_second": ticks / took,
        "real_time_factor": ticks * TICK_SECONDS / took,
    }
