"""Finds a vendor device by name or serial number, reads its properties and calibrates it.

The library knows devices by names from the vendor's setup tool, and a name may refer to another device later. A serial
number does not change. To find one, the devices are initialised name by name, without force, until the serial number
matches.
"""

import logging
import os
import sys
import time
from collections.abc import Callable, Mapping
from ctypes import byref, c_int32
from math import isfinite
from pathlib import Path
from typing import TypeVar

from netboard.base.errors import DeviceError, DeviceNotFound
from netboard.devices.contract.device import Box, DeviceInfo, Found
from netboard.devices.touch.api import Calibration, Capability, Fault, Library, Parameter, Style
from netboard.devices.touch.library import OpenDevice, TouchRig

T = TypeVar("T")

log = logging.getLogger(__name__)

USUAL_NAMES = ("Default Device", "Default PHANToM", "")
"""Usual names of a rig's only device, in the order of trial; the empty name lets the library choose.

It comes last, because some drivers accept only a literal name (danepowell/phantom_omni, issues 5 and 6).
"""

OTHER_NAMES = ("Left Device", "Right Device", "Phantom2", "Phantom3", "Phantom4")
"""Frequent names of second devices: those of the ROS drivers and of CHAI3D."""

CALIBRATE_S = 2.0
"""Time limit for the library to calibrate a device [s]."""

RETRY_INTERVAL_S = 0.02

LIMITS = (
    Capability.MAX_FORCE_CLAMPING,
    Capability.FORCE_RAMPING,
    Capability.SOFTWARE_FORCE_LIMIT,
    Capability.SOFTWARE_VELOCITY_LIMIT,
    Capability.SOFTWARE_FORCE_IMPULSE_LIMIT,
)
"""The library's own safeguards beneath netboard's; all are enabled."""

TEXTS = {
    "hd_version": Parameter.VERSION,
    "vendor": Parameter.DEVICE_VENDOR,
    "driver_version": Parameter.DEVICE_DRIVER_VERSION,
    "firmware_version": Parameter.DEVICE_FIRMWARE_VERSION,
}
NUMBERS = {
    "max_stiffness": (Parameter.NOMINAL_MAX_STIFFNESS, 1, "on the library's scale"),
    "max_damping": (Parameter.NOMINAL_MAX_DAMPING, 1, "on the library's scale"),
    "max_workspace": (Parameter.MAX_WORKSPACE_DIMENSIONS, 6, "mm"),
    "usable_workspace": (Parameter.USABLE_WORKSPACE_DIMENSIONS, 6, "mm"),
    "velocity_limit": (Parameter.SOFTWARE_VELOCITY_LIMIT, 1, "mm/s"),
    "impulse_limit": (Parameter.SOFTWARE_FORCE_IMPULSE_LIMIT, 1, "N/ms"),
    "ramping_rate": (Parameter.FORCE_RAMPING_RATE, 1, "N/s"),
}
"""Recorded properties in the vendor's frame, with count and unit of their values."""

MANUAL = {
    Style.CALIBRATION_INKWELL: "put the stylus into its inkwell, and start the agent again",
    Style.CALIBRATION_AUTO: "move the stylus slowly to all ends of its workspace, and start the agent again",
    Style.CALIBRATION_ENCODER_RESET: (
        "calibrate it with the vendor's tool, with the arm in its reset position, and start the agent again"
    ),
}
"""Instructions to the operator, by calibration method."""


def candidates(name: str) -> list[str]:
    """Return the possible names of a device, likeliest first."""
    configured = sorted(at.stem for folder in config_folders() if folder.is_dir() for at in folder.iterdir())
    return list(dict.fromkeys([*([name] if name else []), *USUAL_NAMES, *configured, *OTHER_NAMES]))


def config_folders() -> list[Path]:
    """Return the folders in which the vendor's driver stores a file per device."""
    home = os.environ.get("GTDD_HOME")
    if home:
        return [Path(home, "config")]
    if sys.platform == "win32":
        return []
    shared = Path("/usr/share/3DSystems/config")
    try:
        return [Path.home() / ".3dsystems" / "config", shared]
    except RuntimeError:  # the user has no home folder
        return [shared]


