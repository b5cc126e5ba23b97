"""From the file of a recording to what can be played. The one module of the package that reads files."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from netboard.recording.reader import Recording
from netboard.replay.reel import Material, Reel
from netboard.tick import TICK


def load(path: Path, tell: Callable[[int], None] = lambda ticks: None) -> Reel:
    """Read a recording, all of it.

    Parameters
    ----------
    path : Path
        The file.
    tell : callable
        Told now and then how many ticks have been read.

    Raises
    ------
    RecordingError
        If it cannot be read, or has no tick.
    ConfigError
        If its configuration cannot be read.
    """
    with Recording(path) as recording:
        parts = [np.empty(0, TICK)]
        for rows in recording.batches():
            parts.append(rows)
            tell(sum(map(len, parts)))
        return Reel(Material(path.name, recording.config_text, np.concatenate(parts), recording.events()))
