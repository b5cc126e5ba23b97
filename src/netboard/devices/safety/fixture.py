"""The lateral fixture: a spring-damper that holds the stylus in the vertical line x = y = 0.

It is computed by the agent from its own reading, so it needs no network, and it is the same in all blocks (reading
B9). Its force goes through the safety chain like any other.
"""

import numba

from netboard.base.tables.rig import Fixture
from netboard.devices.contract.device import Reading


def lateral_force(reading: Reading, fixture: Fixture) -> tuple[float, float]:
    """Force of the fixture on the hand."""
    k, c = fixture.stiffness, fixture.damping
    return drawn_in(k, c, reading.x, reading.vx), drawn_in(k, c, reading.y, reading.vy)


@numba.njit(cache=True)
def drawn_in(k: float, c: float, place: float, rate: float) -> float:
    """Force of the fixture along one axis.

    Parameters
    ----------
    place, rate : float
        How far the stylus is from the line, and how fast it goes away [m, m/s].
    """
    return -k * place - c * rate
