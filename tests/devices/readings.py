"""Readings of a device whose fake moves it in another thread."""

from collections.abc import Callable
from time import monotonic_ns

from netboard.devices.contract.device import Device, Reading
from waiting import until


def read_until(device: Device, wanted: Callable[[Reading], bool], force: tuple[float, ...] = ()) -> Reading:
    """Read until a reading is as wanted; renew a force meanwhile."""

    def read() -> Reading | None:
        reading = device.read(monotonic_ns())
        return reading if wanted(reading) else None

    found = until(read, lambda: device.write(*force) if force else None)
    assert found is not None
    return found
