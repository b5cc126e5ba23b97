"""What a step of each method does to a linear board, in theory: the exact matrix of the step, and what follows from it.

A board of matrix A, ``x' = A x``, is multiplied at every step by a matrix S of the method: a polynomial of hA for the
explicit Runge-Kutta methods, a rational function for the midpoint rule, products of kicks and drifts for Verlet and the
semi-implicit method of Euler, the matrix exponential for the exponential methods. It stays within bounds if no
eigenvalue of S is larger than 1. All this is written from the methods' definitions and shares nothing with the kernels
but the scene; tests hold the two against each other.

The matrices are of the board alone, (z, vz, theta, omega), between its couplings and without weights: the ball is a
saddle because the task is like that, not because of a method. Numpy and scipy, not for a tick.
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
"""A factor that exceeds 1 by no more counts as 1: what is not damped keeps its size."""

_TAYLOR = tuple(1.0 / math.factorial(k) for k in range(9))

POLYNOMIALS = {
    "euler": _TAYLOR[:2],
    "heun": _TAYLOR[:3],
    "rk4": _TAYLOR[:5],
    "dop853": (*_TAYLOR, 2.691692200169e-06, 2.341345108210e-07, 1.494736485459e-08, 3.613324578e-10),
}
"""Stability polynomials, from the constant term up: Taylor's to the order, and then what the stages make of it [1]."""


def tilted_matrix(parts: Parts, scene: Any, balls: int = 0, tilt: float = 0.0, p: float = 0.0) -> Matrix:
    """Return the matrix of the board about a tilt at rest, with all balls in one place.

    By the paper's equations balls have no inertia on the board; by Lagrange's they make it heavier. Balls that roll are
    taken with the momentum along the board eliminated.

    Parameters
    ----------
    parts : Parts
        Structure of the scene.
    scene : SCENE record
        The scene.
    balls : int
        How many balls there are [1].
    tilt : float
        The tilt [rad].
    p : float
        Where the balls are [m].

    Returns
    -------
    ndarray of float64, shape (4, 4)
        A, of (z, vz, theta, omega) [SI].
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
    there = [i for i, moves in enumerate((parts.heaves, parts.tilts)) if moves]
    a = np.zeros((4, 4))
    places, rates = np.array([2 * i for i in there]), np.array([2 * i + 1 for i in there])
    a[places, rates] = 1.0
    own = np.ix_(there, there)
    a[np.ix_(rates, places)] = -np.linalg.solve(inertia[own], stiffness[own])
    a[np.ix_(rates, rates)] = -np.linalg.solve(inertia[own], damping[own])
    return a


def _ball_inertia(parts: Parts, value: dict[str, float], s: float, c: float, p: float) -> Matrix:
    """Return what a ball adds to the inertia against heave and tilt, by Lagrange."""
    m, r, ease = value["m"], value["ball_height"], value["ease"]
    if parts.free:
        return m * np.array([[1.0 - ease * s * s, c * p], [c * p, p * p]])
    return m * value["fixed_load"] * np.array([[1.0, c * p - r * s], [c * p - r * s, p * p + r * r / ease]])


def solved_matrix(parts: Parts, scene: Any, balls: int, h: float) -> Matrix:
    """Return what the exponential methods solve exactly of the board.

    Parameters
    ----------
    parts : Parts
        Structure of the scene.
    scene : SCENE record
        The scene.
    balls : int
        How many balls there are [1].
    h : float
        Step size [s].

    Returns
    -------
    ndarray of float64, shape (4, 4)
        A, of (z, vz, theta, omega) [SI].
    """
    return solved(parts, scene, 4 + 2 * balls, h)[:4, :4]


def step_matrix(method: str, a: Matrix, h: float, solved: Matrix | None = None) -> Matrix:
    """Return what one step multiplies the state of a linear board by.

    Parameters
    ----------
    method : str
        Name of the method.
    a : ndarray of float64, shape (4, 4)
        Matrix of the board [SI].
    h : float
        Step size [s].
    solved : ndarray of float64, shape (4, 4), optional
        Matrix that an exponential method solves exactly, if that is another one: the level board's [SI].

    Returns
    -------
    ndarray of float64, shape (4, 4)
        S [SI].
    """
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
    """Return (1 - hA/2)^-1 (1 + hA/2), Cayley's transform."""
    one = np.eye(len(a))
    return np.array(np.linalg.solve(one - h / 2 * a, one + h / 2 * a), np.float64)


