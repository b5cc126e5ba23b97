"""Simulated devices: the mechanics, encoders and motors of a device model, whatever holds the stylus.

Each reading simulates the hand's mechanics up to the requested time, under the last written force. The device therefore
needs no thread and is deterministic in its times and forces. A caller with no time for that at the reading calls
`SimulatedDevice.live` right after each force. The force then acts from that time on, and a reading within the same
millisecond only extrapolates the hand at its velocity. The device reports what real hardware would: positions in whole
encoder steps, and the velocity that `netboard.devices.contract.velocity` estimates from them. Its motors saturate at
their largest force.

The configuration table ``virtual`` selects the device model and further imperfections of real hardware: cable
compliance (`netboard.participants.body.cable`), motor heating, delayed readings and forces. An imperfection that is not
configured is absent and costs no time.
"""

from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from functools import cache
from math import exp, hypot
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, composed, inlined, kernel, machine_code, waiting
from netboard.base.config import Config, Side
from netboard.base.tick import NEVER_NS, TICK_NS
from netboard.devices.contract.access import CompiledAccess, Fields
from netboard.devices.contract.device import Box, Device, DeviceInfo, Reading
from netboard.devices.contract.velocity import Velocimeter, windowed_velocity
from netboard.participants.body.device_forces import within
from netboard.participants.body.device_models import resolved
from netboard.participants.body.stylus import (
    STEP,
    STEP_NS,
    HeldStylus,
    StylusMechanics,
    advance_with,
)

CATCH_UP_NS = 50_000_000
"""Longest simulated time per reading; a longer pause between readings is cut to this [ns]."""

MS_NS = 1_000_000
"""One millisecond [ns]."""

COOL = 0.8
"""Hot motors recover below this temperature, as a fraction of the limit [1]."""

Vector = tuple[float, float, float]


@inlined
def _quantised(x: float, y: float, z: float, step: float) -> tuple[float, float, float]:
    """Return a position in whole encoder steps; a step of 0 m changes nothing."""
    if step == 0.0:
        return x, y, z
    return round(x / step) * step, round(y / step) * step, round(z / step) * step


@kernel
def encoded(state: Records, rest: float, stop: float, step: float) -> tuple[float, float, float]:
    """Return the position in whole encoder steps a given time [s] after the state, not beyond the stops [m]."""
    place, v = state[0]["place"], state[0]["v"]
    x = min(max(place[0] + rest * v[0], -stop), stop)
    y = min(max(place[1] + rest * v[1], -stop), stop)
    z = min(max(place[2] + rest * v[2], -stop), stop)
    return _quantised(x, y, z, step)


DEVICE = np.dtype(
    [
        ("time_ns", "<i8"),  # time up to which the hand has been simulated, or NEVER_NS [ns]
        ("written", "<f8", (3,)),  # force written last, within the limit [N]
        ("acting", "<f8", (3,)),  # force of the motors on the hand [N]
        ("faulty", "<i8"),  # not 0: what holds the stylus has failed, and why; no force may be rendered
        ("z", "<f8"),  # height of the newest reading [m]
        ("vz", "<f8"),  # and its velocity [m/s]
        ("limit", "<f8"),  # largest force of the motors [N]
        ("stop", "<f8"),  # mechanical stop of each axis [m]
        ("step", "<f8"),  # encoder step, 0 for none [m]
    ]
)
"""State of a virtual device, and what its kernels need of its model."""


@inlined
def _act(d: np.void) -> None:
    """Let the force written last act on the hand."""
    for axis in range(3):
        d["acting"][axis] = d["written"][axis]


class SimulatedParts(NamedTuple):
    """A simulated device, as the kernels see it."""

    device: NDArray[Any]
    window: NDArray[Any]  # positions from which the velocity is estimated
    held: HeldStylus


def advance_held(held: HeldStylus, origin: float, fx: float, fy: float, fz: float, steps: int) -> None:
    """Placeholder for the mechanics of the stylus in its holder's hand, which `composed` replaces."""
    raise NotImplementedError


