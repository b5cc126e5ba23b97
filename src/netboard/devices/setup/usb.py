"""Connected USB devices: presence and permissions only; no device is opened.

On Linux, /sys shows devices and the files in /dev that drive them, without permissions. On other systems pyusb and
hidapi are the only sources, and either may be missing. Serial numbers come from /sys or hidapi, because pyusb would
have to open the device.
"""

import os
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from netboard.base.errors import DeviceNotFound
from netboard.base.finding import Finding, text_of
from netboard.devices.contract.registry import ANY_PRODUCT, BACKENDS, Backend, Ids, UsbLink, UsbModel
from netboard.devices.setup import udev

ROOT = Path("/")


def ids_in_words(ids: Ids) -> tuple[str, str]:
    """Return vendor and product as in /sys; an empty product stands for all of the vendor's."""
    vendor, product = ids
    return f"{vendor:04x}", "" if product == ANY_PRODUCT else f"{product:04x}"


MODELS = {ids_in_words(ids): model for backend in BACKENDS.values() for ids, model in backend.usb.items()}
"""Supported devices, by vendor and product as in /sys."""


def model_of(vendor: str, product: str) -> UsbModel | None:
    """Return the model of a device; None for one that no backend drives."""
    return MODELS.get((vendor, product)) or MODELS.get((vendor, ""))


def is_driven(backend: Backend, vendor: str, product: str) -> bool:
    """Tell whether a backend drives a device."""
    known = {ids_in_words(ids) for ids in backend.usb}
    return not known.isdisjoint({(vendor, product), (vendor, "")})


FILES = {
    UsbLink.RAW: ("bus/usb/*/*", "plug it in again"),
    UsbLink.HID: ("hidraw*", "load the kernel module usbhid; a kernel without hidraw (CONFIG_HIDRAW) cannot drive it"),
    UsbLink.SERIAL: ("ttyACM*", "load the kernel module cdc_acm"),
    UsbLink.HIDAPI: ("*", "plug it in again"),
}
"""File in /dev that a device's library opens, by its link, and what to do if there is none."""

ADVICE = "install deploy/udev/70-netboard.rules and join the group netboard; see docs/how-to/two-stations.md"


class Plugged(NamedTuple):
    """A connected device."""

    vendor: str
    product: str
    serial: str
    place: str  # connection, as named by the source that found it
    nodes: tuple[Path, ...] = ()  # files in /dev that drive it, on Linux

    @property
    def shut(self) -> tuple[str, ...]:
        """Files that this user may not open."""
        return tuple(str(node) for node in self.nodes if not os.access(node, os.R_OK | os.W_OK))

    @property
    def model(self) -> UsbModel:
        """Its model."""
        model = model_of(self.vendor, self.product)
        assert model is not None  # others are not listed
        return model

    def undriven(self, root: Path) -> str:
        """Return why the device's library cannot reach it; empty if the file that it opens is there."""
        name, link = self.model
        pattern, todo = FILES[link]
        if any(node.relative_to(root / "dev").match(pattern) for node in self.nodes):
            return ""
        return f"the {name} at {self.place} has no file /dev/{pattern}: {todo}"


def has_sysfs(root: Path = ROOT) -> bool:
    """Return whether /sys shows the USB."""
    return (root / "sys/bus/usb/devices").is_dir()


def by_sysfs(root: Path = ROOT) -> Iterator[Plugged]:
    """Yield the supported devices in Linux's /sys."""
    for device in sorted((root / "sys/bus/usb/devices").iterdir()):
        vendor, product = text_of(device / "idVendor"), text_of(device / "idProduct")
        if model_of(vendor, product):
            nodes = tuple(node for node in device_nodes(device, root) if node.exists())
            yield Plugged(vendor, product, text_of(device / "serial"), device.name, nodes)


def by_pyusb() -> tuple[Plugged, ...]:
    """List the devices on the USB."""
    core = _library("usb.core", "pyusb")
    try:
        devices = tuple(core.find(find_all=True))
    except core.NoBackendError:
        raise DeviceNotFound("pyusb finds no libusb; install libusb 1.0") from None
    except core.USBError as error:
        raise DeviceNotFound(f"pyusb cannot access the USB: {error}") from error
    return tuple(
        Plugged(f"{each.idVendor:04x}", f"{each.idProduct:04x}", "", f"bus {each.bus} address {each.address}")
        for each in devices
    )


def by_hidapi() -> tuple[Plugged, ...]:
    """List the HID devices, each once."""
    # On Linux the module hid uses libusb and opens every device to read its name; hidraw asks udev.
    module = _library("hidraw" if sys.platform == "linux" else "hid", "hidapi")
    found = module.enumerate()
    return tuple(
        dict.fromkeys(
            Plugged(f"{each['vendor_id']:04x}", f"{each['product_id']:04x}", each.get("serial_number") or "", "HID")
            for each in found
        )
    )


def _library(module: str, package: str) -> Any:
    """Import an optional library."""
    try:
        return import_module(module)
    except (ImportError, OSError) as error:
        raise DeviceNotFound(f"{package} is missing ({error}); install netboard with the extra devices") from error


def devices(root: Path = ROOT) -> Finding:
    """Check that the connected devices have their files, and may be opened through a group, not by all users."""
    name = "USB devices"
    if not has_sysfs(root):
        return Finding(name, "green", "not offered here")
    connected = list(by_sysfs(root))
    found = ", ".join(f"{each.model.name} at {each.place}" for each in connected)
    if undriven := [why for each in connected if (why := each.undriven(root))]:
        return Finding(name, "red", found, "\n".join(undriven))
    if shut := [node for each in connected for node in each.shut]:
        return Finding(name, "red", f"{found}; no permission for {', '.join(shut)}", ADVICE)
    if open_to_all := [str(node) for each in connected for node in each.nodes if node.stat().st_mode & 0o002]:
        later = udev.overriding({each.vendor for each in connected}, root)
        advice = (
            f"remove {', '.join(map(str, later))}, which comes after {udev.RULES}; then {ADVICE}" if later else ADVICE
        )
        return Finding(name, "yellow", f"{found}; all users may open {', '.join(open_to_all)}", advice)
    return Finding(name, "green", found or "no USB haptic device found")


def device_nodes(device: Path, root: Path) -> list[Path]:
    """Return the files in /dev that drive a device: raw USB, HID or serial."""
    nodes = [root / "dev" / line[8:] for line in text_of(device / "uevent").splitlines() if line.startswith("DEVNAME=")]
    nodes += [root / "dev" / at.name for at in device.glob("**/hidraw/hidraw*")]
    nodes += [root / "dev" / at.name for at in device.glob("**/tty/tty*")]
    return nodes
