"""What the tests of the console share: Qt without a screen, a window, and a server for it."""

import os

import pytest
from console_server import ConsoleServer

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")


@pytest.fixture
def app():
    pytest.importorskip("PySide6.QtWidgets", reason="Qt's libraries cannot be loaded here", exc_type=ImportError)
    from netboard.display.window import application

    return application()


@pytest.fixture
def server():
    made = ConsoleServer()
    yield made
    made.close()
