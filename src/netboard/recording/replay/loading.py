"""From the file of a recording to what can be played. The one module of the package that reads files."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.tick import TICK
from netboard.recording.files.reader import Recording
from netboard.recording.replay.loaded import Material, Reel

DRAWN = ("z", "theta", "p", "left_z", "right_z")
"""Numbers of a tick that make the picture."""

_ROW_BYTES = np.dtype((np.void, TICK.itemsize))


def load(path: Path, tell: Callable[[int], None] = lambda ticks: None) -> Reel:
    """Read a recording, all of it."""
    with Recording(path) as recording:
        parts = [np.empty(0, TICK)]
        for rows in recording.batches():
            parts.append(rows)
            tell(sum(map(len, parts)))
        rows = drawable(np.concatenate([part.view(_ROW_BYTES) for part in parts]).view(TICK))
        return Reel(Material(path.name, recording.config_text, rows, recording.events()))


def drawable(ticks: NDArray[Any]) -> NDArray[Any]:
    """Put at 0 what cannot be drawn: of what was imported, not all need be known.

    Returns
    -------
    ndarray of TICK, shape (n,)
        The same, if board, ball and hands are numbers in all of them; else a copy in which they are.
    """
    lost = [name for name in DRAWN if not np.isfinite(ticks[name]).all()]
    if lost:
        ticks = ticks.copy()
        for name in lost:
            ticks[name][~np.isfinite(ticks[name])] = 0.0
    return ticks
