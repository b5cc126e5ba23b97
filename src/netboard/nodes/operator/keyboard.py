"""Keys of a terminal, one by one, as they are pressed."""

import os
import sys
from select import select
from typing import Any, Self

ARROWS = {b"\x1b[A": "up", b"\x1b[B": "down", b"\x1b[C": "right", b"\x1b[D": "left"}
"""What a terminal sends for the arrow keys."""

ARROW_PREFIXES = (b"\x1b", b"\x1b[")
"""Beginnings of an arrow key's code."""

MAX_BYTES = 64
"""Bytes read at once; what follows the first key was typed too fast to be meant [1]."""


class Keyboard:
    """A context in which the terminal's keys are read one by one; without a terminal there are none."""

    def __init__(self) -> None:
        self.available = sys.stdin.isatty() and os.name == "posix"
        self._before: list[Any] = []
        self._prefix = b""

    def __enter__(self) -> Self:
        if self.available:
            import termios  # noqa: PLC0415  (not on Windows)
            import tty  # noqa: PLC0415

            self._before = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin)
        return self

    def __exit__(self, *error: object) -> None:
        if self.available:
            import termios  # noqa: PLC0415

            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)

    def touched(self, seconds: float = 0.0) -> bool:
        """Return whether any key was pressed, Esc too, or the terminal is gone."""
        if not self.available or not select([sys.stdin], [], [], seconds)[0]:
            return False
        os.read(sys.stdin.fileno(), MAX_BYTES)
        return True

    def pressed(self, seconds: float = 0.0) -> str | None:
        """Return the key that was pressed: a letter, or ``left``, ``right``, ``up`` or ``down``; None without one.

        It is empty once the terminal is gone.
        """
        if not self.available or not select([sys.stdin], [], [], seconds)[0]:
            return None
        read = os.read(sys.stdin.fileno(), MAX_BYTES)
        received = self._prefix + read
        self._prefix = received if read and received in ARROW_PREFIXES else b""
        if self._prefix:
            return None
        return ARROWS.get(received[:3]) or read[:1].decode(errors="replace")
