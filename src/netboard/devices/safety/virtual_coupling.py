"""The agent's own copy of the virtual coupling between the stylus and the board's control point. Pure.

With ``physics.coupling_at = "both"`` the server sends the state of the control point and the coupling parameters, and
each end computes its own force from the other end's last known state. The server computes the force on the board, the
agent the force on the hand. The hand's own loop then contains no network, and no force crosses the network. A force
computed here and applied to the board would make the light board unstable
(docs/decisions/0007-coupling-on-the-server.md).

The control point is as old as the network delay. It is extrapolated at constant velocity to the time of the reading, by
at most `REACH`: beyond that time the board has responded to the hands, and its motion is no longer a straight line. A
longer extrapolation makes a light hand less stable, not more (docs/explanation/coupling.md).
"""

from netboard.base.compiled import kernel
from netboard.devices.contract.device import Reading
from netboard.network.protocol.motion import Point

REACH = 0.005
"""Longest extrapolation of the control point [s]."""


def hand_force(point: Point, received_ns: int, reading: Reading) -> float:
    """Return the force of the virtual coupling on the hand [N].

    ``received_ns``: when the point was received, used if the server does not know the agent's clock.
    """
    made_ns = point.stamp_ns or received_ns
    return coupling_force(point.k, point.c, point.z, point.vz, reading.stamp_ns - made_ns, reading.z, reading.vz)


@kernel
def coupling_force(k: float, c: float, place: float, rate: float, age_ns: int, z: float, vz: float) -> float:
    """Return the force of the virtual coupling on the hand [N].

    ``place``, ``rate``: of the control point, ``age_ns`` before the reading ``z``, ``vz`` [m, m/s].
    """
    ahead = min(max(age_ns * 1e-9, -REACH), REACH)
    return k * (place + ahead * rate - z) + c * (rate - vz)
