"""Interaction of two hands through one board: opposing forces, work, effort and force shares.

Forces are those of the hands on the board at its two control points, + = up; velocities are those of the same points.
The board has two degrees of freedom, height and tilt, and two vertical forces drive both. Unlike two hands that squeeze
a box, they have no internal force that the board does not feel. Cancellation is therefore defined for one axis: two
hands that lift cancel in the tilt, two hands that tilt cancel in the height.

Subtract the static support of board and ball (`supports`) first: it carries no information on the interaction.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from netboard.analysis.measures.signals import paired
from netboard.base.compiled import kernel

Axis = Literal["tilt", "heave"]
Rule = Literal["opposing", "half_difference"]
Effort = Literal["squared", "absolute", "rms"]
Weighing = Literal["absolute", "squared"]


@dataclass(frozen=True, slots=True)
class Interaction:
    """Forces of two partners along one axis: left = left_external + between, right = right_external - between.

    Attributes
    ----------
    net : ndarray of float64, shape (n,)
        Net force: the sum of both, which moves the board; times the arm it is the torque along the tilt [N].
    between : ndarray of float64, shape (n,)
        Interaction force of the left side against the right side, signed; it moves nothing along the axis [N].
    left_external, right_external : ndarray of float64, shape (n,)
        Contribution of each side to the net force [N].
    """

    net: NDArray[np.float64]
    between: NDArray[np.float64]
    left_external: NDArray[np.float64]
    right_external: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Work:
    """Energy exchanged between a partner and the board in a period.

    Attributes
    ----------
    net : float
        Energy given minus energy received [J].
    given : float
        Energy from the partner to the board, never negative [J].
    received : float
        Energy from the board to the partner, never negative [J].
    """

    net: float
    given: float
    received: float


def supports(
    p: ArrayLike, *, board_mass: float, ball_mass: float, arm: float, g: float = 9.81
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the static forces of two hands that hold a level board with the ball at rest, + = up [N].

    They are the unique pair that balances weight and torque: ``F_left, F_right = (M + m) g / 2 -+ m g p / (2 l)``. The
    spring to the origin is left out, because it is the hands that stretch it.

    Parameters
    ----------
    board_mass, ball_mass : float
        Masses M and m; the ball mass is 0 while something else carries the ball [kg].
    g : float
        Gravitational acceleration [m/s2].
    """
    half = (board_mass + ball_mass) * g / 2.0
    turn = ball_mass * g * np.asarray(p, dtype=float) / (2.0 * arm)
    return half - turn, half + turn


def interaction(left: ArrayLike, right: ArrayLike, *, axis: Axis = "tilt", rule: Rule = "opposing") -> Interaction:
    """Decompose the forces of both hands into net force and interaction force along an axis [N].

    Parameters
    ----------
    left, right : array_like, shape (n,)
        Forces on the board, + = up, minus the static support of each hand (`supports`) [N].
    axis : {"tilt", "heave"}
        Axis of the task: the tilt, + = right end up, in which the left force counts negative; or the height.
    rule : {"opposing", "half_difference"}
        Definition of the interaction force. "opposing": the smaller of two opposing forces, and zero if they do not
        oppose each other (Groten et al., IEEE RO-MAN 2009, 723). "half_difference": half of the difference at all
        times, so that both sides contribute equally to the net force (the difference force of Reed and Peshkin, IEEE
        Trans. Haptics 1:108, 2008).
    """
    a, b = paired(left, right)
    if axis == "tilt":
        a = -a
    if rule == "half_difference":
        between = (a - b) / 2.0
    else:
        # The comparison has this direction so that NaN stays NaN.
        between = np.where(a * b >= 0.0, 0.0, np.sign(a) * np.minimum(np.abs(a), np.abs(b)))
    return Interaction(a + b, between, a - between, b + between)


