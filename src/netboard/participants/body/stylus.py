"""Mechanics of a held stylus at 4 kHz, in each axis: a mass under the force of a hand and of the device's motors.

The hand is an impedance, as an `ACTION` says: ``F = K (target - x) - B v + force``. The device adds its mass, viscous
damping, Coulomb friction and stops; compliant cables (`netboard.participants.body.cable`) lie between motors and hand.

Rule 1: the number of steps is an argument; there is no clock.
Rule 2: friction is solved implicitly, so a stylus held by friction is exactly at rest and does not creep.
Rule 3: the axes x, y, z are integrated together as lanes of a vector register, a step at a time.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import composed, inlined, kernel, machine_code
from netboard.base.errors import ConfigError
from netboard.participants.body.cable import CABLES, TIP, pack_cables, stretch
from netboard.participants.body.device_models import DeviceModel
from netboard.physics.arithmetic.simd import Packed, gathered, lanes_at, larger, put, smaller, where_within

STEP_NS = 250_000
"""Length of an integration step [ns]."""

STEP = STEP_NS * 1e-9
"""Length of an integration step [s]."""

UPDATE_STEPS = 4
"""Integration steps between two updates of what the hand does [1]."""

LANES = 4
"""Lanes of a vector register in which the axes x, y, z are integrated together [1]."""

ACTION = np.dtype(
    [
        ("target", "<f8", (3,)),  # equilibrium point x, y, z of the hand [m]
        ("stiffness", "<f8"),  # stiffness of the hand towards it [N/m]
        ("damping", "<f8"),  # damping of the hand [N s/m]
        ("force", "<f8", (3,)),  # force of the hand besides, along x, y, z [N]
    ]
)
"""What a hand does to the stylus until the next update."""


MAX_HAND_FORCE = 50.0
"""Largest force besides its stiffness that a hand may command: the strength of a pinch (Mathiowetz et al. 1985) [N]."""

NOT_A_NUMBER, TOO_STRONG, TOO_SLOW = 1, 2, 3
"""Why a hand has let go: its action was not a number or too strong, or its policy decides too slowly; 0: it has not."""


@inlined
def let_go(action: np.void) -> None:
    """Let the hand go: no stiffness, damping and force."""
    action["stiffness"] = action["damping"] = 0.0
    for axis in range(3):
        action["target"][axis] = action["force"][axis] = 0.0


@inlined
def let_go_unless_possible(action: np.void) -> int:
    """Return 0 if a hand can do an action; else let go, and return why."""
    target, force = action["target"], action["force"]
    total, largest = action["stiffness"] + action["damping"], 0.0
    for axis in range(3):
        total += target[axis] + force[axis]
        largest = max(largest, abs(force[axis]))
    if np.isfinite(total) and largest <= MAX_HAND_FORCE:
        return 0
    let_go(action)
    return TOO_STRONG if np.isfinite(total) else NOT_A_NUMBER


MECHANICS = np.dtype(
    [
        ("per_force", "<f8"),  # change of velocity per force in a step [m/s/N]
        ("damping", "<f8"),  # damping of the device [N s/m]
        ("friction_step", "<f8"),  # largest change of velocity by Coulomb friction in a step [m/s]
        ("stop", "<f8"),  # mechanical stop of each axis [m]
    ]
)
"""Constants of a stylus, as one record for the kernels."""

STYLUS = np.dtype(
    [
        ("place", "<f8", (LANES,)),  # position x, y, z; with compliant cables, of the motor side [m]
        ("v", "<f8", (LANES,)),  # velocity [m/s]
        ("steps", "<i8"),  # steps so far
    ]
)
"""State of a stylus."""


class HandMechanics(NamedTuple):
    """What a hand adds to the mechanics of a device for as long as it holds the stylus.

    ``friction``: friction of the device that the hand compensates at all times. ``impedance``: stiffness and damping of
    its actions, if they are constant; else None.
    """

    mass: float = 0.0  # [kg]
    friction: float = 0.0  # [N]
    impedance: tuple[float, float] | None = (0.0, 0.0)  # [N/m, N s/m]


def pack_mechanics(device: DeviceModel, hand: HandMechanics) -> NDArray[Any]:
    """Return the constants of a stylus, packed for the kernels: ndarray of MECHANICS, shape (1,) [SI]."""
    packed = np.zeros(1, MECHANICS)
    packed["per_force"] = STEP / (device.mass + hand.mass)
    packed["damping"], packed["stop"] = device.damping, device.workspace
    packed["friction_step"] = packed["per_force"] * (device.friction - hand.friction)
    return packed


@inlined
def _advanced(place: Packed, v: Packed, force: Packed, damping_factor: Packed, m: np.void) -> tuple[Any, Any]:
    """Advance all axes by one step: implicit friction and damping (Moreau's time stepping), then the stops."""
    v = v + m["per_force"] * force
    v = damping_factor * (v - smaller(larger(v, -m["friction_step"]), m["friction_step"]))
    place, stop = place + STEP * v, m["stop"]
    return smaller(larger(place, -stop), stop), where_within(place, -stop, stop, v, 0.0)


@inlined
def pulled(
    place: Packed, v: Packed, push: Packed, stiffness: Packed, damping: Packed, m: np.void, steps: int
) -> tuple[Any, Any]:
    """Advance lanes, the axes of one stylus or the heights of many, under a force and the stiffness of a hand.

    ``push``: force at place 0 [N]. ``stiffness``, ``damping``: those of the hand, a number or lanes [N/m, N s/m].
    """
    damping_factor = 1.0 / (1.0 + m["per_force"] * (m["damping"] + damping))
    for _ in range(steps):
        place, v = _advanced(place, v, push - stiffness * place, damping_factor, m)
    return place, v


@inlined
def integrate(s: np.void, m: np.void, action: np.void, fx: float, fy: float, fz: float, steps: int) -> None:
    """Advance a stylus between two updates, under a constant motor force."""
    stiffness, target, force = action["stiffness"], action["target"], action["force"]
    push = gathered(
        (
            stiffness * target[0] + force[0] + fx,
            stiffness * target[1] + force[1] + fy,
            stiffness * target[2] + force[2] + fz,
        ),
        LANES,
    )
    place, v = lanes_at(s["place"], 0, LANES), lanes_at(s["v"], 0, LANES)
    place, v = pulled(place, v, push, stiffness, action["damping"], m, steps)
    put(s["place"], 0, place)
    put(s["v"], 0, v)
    s["steps"] += steps


@kernel
def integrate_on_cables(
    s: np.void, tip: np.void, cables: np.void, action: np.void, fx: float, fy: float, fz: float, steps: int
) -> None:
    """Advance a stylus as `integrate` does, with compliant cables; `s` is then the state of the motor side."""
    t, target, load, place, v = tip, action["target"], action["force"], s["place"], s["v"]
    for _ in range(steps):
        place[0], v[0], t["x"], t["vx"] = stretch(place[0], v[0], t["x"], t["vx"], fx, load[0], target[0], cables)
        place[1], v[1], t["y"], t["vy"] = stretch(place[1], v[1], t["y"], t["vy"], fy, load[1], target[1], cables)
        place[2], v[2], t["z"], t["vz"] = stretch(place[2], v[2], t["z"], t["vz"], fz, load[2], target[2], cables)
    s["steps"] += steps


class HeldStylus(NamedTuple):
    """A stylus and the hand that holds it, as the kernels see them: arrays of one record, and the holder's own."""

    stylus: NDArray[Any]
    tip: NDArray[Any]  # state of the stylus side, with compliant cables
    mechanics: NDArray[Any]
    cables: NDArray[Any]  # empty for rigid cables
    action: NDArray[Any]  # what the hand does now
    holder: tuple[Any, ...]  # what `act` needs


def hold(device: DeviceModel, hand: HandMechanics, action: NDArray[Any], holder: tuple[Any, ...] = ()) -> HeldStylus:
    """Return a stylus at rest at height 0, in a hand.

    ``action``: ndarray of ACTION, shape (1,), which the holder writes. Raises `ConfigError` if the cables are compliant
    and the impedance of the hand is not constant, which the cables' solver requires.
    """
    cables = np.zeros(0, CABLES)
    if device.cable_stiffness > 0.0:
        if hand.impedance is None:
            raise ConfigError(
                f"[virtual] cable_stiffness: found {device.cable_stiffness:g}, expected 0: the stiffness of a hand on "
                "compliant cables is constant, and this one changes"
            )
        cables = pack_cables(device, hand.mass, hand.friction, hand.impedance, STEP)
    return HeldStylus(np.zeros(1, STYLUS), np.zeros(1, TIP), pack_mechanics(device, hand), cables, action, holder)


@inlined
def release(holder: tuple[Any, ...], stylus: np.void, force: float, when: float, action: np.void) -> None:
    """Do nothing: no hand holds the stylus."""


def _act(holder: tuple[Any, ...], stylus: np.void, force: float, when: float, action: np.void) -> None:
    """Placeholder for what a holder does at an update, which `composed` replaces."""
    raise NotImplementedError


def _advance(held: HeldStylus, origin: float, fx: float, fy: float, fz: float, steps: int) -> None:
    """Advance a stylus under a constant motor force, over any number of updates.

    ``origin``: time of the initial state, on the holder's clock [s].
    """
    s, action, done = held.stylus[0], held.action[0], 0
    while done < steps:
        if s["steps"] % UPDATE_STEPS == 0:
            _act(held.holder, s, fz, origin + done * STEP, action)
        part = min(UPDATE_STEPS - s["steps"] % UPDATE_STEPS, steps - done)
        if len(held.cables) > 0:
            integrate_on_cables(s, held.tip[0], held.cables[0], action, fx, fy, fz, part)
        else:
            integrate(s, held.mechanics[0], action, fx, fy, fz, part)
        done += part


@cache
def advance_with(act: Callable[..., None]) -> Callable[..., None]:
    """Compile the mechanics of a stylus around what its holder does: a kernel with the arguments of `release`."""
    return composed(_advance, _act=act)


@final
class StylusMechanics:
    """One stylus and its holder, for Python. ``act``: as for `advance_with`."""

    def __init__(self, held: HeldStylus, act: Callable[..., None] = release) -> None:
        self.held = held
        self._advance = machine_code(advance_with(act), held, *(0.0,) * 4, 0)

    def put(self, x: float, y: float, z: float) -> None:
        """Put the stylus at rest at a place [m]."""
        self.held.stylus["place"][0, :3], self.held.stylus["v"] = (x, y, z), 0.0
        for name, place in zip("xyz", (x, y, z), strict=True):
            self.held.tip[name] = place

    def advance(self, steps: int, origin: float, force: tuple[float, float, float]) -> None:
        """Advance under a constant motor force along x, y, z [N]; `origin` as in the kernel [s]."""
        self._advance(self.held, origin, *force, steps)

    @property
    def tip(self) -> tuple[float, float, float]:
        """Position x, y, z of the stylus; with compliant cables it differs from that at the encoders [m]."""
        if len(self.held.cables) == 0:
            return self.position
        t = self.held.tip[0]
        return float(t["x"]), float(t["y"]), float(t["z"])

    @property
    def position(self) -> tuple[float, float, float]:
        """Position x, y, z at the encoders [m]."""
        x, y, z, _ = self.held.stylus["place"][0].tolist()
        return x, y, z

    @property
    def velocity(self) -> tuple[float, float, float]:
        """Velocity x, y, z at the encoders [m/s]."""
        vx, vy, vz, _ = self.held.stylus["v"][0].tolist()
        return vx, vy, vz
