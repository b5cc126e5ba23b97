"""Exponential one-step methods: exact for the linearisation about the level board, Runge-Kutta for the remainder.

They are stable at every step size, however stiff the couplings. With ``x' = A x + N(x, t)``
(`netboard.physics.methods.semilinear`) a method's tables are A and products of h and the functions phi_k of hA
(`netboard.physics.methods.phi`). `exact` is for boards that cannot tilt: there N depends on the hands alone.

Every step has the arguments of those of `netboard.physics.methods.one_step`; the rules of
`netboard.physics.scene.models` hold here.
"""

from math import sqrt
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from netboard.base.compiled import inlined, specialised
from netboard.physics.arithmetic.vectors import State, joined, places, plus, speeds
from netboard.physics.hands.extrapolation import drives
from netboard.physics.methods.phi import phi
from netboard.physics.methods.semilinear import StepTables, pushed, remainder, times
from netboard.physics.scene.linear import scene_matrix
from netboard.physics.scene.models import rates
from netboard.physics.scene.parameters import Parts


@inlined
def etd2rk(x: State, h: float, hands: np.void, tables: StepTables, parts: Parts, scene: np.void) -> State:
    """Return the state after one step of the exponential Heun method (order 2).

    S. M. Cox, P. C. Matthews, "Exponential time differencing for stiff systems", J. Comput. Phys. 176, 2002, eq. 22.

    Parameters
    ----------
    tables : tuple of ndarray of float64, shape (kinds, 4, n, n), and int
        Tables from `etd2rk_tables` for each step size, and the index of the current one.
    """
    left, right = drives(hands, 0, 0.0)
    start = remainder(x, left, right, tables, parts, scene)
    end = pushed(times(x, tables, 1, parts), tables, 2, start, parts)
    left, right = drives(hands, 1, h)
    change = plus(remainder(end, left, right, tables, parts, scene), -1.0, start)
    return pushed(end, tables, 3, change, parts)


@inlined
def etdrk4(x: State, h: float, hands: np.void, tables: StepTables, parts: Parts, scene: np.void) -> State:
    """Return the state after one step of Krogstad's exponential Runge-Kutta method (order 4).

    S. Krogstad, "Generalized integrating factor methods for stiff PDEs", J. Comput. Phys. 203, 2005, ETDRK4-B; in
    tableau form, which leaves few operations after the last evaluation of N.

    Parameters
    ----------
    tables : tuple of ndarray of float64, shape (kinds, 11, n, n), and int
        Tables from `etdrk4_tables` for each step size, and the index of the current one.
    """
    left, right = drives(hands, 0, 0.0)
    n1 = remainder(x, left, right, tables, parts, scene)
    middle, end = times(x, tables, 1, parts), times(x, tables, 2, parts)
    left, right = drives(hands, 1, 0.5 * h)
    x2 = pushed(middle, tables, 3, n1, parts)
    n2 = remainder(x2, left, right, tables, parts, scene)
    x3 = pushed(pushed(middle, tables, 4, n1, parts), tables, 5, n2, parts)
    n3 = remainder(x3, left, right, tables, parts, scene)
    left, right = drives(hands, 2, h)
    x4 = pushed(pushed(end, tables, 6, n1, parts), tables, 7, n3, parts)
    n4 = remainder(x4, left, right, tables, parts, scene)
    known = pushed(pushed(end, tables, 8, n1, parts), tables, 9, plus(n2, 1.0, n3), parts)
    return pushed(known, tables, 10, n4, parts)


MAX_EXPLICIT_STIFFNESS = 2.0
"""Largest stiffness of the remainder N per step; the limit of RK4 is 2.8 [1]."""


def solved(parts: Parts, scene: np.void, length: int, h: float) -> NDArray[np.float64]:
    """Return the matrix A that is solved exactly: of the scene, or of the board without the inertia of balls [SI].

    In the Lagrangian model a ball away from the centre adds less inertia to the heave than A assumes; the difference is
    in N. For stiff scenes it would make N unstable, so A is that of the lightest board: stable, but less accurate.
    """
    k = float(scene["k_left"]) + float(scene["k_right"]) + float(scene["k_s"])
    c = float(scene["c_left"]) + float(scene["c_right"]) + float(scene["b_z"])
    stiff = h * max(c / float(scene["M"]), sqrt(k / float(scene["M"]))) > MAX_EXPLICIT_STIFFNESS
    return scene_matrix(parts._replace(lagrangian=False) if stiff else parts, scene, length)


def etd2rk_tables(scene: np.void, parts: Parts, length: int, h: float) -> NDArray[np.float64]:
    """Return the tables of `etd2rk`, stored by columns: A, phi_0, h phi_1 and h phi_2 [SI]."""
    a = solved(parts, scene, length, h)
    full = phi(a, h, 2)
    return _by_columns(a, full[0], h * full[1], h * full[2])


