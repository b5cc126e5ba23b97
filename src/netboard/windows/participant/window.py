"""Windows: the Qt application, its event loop, screens, and a participant's window, which shows only the board."""

import logging
import os
import sys
from collections.abc import Callable
from math import inf
from pathlib import Path
from typing import cast

from PySide6.QtCore import (
    QEventLoop,
    QMargins,
    QMessageLogContext,
    QSize,
    Qt,
    QTimer,
    QtMsgType,
    Signal,
    qInstallMessageHandler,
)
from PySide6.QtGui import QCloseEvent, QGuiApplication, QKeyEvent, QResizeEvent, QScreen
from PySide6.QtWidgets import QApplication, QVBoxLayout, QWidget

from netboard.base.clock import now_ns
from netboard.base.config import Side
from netboard.base.errors import ConfigError, NetboardError, writing
from netboard.base.files.new import new_file, refuse_existing, try_writing
from netboard.base.number import number_of
from netboard.base.process.display_server import asked_offscreen, require_screen
from netboard.base.tables.rig import Display, Network
from netboard.network.transport import names
from netboard.windows.participant.widget import BoardView

log = logging.getLogger(__name__)

WATCH_MS = 50
"""Interval at which a running window checks whether the process is asked to stop [ms]."""

LEAVE_MS = 5000
"""Time for the second key or click that closes a window during a trial or block [ms]."""

IGNORED_MESSAGE = "This plugin does not support propagateSizeHints()"
"""Message that Qt logs for every window of the offscreen platform."""

FRAME = QMargins(4, 40, 4, 4)
"""Space reserved for the title bar and the frame of a window [pixels]."""

UNLIMITED = 2**24 - 1
"""Largest width and height of a widget in Qt [pixels]."""


def _log_qt_message(kind: QtMsgType, _where: QMessageLogContext, words: str) -> None:
    if words != IGNORED_MESSAGE:
        log.log(logging.DEBUG if kind == QtMsgType.QtDebugMsg else logging.WARNING, "Qt: %s", words)


def application() -> QApplication:
    """Return the Qt application of this process, created on first use; raise an error if there is no screen for it."""
    existing = QApplication.instance()
    if existing is not None:
        return cast("QApplication", existing)
    require_screen()
    qInstallMessageHandler(_log_qt_message)
    app = QApplication(sys.argv[:1])
    app.setApplicationName("netboard")
    app.setStyle("Fusion")
    if asked := asked_offscreen():
        log.warning("drawing off screen, where nobody sees it: %s", asked)
    return app


def scale_to_screen(width: int, height: int) -> None:
    """Scale down this process's windows if one of this size [pixels] does not fit on the primary screen.

    Call it before `application`: Qt reads the scale when it starts. Only a running Qt knows the screen, so Qt is
    started and shut down here.
    """
    if QApplication.instance() is not None:
        return
    app = application()
    room = largest_size(QGuiApplication.primaryScreen())
    scale = min(room.width() / width, room.height() / height)
    if scale < 1:
        given = os.environ.get("QT_SCALE_FACTOR") or "1"
        try:
            os.environ["QT_SCALE_FACTOR"] = f"{scale * number_of(given):.4f}"
        except ValueError:
            raise ConfigError(
                f"QT_SCALE_FACTOR: found {given}, expected a number in this environment variable"
            ) from None
        app.shutdown()


def run_events(seconds: float) -> None:
    """Run Qt's event loop for a duration [s]."""
    loop, end = QEventLoop(), QTimer(singleShot=True, interval=round(seconds * 1000))
    end.timeout.connect(loop.quit)
    end.start()
    loop.exec()


