"""A whole analysis: from recordings to a folder with tables, figures and a report, and a summary in words.

An analysis that was done before, with the same code and settings, is written from the cache. Modules that compute or
draw are therefore imported only when something must be computed.
"""

import json
import shlex
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from markupsafe import escape

from netboard.analysis.extraction.store import Store, default_folder, key_of_analysis, restore_analysis, store_analysis
from netboard.analysis.report.wording import amount, plural, visible
from netboard.base.errors import ConfigError
from netboard.base.files.new import refuse_existing
from netboard.base.process.resources import peak_memory
from netboard.base.terminal.bars import telling
from netboard.recording.export.formats import Progress, need, new_folder
from netboard.recording.files.locate import UNFINISHED, find_recordings, find_unfinished

if TYPE_CHECKING:
    from netboard.analysis.extraction.running import Extraction
    from netboard.analysis.extraction.settings import Readings
    from netboard.analysis.extraction.study import StudyData
    from netboard.analysis.extraction.workers import WorkerPool

LIBRARIES = ("pandas", "pyarrow", "matplotlib", "jinja2", "statsmodels")
"""Packages that an analysis needs beyond those of a session."""

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
    settings: Path | None,
    overrides: Sequence[str],
    chosen: AnalysisOptions,
    read: "Callable[[], Readings]",
) -> list[str]:
    """Analyse recordings into a new folder, named after the first unless given, and return a summary of a few lines.

    The settings are a file, or None for the defaults, with overrides. `read` reads them, only if the analysis is not in
    the cache.
    """
    began = time.perf_counter()
    need("analysis", *LIBRARIES)
    if chosen.dask is not None and chosen.workers is not None:
        raise ConfigError("--workers: found with --dask, whose cluster has its own workers; expected one of them")
    folder = output or Path(f"{named[0].resolve().stem}_analysis")
    refuse_existing(folder)
    recordings, unfinished = find_recordings(named), find_unfinished(named)
    store = Store(chosen.cache or default_folder()) if chosen.keep else None
    with telling() as tell, new_folder(folder) as part:
        tell("reading the cache", 0, 1)
        text = settings.read_bytes() if settings is not None and settings.is_file() else b""
        options = (*overrides, f"skip={chosen.skip}", f"paper={chosen.beside_the_paper}", *map(str, unfinished))
        key = key_of_analysis(recordings, text, options) if store else ""
        words = restore_analysis(store, key, part) if store else None
        before, peak = "; all were cached", 0.0
        if words is None:
            words, kept, peak = _analysed(recordings, unfinished, part, read(), chosen, store, tell)
            before = f"; {amount(kept)} from the cache" if kept else ""
            if store:
                store_analysis(store, key, part, words)
        name_command(part, ["netboard", *sys.argv[1:]])
    first, *others = words
    return [f"{first}{before}", *others, _in_total(folder, time.perf_counter() - began, peak)]


def _analysed(
    recordings: Sequence[Path],
    unfinished: Sequence[Path],
    part: Path,
    readings: "Readings",
    chosen: AnalysisOptions,
    store: Store | None,
    tell: Progress,
) -> tuple[tuple[str, ...], int, float]:
    """Analyse recordings into a folder.

    Return a summary in words, how many recordings came from the cache, and the largest memory of a process [bytes].
    """
    from netboard.analysis.extraction.cache import Cache, PathTable
    from netboard.analysis.extraction.exclusions import require_recordings
    from netboard.analysis.extraction.running import LeftOut, extract
    from netboard.analysis.extraction.study import study_of
    from netboard.analysis.report.folder import write_analysis

    cache = None if store is None else Cache(store)
    require_recordings(readings.exclusions, {path.stem for path in recordings})
    with TemporaryDirectory(dir=part) as paths:
        found = extract(recordings, readings, _pool(chosen), cache, PathTable(Path(paths)), tell, skip=chosen.skip)
        parts = tuple(LeftOut(path.name, UNFINISHED) for path in unfinished)
        found = replace(found, left_out=(*found.left_out, *parts))
        study = study_of(found.measured, readings, found.paths)
        lost = write_analysis(part, study, found, [PLACEHOLDER], tell, beside_the_paper=chosen.beside_the_paper)
    words = (*_in_words(study, found), *(f"warning: {one}" for one in lost))
    return words, sum(source.cached for source in found.sources), found.peak


def _pool(chosen: AnalysisOptions) -> "WorkerPool":
    """Choose the workers that extract the measures."""
    from netboard.analysis.extraction.workers import dask, processes
    from netboard.base.process.workers import cores

    if chosen.dask is None:
        return processes(chosen.workers or cores())
    return dask(chosen.dask)


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
    measured = f", {peak / 1e6:.0f} MB in a process that measures" if peak else ""
    most = f"at most {peak_memory() / 1e6:.0f} MB in memory{measured}"
    return f"{folder / 'report.html'} and {len(files) - 1} other files, {size:.1f} MB; {seconds:.1f} s, {most}"


def name_command(folder: Path, command: Sequence[str]) -> None:
    """Write the command into provenance and report; a word of it that has the placeholder's text is left as it is."""
    text = shlex.join(command)
    written = {"provenance.json": json.dumps(text, ensure_ascii=False)[1:-1], "report.html": str(escape(visible(text)))}
    for name, shown in written.items():
        path = folder / name
        path.write_bytes(path.read_bytes().replace(PLACEHOLDER.encode(), shown.encode()))
