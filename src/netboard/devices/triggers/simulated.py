"""A trigger box without hardware, for pilots and tests: no electrical pulse is made.

With ``loopback`` each code comes back at its input at once.
"""

import socket
from typing import ClassVar

from netboard.base.tables.triggers import Triggers
from netboard.devices.triggers.box import NO_FILE, TriggerBox

MAX_READ = 256
"""Codes read at once [1]."""


class SimulatedBox(TriggerBox):
    """Remembers the lines; its input is a pair of sockets."""

    simulated: ClassVar[bool] = True
    has_input: ClassVar[bool] = True

    def __init__(self, triggers: Triggers) -> None:
        super().__init__(triggers)
        self.lines = 0
        self._ends: tuple[socket.socket, ...] = ()

    @property
    def text(self) -> str:
        """What it is and where, in a few words."""
        return "simulated trigger box, no hardware"

    def open(self) -> None:
        """Begin with all lines low."""
        self._ends = socket.socketpair()  # which Windows can wait for, unlike a pipe
        for end in self._ends:
            end.setblocking(False)
        self.lines = 0

    def write(self, code: int) -> None:
        """Set the lines; a rise comes back at the input if it is wired so."""
        if code and self.settings.loopback:
            self._ends[1].send(bytes((code,)))
        self.lines = code

    def read(self) -> bytes:
        """Return what came back."""
        try:
            return self._ends[0].recv(MAX_READ)
        except BlockingIOError:
            return b""

    @property
    def file(self) -> int:
        """The socket's file."""
        return self._ends[0].fileno() if self._ends else NO_FILE

    def close(self) -> None:
        """Close the sockets."""
        for end in self._ends:
            end.close()
        self._ends = ()
