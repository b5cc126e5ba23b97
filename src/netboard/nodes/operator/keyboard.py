"""Keys of a terminal, one by one, as they are pressed."""

import os
import sys
from select import select
from typing import Any, Self

ARROWS = {b"\x1b[A": "up", b"\x1b[B": "down", b"\x1b[C": "right", b"\x1b[D": "left"}
"""What a terminal sends for the arrow keys."""

ARROW_PREFIXES = (b"\x1b", b"\x1b[")
"""Beginnings of an arrow key's code."""

_INPUT_FLAGS, _CHARACTERS = 0, 6
"""Places in the terminal's attributes, as `termios` lists them."""

MAX_BYTES = 64
"""Bytes read at once; what follows the first key was typed too fast to be meant [1]."""


class Keyboard:
    """A context in which the terminal's keys are read one by one; without a terminal there are none.

    ``all_keys``: read the keys that act on the terminal too, such as Ctrl-Z and Ctrl-S; only Ctrl-C interrupts.
    """

    def __init__(self, *, all_keys: bool = False) -> None:
        self._all_keys = all_keys
        self.available = sys.stdin.isatty() and os.name == "posix"
        self._before: list[Any] = []
        self._prefix = b""

    def __enter__(self) -> Self:
        if self.available:
            import termios  # noqa: PLC0415  (not on Windows)
            import tty  # noqa: PLC0415

            self._before = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin)
            if self._all_keys:
                self._disable_terminal_keys()
        return self

    def __exit__(self, *error: object) -> None:
        if self.available:
            import termios  # noqa: PLC0415

            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)

    def _disable_terminal_keys(self) -> None:
        """Let the keys that suspend or end the process, or hold the output, be read like any other."""
        import termios  # noqa: PLC0415

        attributes = termios.tcgetattr(sys.stdin)
        disabled = bytes([os.fpathconf(sys.stdin.fileno(), "PC_VDISABLE")])
        for name in ("VSUSP", "VDSUSP", "VQUIT"):
            if hasattr(termios, name):
                attributes[_CHARACTERS][getattr(termios, name)] = disabled
        attributes[_INPUT_FLAGS] &= ~termios.IXON
        termios.tcsetattr(sys.stdin, termios.TCSANOW, attributes)

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
