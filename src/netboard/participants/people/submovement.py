"""The unit of action of a simulated participant: one minimum-jerk movement of one hand.

A `Controller` plans submovements, a `Hand` executes them. Submovements that overlap in time add up. This module knows
neither of the two.
"""

from dataclasses import dataclass
from typing import Any

from netboard.base.compiled import inlined, kernel
from netboard.base.config import Side


@dataclass(frozen=True, slots=True)
class Submovement:
    """A planned displacement of one hand's equilibrium point, + = up [m], on the clock of `Controller.step` [s]."""

    side: Side
    start: float
    duration: float
    displacement: float

    def progress(self, when: float) -> float:
        """Return the share of the displacement commanded at a time, 0 before the start to 1 after the end [1]."""
        return float(minimum_jerk((when - self.start) / self.duration))


@inlined
def jerk_polynomial(s: Any) -> Any:
    """Return ``10 s^3 - 15 s^4 + 6 s^5`` for a number or lanes from 0 to 1."""
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


@kernel
def minimum_jerk(s: float) -> float:
    """Return the completed share of a minimum-jerk movement, ``10 s^3 - 15 s^4 + 6 s^5`` (Flash and Hogan 1985) [1].

    The elapsed share s of the duration is clipped to 0..1.
    """
    if s <= 0.0:
        return 0.0
    if s >= 1.0:
        return 1.0
    return float(jerk_polynomial(s))
