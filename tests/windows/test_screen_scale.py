"""True scale, selection of a screen, and the calibration with a card."""

from dataclasses import replace

import pytest
from display_parts import VIEW, WORDS

from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.tables.rig import Display
from netboard.windows.participant.screens import compose

CONFIG = Config()


@pytest.mark.parametrize("size", [(840, 480), (1300, 400), (500, 700)])
@pytest.mark.parametrize("mm_per_pixel", [0.5, 1.25])
def test_board_is_drawn_at_true_scale(app, size, mm_per_pixel):
    from netboard.windows.participant.window import BoardWindow

    window = BoardWindow("a test")
    window.present(Display(width=size[0], height=size[1], mm_per_pixel=mm_per_pixel))
    view = window.board
    view.show_picture(compose(VIEW, CONFIG, WORDS))
    app.processEvents()
    left, right, up = (view.pixel_at(point) for point in ((-0.1, 0.0), (0.1, 0.0), (-0.1, 0.1)))
    assert right.x() - left.x() == pytest.approx(200 / mm_per_pixel, abs=1e-6)
    assert left.y() - up.y() == pytest.approx(100 / mm_per_pixel, abs=1e-6)
    assert (left.x() + right.x()) / 2 == pytest.approx(view.width() / 2, abs=1)
    assert view.metres_across == pytest.approx(size[0] * mm_per_pixel * 1e-3)
    window.resize(size[0] - 100, size[1])
    app.processEvents()
    left, right = (view.pixel_at(point) for point in ((-0.1, 0.0), (0.1, 0.0)))
    assert right.x() - left.x() == pytest.approx(200 / mm_per_pixel, abs=1e-6)
    window.close()


def test_unknown_screen_is_refused_with_a_list_of_screens(app):
    from netboard.windows.participant.window import BoardWindow, in_words, screens

    window = BoardWindow("a test")
    with pytest.raises(ConfigError, match=r"\[display\] screen: found 7, expected one of these: 0: .* pixels at .* Hz"):
        window.present(replace(CONFIG.display, screen=7))
    assert in_words(0, screens()[0]).startswith("0: ")
    assert "mm per pixel" in in_words(0, screens()[0])


def press(window, key, shift=False):
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    QTest.keyClick(window, key, Qt.KeyboardModifier.ShiftModifier if shift else Qt.KeyboardModifier.NoModifier)


def test_matching_the_card_measures_the_pixel_size(app):
    from PySide6.QtCore import Qt

    from netboard.windows.participant.screen_size import CalibrationWindow

    window = CalibrationWindow(0.0)
    window.resize(1200, 800)
    window.show()
    assert window.mm_per_pixel == pytest.approx(0.25, rel=2e-3)
    pixels = round(85.60 / window.mm_per_pixel)
    for key, shift in ((Qt.Key.Key_Right, True), (Qt.Key.Key_Right, False), (Qt.Key.Key_Left, False)):
        press(window, key, shift)
    assert window.mm_per_pixel == pytest.approx(85.60 / (pixels + 10))
    image = window.grab().toImage()
    row = [image.pixelColor(x, round(0.42 * 800)).lightness() for x in range(1200)]
    bright = [x for x, light in enumerate(row) if light > 50]
    assert bright[-1] - bright[0] == pytest.approx(pixels + 10, abs=2)
    closed = []
    window.closed.connect(lambda: closed.append(True))
    press(window, Qt.Key.Key_Return)
    assert (closed, window.done) == ([True], True)


def test_escape_cancels_the_calibration(app):
    from PySide6.QtCore import Qt

    from netboard.windows.participant.screen_size import CalibrationWindow

    window = CalibrationWindow(0.3)
    window.show()
    press(window, Qt.Key.Key_Escape)
    assert not window.done


def test_return_key_completes_the_calibration(app):
    from PySide6.QtCore import Qt, QTimer

    from netboard.windows.participant.screen_size import CalibrationWindow, calibrate

    def enter():
        windows = [w for w in app.topLevelWidgets() if isinstance(w, CalibrationWindow) and w.isVisible()]
        for window in windows:
            press(window, Qt.Key.Key_Return)

    QTimer.singleShot(0, enter)
    size, screen = calibrate(0)
    assert size == pytest.approx(0.254, rel=0.01)
    assert screen.startswith("0: ")


def test_screen_commands_print_the_screens_and_the_pixel_size(app, capsys, monkeypatch):
    from netboard.services import display
    from netboard.windows.participant import screen_size

    display.print_screens()
    assert capsys.readouterr().out.startswith("0: ")
    monkeypatch.setattr(screen_size, "calibrate", lambda _: (0.2768, "0: a screen"))
    assert display.measure_pixels(CONFIG) == 0
    assert "mm_per_pixel = 0.2768" in capsys.readouterr().out
    monkeypatch.setattr(screen_size, "calibrate", lambda _: (None, "0: a screen"))
    assert display.measure_pixels(CONFIG) == 1
