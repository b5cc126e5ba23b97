"""Device listing: USB devices and devices shown by the backends' libraries, joined by serial number.

On Linux the USB is read from /sys, which opens no device and needs no permissions; elsewhere pyusb and hidapi are
asked. A device that may not be opened is listed with the udev rule that permits it.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError, DeviceError, DeviceNotFound
from netboard.base.finding import Colour, Finding, graded
from netboard.devices.contract import registry
from netboard.devices.contract.device import Found
from netboard.devices.setup import usb
from netboard.devices.setup.usb import ADVICE, NAMES, Plugged


@dataclass(frozen=True, slots=True)
class ListedDevice:
    """A listed device."""

    # Model, and serial number if known.
    model: str
    serial: str
    usb: str  # USB vendor and product; empty for other devices
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


class BackendState(NamedTuple):
    """A device backend, and why it cannot be used."""

    name: str
    trouble: str


@dataclass(frozen=True, slots=True)
class Listing:
    """All devices and backends."""

    devices: tuple[ListedDevice, ...]
    backends: tuple[BackendState, ...]
    remarks: tuple[str, ...]


def udev_rule(vendor: str, product: str) -> str:
    """Return the udev rule that lets the group netboard and the local user open a device."""
    where = f'ATTRS{{idVendor}}=="{vendor}", ATTRS{{idProduct}}=="{product}"'
    return f'SUBSYSTEM=="usb|tty|hidraw", {where}, GROUP="netboard", MODE="0660", TAG+="uaccess"'


def listing(config: Config, root: Path = usb.ROOT) -> Listing:
    """List all devices and backends."""
    devices, remarks = [], []
    if usb.has_sysfs(root):
        devices = [_listed(each, "/sys") for each in usb.by_sysfs(root)]
    else:
        for name, ask in (("pyusb", usb.by_pyusb), ("hidapi", usb.by_hidapi)):
            devices, problems = _joined_usb(devices, name, ask)
            remarks += problems
    backends = []
    for name in registry.names():
        trouble, found = _ask_backend(name, config)
        backends.append(BackendState(name, trouble))
        devices = joined(devices, name, found)
    return Listing(tuple(devices), tuple(backends), tuple(remarks))


def configured(config: Config, missing: Colour, root: Path = usb.ROOT) -> list[Finding]:
    """Check that the device of each side can be used; ``missing``: colour of one that is not here."""
    found = listing(config, root)
    return [_of_side(side, config, found, missing) for side in SIDES]


def _of_side(side: Side, config: Config, found: Listing, missing: Colour) -> Finding:
    agent = config.agents.of(side)
    title, name, serial = f"{side} device", agent.device, str(agent.options.get("serial", ""))
    try:
        registry.make(side, config)
        trouble = dict(found.backends)[name]
    except (ConfigError, DeviceNotFound) as error:
        trouble = str(error)
    if trouble:
        return Finding(title, missing, trouble, f"needed at the machine of the {side} device")
    backend = registry.BACKENDS.get(name)
    if backend is None or not backend.usb:
        return Finding(title, "green", name)
    ids = [f"{vendor:04x}:{product:04x}" for vendor, product in backend.usb]
    here = [each for each in found.devices if each.usb in ids or name in each.seen_by]
    here = [each for each in here if not serial or each.serial in ("", serial)]
    words = ", ".join(f"{each.model}, serial {each.serial or '?'}" for each in here)
    if len(here) > 1 and not (serial or agent.options.get("name")):
        advice = f"write its serial number in [agents.{side}.options] serial"
        return Finding(title, "yellow", f"{words}: which of them is used is chance", advice)
    wanted = f"no {name} device" + (f" with serial number {serial}" if serial else "") + " is connected"
    return graded(title, bool(here), words or wanted, "connect it, switch it on, and stop its agent", else_=missing)


def _listed(found: Plugged, source: str) -> ListedDevice:
    """Return a connected USB device as an entry of the list."""
    usb = f"{found.vendor}:{found.product}"
    return ListedDevice(NAMES[found.vendor, found.product], found.serial, usb, found.place, (source,), found.shut)


def joined(devices: list[ListedDevice], backend: str, found: Iterable[Found]) -> list[ListedDevice]:
    """Merge the devices that a backend's library shows into the list, by serial number.

    Returns each device once; the library's model name takes precedence.
    """
    out = list(devices)
    for model, serial in found:
        at = next((i for i, each in enumerate(out) if serial and each.serial == serial), None)
        if at is None:
            out.append(ListedDevice(model, serial, "", "", (backend,)))
        else:
            out[at] = replace(out[at], model=model or out[at].model, seen_by=(*out[at].seen_by, backend))
    return out


def _joined_usb(
    devices: list[ListedDevice], source: str, ask: Callable[[], tuple[Plugged, ...]]
) -> tuple[list[ListedDevice], list[str]]:
    """Merge another library's USB devices; one without serial number matches any of its kind."""
    try:
        shown = ask()
    except DeviceNotFound as error:
        return devices, [str(error)]
    out = list(devices)
    for new in (_listed(each, source) for each in shown if (each.vendor, each.product) in NAMES):
        may_be = [i for i, each in enumerate(out) if each.usb == new.usb and source not in each.seen_by]
        at = next((i for i in may_be if new.serial == out[i].serial or not (new.serial and out[i].serial)), None)
        if at is None:
            out.append(new)
        else:
            known = out[at]
            out[at] = replace(known, serial=known.serial or new.serial, seen_by=(*known.seen_by, source))
    return out, []


def _ask_backend(name: str, config: Config) -> tuple[str, tuple[Found, ...]]:
    """Return why a backend cannot be used (empty if it can), and its devices."""
    try:
        return "", registry.find(name).present(config)
    except DeviceError as error:
        return str(error), ()
