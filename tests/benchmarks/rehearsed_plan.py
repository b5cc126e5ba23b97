"""Recordings of a dyad that rehearsed a shortened plan of the paper."""

from pathlib import Path

from netboard.base.config import Config
from netboard.nodes.rehearsal.jobs import jobs_of, rehearse
from netboard.task.plans.plan import blocks_of, shortened
from netboard.task.studies.study import paper_study


def rehearsed_plan(folder: Path, trials: int, blocks: int | None = None) -> list[Path]:
    """Rehearse the first blocks of the first dyad; return the recordings in order."""
    wanted = list(shortened(blocks_of(Config(), paper_study(), 1, 1), blocks, trials))
    return [Path(rehearse(job).recording) for job in jobs_of(wanted, 1, 1, folder)]
