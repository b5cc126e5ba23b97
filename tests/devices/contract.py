"""What every device backend must do; each backend's test derives from `DeviceContract`."""

import contextlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import replace
from math import inf, isfinite, nan

import pytest

from netboard.base.config import Config
from netboard.base.errors import ConfigError, DeviceError, DeviceNotFound
from netboard.devices.contract.device import Device

MS = 1_000_000


class DeviceContract(ABC):
    """Derive ``class TestMine(DeviceContract)`` and say how to make the device and how to see its motors."""

    @abstractmethod
    def make(self, config: Config) -> Device:
        """The left device of a configuration, not yet open."""

    @abstractmethod
    def motor_force(self, device: Device) -> tuple[float, float, float]:
        """The force the motors exert now, also after `Device.close` [N]."""

    def instants(self) -> Iterator[int]:
        """Times at which a stylus is read, a millisecond apart; a device with a loop of its own overrides this."""
        return (1000 * MS + k * MS for k in range(50))

    def unplug(self, device: Device) -> Callable[[], None]:
        """Pull the plug of an open device; how to put it in again. Skips where there is none."""
        pytest.skip("this device has no plug")

    @pytest.fixture
    def device(self):
        device = self.make(Config())
        yield device
        device.close()

    def test_it_says_what_it_is(self, device: Device) -> None:
        info = device.open()
        assert info.model
        assert info.serial
        assert 0 <= info.continuous_force <= info.max_force < 50
        assert (info.continuous_force > 0) == (info.max_force > 0)
        assert info.resolution >= 0
        assert device.info == info

    def test_it_opens_without_a_force(self, device: Device) -> None:
        device.open()
        assert self.motor_force(device) == (0.0, 0.0, 0.0)

    def test_readings_are_finite_and_in_time(self, device: Device) -> None:
        device.open()
        last = -1
        for now in self.instants():
            reading = device.read(now)
            numbers = (reading.x, reading.y, reading.z, reading.vx, reading.vy, reading.vz)
            assert all(map(isfinite, numbers))
            assert last < reading.stamp_ns <= now
            assert reading.buttons >= 0
            last = reading.stamp_ns

    def test_outside_of_its_workspace_it_is_not_ready(self, device: Device) -> None:
        box = device.open().workspace
        reading = next(device.read(now) for now in self.instants())
        assert not reading.ready or box is None or box.holds(reading.x, reading.y, reading.z)

    def test_a_device_that_is_pulled_out_is_lost_and_can_be_opened_again(self, device: Device) -> None:
        device.open()
        plug_in = self.unplug(device)

        def use() -> None:
            for now in self.instants():
                device.read(now)
                device.write(0.0, 0.0, 0.1)

        with pytest.raises(DeviceError):
            use()
        with contextlib.suppress(DeviceError):
            device.close()
        with pytest.raises(DeviceNotFound):
            device.open()
        plug_in()
        device.open()
        assert self.motor_force(device) == (0.0, 0.0, 0.0)
        use()

    def test_an_unknown_option_is_named(self) -> None:
        plain = Config()
        odd = replace(plain.agents.left, options={**plain.agents.left.options, "no_such_thing": 1})
        with pytest.raises(ConfigError, match=r"\[agents\.left\.options\] no_such_thing: unknown key"):
            self.make(replace(plain, agents=replace(plain.agents, left=odd)))

    def test_the_scene_s_origin_is_where_the_agent_says(self) -> None:
        plain = Config()
        shifted = replace(plain, agents=replace(plain.agents, left=replace(plain.agents.left, zero=0.02)))
        with self.make(plain) as device:
            here = device.read(MS).z
        with self.make(shifted) as device:  # a real one is open only once at a time
            assert device.read(MS).z == pytest.approx(here - 0.02, abs=1e-3)

    def test_it_renders_no_more_than_it_says(self, device: Device) -> None:
        limit = device.open().max_force
        device.write(100.0, -100.0, 100.0)
        fx, fy, fz = self.motor_force(device)
        assert (fx * fx + fy * fy + fz * fz) ** 0.5 <= limit * (1 + 1e-9)

    @pytest.mark.parametrize("bad", [nan, inf, -inf])
    def test_it_takes_no_force_that_is_none(self, device: Device, bad: float) -> None:
        device.open()
        with pytest.raises(ValueError, match="not a force"):
            device.write(0.0, bad, 0.0)
        assert self.motor_force(device) == (0.0, 0.0, 0.0)

    def test_closing_takes_the_force_away_and_may_be_done_twice(self, device: Device) -> None:
        device.open()
        device.write(0.1, 0.2, 0.3)
        device.close()
        assert self.motor_force(device) == (0.0, 0.0, 0.0)
        device.close()

    def test_a_closed_device_does_nothing(self, device: Device) -> None:
        with pytest.raises(ValueError, match="closed"):
            device.read(0)
        with pytest.raises(ValueError, match="closed"):
            device.write(0.0, 0.0, 0.0)
        with pytest.raises(ValueError, match="closed"):
            _ = device.info

    def test_it_opens_only_once_at_a_time(self, device: Device) -> None:
        device.open()
        with pytest.raises(ValueError, match="open already"):
            device.open()
        device.close()
        device.open()

    def test_a_with_block_closes_it_when_something_goes_wrong(self) -> None:
        device = self.make(Config())

        def fail() -> None:
            with device:
                device.write(0.0, 0.0, 0.5)
                raise RuntimeError("on purpose")

        with pytest.raises(RuntimeError, match="on purpose"):
            fail()
        assert self.motor_force(device) == (0.0, 0.0, 0.0)
        with pytest.raises(ValueError, match="closed"):
            device.read(0)
