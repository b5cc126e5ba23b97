"""Estimates of the partner's hand, which is hidden behind the curtain.

The board shows where the partner's hand was one visual delay ago. Its movement since then must be guessed, or inferred
from haptic feedback: at static equilibrium, the force on one's own hand determines the partner's height.
"""

from netboard.base.config import Side
from netboard.base.tables.scene import Physics

SIGN: dict[Side, float] = {"left": -1.0, "right": 1.0}
"""Sign of each side of the board, + = right; also the sign of the tilt when the hand on that side rises [1]."""


def partner_height(force: float, own: float, p: float, side: Side, physics: Physics) -> float:
    """Return the height of the partner's hand, inferred from the force on one's own hand.

    In equilibrium ``F = (W + k_s z)/2 +- m g p/(2 l)`` and ``z = (k_h (z_left + z_right) - W)/(2 k_h + k_s)``, with
    small tilts (the paper's equations 1 to 4, at rest).

    Parameters
    ----------
    force : float
        Force on one's own hand, + = up [N].
    own : float
        Height of one's own hand [m].
    p : float
        Ball position, + = right [m].
    side : {"left", "right"}
        One's own side.
    physics : Physics
        Constants of the scene, which the participant knows.

    Returns
    -------
    float
        Height of the partner's hand [m].
    """
    ball = physics.m if physics.balls else 0.0
    weight = (physics.M + ball) * physics.g
    load = -2.0 * force - weight - SIGN[side] * ball * physics.g * p / physics.l
    z = load / physics.k_s
    return (z * (2.0 * physics.k_h + physics.k_s) + weight) / physics.k_h - own


def partner_seen(own: float, theta: float, side: Side, physics: Physics) -> float:
    """Return the height of the partner's hand, inferred from the tilt of the board.

    Parameters
    ----------
    own : float
        Height of one's own hand [m].
    theta : float
        Tilt of the board [rad].
    side : {"left", "right"}
        One's own side.
    physics : Physics
        Constants of the scene.

    Returns
    -------
    float
        Height of the partner's hand [m].
    """
    return own - SIGN[side] * 2.0 * physics.l * theta
