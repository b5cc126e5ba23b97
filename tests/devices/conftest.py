"""Shared fixtures of the OpenHaptics tests: a fake of the vendor's library, and devices over it."""

from collections.abc import Iterator

import pytest

from libhd import STALL_NS, Fake, Opener, made
from netboard.devices.touch import library as hdrig
from netboard.devices.touch.device import SERVOS, OpenHaptics


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Iterator[Fake]:
    """The fake as it is at first; a servo that other work holds up is not taken for one that stands still."""
    monkeypatch.setattr("netboard.devices.touch.device.STALL_NS", STALL_NS)
    monkeypatch.setattr(hdrig, "SETTLE_NS", STALL_NS)
    fake = Fake()
    fake.reset()
    yield fake
    hdrig.rig_of(fake.path).clear()
    fake.reset()


@pytest.fixture(params=SERVOS)
def open_one(fake: Fake, request: pytest.FixtureRequest) -> Opener:
    """Opens a device with either servo."""

    def opened(**options: str | float) -> OpenHaptics:
        device = made(fake, **{"servo": request.param, **options})
        device.open()
        return device

    return opened
