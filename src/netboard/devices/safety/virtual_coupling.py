"""The agent's own copy of the coupling: spring and damper from the stylus to the board's control point. Pure.

With ``physics.coupling_at = "both"`` the server says where the control point was and what couples it to the stylus, and
each side computes the force for itself: the server that on the board, from the stylus as it last knew it, the agent
that on the hand, from the point as it last knew it. So the hand's own loop has no network in it, and no force crosses
one: a force computed here and felt by the board would drive the light board unstable
(docs/decisions/0007-coupling-on-the-server.md).

The point is as old as the network makes it. It is moved on by its rate to the time of the reading, but for no longer
than `REACH`: within that time the board answers its hands, and what it does after is no straight line. A longer reach
makes a light hand less stable, not more (docs/explanation/coupling.md).
"""

from netboard.devices.contract.device import Reading
from netboard.network.protocol.motion import Point

REACH = 0.005
"""The control point is moved on by its rate over at most this time [s]."""


def hand_force(point: Point, heard_ns: int, reading: Reading) -> float:
    """Force of the coupling on the hand.

    Parameters
    ----------
    heard_ns : int
        When that was received, which counts where the server does not know the time here [ns].
    """
    age = (reading.stamp_ns - (point.stamp_ns or heard_ns)) * 1e-9
    ahead = min(max(age, -REACH), REACH)
    return point.k * (point.z + ahead * point.vz - reading.z) + point.c * (point.vz - reading.vz)