def _kick(a: Matrix, h: float) -> Matrix:
    """Return the velocities' own explicit step, with the places at rest."""
    result = np.eye(len(a))
    result[1::2] += h * a[1::2]
    return result


def _middle_kick(a: Matrix, h: float) -> Matrix:
    """Return the velocities' step by the midpoint rule, with the places at rest."""
    result = np.eye(len(a))
    half = h / 2 * a[1::2, 1::2]
    one = np.eye(len(half))
    result[1::2, 1::2] = np.linalg.solve(one - half, one + half)
    result[1::2, 0::2] = np.linalg.solve(one - half, h * a[1::2, 0::2])
    return result


def _drift(a: Matrix, h: float) -> Matrix:
    """Return the places' own step, with the velocities as they are."""
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
    """Return them from one exponential of a larger matrix (Al-Mohy and Higham, 2011, theorem 2.1)."""
    larger = np.zeros((4 * n, 4 * n))
    larger[:n, :n] = np.frombuffer(numbers).reshape(n, n)
    larger[: 3 * n, n:] += np.eye(3 * n)
    exponential = expm(larger)
    return [exponential[:n, k * n : (k + 1) * n] for k in range(4)]


def _exact(a: Matrix, rest: Matrix, h: float) -> Matrix:
    """Return e^hA: there is no rest where this method is used."""
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
    """Return the largest factor by which one step multiplies a mode of the board; above 1 the board flies apart.

    Parameters
    ----------
    method : str
        Name of the method.
    a : ndarray of float64, shape (4, 4)
        Matrix of the board [SI].
    h : float
        Step size [s].
    solved : ndarray of float64, shape (4, 4), optional
        Matrix that an exponential method solves exactly, if that is another one [SI].

    Returns
    -------
    float
        Spectral radius of the step, infinite if it overflows [1].
    """
    # Places in units in which they are about as large as velocities: only so is nothing lost to rounding.
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
    """Return a basis of the states without the places that nothing pulls back from, which every step leaves alone.

    Their factor is exactly 1. Beside it, the same factor of their velocity would lose half its digits to rounding.
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
    """Return how much happens in a step: its length in units of the fastest time constant.

    Parameters
    ----------
    a : ndarray of float64, shape (4, 4)
        Matrix of the board [SI].
    h : float
        Step size [s].

    Returns
    -------
    float
        h times the largest modulus of a pole [1].
    """
    return h * _modulus(a)


def is_stable(method: str, a: Matrix, h: float, solved: Matrix | None = None) -> bool:
    """Tell whether steps of a length keep a linear board within bounds.

    Parameters
    ----------
    method : str
        Name of the method.
    a : ndarray of float64, shape (4, 4)
        Matrix of the board [SI].
    h : float
        Step size [s].
    solved : ndarray of float64, shape (4, 4), optional
        Matrix that an exponential method solves exactly, if that is another one [SI].
    """
    return spectral_radius(method, a, h, solved) <= 1 + ROUNDING


def largest_step(method: str, a: Matrix, solved: Matrix | None = None) -> float:
    """Return the length up to which all steps are stable.

    Stability is lost and found again as steps grow, by some methods: lengths are tried from short to long, 40 to a
    factor of ten, and the first that fails is closed in on.

    Parameters
    ----------
    method : str
        Name of the method.
    a : ndarray of float64, shape (4, 4)
        Matrix of the board [SI].
    solved : ndarray of float64, shape (4, 4), optional
        Matrix that an exponential method solves exactly, if that is another one [SI].

    Returns
    -------
    float
        Length of the step: 0 if none is stable, infinite if all are, up to a million times the fastest time
        constant [s].
    """
    good = 0.0
    for h in np.geomspace(1e-5, 1e6, 441) / max(_modulus(a), 1e-3):
        if not is_stable(method, a, float(h), solved):
            return _edge(method, a, solved, good, float(h)) if good else 0.0
        good = float(h)
    return math.inf


def _edge(method: str, a: Matrix, solved: Matrix | None, good: float, bad: float) -> float:
    """Return the longest stable step between a stable and an unstable one."""
    while bad - good > 1e-9 * bad:
        middle = (good + bad) / 2
        good, bad = (middle, bad) if is_stable(method, a, middle, solved) else (good, middle)
    return good
