"""Draw the figures of docs/reference/measures.md: the measures of one trial of simulated participants.

    python docs/measure_figures.py

A block of the paper's plan is rehearsed, recorded and read back; nothing in the figures is drawn by hand. Trials
differ a little from one kind of processor to another, and so do the figures.
"""

import tempfile
from pathlib import Path

from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.trials import BlockData
from netboard.analysis.topics.figure import as_bytes
from netboard.analysis.topics.trial import PANELS, panel
from netboard.base.config import Config
from netboard.nodes.rehearsal.jobs import jobs_of, rehearse
from netboard.recording.export.runs import runs_of
from netboard.recording.files.reader import Recording
from netboard.task.plans.plan import blocks_of, shortened
from netboard.task.studies.study import paper_study

IMAGES = Path(__file__).parent / "images"
BLOCK, TRIAL = 9, 4


def main() -> None:
    """Write a figure for each part of the sheet of a trial."""
    plan = list(shortened(blocks_of(Config(), paper_study(), 1, 2), BLOCK, TRIAL))
    with tempfile.TemporaryDirectory() as name:
        (job,) = jobs_of(plan[-1:], 1, 2, Path(name))
        (run,) = runs_of([Path(rehearse(job).recording)])
        with Recording(run.path) as recording:
            block = BlockData.of(recording, run.config, Readings())
    take = next(take for take in block.takes() if take.attempt.trial == TRIAL and take.attempt.outcome == "success")
    for part in PANELS:
        (IMAGES / f"measure-{part}.png").write_bytes(as_bytes(panel(take, part), "png"))


if __name__ == "__main__":
    main()
