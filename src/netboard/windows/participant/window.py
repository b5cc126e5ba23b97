"""A participant's window: the board and nothing else. Esc or Q closes it, F11 switches to the whole screen and back."""

import logging
import os
import sys
from typing import cast

from PySide6.QtCore import QEventLoop, QMessageLogContext, Qt, QTimer, QtMsgType, Signal, qInstallMessageHandler
from PySide6.QtGui import QCloseEvent, QGuiApplication, QKeyEvent, QScreen
from PySide6.QtWidgets import QApplication, QVBoxLayout, QWidget

from netboard.base.config import Side
from netboard.base.errors import ConfigError
from netboard.base.tables.rig import Display
from netboard.windows.participant.widget import BoardView

log = logging.getLogger(__name__)

USELESS = "This plugin does not support propagateSizeHints()"
"""Qt says this of every window without a screen."""


def _hear(kind: QtMsgType, _where: QMessageLogContext, words: str) -> None:
    """Bring what Qt has to say to the log."""
    if words != USELESS:
        log.log(logging.DEBUG if kind == QtMsgType.QtDebugMsg else logging.WARNING, "Qt: %s", words)


def application() -> QApplication:
    """Get the one Qt application of this process, made when first asked for; without a screen it draws offscreen."""
    existing = QApplication.instance()
    if existing is not None:
        return cast("QApplication", existing)
    qInstallMessageHandler(_hear)
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    app = QApplication(sys.argv[:1])
    app.setApplicationName("netboard")
    app.setStyle("Fusion")
    return app


def work(seconds: float) -> None:
    """Let Qt work for a while."""
    loop, end = QEventLoop(), QTimer(singleShot=True, interval=round(seconds * 1000))
    end.timeout.connect(loop.quit)
    end.start()
    loop.exec()


def screen_of(widget: QWidget) -> QScreen:
    """Find the screen a widget is on.

    Not by `QWidget.screen`: the binding would give Python the screen as the widget's child, to be deleted with it.
    """
    return QGuiApplication.screenAt(widget.geometry().center()) or QGuiApplication.primaryScreen()


def screens() -> list[QScreen]:
    """List the screens of this machine, the main one first."""
    main = QGuiApplication.primaryScreen()
    return [main, *(screen for screen in QGuiApplication.screens() if screen != main)]


def numbered_screen(number: int) -> QScreen:
    """Find a screen by its number."""
    there = screens()
    if number >= len(there):
        listed = "; ".join(in_words(i, screen) for i, screen in enumerate(there))
        raise ConfigError(f"[display] screen: found {number}, expected one of these: {listed}")
    return there[number]


def in_words(number: int, screen: QScreen) -> str:
    """Say what a screen is, in one line."""
    size, mm = screen.size() * screen.devicePixelRatio(), screen.physicalSize()
    claimed = mm.width() / max(size.width(), 1)
    name = screen.name() or "unnamed"
    return (
        f"{number}: {name}, {size.width()} x {size.height()} pixels at {screen.refreshRate():.2f} Hz, "
        f"{mm.width():.0f} x {mm.height():.0f} mm by its own account ({claimed:.4f} mm a pixel)"
    )


class BoardWindow(QWidget):
    """A window that shows a `BoardView`."""

    closed = Signal()

    def __init__(self, title: str) -> None:
        super().__init__()
        self.setWindowTitle(title)
        self.board = BoardView(self)
        self._windowed = self.geometry()
        self.rows = QVBoxLayout(self)
        self.rows.setContentsMargins(0, 0, 0, 0)
        self.rows.setSpacing(0)
        self.rows.addWidget(self.board, 1)

    def present(self, display: Display) -> None:
        """Open the window on the screen, in the size and on the scale that the configuration asks for."""
        self.board.mm_per_pixel = display.mm_per_pixel
        self.resize(display.width, display.height)
        if display.screen > 0:
            self.move(numbered_screen(display.screen).availableGeometry().topLeft())
        if display.fullscreen:
            self.fill_screen(True)
        else:
            self.show()

    def take_half(self, side: Side) -> None:
        """Take one half of the screen, beside the window of the other side, unless it takes the whole."""
        if self.isFullScreen():
            return
        room = screen_of(self).availableGeometry()
        room.setWidth(room.width() // 2)
        if side == "right":
            room.translate(room.width(), 0)
        self.setGeometry(room)

    def fill_screen(self, full: bool) -> None:
        """Take the whole screen, without frame and mouse pointer, or give it back.

        The size is set by hand too, for a bare X server has no window manager that would do it.
        """
        if full:
            self._windowed = self.geometry()
            self.setCursor(Qt.CursorShape.BlankCursor)
            self.setGeometry(screen_of(self).geometry())
            self.showFullScreen()
        else:
            self.unsetCursor()
            self.showNormal()
            self.setGeometry(self._windowed)

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802  (Qt's name)
        """Close or fill the screen."""
        if event.key() in (Qt.Key.Key_Escape, Qt.Key.Key_Q):
            self.close()
        elif event.key() == Qt.Key.Key_F11:
            self.fill_screen(not self.isFullScreen())
        else:
            super().keyPressEvent(event)

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: N802  (Qt's name)
        """Say that the window is closed."""
        super().closeEvent(event)
        self.closed.emit()
