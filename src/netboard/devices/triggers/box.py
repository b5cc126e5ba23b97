"""The interface of a trigger box: eight output lines that show a code, and an input that reports pulses.

A box knows no clock: its caller reads one before and after each write. It raises `DeviceNotFound` if it cannot be
opened, and `DeviceLost` or `DeviceTimeout` once it is open, each in words that say what to do.
"""

import errno
import logging
from abc import ABC, abstractmethod
from pathlib import Path
from typing import ClassVar, Self

from netboard.base.errors import DeviceError, DeviceNotFound
from netboard.base.system.ownership import group_of
from netboard.base.tables.triggers import Triggers

log = logging.getLogger(__name__)

NO_FILE = -1
"""Number in place of the file of a box that signals no input."""


class TriggerBox(ABC):
    """A trigger box at an address; as a context it is open within it, and its lines are low afterwards."""

    simulated: ClassVar[bool] = False  # whether it stands in for hardware
    has_input: ClassVar[bool] = False  # whether it can report pulses at an input

    def __init__(self, triggers: Triggers) -> None:
        self.settings = triggers

    @property
    @abstractmethod
    def text(self) -> str:
        """What it is and where, in a few words."""

    @abstractmethod
    def open(self) -> None:
        """Open it, with all lines low; if that fails, leave it closed and raise `DeviceNotFound`."""

    @abstractmethod
    def write(self, code: int) -> None:
        """Set the lines to a code [1]; return once the operating system has it."""

    def read(self) -> bytes:
        """Return the codes of the input pulses since the last call, without waiting."""
        return b""

    @property
    def file(self) -> int:
        """Number of a file that is readable while there is input, or `NO_FILE`."""
        return NO_FILE

    def lower(self) -> None:
        """Set all lines low before the box is closed; of one that takes no more codes, log so."""
        try:
            self.write(0)
        except DeviceError as error:
            log.warning("the lines of the %s may still show a code: %s", self.text, error)

    @abstractmethod
    def close(self) -> None:
        """Close it; closing it again does nothing."""

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, *error: object) -> None:
        try:
            self.lower()
        finally:
            self.close()


def cannot_open(path: str, error: OSError) -> DeviceNotFound:
    """Return why a file of a trigger box cannot be opened, and what to do."""
    if error.errno in (errno.EACCES, errno.EPERM):
        group = group_of(Path(path))
        advice = f"sudo usermod -aG {group} $USER, then log in again" if group else "ask for access to it"
        return DeviceNotFound(
            f"no permission to open {path}" + (f" of the group {group}" if group else "") + f": {advice}"
        )
    if error.errno in (errno.EBUSY, errno.EAGAIN):
        return DeviceNotFound(f"{path} is used by another program: close that program first")
    if error.errno in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        return DeviceNotFound(f"{path}: no such port; is the box plugged in?")
    return DeviceNotFound(f"{path} cannot be opened as a trigger box: {error.strerror or error}")
