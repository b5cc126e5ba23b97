"""A stand-in for the vendor's library of a Touch, so that the loop of its agents can be measured without a device.

``stand_in_libhd.c`` has the library's functions, its servo thread at 1 kHz, and a stylus on a spring, which sways. The
agents, the device backend and its servo callback in C are those of a real Touch, except for the stamps of the samples:
`StandInTouch` stamps a sample when the agent reads it, as the echo does when a peer wakes. A real one is older by up to
a tick, because the vendor's servo keeps its own time. What library and device take is not in the figures, either.

Run as a module with the command of an agent, this module runs it with the stand-in.
"""

import runpy
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, final

from netboard.base import kernel_cache
from netboard.base.compiled import kernel
from netboard.base.config import Config, Side
from netboard.base.device_kind import DeviceKind
from netboard.base.errors import NetboardError
from netboard.devices.contract import registry
from netboard.devices.contract.access import CompiledAccess, Fields
from netboard.devices.contract.device import Device, DeviceInfo, Reading
from netboard.devices.servo.compiling import CannotCompile, compiled_library
from netboard.devices.touch import access
from netboard.devices.touch.device import OpenHaptics

SOURCE = Path(__file__).with_name("stand_in_libhd.c")

SWAY_MM = 5
"""How far the styluses sway up and down, at 0.5 Hz [mm]."""

FLAGS = ("-pthread", "-lm", f"-DSWAY={SWAY_MM}")

DISCLAIMER = (
    "Touch: a stand-in for the vendor's library, and no device. Nothing has been measured on a real Touch, whose "
    "samples are up to 1 ms older. The library's servo thread is among the other threads, not in the ratio of the "
    "agents' CPU time."
)

AGENT = (sys.executable, "-m", "netboard.benchmarks.loop.stand_in")
"""What the command of an agent with the stand-in begins with."""

DeviceName = Literal["virtual", "touch"]


@kernel
def read_now(parts: tuple[Any, ...], now_ns: int) -> tuple[bool, Fields]:
    """Read a Touch as its agent does, but with the time of the reading as its stamp."""
    found, (_, x, y, z, vx, vy, vz, buttons, ready) = access.read(parts, now_ns)
    return found, (now_ns, x, y, z, vx, vy, vz, buttons, ready)


@final
class StandInTouch(Device):
    """A Touch of the stand-in; everything but the stamps is the backend of a real one."""

    def __init__(self, side: Side, config: Config) -> None:
        super().__init__(side, config)
        self._touch = OpenHaptics(side, config)

    def _open(self) -> DeviceInfo:
        return self._touch._open()

    def _read(self, now_ns: int) -> Reading:
        return self._touch._read(now_ns)._replace(stamp_ns=now_ns)

    def _write(self, fx: float, fy: float, fz: float) -> None:
        self._touch._write(fx, fy, fz)

    def _compiled(self) -> CompiledAccess | None:
        own = self._touch._compiled()
        return None if own is None else own._replace(read=read_now)

    def _close(self) -> None:
        self._touch._close()


def with_device(config: Config, device: DeviceName) -> Config:
    """Return a configuration whose agents have this device; for a Touch the stand-in is compiled."""
    if device == "virtual":
        return config
    try:
        library = str(compiled_library(kernel_cache.folder(), SOURCE, *FLAGS))
    except CannotCompile as error:
        raise NetboardError(f"the stand-in for the library of a Touch {error}; {error.advice}") from error
    left, right = (
        replace(agent, device="openhaptics", options={"library": library, "name": name, "servo": "c"})
        for agent, name in ((config.agents.left, "Default Device"), (config.agents.right, "Right Device"))
    )
    return replace(config, agents=replace(config.agents, left=left, right=right))


def main() -> None:
    """Run the command of an agent, ``python -m netboard.services.cli agent ...``, with the stand-in."""
    target = f"{__spec__.name}:{StandInTouch.__name__}"
    registry.BACKENDS["openhaptics"] = replace(
        registry.BACKENDS["openhaptics"], target=target, kind=DeviceKind.SIMULATED
    )
    _, _, _, module, *arguments = sys.argv
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
