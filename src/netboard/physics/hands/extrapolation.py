"""How a hand moves between its samples, and the drive it makes of that.

A hand enters the equations by its drive ``u = k z + c vz`` alone. Through a step it is a polynomial of the time since
the step's start, ``u0 + u1 t + u2 t^2 + u3 t^3``: constant for a zero-order hold, linear for a constant velocity,
quadratic for a constant acceleration, cubic between two samples that are both known (cubic Hermite). The drives of both
hands through a step are one tuple: the left hand's four coefficients, then the right one's.
"""

from typing import Any

from numba import types

from netboard.base.compiled import inlined, specialised
from netboard.physics.arithmetic.vectors import State


@inlined
def reached(z: float, vz: float, az: float, age: float, quick: float, reach: float) -> tuple[float, float]:
    """Return height and rate, at the tick, of a stylus that keeps its acceleration for a while, and then its rate.

    Parameters
    ----------
    z, vz, az : float
        Height as sampled, its rate, and the rate of that [m, m/s, m/s2].
    age : float
        Time from the sample to the tick; negative if the sample is of later [s].
    quick : float
        The acceleration counts for at most this time, in either direction; less than `reach` [s].
    reach : float
        The rate counts for at most this time, in either direction [s].

    Returns
    -------
    z, vz : float
        Height and rate at the tick [m, m/s].
    """
    age = min(max(age, -reach), reach)
    bent = min(max(age, -quick), quick)
    after = vz + az * bent
    return z + vz * bent + 0.5 * az * (bent * bent) + after * (age - bent), after


@inlined
def moving(z: float, vz: float, az: float, k: float, c: float) -> tuple[float, float, float, float]:
    """Return the drive of a hand that moves with constant acceleration from the start of the step.

    Parameters
    ----------
    z, vz, az : float
        Height of the stylus at the start, its rate, and the rate of that [m, m/s, m/s2].
    k, c : float
        Stiffness and damping of the coupling [N/m, N s/m].

    Returns
    -------
    tuple of float
        Coefficients of the time [N, N/s, N/s2, N/s3].
    """
    return k * z + c * vz, k * vz + c * az, 0.5 * (k * az), 0.0


@inlined
def resting(z: float, vz: float, k: float, c: float) -> tuple[float, float, float, float]:
    """Return the drive of a hand whose sample counts all through the step (zero-order hold).

    Parameters
    ----------
    z, vz : float
        Height of the stylus and its rate, as sampled [m, m/s].
    k, c : float
        Stiffness and damping of the coupling [N/m, N s/m].

    Returns
    -------
    tuple of float
        Coefficients of the time [N, N/s, N/s2, N/s3].
    """
    return k * z + c * vz, 0.0, 0.0, 0.0


@inlined
def between(
    z: float, vz: float, next_z: float, next_vz: float, gap: float, k: float, c: float
) -> tuple[float, float, float, float]:
    """Return the drive of a hand on its way between two samples, the cubic that meets both (Hermite).

    Parameters
    ----------
    z, vz : float
        Height of the stylus and its rate at the start [m, m/s].
    next_z, next_vz : float
        The same at the end [m, m/s].
    gap : float
        Time from the start to the end [s].
    k, c : float
        Stiffness and damping of the coupling [N/m, N s/m].

    Returns
    -------
    tuple of float
        Coefficients of the time [N, N/s, N/s2, N/s3].
    """
    mean = (next_z - z) / gap
    bend = (3.0 * mean - 2.0 * vz - next_vz) / gap
    twist = (vz + next_vz - 2.0 * mean) / (gap * gap)
    return k * z + c * vz, k * vz + 2.0 * (c * bend), k * bend + 3.0 * (c * twist), k * twist


@inlined
def later(u: State, t: float) -> State:
    """Return the drives of both hands counted from a later start (Taylor's shift of both polynomials).

    Parameters
    ----------
    u : tuple of float, length 8
        Coefficients of the left drive and of the right one [N, N/s, N/s2, N/s3].
    t : float
        How much later [s].

    Returns
    -------
    tuple of float, length 8
        The same motion, counted from then [N, N/s, N/s2, N/s3].
    """
    return (
        u[0] + t * (u[1] + t * (u[2] + t * u[3])),
        u[1] + t * (2.0 * u[2] + 3.0 * (t * u[3])),
        u[2] + 3.0 * (t * u[3]),
        u[3],
        u[4] + t * (u[5] + t * (u[6] + t * u[7])),
        u[5] + t * (2.0 * u[6] + 3.0 * (t * u[7])),
        u[6] + 3.0 * (t * u[7]),
        u[7],
    )


def drives(hands: Any, node: int, t: float) -> tuple[float, float]:
    """Return the drives of both hands at a node of a step.

    Parameters
    ----------
    hands : tuple of float, length 8, or tuple of ndarray of float64, shape (steps, nodes, 2), and int
        The polynomials of both; or the drives evaluated beforehand at the nodes of the method, and which step this is.
    node : int
        Number of the node [1].
    t : float
        Its time since the start of the step [s].

    Returns
    -------
    left, right : float
        Drives [N].
    """
    if len(hands) == 8:
        return _polynomials(hands, t)
    table, step = hands
    return table[step, node, 0], table[step, node, 1]


@inlined
def _polynomials(u: State, t: float) -> tuple[float, float]:
    """Return the values of both polynomials at a time."""
    return u[0] + t * (u[1] + t * (u[2] + t * u[3])), u[4] + t * (u[5] + t * (u[6] + t * u[7]))


@specialised(drives)
def _drives(hands: Any, node: Any, t: Any) -> Any:
    """Choose, when a kernel is compiled."""
    if isinstance(hands, types.UniTuple):
        return lambda hands, node, t: _polynomials(hands, t)
    return lambda hands, node, t: (hands[0][hands[1], node, 0], hands[0][hands[1], node, 1])
