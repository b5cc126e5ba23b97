"""``make evidence ARGS=analysis``: time and memory of an analysis, and how both grow with the study.

Every cost includes its child processes. The tables of each share are made in a fresh process, and taken from the cache
in another one. The time for reading the same files in as many processes stands beside each time: ratios differ less
between machines. Straight lines are fitted to CPU time, which other programs on the machine disturb less than elapsed
time.
"""

import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from scipy import stats

from evidence.analysis.costs import (
    Stopwatch,
    TablesCost,
    Time,
    cost_of_report,
    cost_of_tables,
    cost_without_cache,
)
from evidence.analysis.rehearsed_study import rehearse_study
from evidence.analysis.step_costs import steps_part, tasks_part
from netboard.analysis.report.analysing import ANSWERED
from netboard.base.process.workers import cores
from netboard.benchmarks.harness.processes import in_fresh_process
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Options, Tell, run
from netboard.recording.files.locate import find_recordings

SHARES = (0.25, 0.5, 0.75, 1.0)
"""Shares of the study's recordings that are analysed [1]."""

MIN_R2 = 0.98
"""Coefficient of determination from which CPU time counts as proportional to the number of trials [1].

At the four shares, growth with the square of the number has 0.969. A straight line with noise of 3 % of the largest
time has about 0.99.
"""

ROUNDS, QUICK_ROUNDS = 1, 3
"""Times each uncached analysis is measured; the shortest CPU time counts, because other programs only add to it [1].

The short form needs several: its analyses take so little time that a disturbance is a large part of it. They follow
each other in one process, because loading the libraries takes longer than such an analysis.
"""

WORKER_GROWTH = 1.1
"""Largest ratio of the peak memory of a worker for the whole study to that for a quarter of it [1]."""

MAIN_GROWTH = 1.25
"""The same for the process that joins the tables [1]."""

SECOND_RUN = 0.1
"""Largest ratio of the CPU time of a second, cached analysis to that of the first [1]."""


class Size(NamedTuple):
    """Number of dyads, of blocks of each dyad, and of trials in a block [1]."""

    dyads: int
    blocks: int
    trials: int


class Run(NamedTuple):
    """A run of the command: the time until it names the tables and the answer [s], and that of the whole."""

    answer: float
    whole: Time


WHOLE, QUICK = Size(4, 18, 60), Size(2, 6, 12)
"""The paper's study, and a small one."""


@dataclass(frozen=True, slots=True)
class Row:
    """Costs of a share of the study.

    - `uncached`, `cached`: cost of the tables with an empty and with a full cache.
    """

    recordings: int
    reading: Time
    uncached: TablesCost
    cached: TablesCost


def main(given: Path | None, workers: int | None, options: Options) -> None:
    """Run the benchmark.

    - `workers`: number of processes; None for one per core, or for one if a small study is rehearsed [1].
    """
    recordings = None if given is None else find_recordings([given])
    count = workers or (1 if options.quick and recordings is None else cores())
    run("analysis", partial(study, recordings, count), options, {"workers": count})


def study(
    recordings: Sequence[Path] | None, workers: int, folder: Folder, tell: Tell, *, quick: bool
) -> Iterator[ResultPart]:
    """Measure the costs of an analysis; without recordings, of a rehearsed study."""
    size = QUICK if quick else WHOLE
    with TemporaryDirectory() as name:
        place = Path(name)
        if recordings is None:
            (made := place / "study").mkdir()

            def progress(done: int, total: int) -> None:
                tell(f"rehearsing: block {done} of {total}", 0.4 * done / total)

            recordings = rehearse_study(made, *size, workers, progress)
        recordings = mixed(recordings)
        tell("compiling the kernels", 0.4)
        in_fresh_process(cost_of_tables, recordings[:1], 1, place / "compiled")
        rows = []
        for share in SHARES:
            tell(f"analysing {share:.0%} of the study", 0.4 + 0.5 * share)
            some = recordings[: max(1, round(share * len(recordings)))]
            rows.append(_row(some, workers, place / f"cache-{share}", QUICK_ROUNDS if quick else ROUNDS))
        yield in_fresh_process(steps_part, recordings)
        yield _costs(rows, workers)
        yield _scaling(rows)
        yield _memory(rows)
        if not quick:  # the first run of the whole command, below, includes it
            tell("writing results, figures and report", 0.95)
            cache = place / f"cache-{SHARES[-1]}"
            yield _whole(rows[-1], *in_fresh_process(cost_of_report, recordings, cache, place / "analysis"))
            yield in_fresh_process(tasks_part, recordings, cache)
        tell("running netboard analyse twice", 0.97)
        again = recordings[: rows[0].recordings] if quick else recordings
        yield _command(*run_twice(again, workers, place / "twice"))


