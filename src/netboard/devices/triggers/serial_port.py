"""A trigger box at a serial port, also one by USB: it gets one byte for a code, and byte 0 for low lines.

Bytes that the box sends are input pulses: an Arduino sends one for each rising edge at its input (see the how-to guide
on triggers). What a USB serial chip delays is not seen here: the time of a write is the time at which the kernel has
the byte.
"""

import errno
import logging
from importlib import import_module
from io import UnsupportedOperation
from typing import Any, ClassVar

from netboard.base.errors import DeviceError, DeviceLost, DeviceNotFound, DeviceTimeout
from netboard.base.tables.triggers import Triggers
from netboard.devices.triggers.box import NO_FILE, TriggerBox, cannot_open

log = logging.getLogger(__name__)

WRITE_SECONDS = 0.05
"""Timeout of a write, so that a box that takes no byte does not delay the codes that follow [s]."""

MAX_READ = 256
"""Bytes read at once [1]."""


class SerialBox(TriggerBox):
    """A box that gets one byte for each code."""

    has_input: ClassVar[bool] = True

    def __init__(self, triggers: Triggers) -> None:
        super().__init__(triggers)
        self._address = triggers.address
        self._port: Any = None
        self._library: Any = None

    @property
    def text(self) -> str:
        """What it is and where, in a few words."""
        return f"serial box at {self._address or 'the only USB serial port'}"

    def open(self) -> None:
        """Open the port for this process alone, with all lines low."""
        try:
            self._library = import_module("serial")
        except ImportError as error:
            raise DeviceNotFound('a serial trigger box needs pyserial: pip install "netboard[triggers]"') from error
        self._address = self.settings.address or self._only_port()
        try:
            self._port = self._library.Serial(
                self._address, self.settings.baud, timeout=0, write_timeout=WRITE_SECONDS, exclusive=True
            )
        except (OSError, ValueError) as error:  # pyserial's own error is an OSError
            raise cannot_open(self._address, error if isinstance(error, OSError) else OSError(str(error))) from error
        self._lower_latency()
        try:
            self.write(0)
        except DeviceError as error:
            self.close()  # or this process's own lock would refuse the next attempt
            raise DeviceNotFound(str(error)) from error

    def write(self, code: int) -> None:
        """Send one byte."""
        try:
            self._port.write(bytes((code,)))
        except self._library.SerialTimeoutException as error:
            raise DeviceTimeout(f"the {self.text} takes no bytes") from error
        except OSError as error:
            raise self._lost(error) from error

    def read(self) -> bytes:
        """Return the bytes that the box has sent."""
        try:
            found: bytes = self._port.read(MAX_READ)
        except OSError as error:
            raise self._lost(error) from error
        return found

    @property
    def file(self) -> int:
        """The port's file; pyserial has none on Windows, where the input is read at each wake-up instead."""
        try:
            return NO_FILE if self._port is None else int(self._port.fileno())
        except UnsupportedOperation:
            return NO_FILE

    def close(self) -> None:
        """Close the port."""
        port, self._port = self._port, None
        if port is not None:
            try:
                port.close()
            except OSError as error:
                log.debug("the %s was closed with an error: %s", self.text, error)

    def _lower_latency(self) -> None:
        """Ask the driver not to collect input for up to 16 ms, as FTDI's does; others have no such mode."""
        try:
            self._port.set_low_latency_mode(True)
        except (OSError, ValueError, AttributeError) as error:
            log.debug("%s: no low-latency mode: %s", self._address, error)

    def _only_port(self) -> str:
        """Return the only USB serial port of this machine."""
        ports = import_module("serial.tools.list_ports").comports()
        found = {port.device: port.description for port in ports if port.vid is not None}
        if len(found) == 1:
            return str(next(iter(found)))
        listed = ", ".join(f"{device} ({text})" for device, text in sorted(found.items())) or "none"
        raise DeviceNotFound(f"[triggers] address: expected the serial port of the trigger box; USB has: {listed}")

    def _lost(self, error: OSError) -> DeviceLost:
        cause = error.__context__  # pyserial's own error has no number
        number = error.errno or (cause.errno if isinstance(cause, OSError) else None)
        said = error.strerror or str(error)
        unplugged = number in (errno.EIO, errno.ENXIO, errno.ENODEV) or "disconnected" in said
        return DeviceLost(f"the {self.text} was unplugged" if unplugged else f"the {self.text} has failed: {said}")
