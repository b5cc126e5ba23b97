"""Time and memory of the parts of an analysis, measured in fresh processes.

A process that reads or measures must not load the report, which imports the plotting library: its peak memory would
include that library. So `cost_of_report` imports the report itself.
"""

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from netboard.analysis.extraction.cache import Cache, PathTable
from netboard.analysis.extraction.running import Extraction, extract
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import StudyData, study_of
from netboard.analysis.extraction.workers import processes
from netboard.base.process.resources import peak_memory
from netboard.recording.files.reader import Recording


@dataclass(frozen=True, slots=True)
class Time:
    """Duration of a call.

    - `elapsed`: wall-clock time [s].
    - `cpu`: CPU time of this process and of the child processes that ended in the meantime [s].
    """

    elapsed: float
    cpu: float


class Stopwatch:
    """Measures elapsed and CPU time since its creation."""

    def __init__(self) -> None:
        self._start = time.perf_counter(), _cpu_time()

    def read(self) -> Time:
        """Return the time since the creation."""
        return Time(time.perf_counter() - self._start[0], _cpu_time() - self._start[1])


def _cpu_time() -> float:
    """Return the CPU time of this process and of its ended children [s]."""
    times = os.times()
    return time.process_time() + times.children_user + times.children_system


def cost_of_reading(recordings: Sequence[Path], workers: int) -> Time:
    """Read all ticks of a study in a number of processes, and compute nothing."""
    watch = Stopwatch()
    with processes(workers)(recordings) as executor:
        list(executor.map(_read, recordings))
    return watch.read()


def _read(path: Path) -> int:
    """Read a recording in batches, and count its ticks."""
    with Recording(path) as recording:
        return sum(rows.size for rows in recording.batches())


@dataclass(frozen=True, slots=True)
class TablesCost:
    """Cost of the tables of a study.

    - `data`: total duration of the recordings [s].
    - `peak`: peak memory of the process that joins the tables [B].
    - `worker_peak`: largest peak memory of the processes that measure recordings; 0 if there is none [B].
    """

    trials: int
    data: float
    time: Time
    peak: float
    worker_peak: float


def cost_of_tables(recordings: Sequence[Path], workers: int, cache: Path) -> TablesCost:
    """Make the tables of a study."""
    watch = Stopwatch()
    with TemporaryDirectory() as paths:
        extracted, study = tables_of(recordings, workers, cache, Path(paths))
    spent, data = watch.read(), float(study.blocks["duration"].sum())
    return TablesCost(len(study.trials), data, spent, peak_memory(), extracted.peak)


def cost_without_cache(recordings: Sequence[Path], workers: int, caches: Sequence[Path]) -> tuple[TablesCost, Time]:
    """Make the tables once for each of these empty caches, and read the recordings; return the costs of both.

    The time is the one with the least CPU time, and the memory that of the first time, to which the others add.
    """
    costs = [cost_of_tables(recordings, workers, cache) for cache in caches]
    least = min((cost.time for cost in costs), key=lambda time: time.cpu)
    return replace(costs[0], time=least), cost_of_reading(recordings, workers)


def cost_of_report(recordings: Sequence[Path], cache: Path, folder: Path) -> tuple[Time, Time, float]:
    """Write both parts of the analysis of a study with cached tables, in this process.

    Return the time of each, and the peak memory [B].
    """
    from netboard.analysis.report.folder import provenance, write_first_part, write_second_part

    with TemporaryDirectory() as paths:
        extracted, study = tables_of(recordings, 1, cache, Path(paths))
        origin = provenance(extracted, ["netboard", "bench", "analysis"])
        parts = [folder / name for name in ("first", "second")]
        for part in parts:
            part.mkdir(parents=True)
        watch = Stopwatch()
        figure = write_first_part(parts[0], study, extracted, origin, None, study, lambda *_: None)
        first = watch.read()
        watch = Stopwatch()
        write_second_part(parts[1], study, origin, None, study, lambda *_: None, figure)
    return first, watch.read(), peak_memory()


def tables_of(recordings: Sequence[Path], workers: int, cache: Path, paths: Path) -> tuple[Extraction, StudyData]:
    """Measure recordings, or take their measures from the cache, and join them."""
    extracted = extract(recordings, Readings(), processes(workers), Cache(cache), PathTable(paths), lambda *_: None)
    return extracted, study_of(extracted.measured, Readings(), extracted.paths)
