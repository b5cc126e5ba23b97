"""Key presses on a pseudo-terminal, including split escape sequences."""

import os
import sys
from collections.abc import Iterator

import pytest

from netboard.nodes.operator.keyboard import ARROWS, Keyboard

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="terminals are POSIX's here")

TIMEOUT = 60.0
"""Time within which a key press arrives even on a busy machine [s]."""


@pytest.fixture
def terminal_end(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """The end of a pseudo-terminal into which key presses are written."""
    writing_end, reading_end = os.openpty()
    with os.fdopen(reading_end) as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        yield writing_end
    os.close(writing_end)


def key(keyboard: Keyboard) -> str:
    while (pressed := keyboard.pressed(TIMEOUT)) is None:
        pass
    return pressed


def test_letters_and_arrows_are_distinguished(terminal_end: int) -> None:
    with Keyboard() as keyboard:
        assert keyboard.pressed() is None
        for sent, name in {b"q": "q", b" ": " ", **ARROWS}.items():
            os.write(terminal_end, sent)
            assert key(keyboard) == name


@pytest.mark.parametrize("first", [1, 2])
@pytest.mark.parametrize("sent", ARROWS)
def test_split_arrow_sequence_is_read_as_one_key(terminal_end: int, sent: bytes, first: int) -> None:
    with Keyboard() as keyboard:
        os.write(terminal_end, sent[:first])
        assert keyboard.pressed(TIMEOUT) is None
        os.write(terminal_end, sent[first:])
        assert key(keyboard) == ARROWS[sent]


def test_escape_followed_by_a_letter_gives_the_letter(terminal_end: int) -> None:
    with Keyboard() as keyboard:
        os.write(terminal_end, b"\x1b")
        assert keyboard.pressed(TIMEOUT) is None
        os.write(terminal_end, b"q")
        assert key(keyboard) == "q"
        os.write(terminal_end, b"\x1b[C")
        assert key(keyboard) == "right"


def test_keyboard_reads_no_keys_without_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    with open(os.devnull, encoding="utf-8") as nothing:  # noqa: PTH123  (it is no file)
        monkeypatch.setattr(sys, "stdin", nothing)
        with Keyboard() as keyboard:
            assert not keyboard.available
            assert keyboard.pressed() is None
