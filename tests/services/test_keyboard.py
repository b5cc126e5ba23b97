"""Keys of a terminal (a pseudo-terminal), complete and in pieces."""

import os
import sys
from collections.abc import Iterator

import pytest

from netboard.services.keyboard import ARROWS, Keyboard

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="terminals are POSIX's here")

TIMEOUT = 60.0
"""A key is there long before, on a busy machine too [s]."""


@pytest.fixture
def fingers(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Where keys are pressed: the other end of this process's terminal."""
    ours, theirs = os.openpty()
    with os.fdopen(theirs) as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        yield ours
    os.close(ours)


def key(keyboard: Keyboard) -> str:
    while (pressed := keyboard.pressed(TIMEOUT)) is None:
        pass
    return pressed


def test_letters_and_arrows_are_told_apart(fingers: int) -> None:
    with Keyboard() as keyboard:
        assert keyboard.pressed() is None
        for sent, name in {b"q": "q", b" ": " ", **ARROWS}.items():
            os.write(fingers, sent)
            assert key(keyboard) == name


@pytest.mark.parametrize("first", [1, 2])
@pytest.mark.parametrize("sent", ARROWS)
def test_an_arrow_that_comes_in_pieces_is_one(fingers: int, sent: bytes, first: int) -> None:
    with Keyboard() as keyboard:
        os.write(fingers, sent[:first])
        assert keyboard.pressed(TIMEOUT) is None
        os.write(fingers, sent[first:])
        assert key(keyboard) == ARROWS[sent]


def test_what_is_no_arrow_after_all_is_the_key_that_it_is(fingers: int) -> None:
    with Keyboard() as keyboard:
        os.write(fingers, b"\x1b")
        assert keyboard.pressed(TIMEOUT) is None
        os.write(fingers, b"q")
        assert key(keyboard) == "q"
        os.write(fingers, b"\x1b[C")
        assert key(keyboard) == "right"


def test_where_there_is_no_terminal_no_key_ever_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    with open(os.devnull, encoding="utf-8") as nothing:  # noqa: PTH123  (it is no file)
        monkeypatch.setattr(sys, "stdin", nothing)
        with Keyboard() as keyboard:
            assert not keyboard.there
            assert keyboard.pressed() is None
