"""What two hands do to one board, and to each other: forces apart, work, effort and shares.

Forces are those of the hands on the board at its two control points, + = up; velocities those of the points they act
at. A board that is raised and turned has two degrees of freedom, and two vertical forces move both: unlike two hands
that squeeze a box, these have no force between them that the board does not feel. What cancels is therefore a question
of an axis: two hands that lift cancel in the tilt, two that tilt cancel in the lift.

What the hands must bear anyway, the weights of board and ball, says nothing of their interaction: take `supports` off.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import trapezoid

from netboard.analysis.measures.signals import paired

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
        What moves the board: the sum of both; times the arm the torque, along the tilt [N].
    between : ndarray of float64, shape (n,)
        What the left side puts against the right one, with its sign; it moves nothing along the axis [N].
    left_external, right_external : ndarray of float64, shape (n,)
        What each side adds to the net force [N].
    """

    net: NDArray[np.float64]
    between: NDArray[np.float64]
    left_external: NDArray[np.float64]
    right_external: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Work:
    """Energy between a partner and the board in a stretch of time.

    Attributes
    ----------
    net : float
        Given less received [J].
    given : float
        By the partner to the board, never negative [J].
    received : float
        By the partner from the board, never negative [J].
    """

    net: float
    given: float
    received: float


