"""The board view paints the right colours in the right places, and repaints only for new pictures."""

import gc
import sys
from dataclasses import replace

import pytest
from display_parts import VIEW, WORDS

from netboard.base.config import Config
from netboard.base.errors import NetboardError
from netboard.base.tables.experiment import Session
from netboard.base.tables.rig import Display
from netboard.windows.participant import screens
from netboard.windows.participant.grip import grip_of
from netboard.windows.participant.scene import COLOURS, PictureState, extent
from netboard.windows.participant.shapes import SMALLEST_LETTERS, Text
from netboard.windows.participant.widget import _fitting_letters

CONFIG = Config()


def compose(view, config=CONFIG, **more):
    return screens.compose(view, config, WORDS, **more)


def name_of(colour):
    """Name of a colour, as Qt writes that of a pixel."""
    from PySide6.QtGui import QColor

    return QColor(colour).name()


def colour_at(view, point):
    """Colour of the pixel at a position in metres, computed from the widget's size alone."""
    width, height = extent(CONFIG)
    scale = min(view.width() / width, view.height() / height)
    x, y = view.width() / 2 + point[0] * scale, view.height() / 2 - point[1] * scale
    return view.grab().toImage().pixelColor(int(x), int(y)).name()


@pytest.mark.parametrize("size", [(840, 480), (1200, 400), (500, 700)])
def test_board_view_paints_each_part_in_its_colour_and_place(app, board, size):
    view, _ = board
    view.window().resize(*size)
    app.processEvents()
    picture = compose(replace(VIEW, theta=0.1, z=0.02, p=-0.05, left=-0.01))
    view.show_picture(picture)
    app.processEvents()
    target = [sum(corner[i] for corner in picture.target) / 4 for i in (0, 1)]
    colours = picture.colours
    corner, next_corner = picture.stripe[1:3]  # along the width of the stripe, whose middle is that of the ball
    beside = [ball + 3 * (b - a) for ball, a, b in zip(picture.ball, corner, next_corner, strict=True)]
    assert colour_at(view, picture.ball) == name_of(colours.background)
    assert colour_at(view, beside) == name_of(colours.ball)
    assert colour_at(view, target) == name_of(colours.target)
    assert colour_at(view, picture.handles[1]) == name_of(colours.background)
    assert colour_at(view, (0.0, 0.02)) == name_of(colours.board)
    assert colour_at(view, (0.0, -0.05)) == name_of(colours.background)
    x, y = picture.cursors[0]
    assert colour_at(view, (x, y + 0.011)) == name_of(colours.cursor)


@pytest.mark.parametrize("size", [(1280, 720), (640, 480)])
def test_long_instructions_get_smaller_letters_and_end_above_the_notice(app, board, size):
    view, _ = board
    view.window().resize(*size)
    words = "Bring the ball into the target. " * 30 + "END"
    config = replace(CONFIG, block=replace(CONFIG.block, instructions=words))
    view.show_picture(compose(replace(VIEW, phase="idle"), config))
    app.processEvents()
    image = view.grab().toImage()
    gap = [image.pixelColor(x, round(0.875 * view.height())).name() for x in range(view.width())]
    assert set(gap) == {name_of(view.picture.colours.background)}
    (text,) = [part for part in view._parts if isinstance(part, Text)]
    assert SMALLEST_LETTERS < _fitting_letters(text) < text.letters


@pytest.mark.parametrize("phase", ["holding", "succeeded", "paused"])
def test_target_colour_follows_the_picture_state(app, board, phase):
    view, _ = board
    view.show_picture(compose(replace(VIEW, phase=phase)))
    app.processEvents()
    assert colour_at(view, (0.15, 0.0)) == name_of(view.picture.colours.target)
    assert view.picture.colours.target != COLOURS[PictureState.RUN].target


def test_each_new_picture_is_painted_once_and_an_equal_one_never(app, board):
    view, paints = board
    view.show_picture(compose(VIEW))
    for _ in range(20):
        app.processEvents()
    paints.clear()
    for tick in range(20):
        assert not view.show_picture(compose(replace(VIEW, tick=tick, sent_ns=tick)))
        app.processEvents()
    assert paints == []
    for step in range(1, 6):
        assert view.show_picture(compose(replace(VIEW, theta=step * 0.01)))
        app.processEvents()
        assert len(paints) == step


