"""A parallel port as a trigger box, by Linux' ``ppdev``: the data lines D0 to D7 (pins 2 to 9) show the code.

The input is nACK (pin 10), whose edge raises an interrupt: a pulse there is seen without polling. A port on a PCI
Express card works like one on the mainboard; a USB-to-parallel cable does not, because it is a printer port only.
"""

import os
import struct
from collections.abc import Callable
from typing import Any, ClassVar

from netboard.base.errors import DeviceLost
from netboard.base.system.device_files import ioctl, open_device
from netboard.base.tables.triggers import Triggers
from netboard.devices.triggers.box import NO_FILE, TriggerBox, cannot_open

DEFAULT = "/dev/parport0"

# From <linux/ppdev.h>
PPEXCL, PPCLAIM, PPRELEASE = 0x708F, 0x708B, 0x708C
PPWDATA, PPCLRIRQ = 0x40017086, 0x80047093

EDGE = b"\1"
"""Code of a pulse at the input, which is one line."""

MAX_EDGES = 255
"""Edges reported at once [1]."""


class ParallelPort(TriggerBox):
    """The data lines of a parallel port. ``ioctl``: the system call that drives it."""

    has_input: ClassVar[bool] = True

    def __init__(self, triggers: Triggers, ioctl: Callable[..., Any] = ioctl) -> None:
        super().__init__(triggers)
        self._address = triggers.address or DEFAULT
        self._ioctl = ioctl
        self._file = NO_FILE

    @property
    def text(self) -> str:
        """What it is and where, in a few words."""
        return f"parallel port {self._address}"

    def open(self) -> None:
        """Claim the port for this process alone, with all lines low."""
        try:
            self._file = open_device(self._address)
            self._ioctl(self._file, PPEXCL)
            self._ioctl(self._file, PPCLAIM)
            self._set(0)
            self._edges()  # those from before
        except OSError as error:
            self.close()
            raise cannot_open(self._address, error) from error

    def write(self, code: int) -> None:
        """Set the data lines."""
        try:
            self._set(code)
        except OSError as error:
            raise DeviceLost(f"the {self.text} has failed: {error.strerror}") from error

    def read(self) -> bytes:
        """Return one code for each edge at nACK."""
        try:
            return EDGE * min(self._edges(), MAX_EDGES)
        except OSError as error:
            raise DeviceLost(f"the {self.text} has failed: {error.strerror}") from error

    @property
    def file(self) -> int:
        """The port's file, which is readable after an interrupt."""
        return self._file

    def close(self) -> None:
        """Release and close the port."""
        file, self._file = self._file, NO_FILE
        if file != NO_FILE:
            os.close(file)  # which releases it, too

    def _set(self, code: int) -> None:
        self._ioctl(self._file, PPWDATA, bytes((code,)))

    def _edges(self) -> int:
        """Return the number of interrupts since the last call [1]."""
        (count,) = struct.unpack("i", self._ioctl(self._file, PPCLRIRQ, bytes(4)))
        return int(count)
