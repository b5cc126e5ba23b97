"""Extrapolation and interpolation of styluses between samples, as drives of the hands.

A hand enters the equations only by its drive ``u = k z + c vz``. During a step it is a polynomial of the time since the
start of the step, ``u0 + u1 t + u2 t^2 + u3 t^3``: constant for a zero-order hold, linear for constant velocity,
quadratic for constant acceleration, cubic between two known samples (cubic Hermite). The drives of both hands are one
tuple: the four coefficients of the left hand, then those of the right hand.
"""

from typing import Any

from numba import types

from netboard.base.compiled import inlined, specialised
from netboard.physics.arithmetic.vectors import State

VELOCITY_HORIZON = 0.010
"""Velocity extrapolates a stylus sample over at most this time [s]."""

ACCELERATION_HORIZON = 0.005
"""Acceleration extrapolates it over at most this time, and comes from samples at most this far apart [s]."""


@inlined
def reached(z: float, vz: float, az: float, age: float, quick: float, reach: float) -> tuple[float, float]:
    """Extrapolate height and rate of a stylus to the tick [m, m/s].

    At first the acceleration is constant, then the velocity.

    Parameters
    ----------
    age : float
        Time from the sample to the tick; negative if the sample is later [s].
    quick : float
        Limit of the extrapolation by acceleration, in either direction; less than `reach` [s].
    reach : float
        Limit of the extrapolation by velocity, in either direction [s].
    """
    age = min(max(age, -reach), reach)
    bent = min(max(age, -quick), quick)
    after = vz + az * bent
    return z + vz * bent + 0.5 * az * (bent * bent) + after * (age - bent), after


@inlined
def moving(z: float, vz: float, az: float, k: float, c: float) -> tuple[float, float, float, float]:
    """Return the drive of a hand at constant acceleration, as coefficients of the time [N, N/s, N/s2, N/s3]."""
    return k * z + c * vz, k * vz + c * az, 0.5 * (k * az), 0.0


@inlined
def resting(z: float, vz: float, k: float, c: float) -> tuple[float, float, float, float]:
    """Return the drive of a hand under a zero-order hold, as coefficients of the time [N, N/s, N/s2, N/s3]."""
    return k * z + c * vz, 0.0, 0.0, 0.0


@inlined
def between(
    z: float, vz: float, next_z: float, next_vz: float, gap: float, k: float, c: float
) -> tuple[float, float, float, float]:
    """Return the drive of a hand between two samples, as coefficients of the time [N, N/s, N/s2, N/s3].

    The cubic Hermite polynomial interpolates height and velocity.

    Parameters
    ----------
    next_z, next_vz : float
        Height and velocity of the next sample [m, m/s].
    gap : float
        Time between the samples [s].
    """
    mean = (next_z - z) / gap
    bend = (3.0 * mean - 2.0 * vz - next_vz) / gap
    twist = (vz + next_vz - 2.0 * mean) / (gap * gap)
    return k * z + c * vz, k * vz + 2.0 * (c * bend), k * bend + 3.0 * (c * twist), k * twist


@inlined
def later(u: State, t: float) -> State:
    """Return the same drives relative to a later start, by a Taylor shift of both polynomials [N, N/s, N/s2, N/s3].

    Parameters
    ----------
    u : tuple of float, length 8
        Coefficients of the left drive and of the right one [N, N/s, N/s2, N/s3].
    t : float
        Shift of the start [s].
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
    """Return the drives of the left and the right hand at a node of a step [N].

    Parameters
    ----------
    hands : tuple of float, length 8, or tuple of ndarray of float64, shape (steps, nodes, 2), and int
        Both polynomials; or the drives at the nodes of the method for all steps, and the index of this step.
    node : int
        Number of the node [1].
    t : float
        Time of the node since the start of the step [s].
    """
    if len(hands) == 8:
        return _polynomials(hands, t)
    table, step = hands
    return table[step, node, 0], table[step, node, 1]


@inlined
def _polynomials(u: State, t: float) -> tuple[float, float]:
    """Evaluate both polynomials."""
    return u[0] + t * (u[1] + t * (u[2] + t * u[3])), u[4] + t * (u[5] + t * (u[6] + t * u[7]))


@specialised(drives)
def _drives(hands: types.Type, node: types.Type, t: types.Type) -> Any:
    """Select the implementation at compile time."""
    if isinstance(hands, types.UniTuple):
        return lambda hands, node, t: _polynomials(hands, t)
    return lambda hands, node, t: (hands[0][hands[1], node, 0], hands[0][hands[1], node, 1])