def test_partial_repaints_match_a_full_repaint(app, board):
    """Only changed regions are repainted; no part of an older picture remains and no part of the new one is missing."""
    view, _ = board
    pilot = replace(CONFIG, session=Session(pilot=True), display=Display(patch=True))
    tilted = replace(VIEW, theta=0.1, z=0.02, p=0.1, left=0.03)
    sequence = [
        compose(VIEW),
        compose(tilted),
        compose(replace(tilted, phase="holding", share=0.5)),
        replace(compose(tilted), grip=grip_of(tilted, CONFIG, WORDS, "left", -0.03, 2.0, keys=False)),
        replace(compose(tilted), grip=grip_of(tilted, CONFIG, WORDS, "left", 0.04, -0.5, keys=False)),
        compose(replace(VIEW, phase="levelling", theta=-0.05, share=0.4), pilot),
        compose(replace(VIEW, phase="levelling", share=0.6), pilot),
        compose(replace(VIEW, phase="idle")),
        compose(replace(VIEW, p=None)),
        screens.blank(CONFIG, WORDS, "", lost=True),
    ]
    for picture in sequence:
        view.show_picture(picture)
        app.processEvents()
        repainted_in_parts = app.primaryScreen().grabWindow(view.window().winId()).toImage()
        assert repainted_in_parts == view.window().grab().toImage().convertToFormat(repainted_in_parts.format())


def test_blank_picture_removes_the_board(app, board):
    view, _ = board
    view.show_picture(compose(replace(VIEW, phase="levelling", right=0.02)))
    app.processEvents()
    view.show_picture(screens.blank(CONFIG, WORDS, "", lost=True))
    app.processEvents()
    image = view.grab().toImage()
    colours = {image.pixelColor(x, y).name() for x in range(0, 840, 5) for y in range(0, 480, 5)}
    assert colours == {name_of(COLOURS[PictureState.LOST].background)}


def test_screenshot_never_overwrites_a_file(app, board, tmp_path):
    from PySide6.QtGui import QImage

    from netboard.windows.participant.window import screenshot

    view, _ = board
    view.show_picture(compose(VIEW))
    path = tmp_path / "shots" / "left.png"
    screenshot(view, path)
    assert QImage(str(path)).width() == 840
    before = path.read_bytes()
    with pytest.raises(NetboardError, match="already exists"):
        screenshot(view, path)
    assert path.read_bytes() == before


def test_f11_toggles_full_screen_and_escape_closes_the_window(app):
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    from netboard.windows.participant.window import BoardWindow, screen_of

    window = BoardWindow("netboard: left station")
    closed = []
    window.closed.connect(lambda: closed.append(True))
    window.present(Display(width=640, height=400))
    assert (window.width(), window.board.height()) == (640, 400)
    QTest.keyClick(window, Qt.Key.Key_F11)
    assert window.isFullScreen()
    assert window.size() == screen_of(window).size()
    QTest.keyClick(window, Qt.Key.Key_F11)
    assert not window.isFullScreen()
    assert (window.width(), window.height()) == (640, 400)
    QTest.keyClick(window, Qt.Key.Key_Escape)
    assert closed == [True]


@pytest.mark.slow
def test_screen_object_outlives_the_window(app):
    from netboard.windows.participant.window import BoardWindow, screen_of

    for _ in range(3):
        window = BoardWindow("a test")
        window.present(Display(width=640, height=400))
        assert screen_of(window).refreshRate() > 0
        window.close()
        del window
        gc.collect()
    assert app.primaryScreen().size().width() > 0


@pytest.mark.skipif(sys.version_info >= (3, 12), reason="None is immortal here and cannot be lost")
def test_qt_binding_does_not_drop_references_to_none(app):
    """PySide6 6.12.0 drops a reference to None in every call, until Python 3.11 aborts after some thousand of them."""
    before = sys.getrefcount(None)
    for _ in range(1000):
        app.processEvents()
    assert sys.getrefcount(None) > before - 500
