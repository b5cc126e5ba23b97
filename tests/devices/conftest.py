"""Shared fixtures of the OpenHaptics tests: a fake of the vendor's library, and devices that use it."""

from collections.abc import Iterator

import pytest

from libhd import STALL_NS, Fake, Opener, make_device
from netboard.devices.touch import library as touch_library
from netboard.devices.touch.device import SERVOS, OpenHaptics


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Iterator[Fake]:
    """The fake library in its initial state; a long stall limit tolerates a servo that a busy machine delays."""
    monkeypatch.setattr("netboard.devices.touch.device.STALL_NS", STALL_NS)
    monkeypatch.setattr(touch_library, "SETTLE_NS", STALL_NS)
    fake = Fake()
    fake.reset()
    yield fake
    touch_library.rig_of(fake.path).clear()
    fake.reset()


@pytest.fixture(params=SERVOS)
def open_device(fake: Fake, request: pytest.FixtureRequest) -> Opener:
    """Return a function that opens a device; each test runs with each servo."""

    def opened(**options: str | float) -> OpenHaptics:
        device = make_device(fake, **{"servo": request.param, **options})
        device.open()
        return device

    return opened
