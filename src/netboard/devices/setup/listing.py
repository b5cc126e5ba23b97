"""Device listing: USB devices and devices shown by the backends' libraries, joined by serial number.

On Linux the USB is read from /sys, which opens no device and needs no permissions; elsewhere pyusb and hidapi are
asked. A device that may not be opened is listed with the udev rule that permits it.
"""

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from netboard.base.config import Config
from netboard.base.errors import DeviceError, DeviceNotFound
from netboard.base.finding import text_of
from netboard.devices.contract import plugged, registry
from netboard.devices.contract.device import Found
from netboard.devices.contract.plugged import Plugged
from netboard.devices.setup.usb_access import ADVICE, NAMES, device_nodes

ROOT = Path("/")


@dataclass(frozen=True, slots=True)
class Listed:
    """A listed device.

    Attributes
    ----------
    model, serial : str
        Model, and serial number if known.
    usb : str
        USB vendor and product; empty for other devices.
    """

    model: str
    serial: str
    usb: str
    place: str
    seen_by: tuple[str, ...]
    shut: tuple[str, ...] = ()

    @property
    def advice(self) -> str:
        """Advice for a device that may not be opened; empty if it may."""
        if not self.shut:
            return ""
        vendor, _, product = self.usb.partition(":")
        return f"{ADVICE}\n{udev_rule(vendor, product)}"


class Backend(NamedTuple):
    """A device backend and its state."""

    name: str
    trouble: str


@dataclass(frozen=True, slots=True)
class Listing:
    """All devices and backends."""

    devices: tuple[Listed, ...]
    backends: tuple[Backend, ...]
    remarks: tuple[str, ...]


def udev_rule(vendor: str, product: str) -> str:
    """Return the udev rule that lets the group netboard and the local user open a device."""
    where = f'ATTRS{{idVendor}}=="{vendor}", ATTRS{{idProduct}}=="{product}"'
    return f'SUBSYSTEM=="usb|tty|hidraw", {where}, GROUP="netboard", MODE="0660", TAG+="uaccess"'


def listing(config: Config, root: Path = ROOT) -> Listing:
    """List all devices and backends."""
    devices, remarks = [], []
    if (root / "sys/bus/usb/devices").is_dir():
        devices = by_sysfs(root)
    else:
        for name, ask in (("pyusb", plugged.by_pyusb), ("hidapi", plugged.by_hidapi)):
            devices, said = _joined_usb(devices, name, ask)
            remarks += said
    backends = []
    for name in registry.names():
        trouble, found = _ask_backend(name, config)
        backends.append(Backend(name, trouble))
        devices = joined(devices, name, found)
    return Listing(tuple(devices), tuple(backends), tuple(remarks))


def by_sysfs(root: Path = ROOT) -> list[Listed]:
    """List known devices in Linux's /sys, with their files that may not be opened."""
    found = []
    for device in sorted((root / "sys/bus/usb/devices").iterdir()):
        vendor, product = text_of(device / "idVendor"), text_of(device / "idProduct")
        if (vendor, product) not in NAMES:
            continue
        nodes = [node for node in device_nodes(device, root) if node.exists()]
        shut = tuple(str(node) for node in nodes if not os.access(node, os.R_OK | os.W_OK))
        model, serial = NAMES[vendor, product], text_of(device / "serial")
        found.append(Listed(model, serial, f"{vendor}:{product}", device.name, ("/sys",), shut))
    return found


def joined(devices: list[Listed], backend: str, found: Iterable[Found]) -> list[Listed]:
    """Merge the devices that a backend's library shows into the list, by serial number.

    Returns
    -------
    list of Listed
        Each device once; the library's model name takes precedence.
    """
    out = list(devices)
    for model, serial in found:
        at = next((i for i, each in enumerate(out) if serial and each.serial == serial), None)
        if at is None:
            out.append(Listed(model, serial, "", "", (backend,)))
        else:
            out[at] = replace(out[at], model=model or out[at].model, seen_by=(*out[at].seen_by, backend))
    return out


def _joined_usb(
    devices: list[Listed], source: str, ask: Callable[[], tuple[Plugged, ...]]
) -> tuple[list[Listed], list[str]]:
    """Merge another library's USB devices; one without serial number matches any of its kind."""
    try:
        shown = ask()
    except DeviceNotFound as error:
        return devices, [str(error)]
    out = list(devices)
    for vendor, product, serial, place in shown:
        if (vendor, product) not in NAMES:
            continue
        usb = f"{vendor}:{product}"
        may_be = [i for i, each in enumerate(out) if each.usb == usb and source not in each.seen_by]
        at = next((i for i in may_be if serial == out[i].serial or not (serial and out[i].serial)), None)
        if at is None:
            out.append(Listed(NAMES[vendor, product], serial, usb, place, (source,)))
        else:
            known = out[at]
            out[at] = replace(known, serial=known.serial or serial, seen_by=(*known.seen_by, source))
    return out, []


def _ask_backend(name: str, config: Config) -> tuple[str, tuple[Found, ...]]:
    """Return why a backend cannot be used (empty if it can), and its devices."""
    try:
        return "", registry.find(name).present(config)
    except DeviceError as error:
        return str(error), ()
