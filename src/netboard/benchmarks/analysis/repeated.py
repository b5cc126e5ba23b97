"""The same analysis twice, as the command: the first time nothing is kept, the second time all of it is."""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from netboard.benchmarks.analysis.apart import Took, Watch

COMMAND = (sys.executable, "-m", "netboard.services.cli", "analyse")


def twice(recordings: Sequence[Path], workers: int, folder: Path) -> tuple[Took, Took]:
    """Analyse recordings twice, each time in a process of its own.

    - `folder`: a new folder, for both analyses and for what is kept.
    """
    folder.mkdir()
    options = ("--workers", str(workers), "--cache", str(folder / "kept"))
    found = []
    for name in ("first", "again"):
        watch = Watch()
        words = [*COMMAND, *map(str, recordings), "-o", str(folder / name), *options]
        subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
        found.append(watch.read())
    return found[0], found[1]
