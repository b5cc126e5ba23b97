"""A dyad that has rehearsed the paper's plan, shortened."""

from pathlib import Path

from netboard.config import Config
from netboard.services.rehearsal import jobs_of, rehearse, shortened
from netboard.services.session import blocks_of


def rehearsed_plan(folder: Path, trials: int, blocks: int | None = None) -> list[Path]:
    """Recordings of the first blocks of the first dyad, in order."""
    wanted = list(shortened(blocks_of(Config(), "paper", 1, 1), blocks, trials))
    return [Path(rehearse(job).recording) for job in jobs_of(wanted, 1, 1, folder, True)]
