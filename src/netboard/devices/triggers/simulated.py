"""A trigger box without hardware, for pilots and tests: no electrical pulse is made.

With ``loopback`` each code comes back at its input at once.
"""

import os
from typing import ClassVar

from netboard.base.tables.triggers import Triggers
from netboard.devices.triggers.box import NO_FILE, TriggerBox

MAX_READ = 256
"""Codes read at once [1]."""


class SimulatedBox(TriggerBox):
    """Remembers the lines; its input is a pipe."""

    simulated: ClassVar[bool] = True
    has_input: ClassVar[bool] = True

    def __init__(self, triggers: Triggers) -> None:
        super().__init__(triggers)
        self.lines = 0
        self._input = self._output = NO_FILE

    @property
    def text(self) -> str:
        """What it is and where, in a few words."""
        return "simulated trigger box, no hardware"

    def open(self) -> None:
        """Begin with all lines low."""
        self._input, self._output = os.pipe()
        for end in (self._input, self._output):
            os.set_blocking(end, False)
        self.lines = 0

    def write(self, code: int) -> None:
        """Set the lines; a rise comes back at the input if it is wired so."""
        if code and self.settings.loopback:
            os.write(self._output, bytes((code,)))
        self.lines = code

    def read(self) -> bytes:
        """Return what came back."""
        try:
            return os.read(self._input, MAX_READ)
        except BlockingIOError:
            return b""

    @property
    def file(self) -> int:
        """The pipe's end."""
        return self._input

    def close(self) -> None:
        """Close the pipe."""
        for end in (self._input, self._output):
            if end != NO_FILE:
                os.close(end)
        self._input = self._output = NO_FILE
