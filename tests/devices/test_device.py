"""Rules that `Device` enforces for every backend, tested on a failing one."""

from dataclasses import replace

import pytest

from netboard.base.config import Config
from netboard.base.errors import DeviceLost, DeviceNotFound, DeviceTimeout
from netboard.devices.contract.device import Device, DeviceInfo, Reading


class Failing(Device):
    """A device that a test can disconnect."""

    connected = True
    released = 0

    def _open(self) -> DeviceInfo:
        if not self.connected:
            raise DeviceNotFound("no such device")
        return DeviceInfo("failing", "0", 3.0, 1.0, 0.0)

    def _read(self, now_ns: int) -> Reading:
        return Reading(now_ns, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0, True)

    def _write(self, fx: float, fy: float, fz: float) -> None:
        if not self.connected:
            raise DeviceLost("it was disconnected")

    def _close(self) -> None:
        self.released += 1


def test_closing_a_lost_device_still_releases_it() -> None:
    device = Failing("left", Config())
    device.open()
    device.connected = False
    with pytest.raises(DeviceLost):
        device.close()
    assert device.released == 1
    device.close()
    assert device.released == 1


def test_zero_force_is_written_again_if_its_first_transfer_is_lost() -> None:
    class Unreliable(Failing):
        forces = ()

        def _write(self, fx: float, fy: float, fz: float) -> None:
            self.forces = (*self.forces, fz)
            if len(self.forces) == 2:
                raise DeviceTimeout("lost")

    device = Unreliable("left", Config())
    with device:
        device.write(0.0, 0.0, 1.0)
    assert device.forces == (1.0, 0.0, 0.0)
    assert device.released == 1


def test_device_that_fails_to_open_stays_closed() -> None:
    device = Failing("left", Config())
    device.connected = False
    with pytest.raises(DeviceNotFound):
        device.open()
    with pytest.raises(ValueError, match="closed"):
        device.read(0)


def test_zero_of_each_side_is_subtracted_from_its_heights() -> None:
    config = Config()
    config = replace(config, agents=replace(config.agents, right=replace(config.agents.right, zero=0.03)))
    with Failing("right", config) as right, Failing("left", config) as left:
        assert right.read(0).z == pytest.approx(0.07)
        assert left.read(0).z == 0.1


def test_incomplete_backend_cannot_be_instantiated() -> None:
    class Half(Device):
        def _open(self) -> DeviceInfo:
            return DeviceInfo("half", "0", 3.0, 1.0, 0.0)

    with pytest.raises(TypeError, match="abstract"):
        Half("left", Config())