def advance_to(parts: SimulatedParts, now_ns: int) -> None:
    """Simulate the hand up to now under the acting force, in whole steps, and over `CATCH_UP_NS` at most."""
    d = parts.device[0]
    start_ns = now_ns if d["time_ns"] == NEVER_NS else max(d["time_ns"], now_ns - CATCH_UP_NS)
    steps = max(now_ns - start_ns, 0) // STEP_NS
    if steps > 0:
        fx, fy, fz = d["acting"][0], d["acting"][1], d["acting"][2]
        advance_held(parts.held, start_ns * 1e-9, fx, fy, fz, steps)
    d["time_ns"] = start_ns + steps * STEP_NS


def live(parts: SimulatedParts, now_ns: int) -> None:
    """Simulate the hand up to now; the force written last acts from then on."""
    advance_to(parts, now_ns)
    _act(parts.device[0])


def read(parts: SimulatedParts, now_ns: int) -> tuple[bool, Fields]:
    """Read the stylus, after a simulation up to now unless the last one was within a millisecond."""
    d = parts.device[0]
    if d["time_ns"] == NEVER_NS or now_ns - d["time_ns"] >= TICK_NS:
        _act(d)
        advance_to(parts, now_ns)
    rest = max(now_ns - d["time_ns"], 0) * 1e-9
    x, y, z = encoded(parts.held.stylus, rest, d["stop"], d["step"])
    vx, vy, vz = windowed_velocity(parts.window, now_ns, x, y, z)
    d["z"], d["vz"] = z, vz
    return True, (now_ns, x, y, z, vx, vy, vz, 0, d["faulty"] == 0)


class Kernels(NamedTuple):
    """The kernels of a simulated device around what its holder does."""

    advance_to: Callable[..., None]
    live: Callable[..., None]
    read: Callable[..., tuple[bool, Fields]]


@cache
def kernels_with(holder_acts: Callable[..., None]) -> Kernels:
    """Compile the kernels of a simulated device around what its holder does at an update of its hand.

    Other threads run meanwhile: a holder may hang.
    """
    advance = composed(advance_to, waiting, advance_held=advance_with(holder_acts))
    return Kernels(advance, composed(live, waiting, advance_to=advance), composed(read, waiting, advance_to=advance))


@kernel
def write(parts: SimulatedParts, fx: float, fy: float, fz: float) -> None:
    """Set the force, limited to what the motors can deliver [N]."""
    d = parts.device[0]
    d["written"][0], d["written"][1], d["written"][2] = within(d["limit"], fx, fy, fz)


class MotorTemperature:
    """Motor temperature as a first-order system driven by the squared force.

    Temperature is relative to the room, in units of the motors' limit: the continuous force, held indefinitely, brings
    it to 1. Above 1 the motors are hot until they have cooled to `COOL`.

    ``continuous``: continuous force of the motors [N]. ``time``: their time constant [s].
    """

    def __init__(self, continuous: float, time: float) -> None:
        self.temperature = 0.0
        self.warm = False
        self._continuous = continuous
        self._time = time

    def live(self, seconds: float, force: float) -> None:
        """Advance the time under a constant force."""
        end = (force / self._continuous) ** 2
        self.temperature = end + (self.temperature - end) * exp(-seconds / self._time)
        self.warm = self.temperature > (COOL if self.warm else 1.0)


class DelayLine:
    """Delay line for positions, with linear interpolation between samples."""

    def __init__(self, delay_ns: int) -> None:
        self._delay_ns = delay_ns
        self._taken: deque[tuple[int, Vector]] = deque()

    def take(self, now_ns: int, place: Vector) -> Vector:
        """Store the current position and return the delayed one; at the start, return the first position."""
        taken, then_ns = self._taken, now_ns - self._delay_ns
        if not taken or now_ns > taken[-1][0]:
            taken.append((now_ns, place))
        while len(taken) > 1 and taken[1][0] <= then_ns:
            taken.popleft()
        start_ns, start = taken[0]
        if len(taken) == 1 or then_ns <= start_ns:
            return start
        end_ns, end = taken[1]
        share = (then_ns - start_ns) / (end_ns - start_ns)
        x, y, z = (a + share * (b - a) for a, b in zip(start, end, strict=True))
        return x, y, z


