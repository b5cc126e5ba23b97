"""Laws of friction between ball and board: one `Friction` for each, named by a key of ``[physics]``.

A key annotated with a law is all that a term of the equations needs: its number in the packed scene, its part of the
kernels, the energy that it dissipates, the checks of a configuration and the tables of the documentation follow. Laws
depend on the speed along the board and on the normal load alone, and are strict arithmetic.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

COLUMNS = 32
"""Coefficients of a row in a table of Taylor series [1]."""

WORK_ROWS = 2
"""Rows of such a table that a law may use for its own intermediate series [1]."""

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
        Name of the law, in words, for the documentation.
    formula : str
        The force, in the symbols of docs/explanation/physics.md.
    source : str
        Reference for the formula.
    force : callable
        ``force(coefficient, vp, load)``: kernel of the force against the motion, an odd function of the speed [N].
    slope : callable
        ``slope(coefficient, load)``: its largest derivative with respect to the speed, up to `MAX_SPEED` [N s/m].
    series : callable
        ``series(n, coefficient, table, vp, load, work)``: kernel of the n-th Taylor coefficient of the force. The rows
        from places `vp` and `load` of the table on have the coefficients up to n; `WORK_ROWS` rows from `work` on are
        the law's own, and keep what it writes from order to order [N/s^n].
    """

    name: str
    formula: str
    source: str
    force: Callable[[float, float, float], float]
    slope: Callable[[float, float], float]
    series: Callable[[int, float, NDArray[np.float64], int, int, int], float]


def _viscous(coefficient: float, vp: float, load: float) -> float:
    """Return viscous friction [N]."""
    return coefficient * vp


def _rolling(coefficient: float, vp: float, load: float) -> float:
    """Return rolling resistance, with a smooth sign of the speed [N]."""
    return coefficient * load * (vp / sqrt(vp * vp + SMOOTHING_SPEED * SMOOTHING_SPEED))


def _viscous_series(n: int, coefficient: float, table: NDArray[np.float64], vp: int, load: int, work: int) -> float:
    """Return a Taylor coefficient of viscous friction [N/s^n]."""
    speed: float = table[vp + n]
    return coefficient * speed


def _rolling_series(n: int, coefficient: float, table: NDArray[np.float64], vp: int, load: int, work: int) -> float:
    """Return a Taylor coefficient of rolling resistance, by those of the root and of the smooth sign [N/s^n]."""
    root, sign = work, work + COLUMNS
    square, rest, ratio, force = 0.0, 0.0, 0.0, 0.0
    for k in range(n + 1):
        square += table[vp + k] * table[vp + n - k]
    for k in range(1, n):
        rest += table[root + k] * table[root + n - k]
    if n == 0:
        table[root] = sqrt(square + SMOOTHING_SPEED * SMOOTHING_SPEED)
    else:
        table[root + n] = (square - rest) / (2.0 * table[root])
    for k in range(n):
        ratio += table[sign + k] * table[root + n - k]
    table[sign + n] = (table[vp + n] - ratio) / table[root]
    for k in range(n + 1):
        force += table[load + k] * table[sign + n - k]
    return coefficient * force


VISCOUS = Friction(
    name="viscous friction",
    formula="b_p p'",
    source="H. Olsson et al., Friction models and friction compensation, European Journal of Control 4, 1998, eq. 2",
    force=_viscous,
    slope=lambda coefficient, load: coefficient,
    series=_viscous_series,
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
    series=_rolling_series,
)
