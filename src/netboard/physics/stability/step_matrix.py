"""Linear stability of the integration methods: the exact matrix of a step, and its spectral radius.

For a board with state matrix A, ``x' = A x``, each step multiplies the state by a matrix S of the method: a polynomial
of hA for explicit Runge-Kutta methods, a rational function for the midpoint rule, products of kicks and drifts for
Verlet and semi-implicit Euler, the matrix exponential for exponential methods. The motion is bounded if no eigenvalue
of S is larger than 1 in modulus. The matrices follow from the definitions of the methods and share only the scene with
the kernels; tests compare the two.

The state is that of the board alone, (z, vz, theta, omega), because the saddle of the ball is a property of the task
and not of a method. NumPy and SciPy; not for use in a tick.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from netboard.physics.methods.exponential import solved
from netboard.physics.scene.parameters import Parts

Matrix = NDArray[np.float64]

ROUNDING = 1e-12
"""Rounding tolerance of the spectral radius, for undamped modes."""

_TAYLOR = tuple(1.0 / math.factorial(k) for k in range(9))

POLYNOMIALS = {
    "euler": _TAYLOR[:2],
    "heun": _TAYLOR[:3],
    "rk4": _TAYLOR[:5],
    "dop853": (*_TAYLOR, 2.691692200169e-06, 2.341345108210e-07, 1.494736485459e-08, 3.613324578e-10),
}
"""Coefficients of the stability polynomials, from the constant term up [1]."""


def tilted_matrix(parts: Parts, scene: Any, balls: int = 0, tilt: float = 0.0, p: float = 0.0) -> Matrix:
    """Return the matrix A of (z, vz, theta, omega) linearised about a tilt, with all balls in one place, (4, 4) [SI].

    In the paper's model balls add no inertia; in the Lagrangian model they do. The coordinates of free balls are
    eliminated.

    Parameters
    ----------
    tilt : float
        Tilt about which the board is linearised [rad].
    p : float
        Position of the balls [m].
    """
    value = {name: float(scene[name]) for name in scene.dtype.names}
    s, c = math.sin(tilt), math.cos(tilt)
    hands = {side: np.array([1.0, sign * value["l"] * c]) for side, sign in (("left", -1.0), ("right", 1.0))}
    stiffness, damping = np.diag([value["k_s"], 0.0]), np.diag([value["b_z"], value["b_theta"]])
    for side, arm in hands.items():
        stiffness += value[f"k_{side}"] * np.outer(arm, arm)
        damping += value[f"c_{side}"] * np.outer(arm, arm)
    inertia = np.diag([value["M"], value["I"]])
    if parts.lagrangian and parts.loaded:
        inertia += balls * _ball_inertia(parts, value, s, c, p)
    movable = [i for i, moves in enumerate((parts.heaves, parts.tilts)) if moves]
    a = np.zeros((4, 4))
    places, rates = np.array([2 * i for i in movable]), np.array([2 * i + 1 for i in movable])
    a[places, rates] = 1.0
    block = np.ix_(movable, movable)
    a[np.ix_(rates, places)] = -np.linalg.solve(inertia[block], stiffness[block])
    a[np.ix_(rates, rates)] = -np.linalg.solve(inertia[block], damping[block])
    return a


def _ball_inertia(parts: Parts, value: dict[str, float], s: float, c: float, p: float) -> Matrix:
    """Return the inertia that a ball adds to heave and tilt in the Lagrangian model."""
    m, r, mass_ratio = value["m"], value["ball_height"], value["mass_ratio"]
    if parts.free:
        return m * np.array([[1.0 - mass_ratio * s * s, c * p], [c * p, p * p]])
    return m * value["fixed_load"] * np.array([[1.0, c * p - r * s], [c * p - r * s, p * p + r * r / mass_ratio]])


def solved_matrix(parts: Parts, scene: np.void, balls: int, h: float) -> Matrix:
    """Return the matrix A of (z, vz, theta, omega) that the exponential methods solve exactly, shape (4, 4) [SI]."""
    return solved(parts, scene, 4 + 2 * balls, h)[:4, :4]


def step_matrix(method: str, a: Matrix, h: float, solved: Matrix | None = None) -> Matrix:
    """Return the matrix S of one step for a linear board, shape (4, 4) [SI]."""
    if method in POLYNOMIALS:
        return _polynomial(h * a, POLYNOMIALS[method])
    if method in _SPLIT:
        return _SPLIT[method](a, h)
    if method in _EXPONENTIAL:
        linear = a if solved is None else solved
        return _EXPONENTIAL[method](linear, a - linear, h)
    raise ValueError(f"there is no theory of the method {method!r}")


def _polynomial(x: Matrix, coefficients: tuple[float, ...]) -> Matrix:
    """Return a polynomial of a matrix, by Horner's rule."""
    one = np.eye(len(x))
    result: Matrix = coefficients[-1] * one
    for coefficient in reversed(coefficients[:-1]):
        result = coefficient * one + x @ result
    return result


