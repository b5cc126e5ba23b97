"""From mouse, finger and keys to a height in metres."""

import pytest
from display_parts import WORDS

from netboard.base.config import Config
from netboard.base.tables.rig import Display
from netboard.windows.participant.scene import extent
from netboard.windows.participant.screens import blank

REACH = 0.075
FRAME = 0.003
"""The window's frame, which Qt without a screen counts in for fingers [m]."""


class Pointed:
    """A window of a size, whose player's height is followed."""

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
        """Height of a pixel by the size of the window alone."""
        board = self.window.board
        width, height = extent(Config())
        scale = min(board.width() / width, board.height() / height)
        return (board.height() / 2 - pixel) / scale

    def mouse(self, x, y):
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

    def one(**how):
        made.append(Pointed(app, **how))
        return made[-1]

    yield one
    for each in made:
        each.close()


@pytest.mark.parametrize("size", [(840, 480), (1200, 400), (500, 700)])
def test_a_pointer_s_height_is_that_of_the_scene(make, size):
    rig = make(size=size)
    assert rig.pointing.height is None
    middle = size[1] / 2
    for x, y in ((5, middle), (size[0] - 5, middle - 20.25), (size[0] / 2, middle + 30.5)):
        rig.mouse(x, y)
        assert rig.pointing.height == pytest.approx(rig.metres_at(y), abs=1e-6)
    assert len(rig.heights) == 3


def test_it_agrees_with_where_the_cursor_is_drawn(make):
    rig = make()
    place = rig.window.board.pixel_at((-0.25, 0.03))
    rig.mouse(place.x(), place.y())
    assert rig.pointing.height == pytest.approx(0.03, abs=1e-9)


def test_out_of_reach_is_the_end_of_the_reach(make):
    rig = make()
    rig.mouse(10, 1)
    assert rig.pointing.height == REACH
    rig.mouse(10, 479)
    assert rig.pointing.height == -REACH


def test_a_pointer_that_leaves_the_window_leaves_the_stylus(make):
    from PySide6.QtCore import QEvent

    rig = make()
    rig.mouse(100, 200)
    before = rig.pointing.height
    rig.app.sendEvent(rig.window.board, QEvent(QEvent.Type.Leave))
    rig.settle()
    assert rig.pointing.height == before


def test_a_finger_is_a_pointer(make):
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
def test_keys_lift_and_lower_and_let_it_stay(make, up, down):
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


def test_a_window_that_is_left_holds_no_key(make):
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


def test_where_keys_alone_play_the_pointer_does_nothing(make):
    rig = make(keys=True)
    rig.mouse(100, 100)
    assert rig.pointing.height is None


def test_q_beside_w_closes_no_played_window_and_escape_does(make):
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    rig = make()
    QTest.keyClick(rig.window, Qt.Key.Key_Q)
    assert rig.window.isVisible()
    QTest.keyClick(rig.window, Qt.Key.Key_Escape)
    assert not rig.window.isVisible()
