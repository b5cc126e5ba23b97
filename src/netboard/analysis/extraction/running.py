"""Extraction from many recordings, on all cores or a Dask cluster, of those not cached.

A process holds one recording at a time and returns its tables. Results are in the order of the recordings, whichever
finished first, so they do not depend on the number or the place of the processes. The paths, which are long, are
written to disk as they arrive.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from netboard.analysis.extraction.cache import Cache, key_of
from netboard.analysis.extraction.recordings import Measured, identify_and_measure
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.store import digests_of
from netboard.analysis.extraction.workers import WorkerPool
from netboard.base.errors import NetboardError, RecordingError
from netboard.base.process.resources import peak_memory
from netboard.base.process.workers import cores
from netboard.recording.export.formats import Progress
from netboard.recording.export.runs import Run, described_run, numbered, unnumbered_run
from netboard.recording.files.copies import each_recording_once
from netboard.recording.files.locate import RECOVERABLE, recovery_command, sha256_of

if TYPE_CHECKING:
    import pandas as pd

    from netboard.analysis.extraction.cache import PathTable


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A recording that was skipped because its extraction failed."""

    file: str
    why: str


@dataclass(frozen=True, slots=True)
class Source:
    """A recording with extracted tables."""

    run: Run
    sha256: str
    cached: bool


@dataclass(frozen=True, slots=True)
class Extraction:
    """Result of the extraction, with peak memory of any process in bytes; 0 if all came from the cache."""

    sources: tuple[Source, ...]
    left_out: tuple[LeftOut, ...]
    measured: tuple[Measured, ...]
    paths: Mapping[str, "pd.DataFrame"]
    peak: float


def extract(
    recordings: Sequence[Path],
    readings: Readings,
    workers_of: WorkerPool,
    cache: Cache | None,
    paths: "PathTable",
    progress: Progress,
    *,
    skip: bool = False,
    meanwhile: Callable[[], object] = list,
    digests: Mapping[Path, str] | None = None,
) -> Extraction:
    """Extract the tables of recordings, without a cache measuring all and storing nothing.

    `progress` is called with the numbers of finished and of all recordings; `meanwhile` once, when workers have begun.
    `digests`: the SHA-256 of each recording, if known. RecordingError if a recording cannot be measured and `skip` is
    false, or none remains.
    """
    kept, copies = each_recording_once(recordings)
    runs, left_out = _readable(kept) if skip else (numbered(_in_threads(described_run, kept)), [])
    left_out += [LeftOut(copy.path.name, copy.about(copy.of.name)) for copy in copies]
    digests = digests_of([run.path for run in runs]) if digests is None else digests
    keys = {run.path: key_of(run.path.stem, digests[run.path], readings) for run in runs}
    collector = _Collector(paths, progress, len(runs))
    if cache is not None:
        for path, key in keys.items():
            if (stored := cache.get(key)) is not None:
                collector.add(path, stored)
    cached, peak = set(collector.tables), 0.0
    known: dict[Path, Run] = {}

    def others() -> None:
        found = _in_threads(unnumbered_run, [run.path for run in runs if run.path in cached])
        known.update((run.path, run) for run in found)
        meanwhile()

    missing = [run for run in runs if run.path not in cached]
    for run, answer in _answers(missing, digests, readings, workers_of, others):
        if isinstance(answer, Exception):
            if not skip:
                raise answer
            left_out.append(_left_out(run.path, answer))
            continue
        people, measured, used = answer
        known[run.path] = replace(people, path=run.path)
        peak = max(peak, used)
        if cache is not None:
            cache.put(keys[run.path], measured)
        collector.add(run.path, measured)
    if cache is not None:
        cache.trim()
    if not collector.tables:
        raise RecordingError("no recording can be measured")
    sources = tuple(
        Source(replace(known[run.path], number=run.number), digests[run.path], run.path in cached)
        for run in runs
        if run.path in collector.tables
    )
    left_out.sort(key=lambda one: one.file)
    tables = tuple(collector.tables[source.run.path] for source in sources)
    return Extraction(sources, tuple(left_out), tables, paths, peak)


class _Collector:
    """Collector of arriving tables: stores paths on disk, keeps the other tables and reports progress."""

    def __init__(self, paths: "PathTable", progress: Progress, total: int) -> None:
        self.tables: dict[Path, Measured] = {}
        self._paths, self._progress, self._total = paths, progress, total
        self._seconds = 0.0

    def add(self, path: Path, measured: Measured) -> None:
        """Add the tables of a recording."""
        self._paths.put(measured)
        self.tables[path] = replace(measured, paths={})
        self._seconds += float(measured.blocks["duration"][0])
        words = f"{len(self.tables)} of {self._total} recordings, {self._seconds:.0f} s of data"
        self._progress(words, len(self.tables), self._total)


def _in_threads(read: Callable[[Path], Run], recordings: Sequence[Path]) -> list[Run]:
    """Read recordings in threads: decompression leaves them to each other."""
    with ThreadPoolExecutor(cores()) as pool:
        return list(pool.map(read, recordings))


def _readable(recordings: Sequence[Path]) -> tuple[tuple[Run, ...], list[LeftOut]]:
    """Return the runs of the recordings that can be opened, and the others with reasons."""
    sound: list[Run] = []
    left_out: list[LeftOut] = []
    for path in recordings:
        try:
            run = described_run(path)
            numbered([run])  # its own names may collide
            sha256_of(path)  # reads every byte of it: a disk may fail at any
            sound.append(run)
        except NetboardError as error:
            left_out.append(_left_out(path, error))
    return numbered(sound), left_out


def _left_out(path: Path, error: Exception) -> LeftOut:
    """Return the reason, without the path of the file, and so without a command that needs it."""
    why = str(error)
    for place in (path.absolute(), path):
        why = why.replace(recovery_command(place), RECOVERABLE).replace(str(place), path.name)
    return LeftOut(path.name, why.removeprefix(f"{path.name}: "))


def _answers(
    runs: Sequence[Run],
    digests: Mapping[Path, str],
    readings: Readings,
    workers_of: WorkerPool,
    meanwhile: Callable[[], object],
) -> Iterator[tuple[Run, tuple[Run, Measured, float] | NetboardError]]:
    """Yield the run with its people and the tables, or the error, of each recording as it finishes."""
    if not runs:
        meanwhile()
        return
    with workers_of([run.path.absolute() for run in runs]) as executor:
        futures = {
            executor.submit(_measured, replace(run, path=run.path.absolute()), readings, digests[run.path]): run
            for run in runs
        }
        meanwhile()
        for future in as_completed(futures):
            run = futures.pop(future)
            try:
                yield run, future.result()
            except NetboardError as error:
                yield run, error


def _measured(run: Run, readings: Readings, sha256: str) -> tuple[Run, Measured, float]:
    """Extract one recording, possibly in another process or machine; return also the peak memory in bytes [1]."""
    if sha256_of(run.path) != sha256:
        raise RecordingError(f"{run.path}: has changed since the start, or is another file on the worker")
    return *identify_and_measure(run, readings), peak_memory()
