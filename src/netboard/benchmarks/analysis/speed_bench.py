"""``netboard bench analysis``: what it costs to analyse a study, and how that grows with the study.

Every figure is of a process that has done nothing else, with those that it starts. Beside each time is that of reading
the same files alone, in as many processes and in the same run: machines differ, and the ratio less so. Time of cores
differs less than time by the clock where others use the machine too, so straight lines are fitted to it.
"""

import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import ArrayLike

from netboard.analysis.extraction.workers import cores
from netboard.benchmarks.analysis.apart import Took, Watch, apart
from netboard.benchmarks.analysis.making import Measurement, tables
from netboard.benchmarks.analysis.reading import reading
from netboard.benchmarks.analysis.remainder import remainder
from netboard.benchmarks.analysis.specimen import make_study
from netboard.benchmarks.harness.results import Folder, Part, Verdict, new_folder
from netboard.benchmarks.harness.running import Tell, run
from netboard.recording.files.locate import find_recordings

SHARES = (0.25, 0.5, 0.75, 1.0)
"""Shares of the study's recordings that are analysed [1]."""

LINEAR = 0.98
"""A cost of which a straight line explains this much grows with the number of trials (R2) [1]."""

FLAT = 1.1
"""A process that measures holds no more than this times as much for a whole study as for a quarter [1]."""

HELD = 1.25
"""The process that has the tables holds no more than this times as much for a whole study as for a quarter [1]."""

AGAIN = 0.1
"""An analysis that is kept takes no more of the cores' time than this share of the first [1]."""


@dataclass(frozen=True, slots=True)
class Size:
    """Size of a study.

    - `dyads`, `blocks`, `trials`: how many dyads, blocks of each, and trials in a block [1].
    """

    dyads: int
    blocks: int
    trials: int


WHOLE, QUICK = Size(4, 18, 60), Size(2, 6, 12)
"""The paper's study, and a small one."""


@dataclass(frozen=True, slots=True)
class Row:
    """Cost of one part of a study.

    - `cold`, `kept`: what the tables cost when nothing was kept, and when all was.
    """

    recordings: int
    reading: Took
    cold: Measurement
    kept: Measurement


def main(
    given: Path | None, workers: int | None, output: Path | None, json: Path | None, *, quick: bool, force: bool
) -> list[Verdict]:
    """Measure, show and write.

    - `workers`: how many processes measure; None for one a core; one alone is enough for a small study that is made
      [1].
    """
    recordings = None if given is None else find_recordings([given])
    size, alone = (QUICK, recordings is None) if quick else (WHOLE, False)
    count = workers or (1 if alone else cores())
    folder = Folder(output or new_folder("bench-analysis"), force=force)
    settings = {"study": "analysis", "quick": quick, "workers": count}
    return run(folder, settings, lambda tell: study(recordings, size, count, tell), json)


def study(recordings: Sequence[Path] | None, size: Size, workers: int, tell: Tell) -> Iterator[Part]:
    """Measure what an analysis costs."""
    with TemporaryDirectory() as name:
        place = Path(name)
        if recordings is None:
            (made := place / "study").mkdir()

            def done(number: int, total: int) -> None:
                tell(f"rehearsing: block {number} of {total}", 0.4 * number / total)

            recordings = make_study(made, size.dyads, size.blocks, size.trials, workers, done)
        tell("getting the kernels ready (compiled once, then kept)", 0.4)
        apart(tables, recordings[:1], 1, place / "ready")
        rows = []
        for share in SHARES:
            tell(f"analysing {share:.0%} of the study", 0.4 + 0.5 * share)
            some = recordings[: max(1, round(share * len(recordings)))]
            rows.append(_row(some, workers, place / f"kept-{share}"))
        yield _costs(rows, workers)
        yield _scaling(rows)
        yield _memory(rows)
        tell("writing the whole analysis", 0.95)
        yield _whole(rows[-1], *apart(remainder, recordings, place / f"kept-{SHARES[-1]}", place / "analysis"))
        tell("the command, twice", 0.97)
        yield _again(*twice(recordings, workers, place / "twice"))


def _row(recordings: Sequence[Path], workers: int, kept: Path) -> Row:
    """Measure one share: when nothing is kept yet, and again."""
    alone = apart(reading, recordings, workers)
    return Row(
        len(recordings), alone, apart(tables, recordings, workers, kept), apart(tables, recordings, workers, kept)
    )


def _costs(rows: Sequence[Row], workers: int) -> Part:
    """Say what each share costs."""
    times = ("reading alone [s]", "anew [s]", "kept [s]")
    how_many = "one process" if workers == 1 else f"{workers} processes"
    ratios = ("anew / reading [1]", "kept / reading [1]", "anew, x real time [1]")
    return Part(
        "costs",
        f"From the names of the files to the tables of the study, {how_many}, by the clock",
        ("recordings", "attempts", "data [s]", *times, *ratios),
        [
            (
                *(row.recordings, row.cold.trials, row.cold.data),
                *(took.seconds for took in _times(row)),
                row.cold.took.seconds / row.reading.seconds,
                row.kept.took.seconds / row.reading.seconds,
                row.cold.data / row.cold.took.seconds,
            )
            for row in rows
        ],
    )


