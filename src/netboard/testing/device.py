"""Tests that every device backend must pass; each backend's test class derives from `DeviceContract`.

Run them first with a mock of the vendor's library, then against the hardware with no hand on the stylus.
"""

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
    """Derive ``class TestMine(DeviceContract)`` and define how to make the device and how to read its motor force."""

    @abstractmethod
    def make(self, config: Config) -> Device:
        """Return the left device of a configuration, not yet open."""

    @abstractmethod
    def motor_force(self, device: Device) -> tuple[float, float, float]:
        """Return the present force of the motors, also after `Device.close` [N]."""

    def read_times(self) -> Iterator[int]:
        """Return read times, one millisecond apart; override this for a device with its own servo loop."""
        return (1000 * MS + k * MS for k in range(50))

    def unplug(self, device: Device) -> Callable[[], None]:
        """Unplug an open device and return a function that replugs it; skip devices without a plug."""
        pytest.skip("this device cannot be unplugged")

    @pytest.fixture
    def device(self) -> Iterator[Device]:
        device = self.make(Config())
        yield device
        device.close()

    def test_open_returns_plausible_device_info(self, device: Device) -> None:
        info = device.open()
        assert info.model
        assert info.serial
        assert 0 <= info.continuous_force <= info.max_force < 50
        assert (info.continuous_force > 0) == (info.max_force > 0)
        assert info.resolution >= 0
        assert device.info == info

    def test_open_renders_no_force(self, device: Device) -> None:
        device.open()
        assert self.motor_force(device) == (0.0, 0.0, 0.0)

    def test_readings_are_finite_with_increasing_time_stamps(self, device: Device) -> None:
        device.open()
        last = -1
        for now in self.read_times():
            reading = device.read(now)
            numbers = (reading.x, reading.y, reading.z, reading.vx, reading.vy, reading.vz)
            assert all(map(isfinite, numbers))
            assert last < reading.stamp_ns <= now
            assert reading.buttons >= 0
            last = reading.stamp_ns

    def test_reading_outside_the_workspace_is_not_ready(self, device: Device) -> None:
        box = device.open().workspace
        for now in self.read_times():
            reading = device.read(now)
            assert not reading.ready or box is None or box.holds(reading.x, reading.y, reading.z)

    def test_unplugged_device_is_lost_and_reopens_when_replugged(self, device: Device) -> None:
        device.open()
        plug_in = self.unplug(device)

        def use() -> None:
            for now in self.read_times():
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

    def test_error_names_unknown_option(self) -> None:
        plain = Config()
        wrong = replace(plain.agents.left, options={**plain.agents.left.options, "no_such_option": 1})
        with pytest.raises(ConfigError, match=r"\[agents\.left\.options\] no_such_option: unknown key"):
            self.make(replace(plain, agents=replace(plain.agents, left=wrong)))

    def test_configured_zero_is_subtracted_from_heights(self) -> None:
        plain = Config()
        shifted = replace(plain, agents=replace(plain.agents, left=replace(plain.agents.left, zero=0.02)))
        with self.make(plain) as device:
            here = device.read(MS).z - (0.0 if device.in_scene else 0.02)
        with self.make(shifted) as device:  # a real device can be open only once at a time
            assert device.read(MS).z == pytest.approx(here, abs=1e-3)

    def test_rendered_force_is_limited_to_max_force(self, device: Device) -> None:
        limit = device.open().max_force
        device.write(100.0, -100.0, 100.0)
        fx, fy, fz = self.motor_force(device)
        assert (fx * fx + fy * fy + fz * fz) ** 0.5 <= limit * (1 + 1e-9)

    @pytest.mark.parametrize("bad", [nan, inf, -inf])
    def test_non_finite_force_is_rejected(self, device: Device, bad: float) -> None:
        device.open()
        with pytest.raises(ValueError, match="not a force"):
            device.write(0.0, bad, 0.0)
        assert self.motor_force(device) == (0.0, 0.0, 0.0)

    def test_close_sets_zero_force_and_is_idempotent(self, device: Device) -> None:
        device.open()
        device.write(0.1, 0.2, 0.3)
        device.close()
        assert self.motor_force(device) == (0.0, 0.0, 0.0)
        device.close()

    def test_closed_device_rejects_reads_writes_and_info(self, device: Device) -> None:
        with pytest.raises(ValueError, match="closed"):
            device.read(0)
        with pytest.raises(ValueError, match="closed"):
            device.write(0.0, 0.0, 0.0)
        with pytest.raises(ValueError, match="closed"):
            _ = device.info

    def test_opening_twice_is_rejected_until_closed(self, device: Device) -> None:
        device.open()
        with pytest.raises(ValueError, match="open already"):
            device.open()
        device.close()
        device.open()

    def test_context_manager_closes_the_device_after_an_exception(self) -> None:
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
