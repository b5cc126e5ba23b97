"""Backend ``virtual``: a Touch-like device that does not exist, held by a simulated hand.

Reading it lets the hand's mechanics run up to the time asked for, under the force written last; so it needs no thread
and is as repeatable as the times and forces it is given. Whoever has no time for that when the stylus is to be read
calls `VirtualTouch.live` right after each force: that one acts from then on, and a reading within the same millisecond
only carries the hand on at its speed. What the device reports is what such a device would: a position in
whole encoder steps, and the velocity that `netboard.devices.velocity` makes of such positions. Its motors saturate at
their largest force, like real ones.

Options (``agents.<side>.options``): ``held = false`` for a stylus that nobody holds.
"""

from collections.abc import Iterable
from math import hypot
from typing import Any, final

import numba
import numpy as np

from netboard.config import SIDES, Config, Side
from netboard.devices.base import Device, DeviceInfo, Reading
from netboard.devices.velocity import Velocimeter
from netboard.errors import ConfigError
from netboard.participants.hand import STEP_NS, Hand, pack_arm
from netboard.participants.submovement import Submovement
from netboard.tick import TICK_NS

CATCH_UP_NS = 50_000_000
"""After a longer pause between two readings the hand lives through only so much of it [ns]."""

CONTINUOUS_SHARE = 0.88 / 3.3
"""Continuous to largest force of a Touch [1]."""


@numba.njit(cache=True)
def encoded(state: Any, rest: float, step: float) -> tuple[float, float, float]:
    """Return where a hand is so long after its state, in whole encoder steps.

    Parameters
    ----------
    state : ndarray of HAND, shape (1,)
        The hand.
    rest : float
        Time since [s].
    step : float
        Size of an encoder step, 0 for none [m].
    """
    s = state[0]
    x, y, z = s["x"] + rest * s["vx"], s["y"] + rest * s["vy"], s["z"] + rest * s["vz"]
    if step == 0.0:
        return x, y, z
    return round(x / step) * step, round(y / step) * step, round(z / step) * step


@final
class VirtualTouch(Device):
    """A simulated device in a simulated hand.

    Parameters
    ----------
    side : {"left", "right"}
        Whose device it is.
    config : Config
        The whole configuration; of it the tables ``virtual``, ``participant`` and ``agents`` and the block's seed.

    Raises
    ------
    ConfigError
        If an option is unknown or of the wrong type.
    """

    def __init__(self, side: Side, config: Config) -> None:
        super().__init__(side, config)
        self._device = config.virtual
        held = self._held()
        rng = np.random.default_rng((config.block.seed, SIDES.index(side)))
        self._hand = Hand(pack_arm(config.participant, config.virtual, held), rng)
        self._written = self._acting = (0.0, 0.0, 0.0)
        self._time_ns: int | None = None
        self._velocimeter = Velocimeter(config.virtual.resolution)

    @property
    def felt(self) -> float:
        """Vertical force the motors exert on the hand now [N]."""
        return self._written[2]

    def command(self, moves: Iterable[Submovement]) -> None:
        """Let the hand do something.

        Parameters
        ----------
        moves : iterable of Submovement
            Movements of this side's hand, timed in seconds of the clock that `read` is given.

        Raises
        ------
        ValueError
            If a movement is for the other hand.
        """
        mine = tuple(moves)
        if any(move.side != self.side for move in mine):
            raise ValueError(f"the {self.side} hand was given movements of the other one")
        self._hand.plan(mine)

    def live(self, now_ns: int) -> None:
        """Let the hand's mechanics run up to now; the force written last acts from then on.

        Parameters
        ----------
        now_ns : int
            The time [ns].
        """
        self._live_until(now_ns)
        self._acting = self._written

    def _held(self) -> bool:
        """Option ``held``."""
        table = f"agents.{self.side}.options"
        unknown = sorted(set(self.agent.options) - {"held"})
        if unknown:
            raise ConfigError(f"[{table}] {unknown[0]}: unknown option of the virtual device; expected: held")
        held = self.agent.options.get("held", True)
        if not isinstance(held, bool):
            raise ConfigError(f"[{table}] held: expected true or false, found {held!r}")
        return held

    def _open(self) -> DeviceInfo:
        device = self._device
        return DeviceInfo(
            model="virtual Touch",
            serial=f"virtual-{self.side}",
            max_force=device.max_force,
            continuous_force=device.max_force * CONTINUOUS_SHARE,
            resolution=device.resolution,
        )

    def _read(self, now_ns: int) -> Reading:
        if self._time_ns is None or now_ns - self._time_ns >= TICK_NS:
            self._acting = self._written
            self._live_until(now_ns)
        x, y, z = self._encoder(now_ns)
        vx, vy, vz = self._velocimeter.update(now_ns, x, y, z)
        return Reading(now_ns, x, y, z, vx, vy, vz, 0, True)

    def _write(self, fx: float, fy: float, fz: float) -> None:
        size = hypot(fx, fy, fz)
        share = 1.0 if size <= self._device.max_force else self._device.max_force / size
        self._written = (fx * share, fy * share, fz * share)

    def _close(self) -> None:
        self._time_ns = None
        self._velocimeter = Velocimeter(self._device.resolution)

    def _live_until(self, now_ns: int) -> None:
        """Let the hand's mechanics run in whole steps up to now, under the force that acts."""
        if self._time_ns is None:
            self._time_ns = now_ns
        self._time_ns = max(self._time_ns, now_ns - CATCH_UP_NS)
        steps = (now_ns - self._time_ns) // STEP_NS
        if steps > 0:
            self._hand.advance(steps, self._time_ns * 1e-9, self._acting)
            self._time_ns += steps * STEP_NS

    def _encoder(self, now_ns: int) -> tuple[float, float, float]:
        """Position now, moved on from the last whole step, in encoder steps [m]."""
        rest = max(now_ns - (self._time_ns or now_ns), 0) * 1e-9
        return encoded(self._hand.state, rest, self._device.resolution)
