"""What one person can know of the partner's hand behind the curtain.

The board shows where the partner was one visual delay ago. What the partner did since then is a guess, or is felt:
in the statics of the scene one's own force reveals the partner's height.
"""

from netboard.base.config import Side
from netboard.base.tables.scene import Physics

SIGN: dict[Side, float] = {"left": -1.0, "right": 1.0}
"""Side of the board, + = right; also the sense in which a rising hand tilts it [1]."""


def partner_height(force: float, own: float, p: float, side: Side, physics: Physics) -> float:
    """Height of the partner's hand inferred from one's own force.

    In equilibrium ``F = (W + k_s z)/2 +- m g p/(2 l)`` and ``z = (k_h (z_left + z_right) - W)/(2 k_h + k_s)``, with
    small tilts (the paper's equations 1 to 4, at rest).

    Parameters
    ----------
    force : float
        Force on the own hand, + = up [N].
    own : float
        Height of the own hand [m].
    p : float
        Ball position, + = right [m].
    side : {"left", "right"}
        The own side.
    physics : Physics
        The scene; the person has got to know it.

    Returns
    -------
    float
        Height of the other hand [m].
    """
    ball = physics.m if physics.balls else 0.0
    weight = (physics.M + ball) * physics.g
    load = -2.0 * force - weight - SIGN[side] * ball * physics.g * p / physics.l
    z = load / physics.k_s
    return (z * (2.0 * physics.k_h + physics.k_s) + weight) / physics.k_h - own


def partner_seen(own: float, theta: float, side: Side, physics: Physics) -> float:
    """Height of the partner's hand as the board shows it.

    Parameters
    ----------
    own : float
        Height of the own hand [m].
    theta : float
        Tilt of the board [rad].
    side : {"left", "right"}
        The own side.
    physics : Physics
        The scene.

    Returns
    -------
    float
        Height of the other hand [m].
    """
    return own - SIGN[side] * 2.0 * physics.l * theta
