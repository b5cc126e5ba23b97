"""A whole analysis: from recordings to a folder with tables, figures and a report, and a summary in words.

An analysis that was done before, with the same code and settings, is written from the cache. Modules that compute or
draw are therefore imported only when something must be computed.
"""

import json
import shlex
import sys
import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from netboard.analysis.extraction.store import (
    SpareStore,
    Store,
    default_folder,
    digests_or_errors,
    key_of_analysis,
    restore_analysis,
    store_entry,
    store_files,
)
from netboard.analysis.report.wording import amount, plural, visible
from netboard.base.errors import ConfigError
from netboard.base.files.new import refuse_existing
from netboard.base.process.resources import peak_memory
from netboard.base.terminal.bars import telling
from netboard.recording.export.formats import Progress, need, scratch_folder
from netboard.recording.files.locate import UNFINISHED, find_recordings, find_unfinished

if TYPE_CHECKING:
    from netboard.analysis.extraction.running import Extraction
    from netboard.analysis.extraction.settings import Readings
    from netboard.analysis.extraction.study import StudyData

LIBRARIES = ("pandas", "pyarrow", "matplotlib", "jinja2", "statsmodels")
"""Packages that an analysis needs beyond those of a session."""

MEASURING = "netboard.analysis.extraction.running"
"""Module that measures."""

REPORTING = "netboard.analysis.report.folder"
"""Module that writes results, figures and report."""

ANSWERED = "tables and answer: "
"""Beginning of the line that names the tables and the beginning of the report."""

REPORT = "report.html"
"""File of the report, of which the first part has only the beginning."""

PLACEHOLDER = "@command-of-this-analysis@"
"""Stands for the command until all other files, which do not depend on it, are written."""


@dataclass(frozen=True, slots=True)
class AnalysisOptions:
    """How to run an analysis. Of these options, only `skip` (leave out unreadable recordings) changes its numbers."""

    workers: int | None = None
    dask: str | None = None
    cache: Path | None = None
    keep: bool = True
    skip: bool = False
    beside_the_paper: bool = False


def analyse(
    named: Sequence[Path],
    output: Path | None,
    settings: str,
    overrides: Sequence[str],
    chosen: AnalysisOptions,
    read: "Callable[[], Readings]",
) -> Iterator[str]:
    """Analyse recordings into a new folder, named after the first unless given; yield what to say of it, line by line.

    The settings are the text of a file, empty for the defaults, with overrides. `read` takes both apart, only if the
    analysis is not in the cache. The folder appears with the tables and the beginning of the report; the rest follows.
    """
    began = time.perf_counter()
    need("analysis", *LIBRARIES)
    if chosen.dask is not None and chosen.workers is not None:
        raise ConfigError("--workers: found with --dask, whose cluster has its own workers; expected one of them")
    folder = output or Path(f"{named[0].resolve().stem}_analysis")
    refuse_existing(folder)
    recordings, unfinished = find_recordings(named), find_unfinished(named)
    store = SpareStore(chosen.cache or default_folder()) if chosen.keep else None
    with scratch_folder(folder) as scratch:
        (whole := scratch / "whole").mkdir()
        with telling() as tell:
            tell("reading the cache", 0, 1)
            options = (*overrides, f"skip={chosen.skip}", f"paper={chosen.beside_the_paper}", *map(str, unfinished))
            digests = digests_or_errors(recordings) if store else None
            key = key_of_analysis(recordings, settings.encode(), options, digests) if store else ""
            words = restore_analysis(store, key, whole) if store else None
        if words is not None:
            name_command(whole, _command())
            publish(whole, folder)
            first, *others = words
            yield from (f"{first}; all were cached", *others)
            peak = 0.0
        else:
            found = _Analysis(recordings, unfinished, scratch, folder, chosen, store, digests)
            words = yield from found.lines(read, began)
            peak = found.peak
            if store:
                store_entry(store, key, found.files, words)
                if store.failure:
                    yield f"warning: {store.failure}"
    yield _in_total(folder, time.perf_counter() - began, peak)


