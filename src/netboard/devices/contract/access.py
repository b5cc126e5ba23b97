"""Compiled access to a device, and the transform from its own frame to the scene's, for single steps and runs alike.

A backend's kernels read and write in its own frame. `placed_access` composes them with the estimator of the velocity
and with `in_scene_frame`, the kernel that `netboard.devices.contract.device.Device.read` calls, too.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, composed, kernel
from netboard.devices.contract.estimators import Estimator

Fields: TypeAlias = tuple[int, float, float, float, float, float, float, int, bool]
"""Fields of a `netboard.devices.contract.device.Reading`."""

Kernel: TypeAlias = Callable[..., Any]


class CompiledAccess(NamedTuple):
    """Kernels that access an open device, so that compiled code can run ticks without Python.

    ``parts`` is the first argument of each. The kernels must not fail: where Python is needed, as after an error of the
    device, `read` says so and changes nothing that a later reading depends on, and `Device.read` then handles it.
    """

    parts: tuple[Any, ...]  # arrays, and tuples of them
    read: Callable[..., tuple[bool, Fields]]  # (parts, now_ns): whether there is a `Reading`, and its fields
    write: Callable[..., None]  # (parts, fx, fy, fz): sets the force on the hand [N]
    live: Callable[..., None]  # (parts, now_ns): called right after a force was set


PLACEMENT = np.dtype(
    [
        ("limited", "<i8"),  # 1: the workspace is known
        ("box", "<f8", (6,)),  # workspace, as in `Box` [m]
        ("zero", "<f8", (3,)),  # scene's origin in the device's own frame [m]
        ("scale", "<f8"),
        ("lowered", "<f8"),  # the agent's ``zero`` [m]
    ]
)
"""Transform from a device's own frame to the scene's, as `in_scene_frame` needs it."""


@kernel
def in_scene_frame(
    placement: Records,
    stamp_ns: int,
    x: float,
    y: float,
    z: float,
    vx: float,
    vy: float,
    vz: float,
    buttons: int,
    ready: bool,
) -> Fields:
    """Transform a reading from the device's own frame to the scene's; outside the workspace it is not ready."""
    p = placement[0]
    b, zero, scale = p["box"], p["zero"], p["scale"]
    holds = b[0] <= x <= b[3] and b[1] <= y <= b[4] and b[2] <= z <= b[5]
    return (
        stamp_ns,
        (x - zero[0]) * scale,
        (y - zero[1]) * scale,
        (z - zero[2]) * scale - p["lowered"],
        vx * scale,
        vy * scale,
        vz * scale,
        buttons,
        bool(ready and (holds or p["limited"] == 0)),
    )


def _own_read(parts: tuple[Any, ...], now_ns: int) -> tuple[bool, Fields]:
    """Stand for the reading of a backend."""
    return True, (now_ns, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, False)


def _own_write(parts: tuple[Any, ...], fx: float, fy: float, fz: float) -> None:
    """Stand for the writing of a backend."""


def _own_live(parts: tuple[Any, ...], now_ns: int) -> None:
    """Stand for what a backend does after a force."""


def _estimate(state: Records, stamp_ns: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Stand for the estimator of the velocity."""
    return 0.0, 0.0, 0.0


def _read_placed(parts: tuple[Any, ...], now_ns: int) -> tuple[bool, Fields]:
    """Read as `Device.read` does, with the velocity of the backend."""
    own, placement, _ = parts
    found, reading = _own_read(own, now_ns)
    return found, in_scene_frame(placement, *reading)


def _read_estimated(parts: tuple[Any, ...], now_ns: int) -> tuple[bool, Fields]:
    """Read as `Device.read` does, with the velocity of an estimator."""
    own, placement, state = parts
    found, reading = _own_read(own, now_ns)
    if not found:
        return found, reading
    stamp_ns, x, y, z, vx, vy, vz, buttons, ready = reading
    vx, vy, vz = _estimate(state, stamp_ns, x, y, z)
    return found, in_scene_frame(placement, stamp_ns, x, y, z, vx, vy, vz, buttons, ready)


def _write_placed(parts: tuple[Any, ...], fx: float, fy: float, fz: float) -> None:
    """Write as the backend does."""
    _own_write(parts[0], fx, fy, fz)


def _live_placed(parts: tuple[Any, ...], now_ns: int) -> None:
    """Do what the backend does after a force."""
    _own_live(parts[0], now_ns)


@cache
def _composed(own: Kernel, template: Kernel, estimate: Kernel) -> Kernel:
    """Compile one of the templates above with the kernels of a backend and an estimator."""
    names = {"_own_read": own, "_own_write": own, "_own_live": own, "_estimate": estimate}
    return composed(template, **{name: found for name, found in names.items() if name in template.__code__.co_names})


def placed_access(own: CompiledAccess, placement: NDArray[Any], estimator: Estimator | None) -> CompiledAccess:
    """Return a backend's access in the scene's frame, with the velocity of an estimator if there is one."""
    if estimator is None:
        read, state = _composed(own.read, _read_placed, _estimate), np.zeros(1)
    else:
        read, state = _composed(own.read, _read_estimated, estimator.kernel), estimator.state
    write, live = (_composed(*pair, _estimate) for pair in ((own.write, _write_placed), (own.live, _live_placed)))
    return CompiledAccess((own.parts, placement, state), read, write, live)
