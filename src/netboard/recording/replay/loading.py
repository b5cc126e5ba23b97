"""Loads a recording file for replay. Only this module of the package reads files."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.terminal.bars import progress_bars
from netboard.base.terminal.output import plain_console
from netboard.base.tick import joined
from netboard.recording.files.reader import Recording
from netboard.recording.replay.loaded import LoadedRecording

DRAWN = ("z", "theta", "p", "left_z", "right_z")
"""Fields of a tick that the display draws."""


def load(path: Path, tell: Callable[[int], None] = lambda ticks: None) -> LoadedRecording:
    """Read a whole recording."""
    with Recording(path) as recording:
        parts: list[NDArray[Any]] = []
        for rows in recording.batches():
            parts.append(rows)
            tell(sum(map(len, parts)))
        rows = drawable(joined(parts))
        return LoadedRecording(path.name, recording.config_text, rows, recording.events())


def load_with_progress(path: Path) -> LoadedRecording:
    """Read a whole recording, with a progress bar on a terminal."""
    with progress_bars(plain_console(stderr=True), "{task.completed} ticks") as progress:
        task = progress.add_task(f"Reading {path.name}", total=None)
        return load(path, lambda ticks: progress.update(task, completed=ticks))


def drawable(ticks: NDArray[Any]) -> NDArray[Any]:
    """Replace missing values in drawn fields by 0; imported data may lack them.

    Returns the same array if board, ball and hands are all finite; otherwise a corrected copy.
    """
    lost = [name for name in DRAWN if not np.isfinite(ticks[name]).all()]
    if lost:
        ticks = ticks.copy()
        for name in lost:
            ticks[name][~np.isfinite(ticks[name])] = 0.0
    return ticks
