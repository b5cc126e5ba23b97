"""What the tests of the display share: Qt without a screen."""

import os

import pytest

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")


@pytest.fixture
def app():
    pytest.importorskip("PySide6.QtWidgets", reason="Qt's libraries cannot be loaded here", exc_type=ImportError)
    from netboard.display.window import application

    return application()


@pytest.fixture
def board(app):
    """The board of an open window, and the pictures it has been painted with so far."""
    from netboard.display.window import BoardWindow
    from netboard.tables.rig import Display

    window = BoardWindow("a test")
    window.present(Display(width=840, height=480))
    paints = []
    window.board.painted.connect(lambda: paints.append(window.board.picture))
    for _ in range(20):  # until the window system has said all it says about a new window
        app.processEvents()
    yield window.board, paints
    window.close()
