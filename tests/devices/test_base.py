"""The rules of `Device` that hold for every backend, on a backend that fails."""

from dataclasses import replace

import pytest

from netboard.base.config import Config
from netboard.base.errors import DeviceLost, DeviceNotFound
from netboard.devices.contract.device import Device, DeviceInfo, Reading


class Failing(Device):
    """A device that can be told to be missing, or to vanish."""

    there = True
    released = 0

    def _open(self) -> DeviceInfo:
        if not self.there:
            raise DeviceNotFound("no such device")
        return DeviceInfo("failing", "0", 3.0, 1.0, 0.0)

    def _read(self, now_ns: int) -> Reading:
        return Reading(now_ns, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0, True)

    def _write(self, fx: float, fy: float, fz: float) -> None:
        if not self.there:
            raise DeviceLost("it is gone")

    def _close(self) -> None:
        self.released += 1


def test_a_lost_device_is_released_all_the_same() -> None:
    device = Failing("left", Config())
    device.open()
    device.there = False
    with pytest.raises(DeviceLost):
        device.close()
    assert device.released == 1
    device.close()
    assert device.released == 1


def test_a_device_that_did_not_open_is_closed() -> None:
    device = Failing("left", Config())
    device.there = False
    with pytest.raises(DeviceNotFound):
        device.open()
    with pytest.raises(ValueError, match="closed"):
        device.read(0)


def test_heights_count_from_the_scene_s_origin() -> None:
    config = Config()
    config = replace(config, agents=replace(config.agents, right=replace(config.agents.right, zero=0.03)))
    with Failing("right", config) as right, Failing("left", config) as left:
        assert right.read(0).z == pytest.approx(0.07)
        assert left.read(0).z == 0.1


def test_an_incomplete_backend_cannot_be_made() -> None:
    class Half(Device):
        def _open(self) -> DeviceInfo:
            return DeviceInfo("half", "0", 3.0, 1.0, 0.0)

    with pytest.raises(TypeError, match="abstract"):
        Half("left", Config())
