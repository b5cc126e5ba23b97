"""A display as input device: mouse, touch or held keys move the stylus of the same side, and its force is shown.

Only the pointer's height counts, in metres of the scene. Keys move it at a constant speed. The height stays as it is
when the pointer leaves the window, the finger is lifted or the keys are released.

The pointer goes to the agent of this side, and the force comes from it, over local sockets of this user on this
computer. The server and the other station take no part, so the curtain holds: players see only the stylus and the force
of their own side.
"""

from PySide6.QtCore import QEvent, QObject, QPointF, Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent, QTouchEvent

from netboard.base import settings
from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Config, Side, played_sides
from netboard.base.errors import WireError
from netboard.devices.mouse import MouseOptions
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.motion import Felt, Pointer
from netboard.network.transport import channels, sockets
from netboard.stage.view import View
from netboard.windows.participant.grip import grip_of
from netboard.windows.participant.language import load_words
from netboard.windows.participant.scene import Grip
from netboard.windows.participant.window import BoardWindow

ALIVE_MS = 50
"""Longest interval between two pointer messages; they are the agent's heartbeat of this window [ms]."""

FELT_TIMEOUT_NS = 500_000_000
"""Older forces are not shown [ns]."""


KEY_SPEED = 0.06
"""Speed of the height while a key is held [m/s]."""

KEY_MS = 8
"""Interval between two steps of the height while a key is held [ms]."""

UP, DOWN = (Qt.Key.Key_Up, Qt.Key.Key_W), (Qt.Key.Key_Down, Qt.Key.Key_S)
"""Keys that raise and lower the height."""

MOUSE = (QEvent.Type.MouseMove, QEvent.Type.MouseButtonPress)
TOUCH = (QEvent.Type.TouchBegin, QEvent.Type.TouchUpdate, QEvent.Type.TouchEnd)
KEYS = (QEvent.Type.KeyPress, QEvent.Type.KeyRelease)


class Pointing(QObject):
    """The height at which a player points, within `reach` of zero [m]; None before the player has pointed anywhere."""

    moved = Signal()

    def __init__(self, window: BoardWindow, reach: float, *, keys: bool) -> None:
        super().__init__(window)
        self.height: float | None = None
        self._board = window.board
        self._reach = reach
        self._held: set[int] = set()
        self._timer = QTimer(self, interval=KEY_MS, timerType=Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._move_on)
        self._window = window
        window.installEventFilter(self)
        if not keys:
            surface = window.board
            surface.setMouseTracking(True)
            surface.setAttribute(Qt.WidgetAttribute.WA_AcceptTouchEvents)
            surface.setCursor(Qt.CursorShape.SizeVerCursor)
            surface.installEventFilter(self)

    def close(self) -> None:
        """Stop receiving events."""
        self._hold(set())
        for watched in (self._window, self._board):
            watched.removeEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802  (Qt's name)
        """Handle an input event; return whether Qt should drop it."""
        kind = event.type()
        if watched is self._window:
            if kind in KEYS and isinstance(event, QKeyEvent):
                return self._key(event)
            if kind == QEvent.Type.WindowDeactivate:  # the release of a held key goes to another window
                self._hold(set())
            return False
        if kind in MOUSE and isinstance(event, QMouseEvent):
            self._point(event.position())
            return True
        if kind in TOUCH and isinstance(event, QTouchEvent):
            self._point(event.points()[0].position())
            event.accept()  # without it Qt sends no further event of this touch
            return True
        return False

    def _point(self, place: QPointF) -> None:
        """Set the height from a place on the widget [pixels]."""
        self._set(self._board.height_at(place))

    def _key(self, event: QKeyEvent) -> bool:
        """Handle a key; return whether Qt should drop it. Q is dropped: it is next to W and would close the window."""
        key = event.key()
        if key not in (*UP, *DOWN):
            return bool(key == Qt.Key.Key_Q)
        if not event.isAutoRepeat():
            pressed = event.type() == QEvent.Type.KeyPress
            self._hold(self._held | {key} if pressed else self._held - {key})
        return True

    def _hold(self, keys: set[int]) -> None:
        """Set the held keys, and start or stop the timer that moves the height."""
        self._held = keys
        if not keys:
            self._timer.stop()
        elif not self._timer.isActive():
            self._move_on()
            self._timer.start()

    def _move_on(self) -> None:
        """Move the height by one step of the held keys."""
        way = bool(self._held & set(UP)) - bool(self._held & set(DOWN))
        self._set((self.height or 0.0) + way * KEY_SPEED * KEY_MS * 1e-3)

    def _set(self, height: float) -> None:
        self.height = min(max(height, -self._reach), self._reach)
        self.moved.emit()


class Playing(QObject):
    """The pointer and the force of one side's player, whose device has its options in the local configuration."""

    def __init__(self, station: Side, config: Config, context: sockets.Context, window: BoardWindow) -> None:
        super().__init__(window)
        options = settings.check(MouseOptions, dict(config.agents.of(station).options), ("agents", station, "options"))
        where = channels.addresses(config.network)
        self._station = station
        self._words = load_words(config.display.language)
        self._keys = options.input == "keys"
        self._force: float | None = None
        self._felt_ns = 0
        self._pointer = sockets.pointer_sender(context, where.pointer(station))
        self._felt = sockets.felt_subscriber(context, where.felt(station))
        self._pointing = Pointing(window, options.reach, keys=self._keys)
        self._pointing.moved.connect(self._send_pointer)
        self._alive = QTimer(self, interval=ALIVE_MS)
        self._alive.timeout.connect(self._send_pointer)
        self._alive.start()
        if played_sides(config) == SIDES:
            window.take_half(station)
        if self._keys:
            window.activateWindow()

    def grip(self, view: View | None, config: Config) -> Grip:
        """Return what is drawn of the player's own hand with this view."""
        self._feel()
        return grip_of(view, config, self._words, self._station, self._pointing.height, self._force, keys=self._keys)

    def close(self) -> None:
        """Close the sockets; a second call does nothing."""
        if self._pointer.closed:
            return
        self._alive.stop()
        self._pointing.close()
        self._pointer.close()
        self._felt.close()

    def _send_pointer(self) -> None:
        sockets.send(self._pointer, encode(Pointer(self._station, self._pointing.height)))

    def _feel(self) -> None:
        """Read the newest force; discard one older than `FELT_TIMEOUT_NS`."""
        now = now_ns()
        frame = sockets.receive(self._felt)
        if frame is not None:
            try:
                message = decode(frame)
            except WireError:
                return
            if isinstance(message, Felt) and message.side == self._station:
                self._force, self._felt_ns = message.force, now
        if now - self._felt_ns > FELT_TIMEOUT_NS:
            self._force = None
