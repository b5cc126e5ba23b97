"""True scale, selection of a screen, and the calibration with a card."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

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


def screen(width, height, x=0, dpi=96):
    """Description of a screen for Qt's offscreen platform [pixels]."""
    return {
        "x": x, "y": 0, "width": width, "height": height,
        "logicalDpi": dpi, "logicalBaseDpi": 96, "dpr": 1.0,
    }  # fmt: skip


def run_on(folder, screens, code):
    """Run Python code on a computer with these screens, the primary one first; return what it prints."""
    for number, made in enumerate(screens):
        made["name"] = str(number)  # Qt sorts them by name
    description = {"synchronousWindowSystemEvents": False, "windowFrameMargins": True, "screens": screens}
    (folder / "screens.json").write_text(json.dumps(description))
    places = os.pathsep.join((str(Path(__file__).parent), *sys.path))
    platform = f"offscreen:configfile={folder / 'screens.json'}"
    environment = os.environ | {"QT_QPA_PLATFORM": platform, "PYTHONPATH": places}
    ran = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout.split()


CONSOLE = """
from netboard.base.config import Config
from netboard.windows.operator.client import run
from netboard.windows.participant.window import application, screen_of

def stop():
    window = application().activeWindow() or application().topLevelWidgets()[0]
    room, frame = screen_of(window).availableGeometry(), window.frameGeometry()
    print(room.contains(frame), window.geometry().contains(window.bar.mapTo(window, window.bar.rect().bottomRight())))
    return True

run(Config(), stop)
"""


@pytest.mark.sampled(1)
@pytest.mark.parametrize(("width", "height", "dpi"), [(1366, 768, 96), (1366, 768, 192), (1280, 1024, 96)])
def test_whole_console_fits_on_a_small_screen(app, tmp_path, width, height, dpi):
    assert run_on(tmp_path, [screen(width, height, dpi=dpi)], CONSOLE)[:2] == ["True", "True"]


DISPLAY = """
from netboard.base.tables.rig import Display
from netboard.windows.participant.window import BoardWindow, application

app = application()
for number, fullscreen in ((0, "always"), (1, "always"), (1, "never")):
    window = BoardWindow("a test")
    window.present(Display(screen=number, fullscreen=fullscreen, width=2000, height=1600))
    app.processEvents()
    place = window.frameGeometry()
    print(place.left(), place.width())
"""


def test_display_opens_on_its_screen_and_within_it(app, tmp_path):
    """The main screen is the right one, and a window may be configured larger than a screen."""
    found = run_on(tmp_path, [screen(1920, 1080, x=1280), screen(1280, 720)], DISPLAY)
    assert found[:4] == ["1280", "1920", "0", "1280"]
    left, width = map(int, found[4:])
    assert left == 0
    assert width <= 1280


MOVED = """
from display_parts import VIEW, WORDS
from netboard.base.config import Config
from netboard.base.tables.rig import Display
from netboard.windows.participant.screens import compose
from netboard.windows.participant.window import BoardWindow, application

app = application()
window = BoardWindow("a test")
window.present(Display(width=800, height=500, mm_per_pixel=0.25))
window.board.show_picture(compose(VIEW, Config(), WORDS))
app.processEvents()
for place in (10, 1300):
    window.move(place, 10)
    app.processEvents()
    left, right = (window.board.pixel_at(point).x() for point in ((-0.1, 0.0), (0.1, 0.0)))
    print(window.devicePixelRatioF(), round((right - left) * window.devicePixelRatioF() * 0.25))
"""


def test_board_keeps_its_true_size_on_a_screen_with_finer_pixels(app, tmp_path):
    found = run_on(tmp_path, [screen(1280, 720), screen(1920, 1080, x=1280, dpi=192)], MOVED)
    assert found == ["1.0", "200", "2.0", "200"]