def etdrk4_tables(scene: np.void, parts: Parts, length: int, h: float) -> NDArray[np.float64]:
    """Return the tables of `etdrk4`, stored by columns: A, phi_0 of half and of a whole step, and the tableau [SI]."""
    a = solved(parts, scene, length, h)
    half, full = phi(a, 0.5 * h, 2), phi(a, h, 3)
    h1, h2, f1, f2, f3 = h * half[1], h * half[2], h * full[1], h * full[2], h * full[3]
    stages = (0.5 * h1, 0.5 * h1 - h2, h2, f1 - 2.0 * f2, 2.0 * f2)
    return _by_columns(a, half[0], full[0], *stages, f1 - 3.0 * f2 + 4.0 * f3, 2.0 * f2 - 4.0 * f3, 4.0 * f3 - f2)


def _by_columns(*matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return matrices stored by columns, for vector instructions."""
    return np.ascontiguousarray(np.array(matrices).transpose(0, 2, 1))


@inlined
def exact(x: State, h: float, hands: Any, tables: StepTables, parts: Parts, scene: np.void) -> State:
    """Return the state after one step of a board that cannot tilt, exact for drives that are cubic in time.

    Parameters
    ----------
    tables : tuple of ndarray of float64, shape (kinds, 1, 2, 11), and int
        Tables from `exact_tables` for each step size, and the index of the current one.
    """
    by, drive = _both(hands)
    z = _row(x, drive, tables[0], tables[1], 0, by)
    vz = _row(x, drive, tables[0], tables[1], 1, by)
    p = plus(places(x), h, speeds(x)) if parts.free else places(x)
    return joined(z, vz, x[2], x[3], p, speeds(x))


@inlined
def _row(x: State, drive: State, table: NDArray[np.float64], kind: int, row: int, by: int) -> float:
    """Return one component of the final state: contributions of weight and drives, and of the initial state."""
    w0, w1 = table[kind, 0, row, by] * drive[0], table[kind, 0, row, by + 1] * drive[1]
    w2, w3 = table[kind, 0, row, by + 2] * drive[2], table[kind, 0, row, by + 3] * drive[3]
    flow: float = table[kind, 0, row, 0] * x[0] + table[kind, 0, row, 1] * x[1]
    push: float = table[kind, 0, row, 2] + (w0 + w1 + w2 + w3)
    return push + flow


def _both(hands: Any) -> tuple[int, State]:
    """Return the first column of the drives in the table, and the sums of both hands' coefficients or values."""
    if len(hands) == 8:
        return 3, (hands[0] + hands[4], hands[1] + hands[5], hands[2] + hands[6], hands[3] + hands[7])
    table, step = hands
    return 7, tuple([float(table[step, node, 0] + table[step, node, 1]) for node in range(4)])


@specialised(_both)
def _write_both(hands: types.Type) -> Any:
    """Select the implementation at compile time."""
    if isinstance(hands, types.UniTuple):
        return lambda hands: (3, (hands[0] + hands[4], hands[1] + hands[5], hands[2] + hands[6], hands[3] + hands[7]))
    return lambda hands: (
        7,
        (
            hands[0][hands[1], 0, 0] + hands[0][hands[1], 0, 1],
            hands[0][hands[1], 1, 0] + hands[0][hands[1], 1, 1],
            hands[0][hands[1], 2, 0] + hands[0][hands[1], 2, 1],
            hands[0][hands[1], 3, 0] + hands[0][hands[1], 3, 1],
        ),
    )


def exact_tables(scene: np.void, parts: Parts, length: int, h: float) -> NDArray[np.float64]:
    """Return the table of `exact`, with columns for state, 1, coefficients of the drives, and their values at nodes.

    Returns
    -------
    ndarray of float64, shape (1, 2, 11)
        Contributions to height and rate [SI].

    Raises
    ------
    ValueError
        If the board can tilt.
    """
    if parts.tilts:
        raise ValueError("a board that tilts is not linear: it has no exact step")
    rest = (0.0,) * length
    weightless = scene.copy()
    weightless["g"] = 0.0
    load = rates(rest, 0.0, 0.0, parts, scene)[1]
    answer = rates(rest, 1.0, 0.0, parts, weightless)[1]
    phis = phi(np.ascontiguousarray(scene_matrix(parts, scene, length)[:2, :2]), h, 4)
    # Integrals of e^((h - t) A) (t / h)^k for a unit drive, of t^k, and of the four Lagrange cubics of the nodes.
    powers = [answer * (h * (factor * phis[k + 1][:, 1])) for k, factor in enumerate((1.0, 1.0, 2.0, 6.0))]
    times = [powers[0], h * powers[1], h * h * powers[2], h * h * h * powers[3]]
    nodes = [
        powers[0] - 5.5 * powers[1] + 9.0 * powers[2] - 4.5 * powers[3],
        9.0 * powers[1] - 22.5 * powers[2] + 13.5 * powers[3],
        -4.5 * powers[1] + 18.0 * powers[2] - 13.5 * powers[3],
        powers[1] - 4.5 * powers[2] + 4.5 * powers[3],
    ]
    columns = [phis[0][:, 0], phis[0][:, 1], load * (h * phis[1][:, 1]), *times, *nodes]
    return np.stack(columns, axis=1)[np.newaxis]
