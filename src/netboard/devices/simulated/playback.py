"""Backend ``playback``: replays a recorded stylus. No hand holds it, and it has no haptic feedback.

Use it as a partner that does not react, for rehearsals without hardware, and for tests. Playback starts with the first
reading. The stylus rests at the start of the file until ``delay`` is over, and at its end afterwards. It is then no
longer ready, so that no block continues with a partner who has stopped; with ``loop`` it starts again.

Options (``agents.<side>.options``): see `Options`; the files are those of `netboard.devices.simulated.trajectory`.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, final

import numpy as np
from pydantic import StrictBool

from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError
from netboard.base.settings import NO_EXTRAS, about
from netboard.devices.contract.device import Device, DeviceInfo, Reading
from netboard.devices.simulated.trajectory import Track, read_track


@dataclass(frozen=True, slots=True)
class Options:
    """Options of the recorded stylus."""

    __pydantic_config__ = NO_EXTRAS
    file: Annotated[str, about("what is played: a recording (.mcap) or a .csv file")] = ""
    side: Annotated[Literal["same", "left", "right"], about("whose stylus in a recording; same: of this side")] = "same"
    trial: Annotated[int, about("number of the trial that is played; 0: the whole recording", "1", ge=0)] = 0
    delay: Annotated[float, about("time from the first reading to the start", "s", ge=0, le=86_400)] = 0.0
    scale: Annotated[float, about("the way is so many times as large", "1", ge=-10, le=10)] = 1.0
    noise: Annotated[float, about("standard deviation of white noise on each reading", "m", ge=0, le=0.1)] = 0.0
    loop: Annotated[StrictBool, about("true: from the end it goes on at the beginning")] = False
    seed: Annotated[int, about("seed of the noise", "1", ge=0, lt=2**31)] = 1


@final
class Playback(Device):
    """A recorded stylus as a device."""

    def __init__(self, side: Side, config: Config) -> None:
        super().__init__(side, config)
        self._options = self.read_options(Options)
        if not self._options.file:
            raise ConfigError(f"[agents.{side}.options] file: found none, expected the recording or .csv file to play")
        self._track: Track | None = None
        self._start_ns: int | None = None
        self._rng = np.random.default_rng()

    def _open(self) -> DeviceInfo:
        options = self._options
        side = self.side if options.side == "same" else options.side
        self._track = read_track(Path(options.file), side, options.trial).scaled(options.scale)
        self._start_ns = None
        self._rng = np.random.default_rng((options.seed, SIDES.index(self.side)))
        details = {
            "file": options.file,
            "stylus": f"{side}, trial {options.trial}" if options.trial else side,
            "duration": f"{self._track.duration:.3f} s",
            "delay": f"{options.delay!r} s",
            "scale": f"{options.scale!r}",
            "noise": f"{options.noise!r} m",
        }
        return DeviceInfo("recorded stylus", f"playback-{self.side}", 0.0, 0.0, 0.0, details=details)

    def _read(self, now_ns: int) -> Reading:
        assert self._track is not None
        if self._start_ns is None:
            self._start_ns = now_ns + round(self._options.delay * 1e9)
        when = (now_ns - self._start_ns) * 1e-9
        duration = self._track.duration
        if self._options.loop and when > duration:
            when %= duration
        (x, y, z), (vx, vy, vz), buttons = self._track.at(when)
        if self._options.noise > 0.0:
            dx, dy, dz = (self._options.noise * self._rng.standard_normal(3)).tolist()
            x, y, z = x + dx, y + dy, z + dz
        return Reading(now_ns, x, y, z, vx, vy, vz, buttons, when <= duration)

    def _write(self, fx: float, fy: float, fz: float) -> None:
        """Ignore the force: no hand feels it."""

    def _close(self) -> None:
        self._track = None
