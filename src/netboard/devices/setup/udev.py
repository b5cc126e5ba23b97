"""udev rules that let the group netboard and the local user open the devices in the registry, and no one else.

A device has a rule for its USB file, and one for its HID or serial file if its library opens that. The installed file,
deploy/udev/70-netboard.rules, holds `rules`; its number stays below 73, or ``uaccess`` has no effect. A rule file with
a higher number may give the same file to all users again, as the vendor of the Touch (HID) does: `overriding` finds it.
"""

from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path

from netboard.base.files.text import find_text
from netboard.devices.contract.registry import ANY_PRODUCT, BACKENDS, Ids, UsbLink, UsbModel

RULES = "70-netboard.rules"

ACCESS = 'GROUP="netboard", MODE="0660", TAG+="uaccess"'

SUBSYSTEMS = {UsbLink.HID: "hidraw", UsbLink.HIDAPI: "hidraw", UsbLink.SERIAL: "tty"}
"""Subsystem of the file that a device's library opens, beside the USB file."""

NO_MODEM = ', ENV{ID_MM_DEVICE_IGNORE}="1"'
"""Keeps ModemManager from probing a serial line."""


def rules() -> str:
    """Return the rules for all devices, those of a backend below its name."""
    backends = (
        "\n".join([f"# {backend.drives}", *_rules_of(backend.usb.items())])
        for backend in BACKENDS.values()
        if backend.usb
    )
    return "\n\n".join(backends)


def rules_for(vendor: str, product: str) -> str:
    """Return the rules for one device, by its vendor and product as in /sys."""
    wanted = (int(vendor, 16), int(product, 16)), (int(vendor, 16), ANY_PRODUCT)
    models = [(ids, backend.usb[ids]) for backend in BACKENDS.values() for ids in wanted if ids in backend.usb]
    return "\n".join(_rules_of(models))


def _rules_of(models: Iterable[tuple[Ids, UsbModel]]) -> Iterator[str]:
    """Yield the rules for devices, jointly for those of one vendor that are opened alike."""
    for (vendor, link), group in groupby(models, lambda model: (model[0][0], model[1].link)):
        products = "|".join(f"{product:04x}" for (_, product), _ in group if product != ANY_PRODUCT)
        at = f'ATTR{{idVendor}}=="{vendor:04x}"' + (f', ATTR{{idProduct}}=="{products}"' if products else "")
        yield f'SUBSYSTEM=="usb", ENV{{DEVTYPE}}=="usb_device", {at}, {ACCESS}'
        if subsystem := SUBSYSTEMS.get(link):
            above = at.replace("ATTR{", "ATTRS{")  # the ids are those of a device above the HID or serial one
            yield f'SUBSYSTEM=="{subsystem}", {above}, {ACCESS}{NO_MODEM if link is UsbLink.SERIAL else ""}'


def overriding(vendors: Iterable[str], root: Path) -> list[Path]:
    """Return the rule files that come after `RULES` and set the mode of a vendor's devices."""
    files = sorted((root / "etc/udev/rules.d").glob("*.rules"))
    later = [file for file in files if file.name > RULES]
    wanted = [f'{{idVendor}}=="{vendor}"' for vendor in vendors]
    return [file for file in later if _sets_mode(find_text(file) or "", wanted)]


def _sets_mode(text: str, wanted: list[str]) -> bool:
    """Tell whether a rule for one of these devices sets a mode."""
    return any(part in line and "MODE" in line for line in text.splitlines() for part in wanted)
