"""Shared fixtures of the window tests: Qt without a screen, a window, and a server for it."""

import os

import pytest
from console_server import ConsoleServer

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")


@pytest.fixture
def app():
    pytest.importorskip("PySide6.QtWidgets", reason="Qt's libraries cannot be loaded here", exc_type=ImportError)
    from netboard.windows.participant.window import application

    return application()


@pytest.fixture
def board(app):
    """The board view of an open window, and the list of pictures painted so far."""
    from netboard.base.tables.rig import Display
    from netboard.windows.participant.window import BoardWindow

    window = BoardWindow("a test")
    window.present(Display(width=840, height=480))
    paints = []
    window.board.painted.connect(lambda: paints.append(window.board.picture))
    for _ in range(20):  # until the window system has delivered all events of a new window
        app.processEvents()
    yield window.board, paints
    window.close()


@pytest.fixture
def server():
    made = ConsoleServer()
    yield made
    made.close()