def supports(
    p: ArrayLike, *, board_mass: float, ball_mass: float, arm: float, g: float = 9.81
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the forces with which two hands bear a level board at rest, and the ball where it is.

    They are the only two that balance weight and torque: ``F_left, F_right = (M + m) g / 2 -+ m g p / (2 l)``. The
    spring to the origin is left out: stretching it is what the hands do.

    Parameters
    ----------
    p : array_like, shape (n,)
        The ball along the board, + = right [m].
    board_mass, ball_mass : float
        Masses M and m; the ball's is 0 while something else carries it [kg].
    arm : float
        Distance l from the board's centre to a control point [m].
    g : float
        Gravity [m/s2].

    Returns
    -------
    left, right : ndarray of float64, shape (n,)
        Forces on the board, + = up [N].
    """
    half = (board_mass + ball_mass) * g / 2.0
    turn = ball_mass * g * np.asarray(p, dtype=float) / (2.0 * arm)
    return half - turn, half + turn


def interaction(left: ArrayLike, right: ArrayLike, *, axis: Axis = "tilt", rule: Rule = "opposing") -> Interaction:
    """Take the forces of both hands apart into what moves the board along an axis and what cancels.

    Parameters
    ----------
    left, right : array_like, shape (n,)
        Forces on the board, + = up, less what each hand must bear (`supports`) [N].
    axis : {"tilt", "heave"}
        The axis of the task: the tilt, + = right end up, in which the left force counts negative; or the height.
    rule : {"opposing", "half_difference"}
        What counts as interaction: the smaller of two forces where they oppose each other and nothing where they do not
        (Groten et al., IEEE RO-MAN 2009, 723); or half of the difference at all times, so that both add equally to the
        net force (the difference force of Reed and Peshkin, IEEE Trans. Haptics 1:108, 2008).

    Returns
    -------
    Interaction
        All forces along the axis [N].

    Raises
    ------
    ValueError
        If the forces have no equal shape.
    """
    a, b = paired(left, right)
    if axis == "tilt":
        a = -a
    if rule == "half_difference":
        between = (a - b) / 2.0
    else:
        # Asked this way round, what is missing stays so.
        between = np.where(a * b >= 0.0, 0.0, np.sign(a) * np.minimum(np.abs(a), np.abs(b)))
    return Interaction(a + b, between, a - between, b + between)


def point_velocities(
    vz: ArrayLike, theta: ArrayLike, omega: ArrayLike, *, arm: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the vertical velocities of both control points: ``z' -+ l theta' cos(theta)``.

    Parameters
    ----------
    vz : array_like, shape (n,)
        Rate of the height of the board's centre [m/s].
    theta : array_like, shape (n,)
        Tilt, + = right end up [rad].
    omega : array_like, shape (n,)
        Its rate [rad/s].
    arm : float
        Distance l from the board's centre to a control point [m].

    Returns
    -------
    left, right : ndarray of float64, shape (n,)
        Velocities, + = up [m/s].
    """
    turn = arm * np.asarray(omega, dtype=float) * np.cos(np.asarray(theta, dtype=float))
    middle = np.asarray(vz, dtype=float)
    return middle - turn, middle + turn


def work(force: ArrayLike, velocity: ArrayLike, rate: float) -> Work:
    """Integrate a partner's power, by trapezoids.

    With the stylus' velocity it is what the hand gives, of which the coupling's damper takes a part; with the control
    point's (`point_velocities`) it is what the board gets.

    Parameters
    ----------
    force : array_like, shape (n,)
        Force of the hand on the board, + = up [N].
    velocity : array_like, shape (n,)
        Velocity of the stylus or of the control point, + = up [m/s].
    rate : float
        Samples per second [Hz].

    Returns
    -------
    Work
        Net, given and received; the latter are integrals of the power's parts of either sign [J].

    Raises
    ------
    ValueError
        If force and velocity have no equal shape.
    """
    f, v = paired(force, velocity)
    given, received = _integral(np.maximum(f * v, 0.0), rate), _integral(np.maximum(-f * v, 0.0), rate)
    return Work(given - received, given, received)


def exchanged(left_power: ArrayLike, right_power: ArrayLike, rate: float) -> tuple[float, float]:
    """Integrate the power that passes through the board from one partner to the other.

    At any time that is the smaller of what one gives and what the other receives; the rest moves the board and the
    ball, or comes from them.

    Parameters
    ----------
    left_power, right_power : array_like, shape (n,)
        Force times velocity of each, + = into the board [W].
    rate : float
        Samples per second [Hz].

    Returns
    -------
    to_right, to_left : float
        Energy that passes, never negative [J].

    Raises
    ------
    ValueError
        If the powers have no equal shape.
    """
    a, b = paired(left_power, right_power)
    to_right = np.minimum(np.maximum(a, 0.0), np.maximum(-b, 0.0))
    to_left = np.minimum(np.maximum(b, 0.0), np.maximum(-a, 0.0))
    return _integral(to_right, rate), _integral(to_left, rate)


def effort(force: ArrayLike, rate: float, *, kind: Effort = "squared") -> float:
    """Measure how much a hand pushes, whether or not it moves.

    Parameters
    ----------
    force : array_like, shape (n,)
        Force of the hand; with or without what it must bear (`supports`) [N].
    rate : float
        Samples per second [Hz].
    kind : {"squared", "absolute", "rms"}
        Integral of the squared force, as in optimal control; integral of its magnitude; or its root mean square, which
        does not grow with the time.

    Returns
    -------
    float
        The effort; NaN if a sample is missing [N2 s, N s or N].
    """
    f = np.asarray(force, dtype=float)
    if kind == "rms":
        return float(np.sqrt(np.mean(f**2)))
    return _integral(np.abs(f) if kind == "absolute" else f**2, rate)


def force_share(left: ArrayLike, right: ArrayLike, *, kind: Weighing = "absolute") -> float:
    """Return the right partner's share in the forces of both: 0 = all is the left's, 0.5 = even, 1 = all is its own.

    Parameters
    ----------
    left, right : array_like, shape (n,)
        Forces on the board, less what each hand must bear (`supports`), of which the one nearer to the ball has more
        [N].
    kind : {"absolute", "squared"}
        What is summed: magnitudes or squares.

    Returns
    -------
    float
        The share; NaN where there is no force [1].

    Raises
    ------
    ValueError
        If the forces have no equal shape.
    """
    a, b = (np.abs(side) ** (2 if kind == "squared" else 1) for side in paired(left, right))
    total = a.sum() + b.sum()
    return float(b.sum() / total) if total > 0.0 else np.nan


def _integral(values: NDArray[np.float64], rate: float) -> float:
    """Integrate samples over time."""
    return float(trapezoid(values, dx=1.0 / rate))