def point_velocities(
    vz: ArrayLike, theta: ArrayLike, omega: ArrayLike, *, arm: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the vertical velocities of both control points, left and right: ``z' -+ l theta' cos(theta)`` [m/s].

    Parameters
    ----------
    vz : array_like, shape (n,)
        Vertical velocity of the board's centre [m/s].
    omega : array_like, shape (n,)
        Angular velocity [rad/s].
    """
    turn = arm * np.asarray(omega, dtype=float) * np.cos(np.asarray(theta, dtype=float))
    middle = np.asarray(vz, dtype=float)
    return middle - turn, middle + turn


def work(force: ArrayLike, velocity: ArrayLike, rate: float) -> Work:
    """Integrate a partner's power, its positive part and its negative part by the trapezoidal rule.

    With the stylus velocity the result is the work of the hand, part of which the virtual coupling's damper dissipates.
    With the control point's velocity (`point_velocities`) it is the work on the board.

    Parameters
    ----------
    force : array_like, shape (n,)
        Force of the hand on the board, + = up [N].
    velocity : array_like, shape (n,)
        Velocity of the stylus or of the control point, + = up [m/s].
    """
    f, v = paired(force, velocity)
    given, received = _integral(np.maximum(f * v, 0.0), rate), _integral(np.maximum(-f * v, 0.0), rate)
    return Work(given - received, given, received)


def exchanged(left_power: ArrayLike, right_power: ArrayLike, rate: float) -> tuple[float, float]:
    """Return the energy that passes through the board to the right partner and to the left one, never negative [J].

    At any time the transferred power is the smaller of the power that one partner gives and the power that the other
    receives. The rest drives the board and the ball, or comes from them.

    Parameters
    ----------
    left_power, right_power : array_like, shape (n,)
        Force times velocity of each, + = into the board [W].
    """
    a, b = paired(left_power, right_power)
    to_right = np.minimum(np.maximum(a, 0.0), np.maximum(-b, 0.0))
    to_left = np.minimum(np.maximum(b, 0.0), np.maximum(-a, 0.0))
    return _integral(to_right, rate), _integral(to_left, rate)


def effort(force: ArrayLike, rate: float, *, kind: Effort = "squared") -> float:
    """Measure the effort of a hand, whether or not it moves; NaN if a sample is missing [N2 s, N s or N].

    Parameters
    ----------
    force : array_like, shape (n,)
        Force of the hand, with or without static support (`supports`) [N].
    kind : {"squared", "absolute", "rms"}
        Integral of the squared force, as in optimal control; integral of the absolute force; or root mean square, which
        does not grow with time.
    """
    f = np.asarray(force, dtype=float)
    if kind == "rms":
        return float(np.sqrt(np.mean(f**2)))
    return _integral(np.abs(f) if kind == "absolute" else f**2, rate)


def force_share(left: ArrayLike, right: ArrayLike, *, kind: Weighing = "absolute") -> float:
    """Return the right partner's share of both forces: 0 = all left, 0.5 = even, 1 = all right; NaN for none [1].

    Parameters
    ----------
    left, right : array_like, shape (n,)
        Forces on the board, minus the static support of each hand (`supports`), which is larger on the side of the ball
        [N].
    kind : {"absolute", "squared"}
        Whether magnitudes or squares are summed.
    """
    a, b = (np.abs(side) ** (2 if kind == "squared" else 1) for side in paired(left, right))
    total = a.sum() + b.sum()
    return float(b.sum() / total) if total > 0.0 else np.nan


def _integral(values: NDArray[np.float64], rate: float) -> float:
    """Integrate samples over time by the trapezoidal rule, as `scipy.integrate.trapezoid` does, to the bit."""
    return float(_trapezoids(np.ascontiguousarray(values), 1.0 / rate))


@kernel
def _trapezoids(values: NDArray[np.float64], step: float) -> float:
    if len(values) < 2:
        return 0.0
    parts = np.empty(len(values) - 1)
    for k in range(len(parts)):
        parts[k] = step * (values[k + 1] + values[k]) / 2.0
    return 0.0 + _sum(parts, 0, len(parts))  # a sum of negative zeros is a positive one in numpy


@kernel
def _sum(values: NDArray[np.float64], first: int, count: int) -> float:
    """Add values in the order of `numpy.sum`: eight partial sums of up to 128 values, and then of pairs of halves."""
    total: float = values[first]
    if count < 8:
        for k in range(first + 1, first + count):
            total += values[k]
        return total
    if count <= 128:
        a, b, c, d = values[first], values[first + 1], values[first + 2], values[first + 3]
        e, f, g, h = values[first + 4], values[first + 5], values[first + 6], values[first + 7]
        whole = first + count - count % 8
        for k in range(first + 8, whole, 8):
            a, b, c, d = a + values[k], b + values[k + 1], c + values[k + 2], d + values[k + 3]
            e, f, g, h = e + values[k + 4], f + values[k + 5], g + values[k + 6], h + values[k + 7]
        total = ((a + b) + (c + d)) + ((e + f) + (g + h))
        for k in range(whole, first + count):
            total += values[k]
        return total
    half = count // 2 - count // 2 % 8
    return _sum(values, first, half) + _sum(values, first + half, count - half)
