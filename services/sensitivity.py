"""``netboard bench analysis --sensitivity``: how strongly settings, noise and lost samples change each measure."""

import tempfile
from pathlib import Path

from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.benchmarks.analysis.sensitivity_bench import study
from netboard.benchmarks.harness.results import Folder, new_folder
from netboard.benchmarks.harness.running import run
from netboard.nodes.rehearsal import session as rehearsal
from netboard.nodes.rehearsal.jobs import jobs_of
from netboard.task.plans.plan import blocks_of, shortened
from netboard.task.studies.study import paper_study

WHOLE, QUICK = (4, 18, 20), (2, 12, 3)
"""Size of the rehearsed study without recordings: dyads, first blocks of the paper's plan, trials in each [1].

Twelve blocks have each condition twice.
"""

SEED = 1


def main(recordings: Path | None, output: Path | None, json: Path | None, *, quick: bool, force: bool) -> None:
    """Run the study."""
    given = None if recordings is None else found_in(recordings)
    folder = Folder(output or new_folder("bench-sensitivity"), force=force)
    what = {"study": "sensitivity", "quick": quick}
    if given is not None:
        run(folder, what, lambda tell: study(given, folder, tell, quick=quick), json)
        return
    with tempfile.TemporaryDirectory() as made:
        rehearsed = rehearse(Path(made), quick=quick)
        run(folder, what, lambda tell: study(rehearsed, folder, tell, quick=quick), json)


def found_in(folder: Path) -> list[Path]:
    """List the recordings of a folder, sorted by name."""
    found = sorted(folder.glob("*.mcap"))
    if not found:
        raise ConfigError(f"{folder}: expected a folder with recordings (*.mcap)")
    return found


def rehearse(folder: Path, *, quick: bool) -> list[Path]:
    """Rehearse the paper's plan, shortened, with simulated dyads, and keep their recordings."""
    dyads, most, trials = QUICK if quick else WHOLE
    jobs = []
    for dyad in range(1, dyads + 1):
        blocks = shortened(blocks_of(Config(), paper_study(), SEED, dyad), most, trials)
        jobs += jobs_of(list(blocks), SEED, dyad, folder)
    rehearsal.together(jobs, 2)
    return found_in(folder)
