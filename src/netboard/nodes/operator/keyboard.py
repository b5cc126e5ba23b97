"""Keys of a terminal, one by one, as they are pressed."""

import sys
from typing import Self

from netboard.base.system.keys import key_reader

ARROWS = {b"\x1b[A": "up", b"\x1b[B": "down", b"\x1b[C": "right", b"\x1b[D": "left"}
"""What a terminal sends for the arrow keys."""

ARROW_PREFIXES = (b"\x1b", b"\x1b[")
"""Beginnings of an arrow key's code."""

MAX_BYTES = 64
"""Bytes read at once; what follows the first key was typed too fast to be meant [1]."""


class Keyboard:
    """A context in which the terminal's keys are read one by one; without a terminal there are none.

    ``all_keys``: read the keys that act on the terminal too, such as Ctrl-Z and Ctrl-S; only Ctrl-C interrupts.
    """

    def __init__(self, *, all_keys: bool = False) -> None:
        self._all_keys = all_keys
        self.available = sys.stdin.isatty()
        self._keys = key_reader()
        self._prefix = b""

    def __enter__(self) -> Self:
        if self.available:
            self._keys.begin(all_keys=self._all_keys)
        return self

    def __exit__(self, *error: object) -> None:
        if self.available:
            self._keys.end()

    def _read(self, seconds: float) -> bytes | None:
        """Return what was typed; None without a key in this time, or without a terminal."""
        return self._keys.read(seconds, MAX_BYTES) if self.available else None

    def touched(self, seconds: float = 0.0) -> bool:
        """Return whether any key was pressed, Esc too, or the terminal is gone."""
        return self._read(seconds) is not None

    def pressed(self, seconds: float = 0.0) -> str | None:
        """Return the key that was pressed: a letter, or ``left``, ``right``, ``up`` or ``down``; None without one.

        It is empty once the terminal is gone.
        """
        read = self._read(seconds)
        if read is None:
            return None
        received = self._prefix + read
        self._prefix = received if read and received in ARROW_PREFIXES else b""
        if self._prefix:
            return None
        return ARROWS.get(received[:3]) or read[:1].decode(errors="replace")