def _midpoint(a: Matrix, h: float) -> Matrix:
    """Return (1 - hA/2)^-1 (1 + hA/2), the Cayley transform."""
    one = np.eye(len(a))
    return np.array(np.linalg.solve(one - h / 2 * a, one + h / 2 * a), np.float64)


def _kick(a: Matrix, h: float) -> Matrix:
    """Return the explicit step of the velocities at fixed positions."""
    result = np.eye(len(a))
    result[1::2] += h * a[1::2]
    return result


def _middle_kick(a: Matrix, h: float) -> Matrix:
    """Return the step of the velocities by the midpoint rule at fixed positions."""
    result = np.eye(len(a))
    half = h / 2 * a[1::2, 1::2]
    one = np.eye(len(half))
    result[1::2, 1::2] = np.linalg.solve(one - half, one + half)
    result[1::2, 0::2] = np.linalg.solve(one - half, h * a[1::2, 0::2])
    return result


def _drift(a: Matrix, h: float) -> Matrix:
    """Return the step of the positions at fixed velocities."""
    result = np.eye(len(a))
    result[0::2] += h * a[0::2]
    return result


_SPLIT: dict[str, Callable[[Matrix, float], Matrix]] = {
    "semi_implicit": lambda a, h: _drift(a, h) @ _kick(a, h),
    "verlet": lambda a, h: _drift(a, h / 2) @ _middle_kick(a, h) @ _drift(a, h / 2),
    "midpoint": _midpoint,
}


def _phis(a: Matrix, h: float) -> list[Matrix]:
    """Return phi_0 ... phi_3 of hA."""
    return _phis_of((h * a).tobytes(), len(a))


@lru_cache(maxsize=16)
def _phis_of(numbers: bytes, n: int) -> list[Matrix]:
    """Return the phi functions from the exponential of an augmented matrix (Al-Mohy and Higham, 2011, theorem 2.1)."""
    larger = np.zeros((4 * n, 4 * n))
    larger[:n, :n] = np.frombuffer(numbers).reshape(n, n)
    larger[: 3 * n, n:] += np.eye(3 * n)
    exponential = expm(larger)
    return [exponential[:n, k * n : (k + 1) * n] for k in range(4)]


def _exact(a: Matrix, rest: Matrix, h: float) -> Matrix:
    """Return e^hA: this method has no remainder."""
    return _phis(a + rest, h)[0]


def _etd2rk(a: Matrix, rest: Matrix, h: float) -> Matrix:
    """Return the step of Cox and Matthews's method of order 2, of ``x' = A x + N x`` (J. Comput. Phys. 176, 2002)."""
    phi0, phi1, phi2, _ = _phis(a, h)
    end = phi0 + h * phi1 @ rest
    return end + h * phi2 @ rest @ (end - np.eye(len(a)))


