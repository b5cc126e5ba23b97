"""Connected devices as seen by pyusb and hidapi: presence only; no device is opened.

On Linux, /sys gives more details (see `netboard.devices.setup.listing`); on other systems these libraries are the only
source. Either may be missing. Serial numbers come from hidapi only, because pyusb would have to open the device.
"""

import sys
from collections.abc import Iterator
from importlib import import_module
from typing import Any, NamedTuple

from netboard.base.errors import DeviceNotFound


class Plugged(NamedTuple):
    """A connected device.

    Attributes
    ----------
    place : str
        Connection, as named by the library that found it.
    """

    vendor: str
    product: str
    serial: str
    place: str


def by_pyusb() -> tuple[Plugged, ...]:
    """List the devices on the USB."""
    core = _library("usb.core", "pyusb")
    try:
        devices = tuple(core.find(find_all=True))
    except core.NoBackendError:
        raise DeviceNotFound("pyusb finds no libusb; install libusb 1.0") from None
    except core.USBError as error:
        raise DeviceNotFound(f"pyusb cannot look at the USB: {error}") from error
    return tuple(
        Plugged(f"{each.idVendor:04x}", f"{each.idProduct:04x}", "", f"bus {each.bus} address {each.address}")
        for each in devices
    )


def by_hidapi() -> tuple[Plugged, ...]:
    """List the HID devices, each once."""
    # On Linux the module hid uses libusb and opens every device to read its name; hidraw asks udev.
    module = _library("hidraw" if sys.platform == "linux" else "hid", "hidapi")
    return tuple(dict.fromkeys(_hid_devices(module)))


def _hid_devices(module: Any) -> Iterator[Plugged]:
    """Yield a device for each HID interface."""
    for each in module.enumerate():
        serial = each.get("serial_number") or ""
        yield Plugged(f"{each['vendor_id']:04x}", f"{each['product_id']:04x}", serial, "HID")


def _library(module: str, package: str) -> Any:
    """Import an optional library."""
    try:
        return import_module(module)
    except (ImportError, OSError) as error:
        raise DeviceNotFound(f"{package} is missing ({error}); install netboard with the extra devices") from error
