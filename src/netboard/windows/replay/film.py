"""An animation of a recording: both participants' displays side by side, as a file for a page or a talk.

Each frame is painted as in the live display, behind the curtain: every participant's own stylus, never the partner's.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PySide6.QtGui import QImage

from netboard.base.config import SIDES
from netboard.base.errors import ConfigError
from netboard.base.files.new import new_file
from netboard.recording.replay.loaded import LoadedRecording
from netboard.recording.replay.position import require_inside
from netboard.windows.participant import window as windows
from netboard.windows.participant.widget import BoardView
from netboard.windows.replay.player import Pane

KINDS = (".gif", ".png", ".webp")
"""File types of animations."""

FRAME_RATE = 20
"""Frames in each second of the file [Hz]."""

LONGEST = 60.0
"""Longest film, for all frames are kept until the file is written [s]."""

WIDTH, HEIGHT, GAP = 480, 270, 6
"""Size of each display, and the space between both [pixels]."""


def write_film(recording: LoadedRecording, path: Path, begin: float, end: float | None, speed: float) -> None:
    """Write what both participants see from one time to another [s], at a speed in multiples of real time.

    Raises
    ------
    ConfigError
        If the file exists, is of no type in `KINDS`, or the times are not in the recording or too far apart.
    """
    last = recording.length if end is None else end
    if path.suffix not in KINDS:
        raise ConfigError(f"--film: found {path.name}, expected a name that ends with {', '.join(KINDS)}")
    require_inside(begin, recording.length, recording.name)
    if not begin < last <= recording.length:
        expected = f"expected a time after {begin:.12g} s, up to {recording.length:.3f} s"
        raise ConfigError(f"--until: found {last:.12g}, {expected}")
    if (last - begin) / speed > LONGEST:
        long = f"{(last - begin) / speed:.1f} s of film; expected at most {LONGEST:g} s"
        raise ConfigError(f"--until: found {long}: use --at and --until, or --speed")
    windows.require_new(path)
    app = windows.application()
    first, *others = [Image.fromarray(frame) for frame in _frames(recording, begin, last, speed)]
    app.processEvents()
    with new_file(path) as part:
        path.parent.mkdir(parents=True, exist_ok=True)
        kind = path.suffix[1:].upper()
        first.save(part, kind, save_all=True, append_images=others, duration=1000 // FRAME_RATE, loop=0)


def _frames(recording: LoadedRecording, begin: float, end: float, speed: float) -> Iterator[NDArray[np.uint8]]:
    """Paint the frames, each an array of RGB values of shape (height, width, 3)."""
    panes = [Pane(recording, side, BoardView()) for side in SIDES]
    for pane in panes:
        pane.board.resize(WIDTH, HEIGHT)
    gap = np.full((HEIGHT, GAP, 3), 255, np.uint8)
    for position in np.arange(begin, end, speed / FRAME_RATE):
        for pane in panes:
            pane.show(float(position))
        left, right = (_pixels(pane.board) for pane in panes)
        yield np.hstack([left, gap, right])


def _pixels(board: BoardView) -> NDArray[np.uint8]:
    image = board.grab().toImage().convertToFormat(QImage.Format.Format_RGB888).scaled(WIDTH, HEIGHT)
    rows = np.frombuffer(image.constBits(), np.uint8).reshape(HEIGHT, image.bytesPerLine())
    return rows[:, : 3 * WIDTH].reshape(HEIGHT, WIDTH, 3).copy()
