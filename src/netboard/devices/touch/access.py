"""What is read from and written to a device in each tick, as kernels that single steps and compiled runs call alike.

Only this module converts axes and units: the vendor has x right, y up, z towards the user, in mm; the scene has x out
of the screen, y right, z up, in m. The servo in C has two slots of memory, for the newest sample and for the force,
which compiled code accesses without Python (`netboard.devices.touch.shim`). What follows from an error or a stall is
decided by `netboard.devices.touch.device` in Python; compiled code only detects them, and then hands over.
"""

from typing import Any

import numpy as np
from numba.core import types

from netboard.base.compiled import Records, kernel
from netboard.base.tick import NEVER_NS
from netboard.devices.contract.access import Fields
from netboard.participants.body.device_forces import within

SYMBOL = "netboard_"
"""What the names of the shim's functions begin with where kernels call them."""

SAMPLE = np.dtype(
    [
        ("tick", "<i8"),  # number of the servo's tick, 0 before the first
        ("stamp_ns", "<i8"),  # time at which the position was read [ns]
        ("position", "<f8", (3,)),  # in the vendor's frame [mm]
        ("velocity", "<f8", (3,)),  # [mm/s]
        ("buttons", "<i4"),
        ("docked", "<i2"),  # 1: the stylus is in the inkwell
        ("cut", "<i2"),  # 1: the servo has cut an old force
    ]
)
"""Result of a tick of the servo; ``struct sample`` in the shim."""

LIBRARY = np.dtype(
    [
        ("since_ns", "<i8"),  # when the scheduler was started; NEVER_NS while it is stopped [ns]
        ("devices", "<i8"),  # open devices [1]
        ("kept", "<i8"),  # 1: errors are kept for a device
    ]
)
"""What the devices of a process share; see `netboard.devices.touch.library.TouchRig`."""

DEVICE = np.dtype(
    [
        ("servo", "<i8"),  # address of the servo in C; 0 for one in Python, and for a released device
        ("stall_ns", "<i8"),  # timeout after which a servo without ticks counts as stalled [ns]
        ("rested_ns", "<i8"),  # after a motor error, not ready before this time; or NEVER_NS [ns]
        ("max_force", "<f8"),  # of the motors [N]
    ]
)
"""State of an open device."""


def _shim_function(name: str, returns: Any, *arguments: Any) -> Any:
    """Make a function of the shim callable from kernels; `netboard.devices.touch.shim` tells its address."""
    return types.ExternalFunction(f"{SYMBOL}{name}", returns(*arguments))


_FLOAT: Any = types.float64
_servo_take = _shim_function("servo_take", types.int32, types.intp, types.intp)
_servo_has_fault = _shim_function("servo_has_fault", types.int32, types.intp)
_servo_put = _shim_function("servo_put", types.void, types.intp, _FLOAT, _FLOAT, _FLOAT)


@kernel
def has_stalled(library: Records, device: Records, sample: Records, now_ns: int) -> bool:
    """Return whether the servo should have run since its newest sample."""
    since_ns = library[0]["since_ns"]
    return bool(since_ns != NEVER_NS and now_ns - max(sample[0]["stamp_ns"], since_ns) > device[0]["stall_ns"])


@kernel
def reading_of(library: Records, device: Records, sample: Records, now_ns: int) -> Fields:
    """Convert the newest sample to a reading."""
    s = sample[0]
    rested = now_ns >= device[0]["rested_ns"]
    ready = library[0]["since_ns"] != NEVER_NS and s["docked"] == 0 and s["cut"] == 0 and rested
    place, rate = s["position"], s["velocity"]
    return (
        min(s["stamp_ns"], now_ns),
        1e-3 * place[2],
        1e-3 * place[0],
        1e-3 * place[1],
        1e-3 * rate[2],
        1e-3 * rate[0],
        1e-3 * rate[1],
        0 + s["buttons"],  # widened to 64 bits, as the buttons of every reading
        bool(ready),
    )


@kernel
def to_motors(device: Records, fx: float, fy: float, fz: float) -> tuple[float, float, float]:
    """Limit a force to what the motors can deliver, and return it in the vendor's frame [N]."""
    fx, fy, fz = within(device[0]["max_force"], fx, fy, fz)
    return fy, fz, fx


@kernel
def read(parts: tuple[Any, ...], now_ns: int) -> tuple[bool, Fields]:
    """Read a device with a servo in C, unless Python must judge an error or a stall."""
    library, device, sample, _ = parts
    servo = device[0]["servo"]
    if servo == 0:  # released: Python says so
        return False, reading_of(library, device, sample, now_ns)
    # Before the errors: those of a tick are there when its sample is, so none of them can be missed.
    _servo_take(servo, sample.ctypes.data)
    alone = library[0]["devices"] == 1 and library[0]["kept"] == 0  # another device may have taken errors of this one
    found = alone and _servo_has_fault(servo) == 0 and not has_stalled(library, device, sample, now_ns)
    return found, reading_of(library, device, sample, now_ns)


@kernel
def write(parts: tuple[Any, ...], fx: float, fy: float, fz: float) -> None:
    """Set the force of a device with a servo in C, unless it is released."""
    _, device, _, _ = parts
    servo = device[0]["servo"]
    right, up, near = to_motors(device, fx, fy, fz)
    if servo != 0:
        _servo_put(servo, right, up, near)


@kernel
def live(parts: tuple[Any, ...], now_ns: int) -> None:
    """Do nothing: a real hand lives by itself."""
