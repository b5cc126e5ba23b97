"""Backend ``mouse``: a pointer in the display's window, or a finger on its screen, moves the stylus.

There is no motor, so the force displaces the stylus: a simulated hand holds it with a spring between pointer and
stylus, and the stylus yields by force over stiffness. The participant sees this on the screen, and lifts against the
weight of board and ball. Hand and stylus together are a critically damped mass on that spring:

    z'' = w^2 (aim + F / k - z) - 2 w z',    w = 1 / smoothing,    mass k / w^2

The mass also smooths the steps of the pointer, which arrive 60 to 125 times a second. The equation is solved exactly
from reading to reading. The point that attracts the stylus obeys the velocity limit and stays within reach. The impulse
response is never negative, so position and velocity of the stylus are averages of those of that point, and the stylus
obeys both limits too.

The agent passes on where the player points, because devices know no network.

Options (``agents.<side>.options``): see `MouseOptions`.
"""

from dataclasses import dataclass
from math import exp, isfinite
from typing import Annotated, Literal, final

from netboard.base.config import Config, Side
from netboard.base.settings import FORBID_UNKNOWN_KEYS, about
from netboard.devices.contract.device import Box, Device, DeviceInfo, Reading
from netboard.participants.body.device_forces import within

SILENCE_TIMEOUT_NS = 1_000_000_000
"""Timeout after which a silent window counts as gone [ns]."""

MAX_FORCE = 3.3
"""Force of the simulated motor, peak and continuous: a Touch's peak force [N]."""

ROUNDING = 1e-9
"""Tolerance for the rounding of a stylus at the limit of its reach [m]."""


@dataclass(frozen=True, slots=True)
class MouseOptions:
    """Options of the mouse."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    input: Annotated[
        Literal["pointer", "keys"], about("what moves the stylus: pointer (mouse, finger, or keys) or keys alone")
    ] = "pointer"
    stiffness: Annotated[
        float, about("stiffness of the simulated hand between pointer and stylus", "N/m", ge=100, le=2000)
    ] = 200.0
    smoothing: Annotated[
        float, about("time constant with which the stylus follows the pointer", "s", ge=0.01, le=0.2)
    ] = 0.015
    max_speed: Annotated[float, about("largest speed of the stylus", "m/s", gt=0, le=1)] = 0.8
    reach: Annotated[float, about("largest height of the stylus, up and down", "m", gt=0, le=0.5)] = 0.075


def follow(z: float, vz: float, before: float, after: float, dt: float, rate: float) -> tuple[float, float]:
    """Return position and velocity of a critically damped mass whose rest point moves uniformly: the exact solution.

    ``before``, ``after``: position of the rest point at the beginning and at the end [m].
    """
    slope = (after - before) / dt
    lag = 2.0 * slope / rate  # steady-state lag behind a uniformly moving rest point
    offset = z - before + lag
    turn = vz - slope + rate * offset
    decay = exp(-rate * dt)
    remaining = offset + turn * dt
    return after - lag + remaining * decay, slope + (turn - rate * remaining) * decay


@final
class MouseStylus(Device):
    """A stylus moved by a pointer. It uses the options of this side's agent."""

    in_scene = True

    def __init__(self, side: Side, config: Config) -> None:
        super().__init__(side, config)
        self._options = self.read_options(MouseOptions)
        self._written = (0.0, 0.0, 0.0)
        self._reset()

    @property
    def felt(self) -> float:
        """Vertical force that displaces the stylus now [N]."""
        return self._written[2]

    def point(self, z: float | None, now_ns: int) -> None:
        """Receive the pointer position from the window.

        ``z``: height of the pointer in the scene's frame; None before the first pointer position [m].
        """
        if z is not None:
            if not isfinite(z):
                raise ValueError(f"not a height: {z}")
            self._pointer = self._in_reach(z)
        self._in_hand = z is not None
        self._pointed_ns = now_ns

    def _reset(self) -> None:
        """Forget the player and rest the stylus in the middle."""
        self._pointer = self._aim = self._z = self._vz = 0.0
        self._in_hand = False
        self._pointed_ns = 0
        self._time_ns: int | None = None

    def _open(self) -> DeviceInfo:
        options = self._options
        reach = options.reach + ROUNDING
        return DeviceInfo(
            model="mouse pointer",
            serial=f"mouse-{self.side}",
            max_force=MAX_FORCE,
            continuous_force=MAX_FORCE,
            resolution=0.0,
            workspace=Box(-reach, -reach, -reach, reach, reach, reach),
            details={"stiffness": f"{options.stiffness!r} N/m", "smoothing": f"{options.smoothing!r} s"},
        )

    def _read(self, now_ns: int) -> Reading:
        if self._time_ns is None:
            self._time_ns = now_ns
        if now_ns > self._time_ns:
            self._live((now_ns - self._time_ns) * 1e-9)
            self._time_ns = now_ns
        ready = self._in_hand and now_ns - self._pointed_ns <= SILENCE_TIMEOUT_NS
        return Reading(now_ns, 0.0, 0.0, self._z, 0.0, 0.0, self._vz, 0, ready)

    def _live(self, dt: float) -> None:
        """Advance the stylus by a duration [s]."""
        options = self._options
        most = options.max_speed * dt
        wanted = self._in_reach(self._pointer + self._written[2] / options.stiffness)
        aim = min(max(wanted, self._aim - most), self._aim + most)
        self._z, self._vz = follow(self._z, self._vz, self._aim, aim, dt, 1.0 / options.smoothing)
        self._aim = aim

    def _in_reach(self, z: float) -> float:
        return min(max(z, -self._options.reach), self._options.reach)

    def _write(self, fx: float, fy: float, fz: float) -> None:
        self._written = within(MAX_FORCE, fx, fy, fz)

    def _close(self) -> None:
        self._reset()