def find(rig: TouchRig, serial: str, name: str) -> OpenDevice:
    """Initialise the wanted device and make it current, while the scheduler is paused.

    ``name``: name of the device. With a serial number, it is tried first; without, it is the only one tried. Empty for
    the usual ones.
    """
    tried: dict[str, str] = {}
    others: dict[str, str] = {}
    names = candidates(name) if serial else [name] if name else list(USUAL_NAMES)
    for each in names:
        called = f'"{each}"' if each else "the library's default"
        if rig.uses(each):
            others[called] = f"{called} (in use by this process)"
            continue
        try:
            opened = rig.init(each)
        except DeviceNotFound as error:
            tried[called] = str(error)
            continue
        found, model = map(rig.library.string, (Parameter.DEVICE_SERIAL_NUMBER, Parameter.DEVICE_MODEL_TYPE))
        rig.library.drain()
        if not serial or found == serial:
            return opened
        others.setdefault(found, f"{called} ({model or 'unknown model'}, serial {found or 'unknown'})")
        rig.release(opened)
    wanted = f"with serial number {serial}" if serial else f'named "{name}"' if name else "at all"
    why = f" ({'; '.join(dict.fromkeys(tried.values()))})" if tried else ""
    raise DeviceNotFound(
        f"there is no haptic device {wanted}; found: {', '.join(others.values()) or 'none'};"
        f" not found: {', '.join(tried) or 'none'}{why}. Is it plugged in and powered, does the vendor's set-up tool"
        " see it, and does no other program use it? See docs/how-to/touch.md"
    )


def present(rig: TouchRig, names: list[str]) -> tuple[Found, ...]:
    """Initialise and release the devices one by one, with no servo and no force.

    ``names``: possible names of devices; a device in use by another program is not found.
    """
    found: dict[str, Found] = {}
    with rig.paused():
        for name in names:
            try:
                opened = rig.init(name)
            except DeviceNotFound:
                continue
            model, serial = map(rig.library.string, (Parameter.DEVICE_MODEL_TYPE, Parameter.DEVICE_SERIAL_NUMBER))
            rig.library.drain()
            rig.release(opened)
            found.setdefault(serial, Found(model, serial))
    return tuple(found.values())


def describe(library: Library, opened: OpenDevice, resolution: float) -> DeviceInfo:
    """Return the properties of the current device, while the scheduler is paused.

    ``resolution``: size of one encoder step, which the library does not report [m].
    """
    serial = _required(library, Parameter.DEVICE_SERIAL_NUMBER, library.string)
    model = _required(library, Parameter.DEVICE_MODEL_TYPE, library.string)
    peak = _force(library, Parameter.NOMINAL_MAX_FORCE)
    continuous = _force(library, Parameter.NOMINAL_MAX_CONTINUOUS_FORCE)
    usable = _required(library, Parameter.USABLE_WORKSPACE_DIMENSIONS, lambda what: library.doubles(what, 6))
    return DeviceInfo(
        model=model,
        serial=serial,
        max_force=peak,
        continuous_force=min(continuous, peak),
        resolution=resolution,
        workspace=workspace(usable),
        details={"name": opened.name or "the library's default", **_details(library)},
    )


def workspace(corners: tuple[float, ...]) -> Box:
    """Convert a workspace to the scene's frame.

    ``corners``: minimum and maximum corner in the vendor's frame: right, up, towards the user [mm].
    """
    right, up, near, most_right, most_up, most_near = (0.001 * value for value in corners)
    return Box(near, right, up, most_near, most_right, most_up)


def _required(library: Library, what: Parameter, read: Callable[[Parameter], T]) -> T:
    """Read a required parameter; raise an error if it is missing or empty."""
    value = read(what)
    faults = library.drain()
    if faults or value == "":
        raise DeviceError(f"the device does not report its HD_{what.name}: {_listed(faults) or 'an empty text'}")
    return value


