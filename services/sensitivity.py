"""``netboard bench analysis --sensitivity``: how far readings, noise and lost samples move each number."""

import tempfile
from pathlib import Path

from netboard.config import Config
from netboard.design.blocks import blocks_of, shortened
from netboard.design.study import paper_study
from netboard.errors import ConfigError
from netboard.rehearsal.jobs import jobs_of
from netboard.sensitivity.bench import study
from netboard.services import rehearsal
from netboard.studies.results import Folder, new_folder
from netboard.studies.running import run

DYADS, TRIALS = 4, 20
"""What is rehearsed where no recordings are given: so many trials in each of the paper's blocks."""

QUICK_DYADS, QUICK_TRIALS = 2, 3

SEED = 1


def main(recordings: Path | None, output: Path | None, json: Path | None, *, quick: bool, force: bool) -> None:
    """Run the study.

    Parameters
    ----------
    recordings : Path or None
        A folder of recordings; None to rehearse some.
    output : Path or None
        Folder of the results; None for a new one here.
    json : Path or None
        File that gets the results too.
    quick : bool
        The short form.
    force : bool
        The folder may be there already.

    Raises
    ------
    ConfigError
        If there are no recordings.
    """
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
    """List the recordings of a folder, sorted by name.

    Raises
    ------
    ConfigError
        If there are none.
    """
    found = sorted(folder.glob("*.mcap"))
    if not found:
        raise ConfigError(f"{folder}: expected a folder with recordings (*.mcap)")
    return found


def rehearse(folder: Path, *, quick: bool) -> list[Path]:
    """Let simulated dyads do the paper's plan, shortened, and keep their recordings."""
    dyads, trials = (QUICK_DYADS, QUICK_TRIALS) if quick else (DYADS, TRIALS)
    jobs = []
    for dyad in range(1, dyads + 1):
        blocks = shortened(blocks_of(Config(), paper_study(), SEED, dyad), None, trials)
        jobs += jobs_of(list(blocks), SEED, dyad, folder)
    rehearsal.together(jobs, 2)
    return found_in(folder)
