"""The one-step methods by name: order, nodes, tables; and `advance`, which compiles to the one that is asked for.

Kernels name a method by its number in `METHODS`, a constant of theirs, so that only that method is compiled into them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from netboard.base.compiled import specialised
from netboard.physics.arithmetic.vectors import State
from netboard.physics.methods.dop853 import NODES, dop853
from netboard.physics.methods.exponential import etd2rk, etd2rk_tables, etdrk4, etdrk4_tables, exact, exact_tables
from netboard.physics.methods.implicit import midpoint, verlet
from netboard.physics.methods.one_step import euler, heun, rk4, semi_implicit
from netboard.physics.methods.semilinear import StepTables
from netboard.physics.scene.parameters import Parts

Step = Callable[[State, float, Any, Any, Parts, Any], State]
Tables = Callable[[Any, Parts, int, float], NDArray[np.float64]]
"""Function of scene record, structure, length of the state vector and step size [s]."""


def _no_tables(scene: np.void, parts: Parts, length: int, h: float) -> NDArray[np.float64]:
    """Return the tables of a method that needs none."""
    return np.zeros((0, 0, 0))


@dataclass(frozen=True)
class Method:
    """A one-step method.

    Attributes
    ----------
    name : str
        The word for it in ``physics.method``.
    order : int
        Order of convergence [1].
    nodes : tuple of float
        Times at which it evaluates the drives, relative to the step [1].
    step : callable
        ``step(x, h, hands, tables, parts, scene)``.
    tables : callable
        ``tables(scene, parts, length, h)`` computes what `step` needs for a step size; empty if it needs nothing.
    """

    name: str
    order: int
    nodes: tuple[float, ...]
    step: Step
    tables: Tables = _no_tables


METHODS = (
    Method("euler", 1, (0.0,), euler),
    Method("semi_implicit", 1, (0.0,), semi_implicit),
    Method("heun", 2, (0.0, 1.0), heun),
    Method("verlet", 2, (0.5,), verlet),
    Method("midpoint", 2, (0.5,), midpoint),
    Method("rk4", 4, (0.0, 0.5, 1.0), rk4),
    Method("dop853", 8, NODES, dop853),
    Method("etd2rk", 2, (0.0, 1.0), etd2rk, etd2rk_tables),
    Method("etdrk4", 4, (0.0, 0.5, 1.0), etdrk4, etdrk4_tables),
    Method("exact", 4, (0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0), exact, exact_tables),
)
"""All methods; a method's number is its place."""

NUMBER = {method.name: i for i, method in enumerate(METHODS)}
"""Number of each method by its name."""


def advance(method: int, x: State, h: float, hands: Any, tables: StepTables, parts: Parts, scene: np.void) -> State:
    """Return the state after one step.

    Parameters
    ----------
    method : int
        Number of the method; a compile-time constant [1].
    """
    return METHODS[method].step(x, h, hands, tables, parts, scene)


@specialised(advance)
def _advance(
    method: types.Type,
    x: types.Type,
    h: types.Type,
    hands: types.Type,
    tables: types.Type,
    parts: types.Type,
    scene: types.Type,
) -> Any:
    """Select the implementation at compile time."""
    if not isinstance(method, types.IntegerLiteral):
        return None
    step = METHODS[method.literal_value].step
    return lambda method, x, h, hands, tables, parts, scene: step(x, h, hands, tables, parts, scene)
