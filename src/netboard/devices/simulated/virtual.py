"""Backend ``virtual``: a device that does not exist, a Touch if nothing else is said, held by a simulated hand.

Reading it lets the hand's mechanics run up to the time asked for, under the force written last; so it needs no thread
and is as repeatable as the times and forces it is given. Whoever has no time for that when the stylus is to be read
calls `VirtualTouch.live` right after each force: that one acts from then on, and a reading within the same millisecond
only carries the hand on at its speed. What the device reports is what such a device would: a position in
whole encoder steps, and the velocity that `netboard.devices.contract.velocity` makes of such positions. Its motors
saturate at their largest force, like real ones.

Which device it stands for, and which of a real one's flaws it has beside these, is the table ``virtual`` of the
configuration: cables that give (`netboard.participants.cable`), motors that get warm, readings and forces that take
their time. A flaw that is not asked for is not there, and costs nothing.

Options (``agents.<side>.options``): see `Options`.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from math import hypot
from typing import Annotated, Any, final

import numba
import numpy as np
from pydantic import StrictBool

from netboard.base.config import SIDES, Config, Side
from netboard.base.settings import NO_EXTRAS, about
from netboard.base.tick import TICK_NS
from netboard.devices.contract.device import Box, Device, DeviceInfo, Reading
from netboard.devices.contract.velocity import Velocimeter
from netboard.devices.simulated.imperfections import Heat, Late
from netboard.participants.device_models import resolved
from netboard.participants.hand import STEP, STEP_NS, hold
from netboard.participants.submovement import Submovement

CATCH_UP_NS = 50_000_000
"""After a longer pause between two readings the hand lives through only so much of it [ns]."""

MS_NS = 1_000_000
"""A millisecond [ns]."""

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Options:
    """Options of the virtual device."""

    __pydantic_config__ = NO_EXTRAS
    held: Annotated[StrictBool, about("false: nobody holds the stylus")] = True


@numba.njit(cache=True)
def encoded(state: Any, rest: float, step: float) -> tuple[float, float, float]:
    """Return where a hand is so long after its state, in whole encoder steps."""
    s = state[0]
    x, y, z = s["x"] + rest * s["vx"], s["y"] + rest * s["vy"], s["z"] + rest * s["vz"]
    if step == 0.0:
        return x, y, z
    return round(x / step) * step, round(y / step) * step, round(z / step) * step


@numba.njit(cache=True)
def within(limit: float, fx: float, fy: float, fz: float) -> tuple[float, float, float]:
    """Scale a force down to a limit [N]."""
    size = np.hypot(np.hypot(fx, fy), fz)
    if size <= limit:
        return fx, fy, fz
    share = limit / size
    return fx * share, fy * share, fz * share


@final
class VirtualTouch(Device):
    """A simulated device in a simulated hand.

    Parameters
    ----------
    config : Config
        The whole configuration; of it the tables ``virtual``, ``participant`` and ``agents`` and the block's seed.
    """

    def __init__(self, side: Side, config: Config) -> None:
        super().__init__(side, config)
        virtual = config.virtual
        self._device = own = resolved(virtual)
        held = self.read_options(Options).held
        rng = np.random.default_rng((config.block.seed, SIDES.index(side)))
        self._hand = hold(config.participant, virtual, rng, held)
        self._written = self._acting = (0.0, 0.0, 0.0)
        self._limit = own.max_force
        self._time_ns: int | None = None
        self._velocimeter = Velocimeter(own.resolution)
        self._heat = Heat(own.continuous_force, own.thermal_time) if own.thermal_time > 0.0 else None
        self._read_delay_ns = round(virtual.read_latency_ms * MS_NS)
        self._write_delay_ns = round(virtual.write_latency_ms * MS_NS)
        self._late = Late(self._read_delay_ns) if self._read_delay_ns > 0 else None
        self._coming: deque[tuple[int, Vector]] = deque()

    @property
    def felt(self) -> float:
        """Vertical force the motors exert on the hand now [N]."""
        return self._acting[2] if self._write_delay_ns else self._written[2]

    @property
    def tip(self) -> tuple[float, float, float]:
        """Where the stylus is in truth, in the device's own frame: without encoders, cables and latency [m]."""
        return self._hand.tip

    @property
    def temperature(self) -> float:
        """Temperature of the motors, 1 where they are warm; 0 where they stay cool [1]."""
        return 0.0 if self._heat is None else self._heat.temperature

    def command(self, moves: Iterable[Submovement]) -> None:
        """Let the hand do something.

        Parameters
        ----------
        moves : iterable of Submovement
            Movements of this side's hand, timed in seconds of the clock that `read` is given.
        """
        mine = tuple(moves)
        if any(move.side != self.side for move in mine):
            raise ValueError(f"the {self.side} hand was given movements of the other one")
        self._hand.plan(mine)

    def put(self, z: float) -> None:
        """Take the stylus to a height and let it go there, at rest: what a study of releases begins with."""
        self._hand.put(z)

    def live(self, now_ns: int) -> None:
        """Let the hand's mechanics run up to now; the force written last acts from then on."""
        self._live_until(now_ns)
        self._hand_over(now_ns)

    def _open(self) -> DeviceInfo:
        own = self._device
        reach = own.workspace + own.resolution  # the stops, in whole encoder steps
        return DeviceInfo(
            model=f"virtual {own.name}",
            serial=f"virtual-{self.side}",
            max_force=own.max_force,
            continuous_force=own.continuous_force,
            resolution=own.resolution,
            workspace=Box(-reach, -reach, -reach, reach, reach, reach),
            details=self._details(),
        )

    def _read(self, now_ns: int) -> Reading:
        if self._time_ns is None or now_ns - self._time_ns >= TICK_NS:
            self._hand_over(now_ns if self._time_ns is None else self._time_ns)
            self._live_until(now_ns)
        x, y, z = self._encoder(now_ns)
        vx, vy, vz = self._velocimeter.update(now_ns, x, y, z)
        return Reading(now_ns, x, y, z, vx, vy, vz, 0, self._heat is None or not self._heat.warm)

    def _write(self, fx: float, fy: float, fz: float) -> None:
        self._written = within(self._limit, fx, fy, fz)

    def _close(self) -> None:
        self._time_ns = None
        self._velocimeter = Velocimeter(self._device.resolution)
        self._late = Late(self._read_delay_ns) if self._late is not None else None
        self._coming.clear()
        self._acting = self._written

    def _hand_over(self, at_ns: int) -> None:
        """Let the force written last act from a time on, or as much later as it takes its time."""
        if self._write_delay_ns == 0:
            self._acting = self._written
        else:
            self._coming.append((at_ns + self._write_delay_ns, self._written))

    def _live_until(self, now_ns: int) -> None:
        """Let the hand's mechanics run up to now, under the force that acts, and those that come to act."""
        if self._time_ns is None:
            self._time_ns = now_ns
        self._time_ns = max(self._time_ns, now_ns - CATCH_UP_NS)
        while self._coming and self._coming[0][0] <= now_ns:
            due_ns, force = self._coming.popleft()
            self._time_ns = self._lived(self._time_ns, due_ns)
            self._acting = force
        self._time_ns = self._lived(self._time_ns, now_ns)

    def _lived(self, time_ns: int, until_ns: int) -> int:
        """Run in whole steps under the force that acts; the time that is reached [ns]."""
        steps = (until_ns - time_ns) // STEP_NS
        if steps <= 0:
            return time_ns
        self._hand.advance(steps, time_ns * 1e-9, self._acting)
        if self._heat is not None:
            self._warm_up(self._heat, steps * STEP)
        return time_ns + steps * STEP_NS

    def _warm_up(self, heat: Heat, seconds: float) -> None:
        """Let the motors get warm or cool; warm ones give no more than the continuous force."""
        heat.live(seconds, hypot(*self._acting))
        self._limit = self._device.continuous_force if heat.warm else self._device.max_force
        if heat.warm:
            self._acting = within(self._limit, *self._acting)
            self._written = within(self._limit, *self._written)

    def _encoder(self, now_ns: int) -> Vector:
        """Position now, moved on from the last whole step, in encoder steps; or as it was, if readings are late [m]."""
        rest = max(now_ns - (self._time_ns or now_ns), 0) * 1e-9
        step = self._device.resolution
        if self._late is None:
            return encoded(self._hand.state, rest, step)
        x, y, z = self._late.take(now_ns, encoded(self._hand.state, rest, 0.0))
        return (x, y, z) if step == 0.0 else (round(x / step) * step, round(y / step) * step, round(z / step) * step)

    def _details(self) -> dict[str, str]:
        """Numbers of the device, with its flaws where it has them."""
        own = self._device
        said = {
            "mass": f"{own.mass!r} kg",
            "friction": f"{own.friction!r} N",
            "damping": f"{own.damping!r} N s/m",
            "cable stiffness": f"{own.cable_stiffness!r} N/m" if own.cable_stiffness else "",
            "thermal time": f"{own.thermal_time!r} s" if own.thermal_time else "",
            "read latency": f"{self._read_delay_ns / MS_NS!r} ms" if self._read_delay_ns else "",
            "write latency": f"{self._write_delay_ns / MS_NS!r} ms" if self._write_delay_ns else "",
        }
        return {name: value for name, value in said.items() if value}