class Window(QWidget):
    """A top-level window that emits `closed`; during a trial or block, only if it is closed twice."""

    closed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._leaving = False

    def ask_again(self) -> bool:
        """Ask for a second close if the first may be an accident; return whether it may."""
        return False

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: N802  (Qt's name)
        """Emit `closed`, or wait for a second close first."""
        if self.isVisible() and not self._leaving and self.ask_again():
            self._leaving = True
            QTimer.singleShot(LEAVE_MS, self, self._stay)
            event.ignore()
            return
        super().closeEvent(event)
        self.closed.emit()

    def _stay(self) -> None:
        self._leaving = False


def run(window: Window, stopping: Callable[[], bool], poll: Callable[[], object] = lambda: None) -> None:
    """Run Qt's event loop until the window is closed or the process is asked to stop; call `poll` at each check."""
    app = application()

    def watch() -> None:
        poll()
        if stopping():
            app.exit()  # unlike quit, this asks no window

    timer = QTimer(window, interval=WATCH_MS)
    timer.timeout.connect(watch)
    timer.start()
    window.closed.connect(app.quit)
    app.exec()
    timer.stop()


def require_new(picture: Path | None) -> None:
    """Refuse a screenshot that exists already, or that cannot be saved."""
    if picture is not None:
        refuse_existing(picture)
        with writing(picture, NetboardError):
            try_writing(next(parent for parent in picture.absolute().parents if parent.exists()))


def screenshot(widget: QWidget, picture: Path) -> None:
    """Write the content of a widget to a PNG file."""
    with new_file(picture) as part:
        picture.parent.mkdir(parents=True, exist_ok=True)
        if not widget.grab().save(str(part), "PNG"):
            raise NetboardError(f"{picture}: cannot be written")


SCREENSHOT_WAIT_NS = 60_000_000_000
"""Time without data from the server after which a screenshot is given up [ns]."""


class ScreenshotTimer:
    """Take one screenshot of a window, a delay after `ready` [s]; without a delay, take it then and end the loop.

    Without a delay, the loop also ends if `server` sends nothing for too long.
    """

    def __init__(
        self, window: Window, picture: Path | None, after: float | None, ready: Callable[[], object], server: Network
    ) -> None:
        self._window, self._picture, self._after, self._ready = window, picture, after, ready
        self._host, self._server = server.host, f"the server at {server.host}:{server.port}"
        self._due_ns = inf if after is not None else now_ns() + SCREENSHOT_WAIT_NS
        self._is_ready = False
        self._error: NetboardError | None = None
        if picture is not None:
            log.info("the screenshot waits for data from %s", self._server)

    def poll(self) -> None:
        """Take the screenshot if it is due."""
        if self._picture is None:
            return
        if not self._is_ready and self._ready():
            self._is_ready, self._due_ns = True, now_ns() + (self._after or 0.0) * 1e9
        if now_ns() >= self._due_ns:
            self.take()
            if self._after is None:
                application().exit()

    def take(self) -> None:
        """Take the screenshot, unless it was taken before."""
        picture, self._picture = self._picture, None
        if picture is not None:
            try:
                if not self._ready():
                    why = names.trouble(self._host) or f"no data came from {self._server}"
                    raise NetboardError(f"{picture}: no screenshot was taken: {why}")
                screenshot(self._window, picture)
            except NetboardError as error:  # raised later: Qt has called this
                self._error = error

    def finish(self) -> None:
        """Raise what went wrong with the screenshot."""
        if self._error is not None:
            raise self._error


def screen_of(widget: QWidget) -> QScreen:
    """Return the screen that a widget is on.

    `QWidget.screen` is avoided: PySide makes the screen a child of the widget, so it would be deleted with the widget.
    """
    return QGuiApplication.screenAt(widget.geometry().center()) or QGuiApplication.primaryScreen()


def screens() -> list[QScreen]:
    """List the screens of this computer, the primary one first."""
    main = QGuiApplication.primaryScreen()
    return [main, *(screen for screen in QGuiApplication.screens() if screen != main)]


def numbered_screen(number: int) -> QScreen:
    """Return a screen by its number; raise ConfigError if there is none."""
    found = screens()
    if number >= len(found):
        listed = "; ".join(in_words(i, screen) for i, screen in enumerate(found))
        raise ConfigError(f"[display] screen: found {number}, expected one of these: {listed}")
    return found[number]


def largest_size(screen: QScreen) -> QSize:
    """Return the largest size of a window on a screen, beside panels and its own title bar; offscreen without limit."""
    if os.environ.get("QT_QPA_PLATFORM") == "offscreen":
        return QSize(UNLIMITED, UNLIMITED)
    return screen.availableSize().shrunkBy(FRAME)


def in_words(number: int, screen: QScreen) -> str:
    """Describe a screen in one line."""
    size, mm = screen.size() * screen.devicePixelRatio(), screen.physicalSize()
    claimed = mm.width() / max(size.width(), 1)
    name = screen.name() or "unnamed"
    return (
        f"{number}: {name}, {size.width()} x {size.height()} pixels at {screen.refreshRate():.2f} Hz, "
        f"{mm.width():.0f} x {mm.height():.0f} mm as reported by the screen ({claimed:.4f} mm per pixel)"
    )


class BoardWindow(Window):
    """A window that shows a `BoardView`. Esc or Q closes it; F11 toggles full screen.

    While `in_trial` returns true, a key or click that closes the window must be repeated: it may be an accident.
    """

    def __init__(self, title: str) -> None:
        super().__init__()
        self.in_trial: Callable[[], bool] = lambda: False
        self._cover: QWidget | None = None
        self.setWindowTitle(title)
        self.board = BoardView(self)
        self._windowed = self.geometry()
        self.rows = QVBoxLayout(self)
        self.rows.setContentsMargins(0, 0, 0, 0)
        self.rows.setSpacing(0)
        self.rows.addWidget(self.board, 1)

    def present(self, display: Display, *, alone: bool = False) -> None:
        """Open the window with the configured screen, size and scale; `alone`: no other display needs the screen."""
        self.board.mm_per_pixel = display.mm_per_pixel
        screen = numbered_screen(display.screen)
        self.resize(QSize(display.width, display.height).boundedTo(largest_size(screen)))
        if display.screen > 0:
            self.move(screen.availableGeometry().topLeft())
        if display.fullscreen == "always" or (display.fullscreen == "auto" and alone and not asked_offscreen()):
            self.fill_screen(True, screen)
        else:
            self.show()

    def cover(self, cover: QWidget) -> None:
        """Show a widget over the board until it is deleted."""
        self._cover = cover
        cover.destroyed.connect(self._uncover)
        cover.setGeometry(self.rect())
        cover.show()
        cover.raise_()

    def _uncover(self) -> None:
        self._cover = None

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802  (Qt's name)
        """Resize what covers the board, too."""
        super().resizeEvent(event)
        if self._cover is not None:
            self._cover.setGeometry(self.rect())

    def take_half(self, side: Side) -> None:
        """Move the window to its half of the screen, beside the other side's window, unless it is full screen."""
        if self.isFullScreen():
            return
        room = screen_of(self).availableGeometry()
        room.setWidth(room.width() // 2)
        if side == "right":
            room.translate(room.width(), 0)
        self.setGeometry(room)

    def fill_screen(self, full: bool, screen: QScreen | None = None) -> None:
        """Enter full screen on a screen, or on that of the window, without frame and mouse pointer; or leave it.

        The size is set explicitly too, because a bare X server has no window manager to do it.
        """
        if full:
            self._windowed = self.geometry()
            self.setCursor(Qt.CursorShape.BlankCursor)
            self.setGeometry((screen or screen_of(self)).geometry())
            self.showFullScreen()
        else:
            self.unsetCursor()
            self.showNormal()
            self.setGeometry(self._windowed)

    def ask_again(self) -> bool:
        """Ask for a second close while a trial is running."""
        running = self.in_trial()
        if running:
            log.warning("a trial is running: close the window once more to end the display")
        return running

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802  (Qt's name)
        """Close the window, or toggle full screen."""
        if event.key() in (Qt.Key.Key_Escape, Qt.Key.Key_Q):
            if not event.isAutoRepeat():  # a key that is held down is pressed once
                self.close()
        elif event.key() == Qt.Key.Key_F11:
            self.fill_screen(not self.isFullScreen())
        else:
            super().keyPressEvent(event)