def _etdrk4(a: Matrix, rest: Matrix, h: float) -> Matrix:
    """Return the step of Krogstad's method of order 4, of ``x' = A x + N x`` (J. Comput. Phys. 203, 2005)."""
    half0, half1, half2, _ = _phis(a, h / 2)
    phi0, phi1, phi2, phi3 = _phis(a, h)
    n1 = rest
    n2 = rest @ (half0 + h / 2 * half1 @ n1)
    n3 = rest @ (half0 + h / 2 * half1 @ n1 + h * half2 @ (n2 - n1))
    n4 = rest @ (phi0 + h * phi1 @ n1 + 2 * h * phi2 @ (n3 - n1))
    return phi0 + h * phi1 @ n1 + h * phi2 @ (-3 * n1 + 2 * n2 + 2 * n3 - n4) + 4 * h * phi3 @ (n1 - n2 - n3 + n4)


_EXPONENTIAL: dict[str, Callable[[Matrix, Matrix, float], Matrix]] = {
    "exact": _exact,
    "etd2rk": _etd2rk,
    "etdrk4": _etdrk4,
}


def spectral_radius(method: str, a: Matrix, h: float, solved: Matrix | None = None) -> float:
    """Return the spectral radius of one step, infinite if it overflows; above 1 the method is unstable [1]."""
    # Positions are scaled to the size of velocities, to limit rounding errors.
    unit = max(_modulus(solved if method in _EXPONENTIAL and solved is not None else a), 1.0)
    scale = np.tile([unit, 1.0], len(a) // 2)
    a = a * scale[:, None] / scale
    if solved is not None:
        solved = solved * scale[:, None] / scale
    with np.errstate(all="ignore"):
        s = step_matrix(method, a, h, solved)
    if not np.all(np.isfinite(s)):
        return math.inf
    rest = _moving(a)
    if rest.shape[1] == len(a):
        return _modulus(s)
    return max(1.0, _modulus(rest.T @ s @ rest))


def _moving(a: Matrix) -> Matrix:
    """Return a basis of the states without positions that have no restoring force.

    Their eigenvalue is exactly 1. With it, the equal eigenvalue of their velocity would lose half its digits.
    """
    _, sizes, rows = np.linalg.svd(a[1::2, 0::2])
    kept = rows[sizes > 1e-13 * max(sizes[0], 1e-300)]
    n = len(a)
    basis = np.zeros((n, n // 2 + len(kept)))
    basis[1::2, : n // 2] = np.eye(n // 2)
    basis[0::2, n // 2 :] = kept.T
    return basis


def _modulus(s: Matrix) -> float:
    """Return the largest modulus of an eigenvalue."""
    return float(np.max(np.abs(np.linalg.eigvals(s))))


def stiffness(a: Matrix, h: float) -> float:
    """Return the stiffness of a step: its size times the largest modulus of a pole [1]."""
    return h * _modulus(a)


def is_stable(method: str, a: Matrix, h: float, solved: Matrix | None = None) -> bool:
    """Return whether a step size is stable for a linear board."""
    return spectral_radius(method, a, h, solved) <= 1 + ROUNDING


def largest_step(method: str, a: Matrix) -> float:
    """Return the step size up to which all steps are stable.

    Some methods have several stable ranges. Therefore sizes are tried from small to large, 40 per decade, and the first
    failure is refined by bisection.

    Returns
    -------
    float
        Step size; 0 if none is stable, infinite if all are, up to a million times the fastest time constant [s].
    """
    good = 0.0
    for h in np.geomspace(1e-5, 1e6, 441) / max(_modulus(a), 1e-3):
        if not is_stable(method, a, float(h)):
            return _edge(method, a, good, float(h)) if good else 0.0
        good = float(h)
    return math.inf


def _edge(method: str, a: Matrix, good: float, bad: float) -> float:
    """Return the largest stable step between a stable and an unstable one, by bisection."""
    while bad - good > 1e-9 * bad:
        middle = (good + bad) / 2
        good, bad = (middle, bad) if is_stable(method, a, middle) else (good, middle)
    return good
