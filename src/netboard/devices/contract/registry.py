"""Registry of backends: one entry for each, from its name in the configuration to its class and its USB ids.

A backend is imported only when it is used, so a missing vendor library does not affect the others. Other packages
register backends in the entry-point group ``netboard.devices``. The udev rules and the table of devices in the
documentation are generated from the entries.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from inspect import isabstract
from typing import NamedTuple, Protocol, runtime_checkable

from netboard.base import plugins
from netboard.base.config import SIDES, Config, Side
from netboard.base.device_kind import DeviceKind
from netboard.base.errors import ConfigError, DeviceNotFound, RecordingError
from netboard.devices.contract.device import Device

GROUP = "netboard.devices"
"""Entry-point group of third-party backends."""

Ids = tuple[int, int]
"""Vendor and product id of a USB device."""

ANY_PRODUCT = -1
"""Product id that stands for all of a vendor's."""


class UsbLink(StrEnum):
    """What a device's library opens."""

    RAW = "raw USB"
    HID = "HID"
    SERIAL = "serial port"
    HIDAPI = "HID or raw USB"  # hidapi uses either, and may detach the HID driver


class UsbModel(NamedTuple):
    """A model of USB device."""

    name: str
    link: UsbLink


@dataclass(frozen=True)
class Backend:
    """A built-in backend."""

    target: str  # module and class
    kind: DeviceKind  # what it stands for in a session
    guide: str  # its page in docs/how-to
    drives: str  # the devices, in words
    library: str  # what it needs beside netboard, in words
    tested_with: str  # what stood in for the device in the tests, in words
    ran_on: str = ""  # models of real devices on which it ran, in words; empty for none
    maker: str = ""  # manufacturer of its devices; empty for none
    usb: Mapping[Ids, UsbModel] = field(default_factory=dict)  # its USB devices
    unlisted: str = ""  # why its library may not list a connected device, in words
    selectors: tuple[str, ...] = ()  # options that select one of several devices; none for what is no device
    lists_serials: bool = False  # whether its own library lists the devices, with serial numbers that the USB may lack
    buttons: int | None = None  # of the model with most; None for a stand-in, which takes the masks of the real device


BACKENDS = {
    "falcon": Backend(
        "netboard.devices.falcon.device:Falcon",
        DeviceKind.HAPTIC,
        guide="falcon",
        drives="Novint Falcon",
        library="pyusb, libusb; firmware from the vendor",
        tested_with="simulated Falcon that implements its protocol byte by byte, beneath pyusb",
        maker="Novint",
        usb={(0x0403, 0xCB48): UsbModel("Falcon", UsbLink.RAW)},  # id of its FTDI chip
        selectors=("serial", "path"),
        buttons=4,
    ),
    "force_dimension": Backend(
        "netboard.devices.force_dimension.device:ForceDimension",
        DeviceKind.HAPTIC,
        guide="force-dimension",
        drives="Force Dimension omega, delta, sigma and lambda",
        library="SDK 3.14 or later, from the vendor",
        tested_with="library in C with the interface of `libdhd`",
        maker="Force Dimension",
        usb={(0x1451, ANY_PRODUCT): UsbModel("Force Dimension device", UsbLink.RAW)},
        unlisted="an agent or another program uses it, or its power is off",
        selectors=("serial",),
        lists_serials=True,
        buttons=32,
    ),
    "haply": Backend(
        "netboard.devices.haply:Haply",
        DeviceKind.HAPTIC,
        guide="haply",
        drives="Haply Inverse3, Inverse3x and Minverse",
        library="websockets; Inverse Service 3.5 or later, from the vendor",
        tested_with="scripted server that speaks the service's protocol",
        maker="Haply Robotics",
        selectors=("serial",),
        lists_serials=True,
        buttons=3,
    ),
    "mouse": Backend(
        "netboard.devices.mouse:MouseStylus",
        DeviceKind.POINTER,
        guide="simulate",
        drives="mouse over the participant's display, without force",
        library="none",
        tested_with="pointer positions as the display sends them",
    ),
    "openhaptics": Backend(
        "netboard.devices.touch.device:OpenHaptics",
        DeviceKind.HAPTIC,
        guide="touch",
        drives="3D Systems Touch (USB and HID), Touch X, and other Phantoms",
        library="OpenHaptics 3.4 and the Touch device driver, from the vendor",
        tested_with="library in C with the interface of `libHD`",
        maker="3D Systems",
        usb={
            (0x2988, 0x0302): UsbModel("Touch (USB)", UsbLink.SERIAL),
            (0x2988, 0x0304): UsbModel("Touch (HID)", UsbLink.HID),
            (0x0301, 0x2988): UsbModel("Touch 3D Stylus", UsbLink.SERIAL),
        },
        unlisted=(
            "an agent uses it, its vendor's driver is missing or older than the device, or its name is unknown to the "
            "driver; run the vendor's set-up tool"
        ),
        selectors=("serial", "name"),
        lists_serials=True,
        buttons=4,
    ),
    "partner": Backend(
        "netboard.devices.simulated.partner:RobotPartner",
        DeviceKind.ROBOT,
        guide="add-a-partner",
        drives="robot partner, a controller in place of a participant",
        library="none",
        tested_with="itself: it is a simulation",
    ),
    "playback": Backend(
        "netboard.devices.simulated.playback:Playback",
        DeviceKind.PLAYBACK,
        guide="play-back",
        drives="stylus of a recording",
        library="none",
        tested_with="recordings of simulated sessions",
    ),
    "spacemouse": Backend(
        "netboard.devices.spacemouse:SpaceMouse",
        DeviceKind.INPUT,
        guide="spacemouse",
        drives="3Dconnexion SpaceMouse, without force",
        library="hidapi",
        tested_with="scripted HID reports, beneath hidapi",
        maker="3Dconnexion",
        usb={
            ids: UsbModel(name, UsbLink.HIDAPI)
            for ids, name in {
                (0x046D, 0xC625): "SpacePilot",
                (0x046D, 0xC626): "SpaceNavigator",
                (0x046D, 0xC627): "SpaceExplorer",
                (0x046D, 0xC629): "SpacePilot Pro",
                (0x046D, 0xC62B): "SpaceMouse Pro",
                (0x256F, 0xC62E): "SpaceMouse Wireless (cable)",
                (0x256F, 0xC632): "SpaceMouse Pro Wireless",
                (0x256F, 0xC633): "SpaceMouse Enterprise",
                (0x256F, 0xC635): "SpaceMouse Compact",
                (0x256F, 0xC638): "SpaceMouse Pro Wireless (Bluetooth)",
                (0x256F, 0xC63A): "SpaceMouse Wireless",
                (0x256F, 0xC641): "SpaceMouse USB",
                (0x256F, 0xC652): "SpaceMouse (Universal Receiver)",
            }.items()
        },
        selectors=("serial", "path"),
        buttons=32,
    ),
    "virtual": Backend(
        "netboard.devices.simulated.virtual:VirtualTouch",
        DeviceKind.SIMULATED,
        guide="simulate",
        drives="simulated device, held by a simulated participant",
        library="none",
        tested_with="itself: it is a simulation",
    ),
}
"""Built-in backends by name."""