class _Analysis:
    """An analysis that is not in the cache.

    After `lines`: the largest memory of a process that worked for it, in bytes, and the cache entries of its files.
    """

    def __init__(
        self,
        recordings: Sequence[Path],
        unfinished: Sequence[Path],
        scratch: Path,
        folder: Path,
        chosen: AnalysisOptions,
        store: Store | None,
        digests: Mapping[Path, str] | None,
    ) -> None:
        self._recordings, self._unfinished = recordings, unfinished
        self._scratch, self._folder, self._chosen, self._store = scratch, folder, chosen, store
        self._digests = digests
        self.peak = 0.0
        self.files: dict[str, str] = {}

    def lines(self, read: "Callable[[], Readings]", began: float) -> Generator[str, None, tuple[str, ...]]:
        """Analyse, and yield what to say as soon as it is known; return what to say of it again from the cache."""
        from netboard.analysis.extraction.workers import processes, warm
        from netboard.base.process.workers import cores

        count = 1 if self._chosen.dask is not None else self._chosen.workers or cores()
        with processes(count)(self._recordings) as executor:
            warm(executor, count, MEASURING)  # meanwhile this process imports what it needs to begin
            pool = executor if isinstance(executor, ProcessPoolExecutor) else None
            with telling() as tell:
                study, found = self._measured(read(), executor, tell)
                from netboard.analysis.extraction.study import share
                from netboard.analysis.report.folder import provenance, write_first_part, write_second_part

                tell("tables", 0, 1)
                shared = study if pool is None else share(study, self._scratch / "study")
                origin = provenance(found, [PLACEHOLDER])
                (first := self._scratch / "first").mkdir()
                beside = self._chosen.beside_the_paper
                figure = write_first_part(first, study, found, origin, pool, shared, tell, beside_the_paper=beside)
                self._finish(first, without=(REPORT,))
                publish(first, self._folder)
            words = tuple(_in_words(study, found))
            kept = sum(source.cached for source in found.sources)
            yield f"{words[0]}; {amount(kept)} from the cache" if kept else words[0]
            yield from words[1:]
            yield (
                f"{ANSWERED}{self._folder / 'tables'}, {self._folder / REPORT}; "
                f"{time.perf_counter() - began:.1f} s. Results and figures follow."
            )
            with telling() as tell:
                (rest := self._scratch / "rest").mkdir()
                lost, peak = write_second_part(rest, study, origin, pool, shared, tell, figure, beside_the_paper=beside)
                self._finish(rest)
                add(rest, self._folder)
        self.peak = max(found.peak, peak)
        warnings = tuple(f"warning: {one}" for one in lost)
        yield from warnings
        return (*words, *warnings)

    def _measured(self, readings: "Readings", executor: Executor, tell: Progress) -> "tuple[StudyData, Extraction]":
        """Measure the recordings, and join their tables to a study."""
        from netboard.analysis.extraction.cache import Cache, PathTable
        from netboard.analysis.extraction.exclusions import require_recordings
        from netboard.analysis.extraction.running import LeftOut, extract
        from netboard.analysis.extraction.study import study_of
        from netboard.analysis.extraction.workers import dask

        chosen = self._chosen
        require_recordings(readings.exclusions, {path.stem for path in self._recordings})
        pool = (lambda recordings: nullcontext(executor)) if chosen.dask is None else dask(chosen.dask)
        cache = None if self._store is None else Cache(self._store)
        (paths := self._scratch / "paths").mkdir()
        found = extract(
            self._recordings,
            readings,
            pool,
            cache,
            PathTable(paths),
            tell,
            skip=chosen.skip,
            meanwhile=partial(import_module, REPORTING),
            digests=self._digests,
        )
        parts = tuple(LeftOut(path.name, UNFINISHED) for path in self._unfinished)
        found = replace(found, left_out=(*found.left_out, *parts))
        return study_of(found.measured, readings, found.paths), found

    def _finish(self, part: Path, without: Sequence[str] = ()) -> None:
        """Store the files of a part while nobody else can change them, then write the command into them.

        Those ``without`` are not stored: a later part has the whole one.
        """
        if self._store is not None:
            self.files |= store_files(self._store, part, without)
        name_command(part, _command())


def _command() -> list[str]:
    """Return the command line of this process."""
    return ["netboard", *sys.argv[1:]]


def publish(part: Path, folder: Path) -> None:
    """Give a complete folder its name."""
    refuse_existing(folder)
    part.rename(folder)


def add(part: Path, folder: Path) -> None:
    """Move complete files to others in a folder, the report last."""
    for path in sorted(part.rglob("*"), key=lambda path: (-len(path.parts), path)):
        if path.is_file():
            place = folder / path.relative_to(part)
            place.parent.mkdir(exist_ok=True)
            path.replace(place)


def _in_words(study: "StudyData", found: "Extraction") -> Iterator[str]:
    """Yield what was measured, and what was excluded."""
    hours = study.blocks["duration"].sum() / 3600
    yield f"{plural(len(found.sources), 'recording')}, {hours:.2f} h"
    for one in found.left_out:
        yield f"  left out: {one.file}: {one.why}"
    silent = study.blocks.loc[~study.blocks["recording"].isin(study.trials["recording"]), "recording"]
    if len(silent):
        yield f"  without an attempt: {len(silent)} of these, the first is {silent.iloc[0]}"
    from netboard.analysis.extraction.study import notes
    from netboard.analysis.report.question import answer_lines

    failed = int((study.trials["outcome"] != "success").sum())
    excluded = study.excluded_attempts
    counted = plural(len(study.counted), "trial")
    yield f"{counted} counted; {plural(failed, 'attempt')} failed; {plural(excluded, 'attempt')} excluded"
    for why, count in study.exclusions["why"].value_counts().sort_index().items():
        yield f"  excluded: {count} x {why}"
    yield from (f"  {note}" for note in notes(study))
    yield from answer_lines(study)


def _in_total(folder: Path, seconds: float, peak: float) -> str:
    """Return a line with the folder, the duration and the memory."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    size = sum(path.stat().st_size for path in files) / 1e6
    measured = f", {peak / 1e6:.0f} MB in a worker process" if peak else ""
    most = f"at most {peak_memory() / 1e6:.0f} MB in memory{measured}"
    return f"{folder / REPORT} and {len(files) - 1} other files, {size:.1f} MB; {seconds:.1f} s, {most}"


def name_command(folder: Path, command: Sequence[str]) -> None:
    """Write the command into provenance and report; a word of it that has the placeholder's text is left as it is."""
    from markupsafe import escape

    text = shlex.join(command)
    written = {"provenance.json": json.dumps(text, ensure_ascii=False)[1:-1], REPORT: str(escape(visible(text)))}
    for name, shown in written.items():
        path = folder / name
        if not path.exists():  # the second part of an analysis has no provenance
            continue
        path.write_bytes(path.read_bytes().replace(PLACEHOLDER.encode(), shown.encode()))
