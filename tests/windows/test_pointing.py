"""Conversion of mouse, touch and key input to a stylus height in metres."""

import pytest
from display_parts import WORDS

from netboard.base.config import Config
from netboard.base.tables.rig import Display
from netboard.windows.participant.scene import extent
from netboard.windows.participant.screens import blank

REACH = 0.075
FRAME = 0.003
"""The window frame, which offscreen Qt adds to touch positions [m]."""


class PointingRig:
    """A window of a given size that logs the player's height."""

    def __init__(self, app, size=(840, 480), keys=False):
        from netboard.windows.participant.playing import Pointing
        from netboard.windows.participant.window import BoardWindow

        self.app = app
        self.window = BoardWindow("a test")
        self.window.present(Display(width=size[0], height=size[1]))
        self.window.board.show_picture(blank(Config(), WORDS, ""))
        self.settle()
        self.pointing = Pointing(self.window, REACH, keys=keys)
        self.heights = []
        self.pointing.moved.connect(lambda: self.heights.append(self.pointing.height))

    def close(self):
        self.pointing.close()
        self.window.close()

    def settle(self):
        for _ in range(20):
            self.app.processEvents()

    def metres_at(self, pixel):
        """Height of a pixel, computed from the size of the window alone."""
        board = self.window.board
        width, height = extent(Config())
        scale = min(board.width() / width, board.height() / height)
        return (board.height() / 2 - pixel) / scale

    def move_mouse(self, x, y):
        from PySide6.QtCore import QEvent, QPointF, Qt
        from PySide6.QtGui import QMouseEvent

        surface, place = self.window.board, QPointF(x, y)
        none = Qt.MouseButton.NoButton
        event = QMouseEvent(
            QEvent.Type.MouseMove, place, surface.mapToGlobal(place), none, none, Qt.KeyboardModifier.NoModifier
        )
        self.app.sendEvent(surface, event)


@pytest.fixture
def make(app):
    made = []

    def create(**options):
        made.append(PointingRig(app, **options))
        return made[-1]

    yield create
    for each in made:
        each.close()


@pytest.mark.parametrize("size", [(840, 480), (1200, 400), (500, 700)])
def test_pointer_height_is_converted_to_metres_of_the_scene(make, size):
    rig = make(size=size)
    assert rig.pointing.height is None
    middle = size[1] / 2
    for x, y in ((5, middle), (size[0] - 5, middle - 20.25), (size[0] / 2, middle + 30.5)):
        rig.move_mouse(x, y)
        assert rig.pointing.height == pytest.approx(rig.metres_at(y), abs=1e-6)
    assert len(rig.heights) == 3


def test_pointer_height_agrees_with_the_drawn_position(make):
    rig = make()
    place = rig.window.board.pixel_at((-0.25, 0.03))
    rig.move_mouse(place.x(), place.y())
    assert rig.pointing.height == pytest.approx(0.03, abs=1e-9)


def test_pointer_height_is_clipped_to_the_reach(make):
    rig = make()
    rig.move_mouse(10, 1)
    assert rig.pointing.height == REACH
    rig.move_mouse(10, 479)
    assert rig.pointing.height == -REACH


def test_stylus_stays_when_the_pointer_leaves_the_window(make):
    from PySide6.QtCore import QEvent

    rig = make()
    rig.move_mouse(100, 200)
    before = rig.pointing.height
    rig.app.sendEvent(rig.window.board, QEvent(QEvent.Type.Leave))
    rig.settle()
    assert rig.pointing.height == before


def test_touch_moves_the_stylus_like_a_mouse(make):
    from PySide6.QtCore import QPoint
    from PySide6.QtTest import QTest

    rig = make()
    surface, screen = rig.window.board, QTest.createTouchDevice()
    touch = QTest.touchEvent(surface, screen)
    touch.press(0, QPoint(100, 200)).commit()
    assert rig.pointing.height == pytest.approx(rig.metres_at(200), abs=FRAME)
    touch.move(0, QPoint(100, 220)).commit()
    touch.release(0, QPoint(100, 220)).commit()
    assert rig.pointing.height == pytest.approx(rig.metres_at(220), abs=FRAME)
    assert rig.heights[0] - rig.heights[-1] == pytest.approx(rig.metres_at(200) - rig.metres_at(220), abs=1e-6)


@pytest.mark.parametrize(("up", "down"), [("Key_Up", "Key_Down"), ("Key_W", "Key_S")])
def test_keys_raise_and_lower_the_stylus_and_release_stops_it(make, up, down):
    from display_parts import until
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    rig = make(keys=True)
    QTest.keyPress(rig.window, getattr(Qt.Key, up))
    assert until(rig.app, lambda: len(rig.heights) >= 6)
    QTest.keyRelease(rig.window, getattr(Qt.Key, up))
    top = rig.pointing.height
    assert rig.heights == sorted(rig.heights)
    assert top > 0
    rig.settle()
    assert rig.pointing.height == top
    QTest.keyPress(rig.window, getattr(Qt.Key, down))
    assert until(rig.app, lambda: rig.pointing.height < 0)
    QTest.keyPress(rig.window, getattr(Qt.Key, up))
    assert until(rig.app, lambda: rig.heights[-1] == rig.heights[-2])
    QTest.keyRelease(rig.window, getattr(Qt.Key, up))
    QTest.keyRelease(rig.window, getattr(Qt.Key, down))


def test_losing_focus_releases_the_keys(make):
    from display_parts import until
    from PySide6.QtCore import QEvent, Qt
    from PySide6.QtTest import QTest

    rig = make(keys=True)
    QTest.keyPress(rig.window, Qt.Key.Key_Up)
    assert until(rig.app, lambda: len(rig.heights) >= 2)
    rig.app.sendEvent(rig.window, QEvent(QEvent.Type.WindowDeactivate))
    left = rig.pointing.height
    rig.settle()
    assert rig.pointing.height == left


def test_mouse_is_ignored_in_keys_mode(make):
    rig = make(keys=True)
    rig.move_mouse(100, 100)
    assert rig.pointing.height is None


def test_escape_closes_a_playing_window_and_q_does_not(make):
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    rig = make()
    QTest.keyClick(rig.window, Qt.Key.Key_Q)
    assert rig.window.isVisible()
    QTest.keyClick(rig.window, Qt.Key.Key_Escape)
    assert not rig.window.isVisible()
