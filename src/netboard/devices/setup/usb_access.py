"""Checks whether connected haptic devices may be opened by this user through a group, not by world permissions.

Presence is read from /sys. No device is opened, because that would interfere with the library that drives it.
"""

import os
from pathlib import Path

from netboard.base.finding import Finding, text_of
from netboard.devices.contract.usb_ids import DEVICES

ROOT = Path("/")

NAMES = {(f"{vendor:04x}", f"{product:04x}"): name for (vendor, product), name in DEVICES.items()}
"""Known devices, by vendor and product as in /sys."""

ADVICE = "install deploy/udev/70-netboard.rules and join the group netboard; see docs/how-to/two-stations.md"


def devices(root: Path = ROOT) -> Finding:
    """Check which known devices are connected and may be opened."""
    name = "USB devices"
    plugged = root / "sys/bus/usb/devices"
    if not plugged.is_dir():
        return Finding(name, "green", "not offered here")
    found, shut, open_to_all = [], [], []
    for device in sorted(plugged.iterdir()):
        what = NAMES.get((text_of(device / "idVendor"), text_of(device / "idProduct")))
        if what is None:
            continue
        found.append(f"{what} at {device.name}")
        nodes = [node for node in device_nodes(device, root) if node.exists()]
        shut += [str(node) for node in nodes if not os.access(node, os.R_OK | os.W_OK)]
        open_to_all += [str(node) for node in nodes if node.stat().st_mode & 0o002]
    if shut:
        return Finding(name, "red", f"{', '.join(found)}; no permission for {', '.join(shut)}", ADVICE)
    if open_to_all:
        return Finding(name, "yellow", f"{', '.join(found)}; everybody may open {', '.join(open_to_all)}", ADVICE)
    return Finding(name, "green", ", ".join(found) or "no haptic device is plugged in")


def device_nodes(device: Path, root: Path) -> list[Path]:
    """Return the files in /dev that drive a device: raw USB, HID or serial."""
    nodes = [root / "dev" / line[8:] for line in text_of(device / "uevent").splitlines() if line.startswith("DEVNAME=")]
    nodes += [root / "dev" / at.name for at in device.glob("**/hidraw/hidraw*")]
    nodes += [root / "dev" / at.name for at in device.glob("**/tty/tty*")]
    return nodes
