"""Keys of a terminal, as they are pressed, without Enter and without an echo.

POSIX: termios and select. Windows: the console's own functions, asked every few milliseconds, which is far below the
time of a hand. What a reader returns is what a POSIX terminal sends.
"""

import os
import sys
import time
from select import select
from types import ModuleType
from typing import Any, Protocol

if sys.platform != "win32":
    import termios
    import tty

_INPUT_FLAGS, _CHARACTERS = 0, 6
"""Places in the terminal's attributes, as `termios` lists them."""

LOOK_INTERVAL_S = 0.005
"""Interval of questions to a Windows console [s]."""

WINDOWS_ARROWS = {"H": b"\x1b[A", "P": b"\x1b[B", "M": b"\x1b[C", "K": b"\x1b[D"}
"""Codes of the arrow keys on POSIX, by the second character that a Windows console has for them."""

WINDOWS_PREFIXES = ("\x00", "\xe0")
"""First character of a Windows console for keys without a letter."""


class KeyReader(Protocol):
    """Reads the keys of the terminal at the standard input."""

    def begin(self, *, all_keys: bool) -> None:
        """Read keys one by one. ``all_keys``: those that act on the terminal too; only Ctrl-C interrupts."""

    def end(self) -> None:
        """Give the terminal back as it was."""

    def read(self, seconds: float, most: int) -> bytes | None:
        """Return what was typed, up to ``most`` bytes; None without a key in this time, empty without a terminal."""


class PosixKeys:
    """A POSIX terminal."""

    def __init__(self) -> None:
        self._before: list[Any] = []

    def begin(self, *, all_keys: bool) -> None:
        """Switch the terminal to single characters."""
        if sys.platform != "win32":
            self._before = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin)
            if all_keys:
                self._disable_terminal_keys()

    def _disable_terminal_keys(self) -> None:
        """Let the keys that suspend or end the process, or hold the output, be read like any other."""
        if sys.platform != "win32":
            attributes = termios.tcgetattr(sys.stdin)
            disabled = bytes([os.fpathconf(sys.stdin.fileno(), "PC_VDISABLE")])
            for name in ("VSUSP", "VDSUSP", "VQUIT"):
                if hasattr(termios, name):
                    attributes[_CHARACTERS][getattr(termios, name)] = disabled
            attributes[_INPUT_FLAGS] &= ~termios.IXON
            termios.tcsetattr(sys.stdin, termios.TCSANOW, attributes)

    def end(self) -> None:
        """Switch the terminal back."""
        if sys.platform != "win32":
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)

    def read(self, seconds: float, most: int) -> bytes | None:
        """Wait for the terminal and read it."""
        if not select([sys.stdin], [], [], seconds)[0]:
            return None
        return os.read(sys.stdin.fileno(), most)


class WindowsKeys:
    """A Windows console. ``console``: the module `msvcrt`, or a stand-in."""

    def __init__(self, console: ModuleType) -> None:
        self._console = console

    def begin(self, *, all_keys: bool) -> None:
        """Do nothing: the console's functions read single keys anyway, and only Ctrl-C interrupts."""

    def end(self) -> None:
        """Do nothing."""

    def read(self, seconds: float, most: int) -> bytes | None:
        """Ask until a key was pressed, and take all that were."""
        until = time.monotonic() + seconds
        while not self._console.kbhit():
            if time.monotonic() >= until:
                return None
            time.sleep(LOOK_INTERVAL_S)
        typed = b""
        while self._console.kbhit() and len(typed) < most:
            typed += self._key()
        return typed

    def _key(self) -> bytes:
        """Return one key; a null character for one that has neither a letter nor an arrow."""
        first = self._console.getwch()
        if first in WINDOWS_PREFIXES:
            return WINDOWS_ARROWS.get(self._console.getwch(), b"\0")
        return str(first).encode()


def key_reader() -> KeyReader:
    """Return the reader for this system."""
    if sys.platform == "win32":
        import msvcrt  # noqa: PLC0415  (only there)

        return WindowsKeys(msvcrt)
    return PosixKeys()
