"""One measurement of what an analysis costs, in a process that has done nothing else: so its memory is its own."""

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ParamSpec, TypeVar

from netboard.export.formats import new_folder
from netboard.measuring.cache import Cache
from netboard.measuring.crews import processes
from netboard.measuring.readings import Readings
from netboard.measuring.running import harvest
from netboard.measuring.shelf import Shelf
from netboard.measuring.study import study_of
from netboard.process import peak_memory
from netboard.recording.reader import Recording
from netboard.report.folder import write_analysis

P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Took:
    """What something took.

    Attributes
    ----------
    seconds : float
        By the clock [s].
    cores : float
        Of cores, in this process and those that it started and saw end [s].
    """

    seconds: float
    cores: float


class Watch:
    """Tells what it took since this was made."""

    def __init__(self) -> None:
        self._began = time.perf_counter(), _of_cores()

    def read(self) -> Took:
        """Tell."""
        return Took(time.perf_counter() - self._began[0], _of_cores() - self._began[1])


def _of_cores() -> float:
    """Time that cores have spent on this process and those it saw end [s]."""
    return sum(os.times()[:4])


@dataclass(frozen=True, slots=True)
class Measurement:
    """What it cost to make the tables of a study.

    Attributes
    ----------
    trials : int
        Attempts in the tables [1].
    data : float
        How long the recordings are [s].
    took : Took
        From the names of the files to the tables.
    peak : float
        The most memory of the process that has the tables, in bytes [1].
    worker_peak : float
        The most memory of a process that measured, in bytes; 0 without one [1].
    """

    trials: int
    data: float
    took: Took
    peak: float
    worker_peak: float


def apart(function: Callable[P, T], *arguments: P.args, **more: P.kwargs) -> T:
    """Call a function in a process of its own.

    Parameters
    ----------
    function : callable
        What is called.
    *arguments, **more
        With what.
    """
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(function, *arguments, **more).result()


def quiet(what: str, done: int, total: int) -> None:
    """Tell nobody."""


def tables(recordings: Sequence[Path], workers: int, kept: Path) -> Measurement:
    """Make the tables of a study.

    Parameters
    ----------
    recordings : sequence of Path
        Its recordings.
    workers : int
        How many processes [1].
    kept : Path
        Where results are kept.
    """
    watch = Watch()
    with TemporaryDirectory() as paths:
        found = harvest(recordings, Readings(), processes(workers), Cache(kept), Shelf(Path(paths)), quiet)
    study = study_of(found.measured, Readings(), found.paths)
    took, data = watch.read(), float(study.blocks["duration"].sum())
    return Measurement(len(study.trials), data, took, peak_memory(), found.peak)


def reading(recordings: Sequence[Path], workers: int) -> Took:
    """Read all ticks of a study and nothing more, in as many processes.

    Parameters
    ----------
    recordings : sequence of Path
        Its recordings.
    workers : int
        How many processes [1].
    """
    watch = Watch()
    with processes(workers)(recordings) as executor:
        list(executor.map(_read, recordings))
    return watch.read()


def _read(path: Path) -> int:
    """Read a recording, a portion at a time."""
    with Recording(path) as recording:
        return sum(rows.size for rows in recording.batches())


def remainder(recordings: Sequence[Path], kept: Path, folder: Path) -> tuple[Took, float]:
    """Write the folder of an analysis whose measures are kept; and tell the most memory, in bytes [1].

    Parameters
    ----------
    recordings : sequence of Path
        Its recordings.
    kept : Path
        Where results are kept.
    folder : Path
        The new folder.
    """
    with new_folder(folder) as part, TemporaryDirectory(dir=part) as paths:
        found = harvest(recordings, Readings(), processes(1), Cache(kept), Shelf(Path(paths)), quiet)
        study = study_of(found.measured, Readings(), found.paths)
        watch = Watch()
        write_analysis(part, study, found, ["netboard", "bench", "analysis"], quiet)
    return watch.read(), peak_memory()
