"""Simulated time and devices for the tests of the device tools."""

from dataclasses import replace

from netboard.base.config import Config
from netboard.base.tables.simulated import Participant, VirtualDevice
from netboard.base.tick import TICK_NS
from netboard.devices.contract.device import Box, Device, DeviceInfo, Reading
from netboard.devices.simulated.virtual import VirtualTouch


class SimulatedTime:
    """Clock that advances by one millisecond per wait."""

    def __init__(self, now_ns: int = 1_000_000_000) -> None:
        self._now_ns = now_ns

    def now(self) -> int:
        return self._now_ns

    def wait(self) -> int:
        self._now_ns += TICK_NS
        return self._now_ns


def configured(held: bool = False, **virtual: float) -> Config:
    """Return a rig whose left device is virtual; an arm that holds it is a passive mass-spring-damper."""
    arm = Participant(friction_skill=0.0, load_skill=0.0, reflex_gain=0.0)
    config = Config(virtual=VirtualDevice(**virtual), participant=arm)
    left = replace(config.agents.left, options={"held": held})
    return replace(config, agents=replace(config.agents, left=left))


def virtual(config: Config) -> VirtualTouch:
    """Return the left device of a rig, open in its own frame."""
    device = VirtualTouch("left", config)
    device.open(placed=False)
    return device


class Puppet(Device):
    """A device that returns the readings of a test and records the written forces."""

    def __init__(self, config: Config, *readings: Reading, max_force: float = 3.0) -> None:
        super().__init__("left", config)
        self.readings = list(readings)
        self.forces: list[tuple[float, float, float]] = []
        self._max_force = max_force
        self.serial = "puppet"

    def _open(self) -> DeviceInfo:
        box = Box(-0.1, -0.1, -0.1, 0.1, 0.1, 0.1)
        return DeviceInfo("Puppet", self.serial, self._max_force, self._max_force / 3.0, 0.0, box)

    def _read(self, now_ns: int) -> Reading:
        reading = self.readings.pop(0) if len(self.readings) > 1 else self.readings[0]
        return reading._replace(stamp_ns=now_ns)

    def _write(self, fx: float, fy: float, fz: float) -> None:
        self.forces.append((fx, fy, fz))

    def _close(self) -> None:
        self.readings = self.readings[-1:]


AT_REST = Reading(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, True)
