"""Laws of friction between ball and board: one `Friction` for each, named by a key of ``[physics]``.

A key annotated with a law is all that a term of the equations needs: its number in the packed scene, its part of the
kernels, the energy that it dissipates, the checks of a configuration and the tables of the documentation follow. Laws
depend on the speed along the board and on the normal load alone, and are strict arithmetic.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

MAX_SPEED = 5.0
"""Largest speed of a ball at which a law must be stable: that of a free fall by 1.3 m [m/s]."""

SMOOTHING_SPEED = 2e-3
"""Below about this speed rolling resistance falls to zero smoothly, so that a method keeps its order [m/s]."""


@dataclass(frozen=True)
class Friction:
    """A force of the board on a ball, against its motion along the board.

    Attributes
    ----------
    name : str
        Name in the documentation.
    formula : str
        The force, in the symbols of docs/explanation/physics.md.
    source : str
        Reference for the formula.
    force : callable
        ``force(coefficient, vp, load)``: kernel of the force against the motion, an odd function of the speed [N].
    slope : callable
        ``slope(coefficient, load)``: its largest derivative with respect to the speed, up to `MAX_SPEED` [N s/m].
    """

    name: str
    formula: str
    source: str
    force: Callable[[float, float, float], float]
    slope: Callable[[float, float], float]


def _viscous(coefficient: float, vp: float, load: float) -> float:
    """Return viscous friction [N]."""
    return coefficient * vp


def _rolling(coefficient: float, vp: float, load: float) -> float:
    """Return rolling resistance, with a smooth sign of the speed [N]."""
    return coefficient * load * (vp / sqrt(vp * vp + SMOOTHING_SPEED * SMOOTHING_SPEED))


VISCOUS = Friction(
    name="viscous friction",
    formula="b_p p'",
    source="H. Olsson et al., Friction models and friction compensation, European Journal of Control 4, 1998, eq. 2",
    force=_viscous,
    slope=lambda coefficient, load: coefficient,
)

ROLLING = Friction(
    name="rolling resistance",
    formula="mu_r N p' / sqrt(p'^2 + v_s^2), v_s = 2 mm/s",
    source=(
        "J. Ai et al., Assessment of rolling resistance models in discrete element simulations, Powder Technology 206, "
        "2011, model A; square-root regularisation: P. Wriggers, Computational Contact Mechanics, 2006, section 5.2"
    ),
    force=_rolling,
    slope=lambda coefficient, load: coefficient * load / SMOOTHING_SPEED,
)