def names() -> tuple[str, ...]:
    """Return the names of all backends, sorted."""
    return plugins.names(GROUP, BACKENDS)


def find(name: str) -> type[Device]:
    """Return the class of a backend."""
    targets = {name: backend.target for name, backend in BACKENDS.items()}
    backend = plugins.load(GROUP, name, targets, "device backend", DeviceNotFound)
    if not (isinstance(backend, type) and issubclass(backend, Device)):
        expected = "expected a netboard.devices.contract.device.Device"
        raise DeviceNotFound(f"the device backend {name!r} is {backend!r}, {expected}")
    if isabstract(backend):
        lacks = ", ".join(sorted(backend.__abstractmethods__))
        raise DeviceNotFound(f"the device backend {name!r} ({backend.__module__}) must implement {lacks}")
    return backend


def maker_of(name: str) -> str:
    """Return the manufacturer of a built-in backend's devices; empty if it is unknown or there is none."""
    return BACKENDS[name].maker if name in BACKENDS else ""


def kind_of(name: str) -> DeviceKind:
    """Return the kind of a backend's device; that of another package's backend is declared by its class."""
    return BACKENDS[name].kind if name in BACKENDS else find(name).kind


def make(side: Side, config: Config) -> Device:
    """Create the device of one side, not yet open; refuse buttons that it does not have, and wrong options."""
    agent = config.agents.of(side)
    made = find(agent.device)(side, config)
    for key in ("stop_buttons", "consent_buttons"):
        _check_buttons(f"[agents.{side}] {key}", getattr(agent, key), agent.device)
    return made


def _check_buttons(key: str, mask: int, name: str) -> None:
    """Refuse a mask of buttons that no device of a backend has: such a stop button could never be pressed."""
    count = BACKENDS[name].buttons if name in BACKENDS else None
    if count is not None and mask >> count:
        expected = f"expected a whole number >= 0 and <= {2**count - 1}"
        raise ConfigError(f"{key}: found {mask}, {expected}, because a {name} has at most {count} buttons")


@runtime_checkable
class NamesFiles(Protocol):
    """A device whose options name files."""

    def require_files(self) -> None:
        """Refuse files that are missing or invalid, without opening the device."""


def check(config: Config) -> None:
    """Check the names of both devices, their options, and the files that these name, without opening a device.

    Raises `ConfigError` with every problem.
    """
    problems = []
    for side in SIDES:
        key = "device"
        try:
            device = make(side, config)
            if isinstance(device, NamesFiles):
                key = "options"
                device.require_files()
        except (DeviceNotFound, RecordingError) as error:
            problems.append(f"[agents.{side}] {key}: {error}")
        except ConfigError as error:
            problems.append(str(error))
    if problems:
        raise ConfigError("\n".join(problems))
