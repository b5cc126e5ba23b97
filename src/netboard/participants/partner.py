"""Estimates of the partner's hand, which is hidden behind the curtain.

The board shows where the partner's hand was one visual delay ago. Its movement since then must be guessed, or inferred
from haptic feedback: at static equilibrium, the force on one's own hand determines the partner's height.
"""

from typing import Any

from netboard.base.compiled import kernel
from netboard.base.config import Side

SIGN: dict[Side, float] = {"left": -1.0, "right": 1.0}
"""Sign of each side of the board, + = right; also the sign of the tilt when the hand on that side rises [1]."""


@kernel
def partner_height(force: float, own: float, p: float, sign: float, scene: Any) -> float:
    """Return the height of the partner's hand, inferred from the force on one's own hand [m].

    In equilibrium ``F = (W + k_s z)/2 +- m g p/(2 l)`` and ``z = (k_h (z_left + z_right) - W)/(2 k_h + k_s)``, with
    small tilts (the paper's equations 1 to 4, at rest).

    Parameters
    ----------
    force : float
        Force on one's own hand, + = up [N].
    p : float
        Ball position, + = right [m].
    scene : record
        Constants of the scene, which the participant knows: M, ball, g, l, k_h, k_s [SI].
    """
    weight = (scene["M"] + scene["ball"]) * scene["g"]
    load = -2.0 * force - weight - sign * scene["ball"] * scene["g"] * p / scene["l"]
    z = load / scene["k_s"]
    return float((z * (2.0 * scene["k_h"] + scene["k_s"]) + weight) / scene["k_h"] - own)


@kernel
def partner_seen(own: float, theta: float, sign: float, l: float) -> float:  # noqa: E741
    """Return the height of the partner's hand, inferred from the tilt of the board [m].

    Parameters
    ----------
    theta : float
        Tilt of the board [rad].
    l : float
        Half the length of the board [m].
    """
    return own - sign * 2.0 * l * theta


@kernel
def haptic_weight(seen: float, drift: float, apart: float, felt: float) -> float:
    """Return the weight by reliability of the partner's height inferred from force, against its visual prediction.

    The partner's height is a random walk. Vision measured it `apart` before touch did, so its variance has grown to
    ``P = seen**2 + drift * apart`` when the force measures it with the variance ``R = felt**2``: ``w = P / (P + R)``.
    Vision and touch integrate in this way (Ernst and Banks, Nature 415:429, 2002), also when the force comes from a
    partner (Takagi, Ganesh, Yoshioka, Kawato and Burdet, Nat. Hum. Behav. 1:0054, 2017).

    Parameters
    ----------
    seen : float
        Standard deviation of the height as seen [m].
    drift : float
        Variance of the partner's unforeseen movement per time [m2/s].
    apart : float
        Time by which vision is later than touch [s].
    felt : float
        Standard deviation of the height inferred from force [m].

    Returns
    -------
    float
        The weight, from 0 to 1; 0 without any uncertainty [1].
    """
    prior = seen * seen + drift * apart
    total = prior + felt * felt
    return prior / total if total > 0.0 else 0.0
