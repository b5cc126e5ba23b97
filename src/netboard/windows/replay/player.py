"""Replay a recording in the participant's display, or two side by side on one time line.

The window shows what the station's participant could see, filtered by the same curtain. Keys: space plays and pauses;
left and right seek by one second (with shift: ten); full stop and comma step by one tick; Page Down and Page Up go to
the next and the previous trial; up and down change the speed; L loops the whole replay (with shift: the current trial);
Home goes to the start of the block.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QVBoxLayout, QWidget

from netboard.base.clock import now_ns
from netboard.base.config import Side
from netboard.base.tick import TICK_SECONDS
from netboard.recording.replay.loaded import LoadedRecording
from netboard.recording.replay.marks import near, trial_starts
from netboard.recording.replay.pairing import Sync, pair
from netboard.recording.replay.position import ReplayPosition, clock, require_inside
from netboard.stage.view import View
from netboard.windows.participant import window as windows
from netboard.windows.participant.language import LANGUAGES, load_words
from netboard.windows.participant.scene import COLOURS, PictureState
from netboard.windows.participant.screens import compose
from netboard.windows.participant.trial_events import TrialEvents, events_after
from netboard.windows.participant.widget import BoardView
from netboard.windows.replay.timebar import TimeBar

FRAME_MS = 16
"""Interval between two frames while playing [ms]."""

STEP, LONG_STEP = 1.0, 10.0
"""Distance that the arrow keys seek [s]."""

NEAR_TICKS = 1000
"""Ticks between two views above which the trial events are cleared [1]."""

MAX_WIDE = 1600
"""Largest initial width of boards side by side [pixels]."""

KEYS = (
    "space: play, pause   \u2190 \u2192: 1 s   , .: one tick   PgUp PgDn: trial   \u2191 \u2193: speed   "
    "L: loop   Home: start   Q: close"
)
"""Help line with the keys."""


class Pane:
    """One recording in the window."""

    def __init__(self, recording: LoadedRecording, station: Side, board: BoardView) -> None:
        self.recording, self.board = recording, board
        self._station = station
        language = recording.config.display.language
        self._words = load_words(language if language in LANGUAGES else LANGUAGES[0])
        self._events: TrialEvents | None = None

    def show(self, position: float) -> View:
        """Show the view at a position [s], and return it."""
        view = self.recording.view(self.recording.at(position), self._station)
        near_by = self._events is not None and 0 <= view.tick - self._events.view.tick < NEAR_TICKS
        self._events = events_after(self._events if near_by else None, view)
        self.board.show_picture(compose(view, self.recording.config, self._words, self._events.result))
        return view


class PlayerWindow(windows.BoardWindow):
    """A window that plays recordings by a monotonic clock [s]."""

    def __init__(
        self,
        recordings: Sequence[LoadedRecording],
        station: Side,
        speed: float = 1.0,
        sync: Sync = "time",
        now: Callable[[], float] = lambda: now_ns() * 1e-9,
    ) -> None:
        super().__init__("netboard replay: " + ", ".join(recording.name for recording in recordings))
        self._station, self._now = station, now
        self.pairing = pair(recordings, sync)
        starts = trial_starts(recordings[0].marks)
        self._trials = [replace(mark, time=self.pairing.of(0, mark.time)) for mark in starts]
        self.playback = ReplayPosition(self.pairing.length, self.pairing.begin, now(), speed)
        self.panes = [Pane(recordings[0], station, self.board)]
        self._captions: list[QLabel] = []
        if len(recordings) > 1:
            self._put_side_by_side(recordings)
        self.bar = TimeBar(recordings, self.pairing, self)
        self.bar.sought.connect(self.seek)
        self.line, keys = QLabel(self), QLabel(KEYS, self)
        colours = COLOURS[PictureState.RUN]
        self.line.setStyleSheet(f"background: {colours.background}; color: {colours.detail}; padding: 4px 12px 0px;")
        keys.setStyleSheet(f"background: {colours.background}; color: {colours.quiet}; padding: 0px 12px 4px;")
        for line in (self.line, keys):
            line.setMinimumWidth(1)
        for row in (self.bar, self.line, keys):
            self.rows.addWidget(row)
        self._frames = QTimer(self, interval=FRAME_MS, timerType=Qt.TimerType.PreciseTimer)
        self._frames.timeout.connect(self.refresh)
        self.refresh()

    def _put_side_by_side(self, recordings: Sequence[LoadedRecording]) -> None:
        """Give each recording a board and a caption."""
        colours = COLOURS[PictureState.RUN]
        self.panes += [Pane(recording, self._station, BoardView(self)) for recording in recordings[1:]]
        boards = QWidget(self)
        across = QHBoxLayout(boards)
        across.setContentsMargins(0, 0, 0, 0)
        across.setSpacing(2)
        boards.setStyleSheet(f"background: {colours.guide};")
        for pane in self.panes:
            column, caption = QVBoxLayout(), QLabel(self)
            caption.setStyleSheet(f"background: {colours.background}; color: {colours.detail}; padding: 4px 12px;")
            caption.setMinimumWidth(1)  # a long line must not make the window wider
            column.setSpacing(0)
            column.addWidget(caption)
            column.addWidget(pane.board, 1)
            across.addLayout(column, 1)
            self._captions.append(caption)
        self.rows.addWidget(boards, 1)

    def refresh(self) -> None:
        """Show the present position of the replay."""
        self.playback = self.playback.now(self._now())
        positions = self.pairing.at(self.playback.position)
        views = [pane.show(position) for pane, position in zip(self.panes, positions, strict=True)]
        for caption, pane, position in zip(self._captions, self.panes, positions, strict=False):
            caption.setText(f"{pane.recording.name}\n{clock(position)}   {pane.recording.where(position)}")
        self.bar.point_at(self.playback.position)
        self.bar.show_loop(self.playback.loop)
        self.line.setText(self._in_words(positions[0], views[0]))
        if self.playback.playing and not self._frames.isActive():
            self._frames.start()
        elif not self.playback.playing:
            self._frames.stop()

    def _in_words(self, position: float, view: View) -> str:
        here = self.playback
        texts = ["\u25b6" if here.playing else "\u275a\u275a", f"{clock(here.position)} / {clock(here.length)}"]
        texts.append(f"{here.speed:g}\u00d7")
        if here.loop is not None:
            texts.append(f"\u21bb {clock(here.loop[0])}\u2013{clock(here.loop[1])}")
        texts.append(f"{self._station} station")
        if not self._captions:
            texts += [f"tick {view.tick}", view.phase, f"trial {view.trial}", self.panes[0].recording.gap_at(position)]
        return "   ".join(filter(None, texts))

    def toggle(self) -> None:
        """Play or pause."""
        self._go(self.playback.toggle(self._now()))

    def seek(self, position: float) -> None:
        """Go to a position from the start of the time line [s]."""
        self._go(self.playback.seek(self._now(), position))

    def step(self, ticks: int) -> None:
        """Pause, and move by a number of ticks, forward or back [1]."""
        now = self._now()
        self._go(self.playback.pause(now).move(now, ticks * TICK_SECONDS))

    def next_trial(self, *, back: bool) -> None:
        """Go to the next or the previous trial of the first recording."""
        mark = near(self._trials, self.playback.at(self._now()), "trial", back=back)
        if mark is not None:
            self.seek(mark.time)

    def loop(self, *, trial: bool) -> None:
        """Start to loop the whole replay or the current trial, or stop looping."""
        now = self._now()
        begin, end = self._trial_at(self.playback.at(now)) if trial else (0.0, self.pairing.length)
        wanted = self.playback.loop is None and begin < end
        self._go(self.playback.repeat(now, (begin, end) if wanted else None))

    def _trial_at(self, position: float) -> tuple[float, float]:
        """Return the beginning of the current trial and that of the next one [s]."""
        begins = [mark.time for mark in self._trials]
        before = max((time for time in begins if time <= position), default=0.0)
        return before, min((time for time in begins if time > position), default=self.pairing.length)

    def _go(self, playback: ReplayPosition) -> None:
        """Set the state of the replay, and show it."""
        self.playback = playback
        self.refresh()

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802  (Qt's name)
        """Play, pause, seek, change the speed."""
        now = self._now()
        shift = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
        match event.key():
            case Qt.Key.Key_Space:
                self.toggle()
            case Qt.Key.Key_Left | Qt.Key.Key_Right as key:
                far = LONG_STEP if shift else STEP
                self._go(self.playback.move(now, far if key == Qt.Key.Key_Right else -far))
            case Qt.Key.Key_Period | Qt.Key.Key_Comma as key:
                self.step(1 if key == Qt.Key.Key_Period else -1)
            case Qt.Key.Key_PageDown | Qt.Key.Key_PageUp as key:
                self.next_trial(back=key == Qt.Key.Key_PageUp)
            case Qt.Key.Key_Up | Qt.Key.Key_Down as key:
                self._go(self.playback.faster(now, 1 if key == Qt.Key.Key_Up else -1))
            case Qt.Key.Key_L:
                self.loop(trial=shift)
            case Qt.Key.Key_Home:
                self.seek(self.pairing.begin)
            case _:
                super().keyPressEvent(event)


def run(
    recordings: Sequence[LoadedRecording],
    station: Side,
    stopping: Callable[[], bool],
    speed: float = 1.0,
    picture: Path | None = None,
    sync: Sync = "time",
    at: float | None = None,
) -> None:
    """Play recordings from a position [s], or from the start of the block, until the window is closed."""
    windows.require_new(picture)
    app = windows.application()
    window = PlayerWindow(recordings, station, speed, sync)
    require_inside(at, window.pairing.length, " and ".join(one.name for one in recordings))
    shown = recordings[0].config.display
    window.present(replace(shown, screen=0, mm_per_pixel=0.0, width=min(shown.width * len(recordings), MAX_WIDE)))
    if at is not None:
        window.seek(at)
    if picture is not None:
        app.processEvents()
        windows.screenshot(window, picture)
        window.close()
        return
    window.toggle()
    windows.run(window, stopping)
    window.close()