class SimulatedDevice(Device):
    """A simulated device; a subclass says what holds its stylus.

    It uses the tables ``virtual`` and ``agents`` of the configuration, and the block's seed.
    """

    def __init__(self, side: Side, config: Config) -> None:
        super().__init__(side, config)
        virtual = config.virtual
        self._model = model = resolved(virtual)
        self._state = np.zeros(1, DEVICE)
        self._device = self._state[0]
        self._written, self._acting = self._device["written"], self._device["acting"]
        self._device["time_ns"], self._device["limit"] = NEVER_NS, model.max_force
        self._device["stop"], self._device["step"] = model.workspace, model.resolution
        self._velocimeter = Velocimeter(model.resolution)
        self._heat = MotorTemperature(model.continuous_force, model.thermal_time) if model.thermal_time > 0.0 else None
        self._read_delay_ns = round(virtual.read_latency_ms * MS_NS)
        self._write_delay_ns = round(virtual.write_latency_ms * MS_NS)
        self._late = DelayLine(self._read_delay_ns) if self._read_delay_ns > 0 else None
        self._coming: deque[tuple[int, NDArray[np.float64]]] = deque()
        self._ideal = self._heat is None and self._read_delay_ns == self._write_delay_ns == 0
        self._stylus, holder_acts = self._held(config)
        self._kernels = kernels_with(holder_acts)
        self._parts = SimulatedParts(self._state, self._velocimeter.state, self._stylus.held)
        self._encoded = machine_code(encoded, self._stylus.held.stylus, 0.0, 0.0, 0.0)
        self._advance_to = machine_code(self._kernels.advance_to, self._parts, 0)
        self._live = machine_code(self._kernels.live, self._parts, 0)
        self._read_ideal = machine_code(self._kernels.read, self._parts, 0)

    @abstractmethod
    def _held(self, config: Config) -> tuple[StylusMechanics, Callable[..., None]]:
        """Return the stylus in what holds it, and the kernel of what that does at an update of the hand."""

    @property
    def felt(self) -> float:
        """Vertical force of the motors on the hand [N]."""
        return float(self._acting[2] if self._write_delay_ns else self._written[2])

    @property
    def tip(self) -> tuple[float, float, float]:
        """True position of the stylus in the device's own frame, without encoder, cable and latency effects [m]."""
        return self._stylus.tip

    @property
    def temperature(self) -> float:
        """Motor temperature: 1 at the limit, always 0 without heating [1]."""
        return 0.0 if self._heat is None else self._heat.temperature

    def put(self, z: float) -> None:
        """Place the stylus at a height, at rest, and release it there: the start of a release study."""
        x, y, _ = self._stylus.position
        self._stylus.put(x, y, z)

    def live(self, now_ns: int) -> None:
        """Simulate the hand's mechanics up to now; the last written force acts from then on."""
        if self._ideal:
            self._live(self._parts, now_ns)
        else:
            self._advance_imperfect(now_ns)
            self._apply_written(now_ns)

    def _open(self) -> DeviceInfo:
        model = self._model
        reach = model.workspace + model.resolution  # the end stops, in whole encoder steps
        return DeviceInfo(
            model=f"virtual {model.name}",
            serial=f"virtual-{self.side}",
            max_force=model.max_force,
            continuous_force=model.continuous_force,
            resolution=model.resolution,
            workspace=Box(-reach, -reach, -reach, reach, reach, reach),
            details=self._details(),
        )

    def _compiled(self) -> CompiledAccess | None:
        return CompiledAccess(self._parts, self._kernels.read, write, self._kernels.live) if self._ideal else None

    def _read(self, now_ns: int) -> Reading:
        if self._ideal:
            _, fields = self._read_ideal(self._parts, now_ns)
            return Reading(*fields)
        time_ns = int(self._device["time_ns"])
        if time_ns == NEVER_NS or now_ns - time_ns >= TICK_NS:
            self._apply_written(now_ns if time_ns == NEVER_NS else time_ns)
            self._advance_imperfect(now_ns)
        x, y, z = self._encoder(now_ns)
        vx, vy, vz = self._velocimeter.update(now_ns, x, y, z)
        self._device["z"], self._device["vz"] = z, vz
        cool = self._heat is None or not self._heat.warm
        return Reading(now_ns, x, y, z, vx, vy, vz, 0, cool and not self._device["faulty"])

    def _write(self, fx: float, fy: float, fz: float) -> None:
        limit = self._device["limit"]
        small = abs(fx) + abs(fy) + abs(fz) <= limit  # the usual case, without a call of compiled code
        self._written[:] = (fx, fy, fz) if small else within(limit, fx, fy, fz)

    def _close(self) -> None:
        self._device["time_ns"] = NEVER_NS
        self._velocimeter.forget()
        self._late = DelayLine(self._read_delay_ns) if self._late is not None else None
        self._coming.clear()
        self._acting[:] = self._written

    def _apply_written(self, at_ns: int) -> None:
        """Apply the last written force from a given time on, plus the actuation delay."""
        if self._write_delay_ns == 0:
            self._acting[:] = self._written
        else:
            self._coming.append((at_ns + self._write_delay_ns, self._written.copy()))

    def _advance_imperfect(self, now_ns: int) -> None:
        """Simulate the hand up to now as `advance_to` does, with the delayed forces that become due, and with heat."""
        if self._device["time_ns"] != NEVER_NS:
            self._device["time_ns"] = max(self._device["time_ns"], now_ns - CATCH_UP_NS)
        while self._coming and self._coming[0][0] <= now_ns:
            due_ns, force = self._coming.popleft()
            self._advance_and_heat(due_ns)
            self._acting[:] = force
        self._advance_and_heat(now_ns)

    def _advance_and_heat(self, until_ns: int) -> None:
        """Simulate hand and motors under the acting force; hot motors deliver no more than the continuous force."""
        before_ns = int(self._device["time_ns"])
        self._advance_to(self._parts, until_ns)
        steps = (int(self._device["time_ns"]) - before_ns) // STEP_NS
        if self._heat is None or before_ns == NEVER_NS or steps == 0:
            return
        self._heat.live(steps * STEP, hypot(*self._acting))
        limit = self._model.continuous_force if self._heat.warm else self._model.max_force
        self._device["limit"] = limit
        if self._heat.warm:
            self._acting[:] = within(limit, *self._acting)
            self._written[:] = within(limit, *self._written)

    def _encoder(self, now_ns: int) -> Vector:
        """Return the encoder position extrapolated from the last whole step, or the delayed one [m]."""
        rest = max(now_ns - int(self._device["time_ns"]), 0) * 1e-9
        stop, step = self._model.workspace, self._model.resolution
        if self._late is None:
            return self._encoded(self._stylus.held.stylus, rest, stop, step)
        return _quantised(*self._late.take(now_ns, self._encoded(self._stylus.held.stylus, rest, stop, 0.0)), step)

    def _details(self) -> dict[str, str]:
        """Return the parameters of the device and its configured imperfections."""
        model = self._model
        details = {
            "mass": f"{model.mass!r} kg",
            "friction": f"{model.friction!r} N",
            "damping": f"{model.damping!r} N s/m",
            "cable stiffness": f"{model.cable_stiffness!r} N/m" if model.cable_stiffness else "",
            "thermal time": f"{model.thermal_time!r} s" if model.thermal_time else "",
            "read latency": f"{self._read_delay_ns / MS_NS!r} ms" if self._read_delay_ns else "",
            "write latency": f"{self._write_delay_ns / MS_NS!r} ms" if self._write_delay_ns else "",
        }
        return {name: value for name, value in details.items() if value}
