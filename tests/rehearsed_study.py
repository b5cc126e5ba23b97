"""A small study to analyse: simulated people do the first blocks of the paper's plan, and recordings are kept."""

from functools import cache
from pathlib import Path

from netboard.analysis.extraction.recordings import Measured, measure
from netboard.analysis.extraction.settings import Readings
from netboard.base.config import Config
from netboard.benchmarks.analysis.specimen import make_study
from netboard.nodes.rehearsal.jobs import jobs_of, rehearse_all
from netboard.recording.export.runs import runs_of
from netboard.task.plans.plan import blocks_of, shortened
from netboard.task.studies.study import paper_study


def rehearse(folder: Path, dyads: int = 2, blocks: tuple[int, ...] = (1, 2, 9, 10), trials: int = 3) -> list[Path]:
    """Write recordings of some blocks of each dyad; with the default all four conditions are there."""
    folder.mkdir(parents=True, exist_ok=True)
    for dyad in range(1, dyads + 1):
        plan = list(shortened(blocks_of(Config(), paper_study(), 1, dyad), None, trials))
        chosen = [config for config in plan if config.block.number in blocks]
        rehearse_all(jobs_of(chosen, 1, dyad, folder), 1)
    return sorted(folder.glob("*.mcap"))


@cache
def measured(folder: Path, readings: Readings) -> tuple[Measured, ...]:
    """All recordings of a folder, measured; kept for the next test that asks."""
    return tuple(measure(run, readings) for run in runs_of(sorted(folder.glob("*.mcap"))))


def small_study(folder: Path) -> tuple[Path, ...]:
    """Four blocks of one dyad, of two trials each: bimanual and dyadic ones, with forces and without."""
    return make_study(folder, 1, 4, 2, 1, lambda done, total: None)
