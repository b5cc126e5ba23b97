"""The force of the lateral fixture on a reading, for tests that close the loop of a device in Python."""

from netboard.base.tables.rig import Fixture
from netboard.devices.contract.device import Reading
from netboard.participants.body.device_forces import fixture_force


def lateral_force(reading: Reading, fixture: Fixture) -> tuple[float, float]:
    """Return the lateral force x, y of the fixture on the hand [N]."""
    k, c = fixture.stiffness, fixture.damping
    return fixture_force(k, c, reading.x, reading.vx), fixture_force(k, c, reading.y, reading.vy)
