"""Reading the ticks of a study and nothing more: what all else that an analysis costs is compared with."""

from collections.abc import Sequence
from pathlib import Path

from netboard.analysis.extraction.workers import processes
from netboard.benchmarks.analysis.apart import Took, Watch
from netboard.recording.files.reader import Recording


def reading(recordings: Sequence[Path], workers: int) -> Took:
    """Read all ticks of a study and nothing more, in as many processes."""
    watch = Watch()
    with processes(workers)(recordings) as executor:
        list(executor.map(_read, recordings))
    return watch.read()


def _read(path: Path) -> int:
    """Read a recording, a portion at a time."""
    with Recording(path) as recording:
        return sum(rows.size for rows in recording.batches())
