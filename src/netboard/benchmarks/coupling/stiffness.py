"""Largest stable stiffness of a virtual coupling: from the exact loop, and by rules of thumb [N/m]."""

import math
from dataclasses import replace

from netboard.base.tick import TICK_SECONDS
from netboard.physics.stability.delayed_coupling import Loop, Mechanism, is_stable

STIFFEST = 1e6
"""Largest stiffness considered [N/m]."""


def largest_stiffness(loop: Loop, start: float = 1.0, factor: float = 1.2, most: float = STIFFEST) -> float:
    """Return the stiffness up to which a loop is stable, to a hundredth of a per cent.

    Stiffnesses are raised by a factor from the first one; then the limit is found by bisection. The result is 0 if
    the first is unstable, and infinite if all are stable.
    """
    stable, k = 0.0, start
    while is_stable(replace(loop, k=k)):
        stable, k = k, k * factor
        if stable >= most:
            return math.inf
    if stable == 0.0:
        return 0.0
    while k - stable > 1e-4 * stable:
        middle = 0.5 * (stable + k)
        stable, k = (middle, k) if is_stable(replace(loop, k=middle)) else (stable, middle)
    return stable


def passive_stiffness(mechanism: Mechanism, c: float) -> float:
    """Return the largest stiffness of a passive sampled-data wall without delay: b > K T / 2 + |B|.

    J. E. Colgate, G. G. Schenkel, Passivity of a class of sampled-data systems, J. Robotic Systems 14 (1997).
    """
    return max(0.0, 2.0 * (mechanism.damping - abs(c)) / TICK_SECONDS)


def ruled_stiffness(mechanism: Mechanism, c: float, delay: float) -> float:
    """Return the largest stable stiffness of a wall with a short delay: K < (b + B) / (T / 2 + t_d).

    J. J. Gil, E. Sanchez, T. Hulin, C. Preusche, G. Hirzinger, Stability boundary for haptic rendering: influence of
    damping and delay, J. Computing and Information Science in Engineering 9 (2009) 011005.
    """
    return (mechanism.damping + c) / (0.5 * TICK_SECONDS + delay)