def _force(library: Library, what: Parameter) -> float:
    """Read a force that limits others; raise an error if it cannot be one [N]."""
    (force,) = _required(library, what, lambda what: library.doubles(what, 1))
    if not (isfinite(force) and force >= 0.0):
        raise DeviceError(
            f"the device reports an HD_{what.name} of {force:g} N; expected a number of at least 0. Try "
            "the vendor's diagnostic tool; if it shows the same, install the driver again"
        )
    return force


def _details(library: Library) -> Mapping[str, str]:
    """Return further properties worth recording; for a missing one, the reason."""
    details: dict[str, str] = {}
    for key, text in TEXTS.items():
        details[key] = _value_or_fault(library, library.string(text))
    for key, (number, count, unit) in NUMBERS.items():
        values = " ".join(f"{value:g}" for value in library.doubles(number, count))
        details[key] = _value_or_fault(library, f"{values} {unit}")
    details["update_rate"] = _value_or_fault(library, f"{library.integer(Parameter.UPDATE_RATE)} Hz")
    return details


def _value_or_fault(library: Library, value: str) -> str:
    """Return a value, or the reason why it is missing."""
    faults = library.drain()
    return f"not reported: {_listed(faults)}" if faults else value


def _listed(faults: list[Fault]) -> str:
    return "; ".join(map(str, faults))


def calibrate(rig: TouchRig, opened: OpenDevice, pause: Callable[[float], None] = time.sleep) -> None:
    """Make sure that a device is calibrated, while its servo runs without force."""
    hd = rig.library.ticks
    state = _state(rig, opened)
    styles = Style(rig.ask(opened, "querying its kind of calibration", lambda: _style(rig.library)))
    best = next((style for style in (Style.CALIBRATION_AUTO, Style.CALIBRATION_INKWELL) if style in styles), None)
    if state == Calibration.CALIBRATION_NEEDS_UPDATE and best is not None:
        rig.ask(opened, "calibrating", lambda: hd.hdUpdateCalibration(best) or 0)
        for _ in range(round(CALIBRATE_S / RETRY_INTERVAL_S)):
            if (state := _state(rig, opened)) == Calibration.CALIBRATION_OK:
                log.info("the haptic device has been calibrated")
                break
            pause(RETRY_INTERVAL_S)
    if state != Calibration.CALIBRATION_OK:
        known = f"HD_{Calibration(state).name}" if state in set(Calibration) else f"an unknown state, 0x{state:04x}"
        todo = MANUAL[best or Style.CALIBRATION_ENCODER_RESET]
        raise DeviceError(f"the haptic device is not calibrated ({known}): {todo}; docs/how-to/touch.md")


def _state(rig: TouchRig, opened: OpenDevice) -> int:
    """Return the calibration state."""
    return rig.ask(opened, "querying its calibration", rig.library.ticks.hdCheckCalibration)


def _style(library: Library) -> int:
    """Return the calibration methods of the current device as bits; called in the servo thread."""
    room = c_int32()
    library.ticks.hdGetIntegerv(Parameter.CALIBRATION_STYLE, byref(room))
    return room.value


def enable(rig: TouchRig, opened: OpenDevice) -> dict[str, str]:
    """Enable force output and the library's own safeguards, while the scheduler is paused."""
    hd = rig.library
    hd.calls.hdMakeCurrentDevice(opened.handle)
    states = {}
    for limit in LIMITS:
        hd.calls.hdEnable(limit)
        faults = hd.drain()
        on = bool(hd.calls.hdIsEnabled(limit)) and not hd.drain()
        states[limit.name.lower()] = "on" if on else f"off: {_listed(faults) or 'the device does not have it'}"
        if not on:
            log.warning("the haptic device does without HD_%s: %s", limit.name, states[limit.name.lower()])
    # Last, so that there is no force without the library's own limits.
    hd.calls.hdEnable(Capability.FORCE_OUTPUT)
    rig.check("switching on the force")
    return states
