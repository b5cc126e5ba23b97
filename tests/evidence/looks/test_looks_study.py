"""In every state of every window, at each size, all text is whole, and a key reaches every control."""

import os
from dataclasses import replace
from itertools import product

import pytest

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
pytest.importorskip("PySide6.QtWidgets", reason="Qt's libraries cannot be loaded here", exc_type=ImportError)

from PySide6.QtWidgets import QHBoxLayout, QLabel, QPushButton, QWidget

from evidence.looks import console_states
from evidence.looks.reading import cut_texts, unreached
from evidence.looks.study import SIZES, WINDOWS, opened, shown
from netboard.base.looks import DARK, LIGHT
from netboard.windows.participant.window import application
from netboard.windows.style import choose_theme, current_theme

CASES = [
    pytest.param(name, size, id=f"{name}-{size[0]}x{size[1]}", marks=[] if size == SIZES[0] else [pytest.mark.slow])
    for name, size in product(WINDOWS, SIZES)
]


@pytest.mark.parametrize(("name", "size"), CASES)
def test_all_text_is_whole_and_every_control_has_a_key(name: str, size: tuple[int, int]) -> None:
    found = {}
    with opened(name, size, "dark") as window:
        for state in WINDOWS[name].states:
            shown(name, window, state)
            assert (window.width(), window.height()) == size
            if lacking := cut_texts(window) + unreached(window):
                found[state] = lacking
    assert found == {}


def test_a_cut_text_and_a_control_without_a_key_are_found() -> None:
    application()
    window = QWidget()
    row = QHBoxLayout(window)
    words, button = QLabel("some words that have no room"), QPushButton("no key")
    words.setStyleSheet("font-size: 14px;")
    button.setStyleSheet("font-size: 14px;")
    button.setFocusPolicy(button.focusPolicy().NoFocus)
    row.addWidget(words)
    row.addWidget(button)
    window.show()
    application().processEvents()
    assert (cut_texts(window), unreached(window)) == ([], ["no key"])
    words.setFixedWidth(30)
    application().processEvents()
    assert cut_texts(window) == ["some words that have no room"]
    window.close()


def test_console_takes_another_theme_while_it_is_open() -> None:
    with opened("console", SIZES[0], "dark") as window:
        shown("console", window, "running")
        dark = window.grab().toImage().pixelColor(3, 400).name()
        choose_theme("light")
        window.restyle()
        shown("console", window, "running")
        light = window.grab().toImage().pixelColor(3, 400).name()
        assert (dark, light) == (DARK.background.lower(), LIGHT.background.lower())
        assert current_theme() is LIGHT
    choose_theme("system")


def test_every_state_of_the_console_has_its_seats() -> None:
    with opened("console", SIZES[0], "dark") as window:
        shown("console", window, "running")
        assert window.rig["left"].text() == "LEFT  A: P07\nhaptic device: Touch, serial 4711"
        assert window.ahead.text() == f"Next: {', then '.join(console_states.AHEAD)}"
        window.show_state(replace(window.state, status=replace(window.state.status, opened=False)))
        assert window.ahead.text() == ""
