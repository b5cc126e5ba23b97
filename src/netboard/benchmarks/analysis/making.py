"""From the names of the files to the tables of a study."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from netboard.analysis.extraction.cache import Cache
from netboard.analysis.extraction.path_table import PathTable
from netboard.analysis.extraction.running import extract
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import study_of
from netboard.analysis.extraction.workers import processes
from netboard.base.process import peak_memory
from netboard.benchmarks.analysis.apart import Took, Watch


@dataclass(frozen=True, slots=True)
class Measurement:
    """Cost of making the tables of a study.

    - `data`: how long the recordings are [s].
    - `peak`: the most memory of the process that has the tables, in bytes [1].
    - `worker_peak`: the most memory of a process that measured, in bytes; 0 without one [1].
    """

    trials: int
    data: float
    took: Took
    peak: float
    worker_peak: float


def quiet(what: str, done: int, total: int) -> None:
    """Tell nobody."""


def tables(recordings: Sequence[Path], workers: int, kept: Path) -> Measurement:
    """Make the tables of a study."""
    watch = Watch()
    with TemporaryDirectory() as paths:
        found = extract(recordings, Readings(), processes(workers), Cache(kept), PathTable(Path(paths)), quiet)
        study = study_of(found.measured, Readings(), found.paths)
    took, data = watch.read(), float(study.blocks["duration"].sum())
    return Measurement(len(study.trials), data, took, peak_memory(), found.peak)
