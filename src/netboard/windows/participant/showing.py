"""Frame scheduling of a station's window: from the newest views to painted frames and their markers.

While anything moves, a frame is due at each refresh of the screen. It is extrapolated to the time at which it will have
been painted (`netboard.windows.participant.motion`). A picture equal to the one before is not painted, and while
nothing moves no picture is made. Without `display.smooth`, the newest view is painted unchanged as soon as it arrives,
at most once per refresh.

Qt does not report when a frame of a software-rendered window reaches the screen. Frames therefore follow a timer at the
refresh rate, and counts and markers refer to the end of painting.
"""

import logging
from dataclasses import replace
from typing import Protocol

from PySide6.QtCore import QObject, Qt, QTimer

from netboard.base.clock import now_ns
from netboard.base.config import Config, Side
from netboard.base.errors import NetboardError
from netboard.base.terminal.logs import RateLimitedLog
from netboard.stage.view import View
from netboard.windows.participant.frames import FrameTally
from netboard.windows.participant.markers import Markers
from netboard.windows.participant.motion import ShownMotion, motion_after
from netboard.windows.participant.scene import DisplayPicture, Grip, PictureState
from netboard.windows.participant.screens import IN_TRIAL, check, compose
from netboard.windows.participant.trial_events import TrialEvents, events_after
from netboard.windows.participant.window import BoardWindow, screen_of
from netboard.windows.participant.words import DisplayTexts

log = logging.getLogger(__name__)

DEFAULT_REFRESH_HZ = 60.0
"""Refresh rate that is assumed if the screen does not report one [Hz]."""

SOON = 0.15
"""A frame due within this share of a refresh period is painted at once [1]."""

PAINTINGS = 8
"""Number of frames over which the painting time is averaged [1]."""


class PlayerInput(Protocol):
    """The player of this side, if this display is also its input."""

    def grip(self, view: View | None, config: Config) -> Grip:
        """Return what is drawn of the player's own hand with a view."""

    def close(self) -> None:
        """Release what the player holds."""


class Showing(QObject):
    """Turn the views of one station into frames, counts and markers; the server's configuration replaces `config`."""

    def __init__(
        self,
        station: Side,
        config: Config,
        words: DisplayTexts,
        markers: Markers,
        window: BoardWindow,
        player: PlayerInput | None = None,
    ) -> None:
        super().__init__(window)
        self.config = config
        self._words, self._markers, self._window, self._player = words, markers, window, player
        self._problems = RateLimitedLog(log)
        self._events: TrialEvents | None = None
        self._motion: ShownMotion | None = None
        self._received_ns = self._planned_ns = self._due_ns = self._shown_ns = self._painting_ns = 0
        self._new_events: list[str] = []
        self._to_mark: list[str] = []
        self._refresh_ns = round(1e9 / DEFAULT_REFRESH_HZ)
        self.tally = FrameTally(station, self._refresh_ns)
        # Qt's default timer may be 5 % early or late.
        self._turn = QTimer(self, singleShot=True, timerType=Qt.TimerType.PreciseTimer)
        self._turn.timeout.connect(self._frame)
        window.board.painted.connect(self._painted)

    @property
    def refresh_hz(self) -> float:
        """Refresh rate of the screen [Hz]."""
        return 1e9 / self._refresh_ns

    @property
    def in_trial(self) -> bool:
        """Whether the newest view is of a running attempt, or of the levelling before it."""
        return self._motion is not None and self._motion.view.phase in ("levelling", *IN_TRIAL)

    def read_refresh_rate(self) -> None:
        """Read the refresh rate of the screen that the window is on."""
        rate = screen_of(self._window).refreshRate()
        self._refresh_ns = round(1e9 / (rate if rate > 1 else DEFAULT_REFRESH_HZ))
        self.tally.period_ns = max(self._refresh_ns, round(1e9 / self.config.network.view_rate_hz))

    def take(self, view: View, received_ns: int) -> None:
        """Take a view that has arrived, and schedule its frame."""
        check(view)
        self.tally.receive(view.seq, view.sent_ns)
        self._events = events_after(self._events, view)
        self._new_events += self._events.events
        self._motion = motion_after(self._motion, view, received_ns)
        self._received_ns = received_ns
        self._plan(received_ns)

    def blank(self, picture: DisplayPicture) -> None:
        """Show a picture of text and discard the views."""
        self._turn.stop()
        if self._motion is not None:
            self._new_events.append("blank")
        self._motion = self._events = None
        self._to_mark += self._new_events
        self._new_events.clear()
        if not self._window.board.show_picture(self._with_grip(picture, None)):
            self._mark()

    def close(self) -> None:
        """Stop making frames, and close markers and player."""
        self._turn.stop()
        self._markers.close()
        if self._player is not None:
            self._player.close()

    def _plan(self, now: int) -> None:
        """Schedule the next frame: at once, if a refresh has passed since the one before."""
        if self._turn.isActive():
            return
        self._planned_ns = max(self._due_ns, now)
        remaining = self._planned_ns - now
        if remaining <= SOON * self._refresh_ns:
            self._frame()
        else:
            self._turn.start(round(remaining / 1e6))

    def _frame(self) -> None:
        """Compose the picture of now, and give it to the window if it differs."""
        motion, events, now = self._motion, self._events, now_ns()
        if motion is None or events is None:
            return
        late = now - self._planned_ns > self._refresh_ns
        self._due_ns = (now if late else self._planned_ns) + self._refresh_ns
        smooth = self.config.display.smooth
        view = motion.at(now + self._painting_ns, self.config) if smooth else motion.view
        picture = self._with_grip(compose(view, self.config, self._words, events.result), view)
        self._to_mark += self._new_events
        self._new_events.clear()
        if self._window.board.show_picture(picture):
            self.tally.expect(view.tick, self._received_ns, self._planned_ns)
            self._shown_ns = now
        else:
            self._mark()
        if smooth and not motion.settled(now):
            self._plan(now_ns())

    def _with_grip(self, picture: DisplayPicture, view: View | None) -> DisplayPicture:
        """Add the player's own hand, if there is a player; without a board, only the hint how to play.

        After the end the grip is not drawn. A hint that asks for something replaces the request to wait.
        """
        if self._player is None or picture.state is PictureState.FINISHED:
            return picture
        grip = self._player.grip(view if picture.board else None, self.config)
        return replace(picture, grip=grip, notice="" if grip.asks else picture.notice)

    def _painted(self) -> None:
        """Count a painted frame, and send the markers of the events that it shows first."""
        now = now_ns()
        if self.tally.paint(now):
            self._painting_ns += (min(now - self._shown_ns, self._refresh_ns) - self._painting_ns) // PAINTINGS
        self._mark()

    def _mark(self) -> None:
        """Send the markers of the events that the screen now shows."""
        for event in self._to_mark:
            try:
                self._markers.mark(event)
            except NetboardError as error:
                self._problems.log(str(error))
        self._to_mark.clear()
