"""Backend ``tampered``: the virtual device, with a trace of all written forces, and faults that can be switched on.

The benchmark adds it to its processes as a plug-in (`install`), as a lab would. Every force is written to a file of the
process at once, with the time, so the trace is complete even if the process is killed. The active fault is one byte in
another file, which is read at every reading.

Options (``agents.<side>.options``): see `Options`.
"""

import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path
from typing import Annotated, Any, Literal, final

import numpy as np
from numpy.typing import NDArray

from netboard.base.clock import now_ns
from netboard.base.config import Config, Side
from netboard.base.errors import DeviceLost, DeviceNotFound
from netboard.base.settings import FORBID_UNKNOWN_KEYS, about
from netboard.base.tables.rig import Agent
from netboard.devices.contract.device import Device, DeviceInfo, Reading
from netboard.devices.contract.registry import GROUP
from netboard.devices.contract.velocity import Velocimeter
from netboard.devices.simulated.virtual import VirtualTouch
from netboard.participants.body.device_models import resolved
from netboard.participants.people.submovement import Submovement

NAME = "tampered"

TRACE = np.dtype([("time_ns", "<i8"), ("fx", "<f8"), ("fy", "<f8"), ("fz", "<f8"), ("z", "<f8")])
"""One row for each force written to the device: time, force, and the last height, NaN if the device returns none or is
gone [ns, N, N, N, m]."""

DeviceFault = Literal["none", "nan", "frozen", "jump", "gone"]

_FAULT_BYTES: dict[bytes, DeviceFault] = {b"-": "none", b"n": "nan", b"f": "frozen", b"j": "jump", b"g": "gone"}

JUMP = 0.1
"""Apparent jump of the stylus [m]."""


@dataclass(frozen=True, slots=True)
class Options:
    """Options of the tampered device."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    folder: Annotated[str, about("folder of both files", min_length=1)] = "."


@final
class TamperedTouch(Device):
    """A virtual device whose faults can be switched on."""

    def __init__(self, side: Side, config: Config) -> None:
        super().__init__(side, config)
        self._folder = Path(self.read_options(Options).folder)
        self._touch = VirtualTouch(side, _virtual_config(config, side))
        self._velocimeter = Velocimeter(resolved(config.virtual).resolution)
        self._reading: Reading | None = None
        self._trace_descriptor = self._fault_descriptor = -1

    @property
    def felt(self) -> float:
        """Return the vertical force that the motors exert on the hand now [N]."""
        return self._touch.felt

    def command(self, moves: Iterable[Submovement]) -> None:
        """Begin submovements of the hand."""
        self._touch.command(moves)

    def live(self, now_ns: int) -> None:
        """Advance the hand's mechanics to now."""
        self._touch.live(now_ns)

    def _open(self) -> DeviceInfo:
        flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND
        self._trace_descriptor = os.open(trace_file(self._folder, self.side, os.getpid()), flags, 0o600)
        self._fault_descriptor = os.open(_fault_file(self._folder, self.side), os.O_RDONLY | os.O_CREAT, 0o600)
        if self._active_fault() == "gone":
            self._close_files()
            raise DeviceNotFound("the device is gone")
        return self._touch.open(placed=False)  # the profile is applied once, to the device around it

    def _read(self, now_ns: int) -> Reading:
        fault = self._active_fault()
        if fault == "gone":
            raise DeviceLost("the device is gone")
        if fault == "frozen" and self._reading is not None:
            return self._reading
        there = self._touch.read(now_ns)
        x, y, z = (nan, nan, nan) if fault == "nan" else (there.x, there.y, there.z)
        if fault == "jump":
            z += JUMP
        vx, vy, vz = self._velocimeter.update(now_ns, x, y, z)
        self._reading = there._replace(x=x, y=y, z=z, vx=vx, vy=vy, vz=vz)
        return self._reading

    def _write(self, fx: float, fy: float, fz: float) -> None:
        gone = self._active_fault() == "gone"
        z = self._reading.z if self._reading is not None and not gone else nan
        os.write(self._trace_descriptor, np.array((now_ns(), fx, fy, fz, z), TRACE).tobytes())
        if gone:
            raise DeviceLost("the device is gone")
        self._touch.write(fx, fy, fz)

    def _close(self) -> None:
        self._close_files()
        self._reading = None
        self._touch.close()

    def _close_files(self) -> None:
        os.close(self._trace_descriptor)
        os.close(self._fault_descriptor)

    def _active_fault(self) -> DeviceFault:
        return _FAULT_BYTES.get(os.pread(self._fault_descriptor, 1, 0), "none")


def _virtual_config(config: Config, side: Side) -> Config:
    """Return the configuration for the wrapped virtual device."""
    agents = replace(config.agents, left=Agent()) if side == "left" else replace(config.agents, right=Agent())
    return replace(config, agents=agents)


def _fault_file(folder: Path, side: Side) -> Path:
    return folder / f"{side}.trick"


def set_device_fault(folder: Path, side: Side, fault: DeviceFault) -> None:
    """Make the device of a side fail or work again."""
    letter = next(letter for letter, name in _FAULT_BYTES.items() if name == fault)
    _fault_file(folder, side).write_bytes(letter)


def trace_file(folder: Path, side: Side, process_id: int) -> Path:
    """Return the file of the forces written by a process."""
    return folder / f"{side}-{process_id}.trace"


def read_traces(folder: Path, side: Side) -> list[NDArray[Any]]:
    """Read the forces written to the devices of a side: a trace for each agent, in the order of their starts."""
    traces = [read_trace(path) for path in folder.glob(f"{side}-*.trace")]
    return sorted((trace for trace in traces if trace.size), key=lambda trace: int(trace["time_ns"][0]))


def read_trace(path: Path, newest: int | None = None) -> NDArray[Any]:
    """Read the forces written to a device, up to now if its agent still runs.

    - `newest`: number of newest forces; None for all [1].
    """
    there = path.stat().st_size // TRACE.itemsize if path.exists() else 0
    count = there if newest is None else min(there, newest)
    if not count:
        return np.empty(0, TRACE)
    return np.fromfile(path, TRACE, count, offset=(there - count) * TRACE.itemsize)


def install(folder: Path) -> dict[str, str]:
    """Create a folder with a plug-in that adds this backend to a process."""
    info = folder / "netboard_faults-0.dist-info"
    info.mkdir(parents=True, exist_ok=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: netboard-faults\nVersion: 0\n", encoding="utf-8")
    (info / "entry_points.txt").write_text(f"[{GROUP}]\n{NAME} = {__name__}:TamperedTouch\n", encoding="utf-8")
    before = os.environ.get("PYTHONPATH")
    return {"PYTHONPATH": os.pathsep.join(filter(None, (str(folder), str(Path(__file__).parents[2]), before)))}
