"""Stability of a virtual coupling over a delay, from the exact matrix of the sampled-data loop.

One millisecond of the loop is a linear map: the stylus under a held force, its velocity estimate, the samples on their
way to the server, the coupling, the end of the board, and the forces on their way back. Applied to unit vectors, it
gives its matrix; the loop is stable if no eigenvalue is larger than 1 in modulus. The coupling is computed either on
the server, or on both: then the agent computes the force on the hand from the delayed end of the board
(docs/explanation/coupling.md).

The model is linear, without friction, encoder steps and force limits. NumPy and SciPy; not for use in a tick.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from netboard.base.tables.declared import Extrapolation
from netboard.base.tables.scene import Physics
from netboard.base.tick import TICK_SECONDS
from netboard.physics.hands.extrapolation import ACCELERATION_HORIZON, VELOCITY_HORIZON

Matrix = NDArray[np.float64]
At = Literal["server", "both"]

ROUNDING = 1e-7
"""Tolerance of the spectral radius. A free body has a double eigenvalue 1, which rounding moves by the square root of
the machine precision, 1.5e-8; growth this slow takes hours to be noticed [1]."""

LONGEST = 60
"""Largest delay considered [ms]."""

STRIDE = 5
"""First step size of the search for a delay [ms]."""


@dataclass(frozen=True)
class Mechanism:
    """Mechanics of the stylus: the device and the hand that holds it, if any.

    Attributes
    ----------
    mass : float
        Of device and hand [kg].
    damping : float
        Viscous damping of both [N s/m].
    stiffness : float
        Stiffness of the hand towards its equilibrium point; 0 for a released stylus [N/m].
    substeps : int
        Steps per tick of the virtual device; 0: the exact motion of a real one [1].
    """

    mass: float = 0.045
    damping: float = 0.1
    stiffness: float = 0.0
    substeps: int = 0


@dataclass(frozen=True)
class BoardEnd:
    """End of the board as seen by one hand: a mass on a spring and a damper.

    Attributes
    ----------
    mass : float
        Its mass; infinite for a fixed end, the worst case [kg].
    damping : float
        Damping of its damper [N s/m].
    stiffness : float
        Stiffness of its spring [N/m].
    """

    mass: float = math.inf
    damping: float = 0.0
    stiffness: float = 0.0


FIXED = BoardEnd()


@dataclass(frozen=True)
class Loop:
    """A hand, its virtual coupling and the end of the board.

    Attributes
    ----------
    mechanism : Mechanism
        Stylus and hand.
    end : End
        End of the board that the coupling holds.
    k : float
        Stiffness of the coupling [N/m].
    c : float
        Its damping [N s/m].
    up : int
        Delay from stylus to server [ms].
    down : int
        Delay back [ms].
    at : str
        ``server`` or ``both``: where the force on the hand is computed.
    hold : str
        Extrapolation of samples on the server, as in ``physics.hold``.
    window : int
        Interval of the position difference that estimates the velocity; 0: exact velocity [ms].
    reach : float
        Longest extrapolation of the end of the board by the agent [s].
    gain : float
        Commanded force over the force on the board [1].
    """

    mechanism: Mechanism = Mechanism()
    end: BoardEnd = FIXED
    k: float = 200.0
    c: float = 2.0
    up: int = 0
    down: int = 0
    at: At = "server"
    hold: Extrapolation = "zoh"
    window: int = 0
    reach: float = 0.0
    gain: float = 1.0


def loop_matrix(loop: Loop) -> Matrix:
    """Return the matrix of one tick of a loop, shape (n, n) [SI]."""
    length, step = _make_step(loop)
    return step(np.eye(length))


def growth(loop: Loop) -> float:
    """Return the spectral radius of a tick, which is at most 1 in a stable loop [1]."""
    return float(np.abs(np.linalg.eigvals(loop_matrix(loop))).max())


def dominant_frequency(loop: Loop) -> float:
    """Return the frequency of the oscillation that decays last or grows first [rad/s]."""
    values = np.linalg.eigvals(loop_matrix(loop))
    turns = np.abs(np.angle(values)) > ROUNDING
    return abs(float(np.angle(values[np.argmax(np.abs(values) * turns)]))) / TICK_SECONDS


def is_stable(loop: Loop) -> bool:
    """Return whether a loop is stable."""
    return growth(loop) <= 1.0 + ROUNDING


def delayed(loop: Loop, up: int, down: int) -> Loop:
    """Return the same loop with other delays.

    Parameters
    ----------
    up, down : int
        Delay to the server and back [ms].
    """
    return replace(loop, up=up, down=down)


def largest_delay(loop: Loop, most: int = LONGEST) -> int:
    """Return the largest stable one-way delay, equal in both directions; -1 if the loop is unstable without any [ms].

    Parameters
    ----------
    loop : Loop
        The coupling's control loop; its delays are ignored.
    most : int
        Largest one-way delay examined, and returned if the loop is stable with it [ms].
    """
    return furthest(lambda way: is_stable(delayed(loop, way, way)), most)


def largest_round_trip(loop: Loop, most: int = LONGEST) -> int:
    """Return the largest stable round-trip delay; -1 if the loop is unstable without any [ms].

    The delay to the server is equal to that back, or 1 ms longer.

    Parameters
    ----------
    loop : Loop
        The coupling's control loop; its delays are ignored.
    most : int
        Largest round-trip delay examined [ms].
    """
    return furthest(lambda trip: is_stable(delayed(loop, trip - trip // 2, trip // 2)), most)


def furthest(stable: Callable[[int], bool], most: int) -> int:
    """Return the last integer from 0 for which a condition holds, -1 for none; large steps first, for slow checks [1].

    Parameters
    ----------
    stable : callable
        The condition, which holds up to some integer [1].
    most : int
        Largest integer examined [1].
    """
    start = 0
    while start <= most and stable(start):
        start += STRIDE
    first = max(start - STRIDE + 1, 0)
    return min(next((number for number in range(first, start) if not stable(number)), start) - 1, most)


# --- the board of a scene ----------------------------------------------------------------------------------------


def ends_of(physics: Physics) -> dict[str, BoardEnd]:
    """Return the end of the board as seen by each hand, in the modes ``heave`` and ``tilt`` that the board has.

    The level board without balls is linearised. Two coupled hands share the board equally in both modes; a single
    coupled hand has all of it.
    """
    hands = 2.0 if physics.coupling == "both" else 1.0
    arm = physics.l * physics.l
    ends = {}
    if physics.board != "hinged":
        ends["heave"] = BoardEnd(physics.M / hands, physics.b_z / hands, physics.k_s / hands)
    if physics.board != "level":
        ends["tilt"] = BoardEnd(physics.I / arm / hands, physics.b_theta / arm / hands, 0.0)
    return ends


# --- one tick ----------------------------------------------------------------------------------------------------


def _make_step(loop: Loop) -> tuple[int, Callable[[Matrix], Matrix]]:
    """Return the length of the loop's state vector, and the map of a tick on states (as columns).

    The state: position and velocity of the stylus, its last positions, the samples on their way to the server, the
    force on its way back (or position and velocity of the end), position and velocity of the end.
    """
    moved, pushed = _mechanism(loop.mechanism)
    carried, driven = _end(loop)
    remembered = max(loop.window, 1)
    waiting = loop.up + 1
    width = 1 if loop.at == "server" else 2
    cuts = np.cumsum([2, remembered, 2 * waiting, width * loop.down])
    length = int(cuts[-1]) + 2
    age, back = loop.up * TICK_SECONDS, min(loop.down * TICK_SECONDS, loop.reach)

    def step(states: Matrix) -> Matrix:
        stylus, places, samples, coming, end = np.split(states, cuts)
        rate = (stylus[0] - places[loop.window - 1]) / (loop.window * TICK_SECONDS) if loop.window else stylus[1]
        samples = np.vstack([stylus[:1], rate[None], samples])
        used = _used(samples[2 * loop.up :], age, loop.hold)
        if loop.at == "server":
            force = loop.k * (end[0] - used[0]) + loop.c * (end[1] - used[1])
            coming = np.vstack([force[None], coming])
            felt = coming[loop.down]
        else:
            coming = np.vstack([end, coming])
            z, vz = coming[2 * loop.down], coming[2 * loop.down + 1]
            felt = loop.k * (z + back * vz - stylus[0]) + loop.c * (vz - rate)
        return np.vstack(
            [
                moved @ stylus + np.outer(pushed, loop.gain * felt),
                np.vstack([stylus[:1], places])[:remembered],
                samples[: 2 * waiting],
                coming[: width * loop.down],
                carried @ end + driven @ used,
            ]
        )

    return length, step


def _used(samples: Matrix, age: float, hold: Extrapolation) -> Matrix:
    """Return position, velocity and acceleration of a stylus at the tick, from its last two samples."""
    z, vz = samples[0], samples[1]
    if hold == "zoh":
        return np.stack([z, vz, np.zeros_like(z)])
    az = (vz - samples[3]) / TICK_SECONDS if hold == "ca" else np.zeros_like(z)
    reach, bent = min(age, VELOCITY_HORIZON), min(age, ACCELERATION_HORIZON)
    z = z + vz * reach + az * (0.5 * bent * bent + bent * (reach - bent))
    return np.stack([z, vz + az * bent, az])


def _mechanism(mechanism: Mechanism) -> tuple[Matrix, Matrix]:
    """Return the transition matrix of position and velocity of the stylus, and the response to 1 N."""
    m, b, k = mechanism.mass, mechanism.damping, mechanism.stiffness
    if mechanism.substeps == 0:
        a = np.array([[0.0, 1.0, 0.0], [-k / m, -b / m, 1.0 / m], [0.0, 0.0, 0.0]])
        whole = expm(a * TICK_SECONDS)
        return whole[:2, :2], whole[:2, 2]
    h = TICK_SECONDS / mechanism.substeps
    slowed = 1.0 / (1.0 + h * b / m)
    rate = np.array([-h * k / m, 1.0, h / m]) * slowed
    once = np.array([[1.0, 0.0, 0.0] + h * rate, rate, [0.0, 0.0, 1.0]])
    whole = np.linalg.matrix_power(once, mechanism.substeps)
    return whole[:2, :2], whole[:2, 2]


def _end(loop: Loop) -> tuple[Matrix, Matrix]:
    """Return the transition matrix of position and velocity of the end, and the response to a stylus (z, vz, az)."""
    end, k, c = loop.end, loop.k, loop.c
    if math.isinf(end.mass):
        return np.eye(2), np.zeros((2, 3))
    # With the drive u = k z + c vz as a polynomial: position, velocity, and u with its derivatives.
    a = np.zeros((5, 5))
    a[0, 1] = 1.0
    a[1] = np.array([-(end.stiffness + k), -(end.damping + c), 1.0, 0.0, 0.0]) / end.mass
    a[2, 3] = a[3, 4] = 1.0
    whole = expm(a * TICK_SECONDS)
    drive = np.array([[k, c, 0.0], [0.0, k, c], [0.0, 0.0, k]])
    if loop.hold == "zoh":
        drive[1:] = 0.0
    return whole[:2, :2], whole[:2, 2:] @ drive
