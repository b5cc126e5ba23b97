"""The lateral fixture: a spring-damper that holds the stylus in the vertical line x = y = 0.

It is computed by the agent from its own reading, so it needs no network, and it is the same in all blocks (reading
B9). Its force goes through the safety chain like any other.
"""

from netboard import config
from netboard.devices.base import Reading


def lateral_force(reading: Reading, fixture: config.Fixture) -> tuple[float, float]:
    """Force of the fixture on the hand.

    Parameters
    ----------
    reading : Reading
        Where the stylus is.
    fixture : netboard.config.Fixture
        Stiffness and damping.

    Returns
    -------
    tuple of float
        Force along x and y [N].
    """
    k, c = fixture.stiffness, fixture.damping
    return -k * reading.x - c * reading.vx, -k * reading.y - c * reading.vy
