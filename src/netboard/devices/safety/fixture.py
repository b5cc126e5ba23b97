"""The lateral fixture: a spring-damper that holds the stylus on the vertical line x = y = 0.

The agent computes it from its own reading, so it needs no network. It is the same in all blocks. Its force
passes the safety chain like any other.
"""

from netboard.base.compiled import kernel
from netboard.base.tables.rig import Fixture
from netboard.devices.contract.device import Reading


def lateral_force(reading: Reading, fixture: Fixture) -> tuple[float, float]:
    """Return the lateral force x, y of the fixture on the hand [N]."""
    k, c = fixture.stiffness, fixture.damping
    return fixture_force(k, c, reading.x, reading.vx), fixture_force(k, c, reading.y, reading.vy)


@kernel
def fixture_force(k: float, c: float, place: float, rate: float) -> float:
    """Return the force of the fixture along one axis [N].

    ``place``, ``rate``: distance of the stylus from the line, and its rate of change [m, m/s].
    """
    return -k * place - c * rate
