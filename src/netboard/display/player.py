"""A recording in the participants' display.

What is shown at each moment is what the station's participant could see, made by the same curtain. Keys: space plays
and pauses, left and right go one second (with shift: ten), up and down change the speed, Home begins again.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QLabel

from netboard.clock import now_ns
from netboard.config import Config, Side, parse
from netboard.curtain import make_curtain, view_of
from netboard.display.language import LANGUAGES, load_words
from netboard.display.scene import COLOURS, Mood
from netboard.display.screens import compose
from netboard.display.story import Story, follow
from netboard.display.timebar import TimeBar
from netboard.display.timeline import Playback, begin, best_so_far, clock, seconds
from netboard.display.widget import screenshot
from netboard.display.window import BoardWindow, application
from netboard.errors import NetboardError, RecordingError
from netboard.recording.reader import Recording

FRAME_MS = 16
STEP, LONG_STEP = 1.0, 10.0
"""How far the arrow keys go [s]."""

NEAR_TICKS = 1000
"""A view that is further from the one before does not go on from there [1]."""

KEYS = "space: play, pause   \u2190 \u2192: seek   \u2191 \u2193: speed   Home: begin again   Q: close"
"""What the keys do, for people."""


DRAWN = ("z", "theta", "p", "left_z", "right_z")
"""Numbers of a tick that make the picture."""


class PlayerWindow(BoardWindow):
    """A window that plays a recording.

    Parameters
    ----------
    ticks : ndarray of netboard.tick.TICK, shape (n,)
        The recorded ticks; at least one.
    config : Config
        The recording's own configuration.
    station : str
        Whose view is shown.
    title : str
        Title of the window.
    speed : float
        Seconds of the recording per second to begin with [1].
    now : callable
        A steady clock [s].
    """

    def __init__(
        self,
        ticks: NDArray[Any],
        config: Config,
        station: Side,
        title: str,
        speed: float = 1.0,
        now: Callable[[], float] = lambda: now_ns() * 1e-9,
    ) -> None:
        super().__init__(title)
        ticks = drawable(ticks)
        self._ticks, self._config, self._station, self._now = ticks, config, station, now
        self._curtain = make_curtain(config)
        language = config.display.language
        self._words = load_words(language if language in LANGUAGES else LANGUAGES[0])
        self._story: Story | None = None
        self._times, self._best = seconds(ticks), best_so_far(ticks)
        self._begin = begin(ticks)
        self.playback = Playback(float(self._times[-1]), self._begin, now(), speed)
        self.bar = TimeBar(ticks, config, self)
        self.bar.sought.connect(self.seek)
        self.line = QLabel(self)
        colours = COLOURS[Mood.RUN]
        self.line.setStyleSheet(f"background: {colours.background}; color: {colours.detail}; padding: 4px 12px;")
        self.rows.addWidget(self.bar)
        self.rows.addWidget(self.line)
        self._frames = QTimer(self, interval=FRAME_MS, timerType=Qt.TimerType.PreciseTimer)
        self._frames.timeout.connect(self.refresh)
        self.refresh()

    def refresh(self) -> None:
        """Show where the replay is now."""
        self.playback = self.playback.now(self._now())
        position = self.playback.position
        i = max(int(np.searchsorted(self._times, position, side="right")) - 1, 0)
        best = float(self._best[i])
        view = view_of(self._curtain, self._ticks[i], self._station, best if np.isfinite(best) else None, 0)
        near = self._story is not None and 0 <= view.tick - self._story.view.tick < NEAR_TICKS
        self._story = follow(self._story if near else None, view)
        self.board.show_picture(compose(view, self._config, self._words, self._story.result))
        self.bar.point_at(position)
        state = "\u25b6" if self.playback.playing else "\u275a\u275a"
        self.line.setText(
            f"{state}   {clock(position)} / {clock(self.playback.length)}   {self.playback.speed:g}\u00d7   "
            f"tick {view.tick}   {view.phase}   {self._station} station        {KEYS}"
        )
        if self.playback.playing and not self._frames.isActive():
            self._frames.start()
        elif not self.playback.playing:
            self._frames.stop()

    def toggle(self) -> None:
        """Play or pause."""
        self._go(self.playback.toggle(self._now()))

    def seek(self, position: float) -> None:
        """Go to a position from the start of the recording [s]."""
        self._go(self.playback.seek(self._now(), position))

    def _go(self, playback: Playback) -> None:
        """Take over a new state of the replay."""
        self.playback = playback
        self.refresh()

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802  (Qt's name)
        """Play, pause, seek, change the speed."""
        now = self._now()
        step = LONG_STEP if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else STEP
        match event.key():
            case Qt.Key.Key_Space:
                self.toggle()
            case Qt.Key.Key_Left:
                self._go(self.playback.step(now, -step))
            case Qt.Key.Key_Right:
                self._go(self.playback.step(now, step))
            case Qt.Key.Key_Up:
                self._go(self.playback.faster(now, 1))
            case Qt.Key.Key_Down:
                self._go(self.playback.faster(now, -1))
            case Qt.Key.Key_Home:
                self.seek(self._begin)
            case _:
                super().keyPressEvent(event)


def drawable(ticks: NDArray[Any]) -> NDArray[Any]:
    """Put at 0 what cannot be drawn: of what was imported, not all need be known.

    Parameters
    ----------
    ticks : ndarray of TICK, shape (n,)
        The recorded ticks.

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


def run(
    path: Path, station: Side, stopping: Callable[[], bool], speed: float = 1.0, picture: Path | None = None
) -> None:
    """Play a recording until the window is closed or the process is asked to stop.

    Parameters
    ----------
    path : Path
        The recording.
    station : str
        Whose view is shown.
    stopping : callable
        Whether the process has been asked to stop; asked some twenty times a second.
    speed : float
        Seconds of the recording per second to begin with [1].
    picture : Path, optional
        Save the first picture there and stop.

    Raises
    ------
    RecordingError
        If the recording cannot be read, or has no tick.
    NetboardError
        If the screenshot exists already or cannot be written.
    """
    if picture is not None and picture.exists():
        raise NetboardError(f"{picture} exists; a screenshot never overwrites a file")
    with Recording(path) as recording:
        config = parse(recording.config_text, str(path))
        ticks = recording.ticks()
    if not len(ticks):
        raise RecordingError(f"{path}: has no tick to show")
    app = application()
    window = PlayerWindow(ticks, config, station, f"netboard replay: {path.name}", speed)
    window.present(replace(config.display, screen=0, mm_per_pixel=0.0))
    if picture is not None:
        app.processEvents()
        screenshot(window, picture)
        window.close()
        return
    watch = QTimer(window, interval=50)
    watch.timeout.connect(lambda: app.quit() if stopping() else None)
    watch.start()
    window.closed.connect(app.quit)
    window.toggle()
    app.exec()
    watch.stop()
    window.close()
