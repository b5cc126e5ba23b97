"""A participant's window: the board and nothing else. Esc or Q closes it, F11 switches to the whole screen and back."""

import logging
import os
import sys
from typing import cast

from PySide6.QtCore import QMessageLogContext, Qt, QtMsgType, Signal, qInstallMessageHandler
from PySide6.QtGui import QCloseEvent, QGuiApplication, QKeyEvent, QScreen
from PySide6.QtWidgets import QApplication, QVBoxLayout, QWidget

from netboard.config import Display
from netboard.display.widget import BoardView

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


def screen_of(widget: QWidget) -> QScreen:
    """Find the screen a widget is on.

    Not by `QWidget.screen`: the binding would give Python the screen as the widget's child, to be deleted with it.
    """
    return QGuiApplication.screenAt(widget.geometry().center()) or QGuiApplication.primaryScreen()


class BoardWindow(QWidget):
    """A window that shows a `BoardView`.

    Signals
    -------
    closed
        When the window has been closed.
    """

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
        """Open the window in the size the configuration asks for."""
        self.resize(display.width, display.height)
        if display.fullscreen:
            self.fill_screen(True)
        else:
            self.show()

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
