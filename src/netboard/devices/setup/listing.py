"""Device listing, and the doctor's check of the configured devices.

The list has USB devices and devices shown by the backends' libraries, joined by serial number.

On Linux the USB is read from /sys, which opens no device and needs no permissions; elsewhere pyusb and hidapi are
asked. A device that may not be opened is listed with the udev rule that permits it.

In the check, a side is green only if one connected device fits its options, and the other side has another. Chance is
never green: if several fit, an agent opens none (`netboard.devices.contract.selection`), or a vendor's library chooses.
"""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError, DeviceError, DeviceNotFound
from netboard.base.finding import Colour, Finding
from netboard.devices.contract import registry
from netboard.devices.contract.device import Found
from netboard.devices.contract.registry import Backend
from netboard.devices.contract.selection import in_words
from netboard.devices.setup import udev, usb
from netboard.devices.setup.usb import ADVICE, Plugged

PORT = re.compile(r"\d+-[\d.]+")
"""A USB port, as Linux names it."""


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
    nodes: tuple[str, ...] = ()  # files in /dev that drive it, on Linux

    @property
    def words(self) -> str:
        """The device in a message."""
        return f"{self.model}, serial {self.serial or '?'}" + (f", at {self.place}" if self.place else "")

    @property
    def advice(self) -> str:
        """Advice for a device that may not be opened; empty if it may."""
        if not self.shut:
            return ""
        vendor, _, product = self.usb.partition(":")
        return f"{ADVICE}\n{udev.rules_for(vendor, product)}"


class BackendState(NamedTuple):
    """A device backend, and why it cannot be used."""

    name: str
    trouble: str


@dataclass(frozen=True, slots=True)
class DeviceListing:
    """All devices and backends."""

    devices: tuple[ListedDevice, ...]
    backends: tuple[BackendState, ...]
    remarks: tuple[str, ...]


def listing(config: Config, root: Path = usb.ROOT) -> DeviceListing:
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
    return DeviceListing(tuple(devices), tuple(backends), tuple(remarks))


def _listed(found: Plugged, source: str) -> ListedDevice:
    """Return a connected USB device as an entry of the list."""
    ids = f"{found.vendor}:{found.product}"
    nodes = tuple(map(str, found.nodes))
    return ListedDevice(found.model.name, found.serial, ids, found.place, (source,), found.shut, nodes)


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
    for new in (_listed(each, source) for each in shown if usb.model_of(each.vendor, each.product)):
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


class DeviceMatch(NamedTuple):
    """The connected devices that fit the options of one side; ``options``: those that select a device."""

    backend: str
    options: dict[str, str]
    fitting: tuple[ListedDevice, ...]
    trouble: str = ""

    @property
    def words(self) -> str:
        """The devices in a message."""
        return "; ".join(each.words for each in self.fitting)

    @property
    def named(self) -> bool:
        """Whether the vendor's set-up tool has given the device a name, which no list shows."""
        return bool(self.options.get("name")) and "serial" not in self.options


def configured(config: Config, missing: Colour, root: Path = usb.ROOT) -> list[Finding]:
    """Check that the device of each side can be used; ``missing``: colour of one that is not here.

    It is red if all processes run on this machine.
    """
    found = listing(config, root)
    left, right = (_choice(side, config, found) for side in SIDES)
    return [_judged("left", left, right, missing), _judged("right", right, left, missing)]


def _choice(side: Side, config: Config, found: DeviceListing) -> DeviceMatch:
    """Return which connected devices a side may mean."""
    agent = config.agents.of(side)
    name, backend = agent.device, registry.BACKENDS.get(agent.device)
    keys = backend.selectors if backend else ()
    options = {key: str(agent.options[key]) for key in keys if agent.options.get(key)}
    try:
        registry.make(side, config)
        trouble = dict(found.backends)[name]
    except (ConfigError, DeviceNotFound) as error:
        trouble = str(error)
    here = _of_backend(name, backend, found.devices) if backend else []
    library_only = backend is not None and backend.lists_serials
    return DeviceMatch(name, options, tuple(each for each in here if _fits(each, options, library_only)), trouble)