def mixed(recordings: Sequence[Path]) -> list[Path]:
    """Return recordings of the first and of the second half in turn.

    The halves of a short study differ: in one of them, no block may have haptics off, and so controls.
    """
    half = -(-len(recordings) // 2)
    pairs = zip_longest(recordings[:half], recordings[half:])
    return [path for pair in pairs for path in pair if path is not None]


def _row(recordings: Sequence[Path], workers: int, cache: Path, rounds: int) -> Row:
    """Measure a share of the study, with an empty cache and then with a full one."""
    caches = [cache, *(cache.with_name(f"{cache.name}-{number}") for number in range(1, rounds))]
    uncached, reading = in_fresh_process(cost_without_cache, recordings, workers, caches)
    return Row(len(recordings), reading, uncached, in_fresh_process(cost_of_tables, recordings, workers, cache))


def _costs(rows: Sequence[Row], workers: int) -> ResultPart:
    times = ("reading alone [s]", "uncached [s]", "cached [s]")
    ratios = ("uncached / reading [1]", "cached / reading [1]", "uncached, x real time [1]")
    return ResultPart(
        "costs",
        "From recordings to the tables of the study: elapsed time with "
        f"{workers} process{'' if workers == 1 else 'es'}",
        ("recordings", "attempts", "data [s]", *times, *ratios),
        [
            (
                *(row.recordings, row.uncached.trials, row.uncached.data),
                *(time.elapsed for time in _times(row)),
                row.uncached.time.elapsed / row.reading.elapsed,
                row.cached.time.elapsed / row.reading.elapsed,
                row.uncached.data / row.uncached.time.elapsed,
            )
            for row in rows
        ],
    )


def _times(row: Row) -> tuple[Time, Time, Time]:
    """Return the times for reading alone, uncached and cached."""
    return row.reading, row.uncached.time, row.cached.time


def _scaling(rows: Sequence[Row]) -> ResultPart:
    """Fit straight lines to CPU time against the number of attempts."""
    trials = [row.uncached.trials for row in rows]
    names = ("reading alone", "uncached", "cached")
    series = zip(names, zip(*(_times(row) for row in rows), strict=True), strict=True)
    fits = {name: line(trials, [time.cpu for time in times]) for name, times in series}
    slope, _, explained = fits["uncached"]
    part = ResultPart(
        "scaling",
        "CPU time: straight lines fitted to these shares",
        "part | whole study [s] | slope [ms per attempt] | intercept [s] | R2 [1]",
        [
            (name, time.cpu, 1e3 * fits[name][0], *fits[name][1:])
            for name, time in zip(names, _times(rows[-1]), strict=True)
        ],
    )
    part.claim("CPU time grows in proportion to the number of attempts", explained >= MIN_R2, f"R2 = {explained:.4f}")
    part.claim(
        "cached measures save CPU time",
        slope > fits["cached"][0],
        f"{1e3 * slope:.2f} ms per attempt, cached {1e3 * fits['cached'][0]:.2f} ms",
    )
    return part


def line(x: Sequence[float], y: Sequence[float]) -> tuple[float, float, float]:
    """Fit a straight line by least squares; return slope, intercept and R2 (1 if y is constant) [y per x, y, 1]."""
    fit = stats.linregress(x, y)
    return float(fit.slope), float(fit.intercept), float(fit.rvalue**2) if any(one != y[0] for one in y) else 1.0


def _memory(rows: Sequence[Row]) -> ResultPart:
    hours = [row.uncached.data / 3600 for row in rows]
    growth, start, _ = line(hours, [row.uncached.peak for row in rows])
    first, last = rows[0].uncached.worker_peak, rows[-1].uncached.worker_peak
    part = ResultPart(
        "memory",
        "Peak memory of the processes",
        "recordings | data [h] | worker [MB] | main process, uncached [MB] | main process, cached [MB]",
        [
            (row.recordings, hour, row.uncached.worker_peak / 1e6, row.uncached.peak / 1e6, row.cached.peak / 1e6)
            for row, hour in zip(rows, hours, strict=True)
        ],
    )
    part.claim(
        "the memory of a worker does not grow with the study",
        last <= WORKER_GROWTH * first,
        f"{first / 1e6:.0f} MB for a quarter, {last / 1e6:.0f} MB for all",
    )
    part.claim(
        "the memory of the main process hardly grows, because paths stay on disk",
        rows[-1].uncached.peak <= MAIN_GROWTH * rows[0].uncached.peak,
        f"{start / 1e6:.0f} MB and {growth / 1e6:.1f} MB for each hour of data",
    )
    return part


def _whole(row: Row, first: Time, second: Time, peak: float) -> ResultPart:
    return ResultPart(
        "whole",
        "Parts of an analysis; those after the tables in one process, although the command uses all",
        "part | elapsed time [s] | CPU time [s] | peak memory [MB]",
        [
            *(
                (f"tables, {name}", cost.time.elapsed, cost.time.cpu, cost.peak / 1e6)
                for name, cost in (("uncached", row.uncached), ("cached", row.cached))
            ),
            ("files of the tables, answer", first.elapsed, first.cpu, peak / 1e6),
            ("results, figures, report", second.elapsed, second.cpu, peak / 1e6),
        ],
    )


def _command(first: Run, second: Run) -> ResultPart:
    """Tabulate the cost of the whole command, for the first run and an identical second one."""
    share = second.whole.cpu / first.whole.cpu
    part = ResultPart(
        "again",
        "netboard analyse, the whole command",
        "run | tables and answer after [s] | elapsed time [s] | CPU time [s]",
        [(name, run.answer, run.whole.elapsed, run.whole.cpu) for name, run in (("first", first), ("second", second))],
    )
    part.claim(
        f"the second run takes at most {SECOND_RUN:.0%} of the first run's CPU time",
        share <= SECOND_RUN,
        f"{share:.1%}",
    )
    return part


def run_twice(recordings: Sequence[Path], workers: int, folder: Path) -> tuple[Run, Run]:
    """Run ``netboard analyse`` twice with one cache, each time in a new process.

    - `folder`: a new folder, for both analyses and the cache.
    """
    folder.mkdir()
    options = ("--workers", str(workers), "--cache", str(folder / "cache"))
    runs = []
    for name in ("first", "second"):
        watch = Stopwatch()
        command = [sys.executable, "-m", "netboard.services.cli", "analyse", *map(str, recordings)]
        answer = None
        whole = [*command, "-o", str(folder / name), *options]
        with subprocess.Popen(whole, stdout=subprocess.PIPE, text=True) as process:
            for line in process.stdout or ():
                if line.startswith(ANSWERED):
                    answer = watch.read().elapsed
        if process.returncode:
            raise subprocess.CalledProcessError(process.returncode, whole)
        spent = watch.read()
        runs.append(Run(spent.elapsed if answer is None else answer, spent))
    return runs[0], runs[1]
