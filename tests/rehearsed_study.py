"""Small studies to analyse: recordings of simulated participants in some blocks of the paper's plan."""

from functools import cache
from pathlib import Path

from evidence.analysis.rehearsed_study import rehearse_study
from netboard.analysis.extraction.recordings import Measured, measure
from netboard.analysis.extraction.settings import Readings
from netboard.base.config import Config
from netboard.nodes.rehearsal.jobs import jobs_of, rehearse_all
from netboard.recording.export.runs import runs_of
from netboard.task.plans.plan import blocks_of, shortened
from netboard.task.studies.study import paper_study


def rehearse(folder: Path, dyads: int = 2, blocks: tuple[int, ...] = (1, 2, 9, 10), trials: int = 3) -> list[Path]:
    """Rehearse some blocks of each dyad; the default blocks cover all four conditions."""
    folder.mkdir(parents=True, exist_ok=True)
    for dyad in range(1, dyads + 1):
        plan = list(shortened(blocks_of(Config(), paper_study(), 1, dyad), None, trials))
        chosen = [config for config in plan if config.block.number in blocks]
        rehearse_all(jobs_of(chosen, 1, dyad, folder), 1)
    return sorted(folder.glob("*.mcap"))


@cache
def measured(folder: Path, readings: Readings) -> tuple[Measured, ...]:
    """Measure all recordings of a folder, once for all tests."""
    return tuple(measure(run, readings) for run in runs_of(sorted(folder.glob("*.mcap"))))


def small_study(folder: Path) -> tuple[Path, ...]:
    """Rehearse four blocks of two trials of one dyad: bimanual and dyadic, haptics on and off."""
    return rehearse_study(folder, 1, 4, 2, 1, lambda done, total: None)