def _of_backend(name: str, backend: Backend, devices: tuple[ListedDevice, ...]) -> list[ListedDevice]:
    """Return the connected devices of a backend; if its own library lists them, each appears there once."""
    shown = [each for each in devices if name in each.seen_by]
    if shown and backend.lists_serials:
        return shown
    return [each for each in devices if name in each.seen_by or usb.is_driven(backend, *each.usb.partition(":")[::2])]


def _fits(each: ListedDevice, options: dict[str, str], library_only: bool) -> bool:
    """Tell whether a connected device may be the one that the options select.

    ``library_only``: the serial number that counts is that of the backend's library, which the USB may not show.
    """
    serial, path = options.get("serial", ""), options.get("path", "")
    unknown = not each.serial and (library_only or "/sys" not in each.seen_by)
    return (not serial or each.serial == serial or unknown) and (not path or _is_at(each, path))


def _is_at(each: ListedDevice, path: str) -> bool:
    """Tell whether a device may be at a USB port or path; True if this system does not show where it is."""
    port = path.partition(":")[0]
    if PORT.fullmatch(port) and "/sys" in each.seen_by:
        return each.place == port
    return path in each.nodes if path.startswith("/dev/") else True


def _judged(side: Side, mine: DeviceMatch, other: DeviceMatch, missing: Colour) -> Finding:
    """Judge the device of a side; ``other``: the choice of the other side."""
    title, backend = f"{side} device", registry.BACKENDS.get(mine.backend)
    if mine.trouble:
        return Finding(title, missing, mine.trouble, f"needed at the machine of the {side} device")
    if backend is None or not backend.selectors:
        return Finding(title, "green", mine.backend)
    given = in_words(mine.options)
    guide = f"docs/how-to/{backend.guide}.md"
    if not mine.fitting:
        wanted = f"no {mine.backend} device {f'with {given} ' if given else ''}is connected"
        return Finding(title, missing, wanted, f"connect it, switch it on, and stop its agent; see {guide}")
    select = f"write the {' or '.join(backend.selectors)} of each device in [agents.<side>.options]"
    if len(mine.fitting) > 1 and not mine.named:
        chance = f"{len(mine.fitting)} devices fit{f' {given}' if given else ''}: {mine.words}"
        return Finding(title, "red", f"{chance}: which of them is used is chance", select)
    if _is_shared(mine, other) and (missing == "red" or mine.options):
        return Finding(title, missing, f"{mine.words}: both sides would use it", f"each needs one: {select}")
    if serial := _shared_serial(mine, other):
        return Finding(
            title,
            "yellow",
            f"{mine.words}: the other side's device has the same serial number, so both use one profile, {serial}",
            "run each agent with a configuration file of its own, with a folder of its own in [agents] profiles",
        )
    if backend.lists_serials and not all(mine.backend in each.seen_by for each in mine.fitting):
        unlisted = f"{mine.words}: its vendor's library does not list it"
        return Finding(title, "yellow", unlisted, f"{backend.unlisted}; see {guide}")
    return Finding(title, "green", mine.words)


def _shared_serial(mine: DeviceMatch, other: DeviceMatch) -> str:
    """Return the serial number of two different devices, which selects their profile; empty if it differs."""
    if mine.backend != other.backend or len(mine.fitting) != 1 or len(other.fitting) != 1:
        return ""
    serial = mine.fitting[0].serial
    return serial if mine.fitting != other.fitting and serial == other.fitting[0].serial else ""


def _is_shared(mine: DeviceMatch, other: DeviceMatch) -> bool:
    """Tell whether both sides mean the same device."""
    if mine.backend != other.backend:
        return False
    if mine.named and other.named and mine.options == other.options:
        return True
    return len(mine.fitting) == 1 and mine.fitting == other.fitting