def _times(row: Row) -> tuple[Took, Took, Took]:
    """Reading alone, anew and kept."""
    return row.reading, row.cold.took, row.kept.took


def _scaling(rows: Sequence[Row]) -> Part:
    """Fit straight lines."""
    trials = [row.cold.trials for row in rows]
    names = ("reading alone", "anew", "kept")
    every = zip(names, zip(*(_times(row) for row in rows), strict=True), strict=True)
    fits = {name: line(trials, [took.cores for took in times]) for name, times in every}
    slope, _, explained = fits["anew"]
    return Part(
        "scaling",
        "Time of cores: straight lines through these shares",
        ("what", "whole study [s]", "an attempt [ms]", "start [s]", "R2 [1]"),
        [
            (name, took.cores, 1e3 * fits[name][0], *fits[name][1:])
            for name, took in zip(names, _times(rows[-1]), strict=True)
        ],
        [
            Verdict("time grows in proportion to the number of attempts", explained >= LINEAR, f"R2 = {explained:.4f}"),
            Verdict(
                "measuring anew costs most, so keeping results pays",
                slope > fits["kept"][0],
                f"{1e3 * slope:.2f} ms an attempt, kept {1e3 * fits['kept'][0]:.2f} ms",
            ),
        ],
    )


def line(x: ArrayLike, y: ArrayLike) -> tuple[float, float, float]:
    """Fit a straight line by least squares: slope, value at 0, share of the variance explained, R2 [y per x, y, 1]."""
    places, values = np.asarray(x, float), np.asarray(y, float)
    slope, start = np.polyfit(places, values, 1)
    left = values - (start + slope * places)
    whole = values - values.mean()
    total = float(np.sum(whole * whole))
    return float(slope), float(start), 1.0 - float(np.sum(left * left)) / total if total else 1.0


def _memory(rows: Sequence[Row]) -> Part:
    """Say how much memory each share takes."""
    hours = [row.cold.data / 3600 for row in rows]
    growth, start, _ = line(hours, [row.cold.peak for row in rows])
    first, last = rows[0].cold.worker_peak, rows[-1].cold.worker_peak
    return Part(
        "memory",
        "The most memory that processes held",
        ("recordings", "data [h]", "one that measures [MB]", "the one that has the tables [MB]", "the same, kept [MB]"),
        [
            (row.recordings, hour, row.cold.worker_peak / 1e6, row.cold.peak / 1e6, row.kept.peak / 1e6)
            for row, hour in zip(rows, hours, strict=True)
        ],
        [
            Verdict(
                "a process that measures does not grow with the study",
                last <= FLAT * first,
                f"{first / 1e6:.0f} MB for a quarter, {last / 1e6:.0f} MB for all",
            ),
            Verdict(
                "the one that has the tables hardly does, for it does not hold the paths",
                rows[-1].cold.peak <= HELD * rows[0].cold.peak,
                f"{start / 1e6:.0f} MB and {growth / 1e6:.1f} MB for each hour of data",
            ),
        ],
    )


def _whole(row: Row, rest: Took, peak: float) -> Part:
    """Say what a whole analysis costs."""
    return Part(
        "whole",
        "A whole analysis",
        ("what", "by the clock [s]", "of cores [s]", "most memory [MB]"),
        [
            ("tables, anew", row.cold.took.seconds, row.cold.took.cores, row.cold.peak / 1e6),
            ("tables, kept", row.kept.took.seconds, row.kept.took.cores, row.kept.peak / 1e6),
            ("numbers, pictures, report, files", rest.seconds, rest.cores, peak / 1e6),
        ],
    )


def _again(first: Took, again: Took) -> Part:
    """Say what the whole command takes when it has been run before."""
    share = again.cores / first.cores
    return Part(
        "again",
        "netboard analyse, the whole command",
        ("run", "by the clock [s]", "of cores [s]"),
        [("first", first.seconds, first.cores), ("again", again.seconds, again.cores)],
        [Verdict(f"the second run takes at most {AGAIN:.0%} of the first's", share <= AGAIN, f"{share:.1%} of cores")],
    )


# --- the command, twice: the first time nothing is kept, the second time all of it is --------------------------------

COMMAND = (sys.executable, "-m", "netboard.services.cli", "analyse")


def twice(recordings: Sequence[Path], workers: int, folder: Path) -> tuple[Took, Took]:
    """Analyse recordings twice, each time in a process of its own.

    - `folder`: a new folder, for both analyses and for what is kept.
    """
    folder.mkdir()
    options = ("--workers", str(workers), "--cache", str(folder / "kept"))
    found = []
    for name in ("first", "again"):
        watch = Watch()
        words = [*COMMAND, *map(str, recordings), "-o", str(folder / name), *options]
        subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
        found.append(watch.read())
    return found[0], found[1]
