"""The unit of a simulated person's action: one minimum-jerk movement of one hand.

A brain makes submovements, a hand carries them out. They add up: where two overlap in time, the hand's aim is the sum
of both. This module knows neither brains nor hands.
"""

from dataclasses import dataclass

import numba

from netboard.base.config import Side


@dataclass(frozen=True, slots=True)
class Submovement:
    """A planned displacement of one hand's equilibrium point.

    Attributes
    ----------
    side : {"left", "right"}
        The hand that moves.
    start : float
        When it starts, on the clock the brain was stepped with [s].
    duration : float
        How long it takes [s].
    displacement : float
        How far the hand goes, + = up [m].
    """

    side: Side
    start: float
    duration: float
    displacement: float

    def progress(self, when: float) -> float:
        """Share of the displacement that has been asked for at a time.

        Parameters
        ----------
        when : float
            A time on the clock of `start` [s].

        Returns
        -------
        float
            From 0 before the start to 1 after the end [1].
        """
        return float(minimum_jerk((when - self.start) / self.duration))


@numba.njit(cache=True)
def minimum_jerk(s: float) -> float:
    """Course of the smoothest movement from rest to rest (Flash and Hogan 1985).

    Parameters
    ----------
    s : float
        Share of the movement's duration that has passed; clipped to 0..1 [1].

    Returns
    -------
    float
        Share of the displacement covered: ``10 s^3 - 15 s^4 + 6 s^5`` [1].
    """
    if s <= 0.0:
        return 0.0
    if s >= 1.0:
        return 1.0
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))
