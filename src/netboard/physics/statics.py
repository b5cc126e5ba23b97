"""What is known of the scene in closed form: where it rests, how fast it moves, how much energy it holds.

For tests, documentation and studies, which hold the kernels against it; nothing here runs in a tick. Everything follows
from the equations in docs/physics.md, without approximation unless a docstring says "linear". A scene is one record of
`netboard.physics.scene.SCENE`; `load` is the share of the ball's weight that the board carries: 1 with the ball on it,
0 without a ball.
"""

import cmath
import math
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Equilibrium:
    """The board at rest between two styluses at rest.

    Attributes
    ----------
    z : float
        Height of the board's centre [m].
    theta : float
        Tilt, + = right end up [rad].
    left, right : float
        Forces of the hands on the board, + = up [N].
    """

    z: float
    theta: float
    left: float
    right: float


def equilibrium(left_z: float, right_z: float, p: float, scene: Any, load: float = 1.0) -> Equilibrium:
    """Return where the board rests with both styluses and the ball at rest.

    Zero torque asks ``right - left = W p / l`` at any tilt, and by the springs that difference is
    ``k_h (right_z - left_z - 2 l sin theta)``; with the tilt known, zero force gives the height.

    Parameters
    ----------
    left_z, right_z : float
        Heights of the styluses [m].
    p : float
        Ball along the board [m].
    scene : SCENE record
        The scene.
    load : float
        Share of the ball's weight that the board carries [1].

    Returns
    -------
    Equilibrium
        Height, tilt and forces.

    Raises
    ------
    ValueError
        If no tilt balances the torques, as without a coupling to the hands.
    """
    M, g, k_h, k_s, l = (float(scene[name]) for name in ("M", "g", "k_h", "k_s", "l"))  # noqa: E741
    weight = load * float(scene["m"]) * g
    if k_h <= 0:
        raise ValueError("without a stiffness between hands and board the board rests nowhere")
    sine = (right_z - left_z - weight * p / (k_h * l)) / (2 * l)
    if not abs(sine) < 1:
        raise ValueError(f"no tilt balances the torques: sin(theta) would be {sine:.3g}")
    z = (k_h * (left_z + right_z) - M * g - weight * (1 - sine * sine)) / (2 * k_h + k_s)
    return Equilibrium(z, math.asin(sine), k_h * (left_z - z + l * sine), k_h * (right_z - z - l * sine))


def _poles(inertia: float, damping: float, stiffness: float) -> tuple[complex, complex]:
    """Return both roots of ``inertia x^2 + damping x + stiffness``, the one of larger modulus first."""
    middle = -damping / (2 * inertia)
    root = cmath.sqrt(complex(middle * middle - stiffness / inertia))
    fast = middle - root
    # The product of the roots is exact where their sum cancels.
    slow = stiffness / inertia / fast if fast else 0j
    return fast, slow


def heave_poles(scene: Any) -> tuple[complex, complex]:
    """Poles of the board moving up and down: ``M z'' + 2 c_h z' + (2 k_h + k_s) z = 0``, linear.

    Parameters
    ----------
    scene : SCENE record
        The physics.

    Returns
    -------
    tuple of complex
        The two poles [1/s].
    """
    return _poles(float(scene["M"]), 2 * float(scene["c_h"]), 2 * float(scene["k_h"]) + float(scene["k_s"]))


def rotation_poles(scene: Any) -> tuple[complex, complex]:
    """Poles of the board turning, at no tilt: ``I t'' + 2 c_h l^2 t' + 2 k_h l^2 t = 0``, linear.

    Parameters
    ----------
    scene : SCENE record
        The physics.

    Returns
    -------
    tuple of complex
        The two poles [1/s].
    """
    double_square = 2 * float(scene["l"]) ** 2
    return _poles(float(scene["I"]), float(scene["c_h"]) * double_square, float(scene["k_h"]) * double_square)


def ball_poles(scene: Any) -> tuple[complex, complex]:
    """Poles of the ball with both hands still and the board following at once, linear.

    The weight of a ball at p tilts the board by ``-m g p / (2 k_h l^2)``: downhill is away from the centre, and the
    ball a saddle. (With the printed sign of its equation it is a slow oscillator.)

    Parameters
    ----------
    scene : SCENE record
        The physics.

    Returns
    -------
    tuple of complex
        The two poles [1/s].
    """
    tilt_per_metre = -float(scene["m"]) * float(scene["g"]) / (2 * float(scene["k_h"]) * float(scene["l"]) ** 2)
    return _poles(1.0, 0.0, -float(scene["ball_gravity"]) * tilt_per_metre)


def energy(
    z: float,
    vz: float,
    theta: float,
    omega: float,
    p: float,
    vp: float,
    left_z: float,
    right_z: float,
    scene: Any,
    load: float = 1.0,
) -> float:
    """Return kinetic and potential energy of board, ball and springs.

    Parameters
    ----------
    z, vz : float
        Height of the board's centre and its rate [m, m/s].
    theta, omega : float
        Tilt and its rate [rad, rad/s].
    p, vp : float
        Ball along the board and its rate [m, m/s].
    left_z, right_z : float
        Heights of the styluses [m].
    scene : SCENE record
        The scene.
    load : float
        Share of the ball's weight that the board carries [1].

    Returns
    -------
    float
        Energy; zero for the level board at rest at the origin, styluses at its points, ball at its centre [J].
    """
    M, m, g, k_h, k_s = (float(scene[name]) for name in ("M", "m", "g", "k_h", "k_s"))
    arm = float(scene["l"]) * math.sin(theta)
    kinetic = (M * vz * vz + float(scene["I"]) * omega * omega + load * m * vp * vp) / 2
    lifted = M * g * z + load * m * g * (z + p * math.sin(theta))
    stretched = (k_s * z * z + k_h * (left_z - z + arm) ** 2 + k_h * (right_z - z - arm) ** 2) / 2
    return kinetic + lifted + stretched


def power(
    z: float,
    vz: float,
    theta: float,
    omega: float,
    vp: float,
    left_z: float,
    left_vz: float,
    right_z: float,
    right_vz: float,
    scene: Any,
    load: float = 1.0,
) -> float:
    """Return the rate at which the `energy` of the scene grows.

    What the hands put in, less what the dampers take out, and the two terms in which the paper's equations are not
    those of a mechanical system: the board carries only ``cos^2`` of the ball's weight, and the ball may be told to
    roll uphill.

    Parameters
    ----------
    z, vz : float
        Height of the board's centre and its rate [m, m/s].
    theta, omega : float
        Tilt and its rate [rad, rad/s].
    vp : float
        Rate of the ball along the board [m/s].
    left_z, left_vz, right_z, right_vz : float
        Heights of the styluses and their rates [m, m/s].
    scene : SCENE record
        The scene.
    load : float
        Share of the ball's weight that the board carries [1].

    Returns
    -------
    float
        Power [W].
    """
    m, g, k_h, c_h, l = (float(scene[name]) for name in ("m", "g", "k_h", "c_h", "l"))  # noqa: E741
    s, c = math.sin(theta), math.cos(theta)
    left_slip = left_vz - (vz - l * omega * c)
    right_slip = right_vz - (vz + l * omega * c)
    left = k_h * (left_z - (z - l * s)) + c_h * left_slip
    right = k_h * (right_z - (z + l * s)) + c_h * right_slip
    hands = left * left_vz + right * right_vz
    dampers = c_h * (left_slip * left_slip + right_slip * right_slip)
    odd = load * m * (g * s * s * vz + (float(scene["ball_gravity"]) + g) * s * vp)
    return hands - dampers + odd
