"""Extraction of measures for tests, with the paths in memory, and comparisons of studies."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd

from netboard.analysis.extraction.cache import Cache, PathTable
from netboard.analysis.extraction.running import Extraction, extract
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import StudyData, study_of
from netboard.analysis.extraction.workers import WorkerPool, processes
from netboard.recording.export.formats import Progress

HERE = processes(1)


def quiet(what: str, done: int, total: int) -> None:
    assert 0 < done <= total


def extracted(
    recordings: Sequence[Path],
    readings: Readings,
    pool: WorkerPool = HERE,
    cache: Cache | None = None,
    progress: Progress = quiet,
    *,
    skip: bool = False,
) -> Extraction:
    """Measure recordings, and have the paths in memory."""
    with TemporaryDirectory() as folder:
        found = extract(recordings, readings, pool, cache, PathTable(Path(folder)), progress, skip=skip)
        return replace(found, paths=dict(found.paths))


def study_from(found: Extraction, readings: Readings | None = None) -> StudyData:
    return study_of(found.measured, readings or Readings(), found.paths)


def assert_same(one: StudyData, other: StudyData) -> None:
    for name in ("blocks", "trials", "movements", "exclusions"):
        pd.testing.assert_frame_equal(getattr(one, name), getattr(other, name), check_exact=True)
    assert set(one.paths) == set(other.paths)
    for name, paths in one.paths.items():
        assert len(paths)
        pd.testing.assert_frame_equal(paths, other.paths[name], check_exact=True)
