"""A LabJack T4, T7 or T8 as a trigger box, by LabJack's library LJM: the lines EIO0 to EIO7 show the code.

A write is a round trip of a command by USB or network, so its time includes the box's answer. The library's wrapper is
a package (MIT licence); LJM itself comes from LabJack's installer. No LabJack was ever connected: the tests run a
scripted stand-in of the wrapper.
"""

from ctypes.util import find_library
from importlib import import_module
from typing import Any

from netboard.base.errors import DeviceLost, DeviceNotFound
from netboard.base.tables.triggers import Triggers
from netboard.devices.triggers.box import TriggerBox

LINES = 0xFF
"""The eight lines EIO0 to EIO7 [1]."""

ANALOG = LINES << 8
"""The same lines among all digital ones, where EIO0 is DIO8 [1]."""


class LabJackBox(TriggerBox):
    """The EIO lines of a LabJack. ``library``: LJM's wrapper; None to load it."""

    def __init__(self, triggers: Triggers, library: Any = None) -> None:
        super().__init__(triggers)
        self._library = library
        self._handle: Any = None
        self._identifier = triggers.address or "ANY"

    @property
    def text(self) -> str:
        """What it is and where, in a few words."""
        return "LabJack" + (f" {self._identifier}" if self._identifier != "ANY" else "")

    def open(self) -> None:
        """Open the device, and make the lines digital outputs that are low."""
        ljm = self._library = self._library or _ljm()
        try:
            self._handle = ljm.openS("ANY", "ANY", self._identifier)
            analog = int(ljm.eReadName(self._handle, "DIO_ANALOG_ENABLE"))
            ljm.eWriteName(self._handle, "DIO_ANALOG_ENABLE", analog & ~ANALOG)
            ljm.eWriteName(self._handle, "EIO_DIRECTION", LINES)
            ljm.eWriteName(self._handle, "EIO_STATE", 0)
        except ljm.LJMError as error:
            self.close()
            raise DeviceNotFound(f"the {self.text} cannot be opened: {error}") from error

    def write(self, code: int) -> None:
        """Set the lines; return when the device has answered."""
        try:
            self._library.eWriteName(self._handle, "EIO_STATE", code)
        except self._library.LJMError as error:
            raise DeviceLost(f"the {self.text} has failed: {error}") from error

    def close(self) -> None:
        """Close the device, which may be gone."""
        handle, self._handle = self._handle, None
        if handle is not None:
            try:
                self._library.close(handle)
            except self._library.LJMError:
                return  # it is closed: LJM forgets a device that is gone


def _ljm() -> Any:
    """Load LJM's wrapper, and LJM by it."""
    if not find_library("LabJackM"):  # the wrapper would only print so, and fail at every call
        raise DeviceNotFound("a LabJack needs the library LJM (libLabJackM), which LabJack's installer brings")
    try:
        return import_module("labjack.ljm")
    except ImportError as error:
        raise DeviceNotFound('a LabJack needs its Python package: pip install "netboard[triggers]"') from error
