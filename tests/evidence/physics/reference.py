"""Reference solution of the test problem, its equations in any arithmetic, and the errors of other solutions.

`derivatives` states the equations a second time, for any arithmetic: 80-bit numbers, or the expressions of other
libraries. It shares nothing with the kernels, and so checks them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from netboard.base.compiled import kernel
from netboard.base.tables.scene import Physics
from netboard.benchmarks.physics.problem import Array, Problem, both_drives, drives_at
from netboard.physics.methods.march import forces_along
from netboard.physics.scene.models import rates
from netboard.physics.scene.parameters import Parts

SIGNALS = ("z", "theta", "p", "force")
"""Signals with errors: height [m], tilt [rad], ball [m], force of the hand with the larger error [N]."""

ERRORS = tuple(f"{name} [{unit}]" for name, unit in zip(SIGNALS, ("m", "rad", "m", "N"), strict=True))
"""Heads of the columns of their errors."""


def push_and_turn(waves: Any, t: Any, sine: Callable[[Any], Any]) -> tuple[Any, Any]:
    """Return the sum of both drives, and right minus left, in any arithmetic."""
    terms = [amplitude * sine(rate * t + phase) for amplitude, rate, phase in waves]
    return terms[0] + terms[1] + terms[2], terms[3] + terms[4] + terms[5]


def derivatives(
    physics: Physics, x: Any, push: Any, turn: Any, sine: Callable[[Any], Any], cosine: Callable[[Any], Any]
) -> list[Any]:
    """Return the rate of change of a state, in any arithmetic: the paper's equations (1-5), or Lagrange's.

    - `physics`: the scene: both hands coupled, a free board, one ball that slides.
    """
    z, vz, theta, omega, p, vp = x
    mass, m, g, arm, inertia = physics.M, physics.m, physics.g, physics.l, physics.I
    s, c = sine(theta), cosine(theta)
    upward = push - (2.0 * physics.k_h + physics.k_s) * z - 2.0 * physics.c_h * vz - mass * g - m * g * (c * c)
    torque = arm * c * (turn - 2.0 * physics.k_h * arm * s - 2.0 * physics.c_h * arm * omega * c) - m * g * p * c
    if physics.model == "paper":
        return [vz, upward / mass, omega, torque / inertia, vp, -g * s]
    upward = upward - 2.0 * m * c * vp * omega
    torque = torque - 2.0 * m * p * vp * omega
    a11, a12, a22 = mass + m * (c * c), m * p * c, inertia + m * (p * p)
    whole = a11 * a22 - a12 * a12
    az, ao = (a22 * upward - a12 * torque) / whole, (a11 * torque - a12 * upward) / whole
    return [vz, az, omega, ao, vp, p * (omega * omega) - g * s - s * az]


@cache
def make_right_side(PARTS: Parts) -> Callable[..., None]:
    """Compile the right-hand side for solvers that call it: the kernels' own equations, the hands evaluated in it."""

    @kernel
    def right_side(t: float, x: Any, waves: Any, scene: Any, out: Any) -> None:
        left, right = both_drives(waves, t)
        rate = rates((x[0], x[1], x[2], x[3], x[4], x[5]), left, right, PARTS, scene[0])
        for i in range(6):
            out[i] = rate[i]

    return right_side


@dataclass(frozen=True)
class Reference:
    """The reference solution.

    - `states` (shape (n, 6)): at `Problem.times` [SI].
    - `forces` (shape (n, 2)): of the left and the right hand on the board [N].
    - `scales` (shape (4,)): largest magnitude of each of `SIGNALS` [SI].
    """

    source: str
    states: Array
    forces: Array
    scales: Array


def make_reference(problem: Problem, source: str, states: NDArray[Any]) -> Reference:
    """Return the reference from a solution; forces are computed with the precision of the solution."""
    physics, kind = problem.physics, states.dtype.type
    waves = [[kind(value) for value in wave] for wave in problem.waves.tolist()]
    push, turn = push_and_turn(waves, problem.times.astype(kind), np.sin)
    arm, rate = physics.l * np.sin(states[:, 2]), physics.l * states[:, 3] * np.cos(states[:, 2])
    left = (push - turn) / 2 - physics.k_h * (states[:, 0] - arm) - physics.c_h * (states[:, 1] - rate)
    right = (push + turn) / 2 - physics.k_h * (states[:, 0] + arm) - physics.c_h * (states[:, 1] + rate)
    forces = np.stack([left, right], axis=1).astype(np.float64)
    plain = states.astype(np.float64)
    return Reference(source, plain, forces, largest(plain, forces))


def largest(states: Array, forces: Array) -> Array:
    """Return the largest magnitude of each of `SIGNALS`; infinite if anything is not finite."""
    values = np.array([*(np.abs(states[:, i]).max() for i in (0, 2, 4)), np.abs(forces).max()])
    return np.where(np.isfinite(values), values, np.inf)


def errors_of(problem: Problem, reference: Reference, states: Array, stride: int) -> Array:
    """Return the largest error of each of `SIGNALS`.

    - `states` (shape (n, 6)): solution of a method at every `stride`-th of `Problem.times` [SI].
    """
    drives = drives_at(problem.waves, problem.times[::stride])
    forces = forces_along(np.ascontiguousarray(states), drives, problem.parts, problem.scene)
    with np.errstate(invalid="ignore", over="ignore"):
        return largest(states - reference.states[::stride], forces - reference.forces[::stride])


def new_rate(problem: Problem) -> Callable[[float, Array], Array]:
    """Return the compiled right-hand side as scipy calls it, with a new array for each result."""
    right_side = make_right_side(problem.parts)
    waves, scene = problem.waves, problem.scene

    def rate(t: float, x: Array) -> Array:
        out = np.empty(6)
        right_side(t, x, waves, scene, out)
        return out

    return rate


def tight(problem: Problem) -> Array:
    """Solve a problem by DOP853 with tight tolerances."""
    rate, times = new_rate(problem), problem.times
    solution = solve_ivp(rate, (0.0, times[-1]), problem.first, method="DOP853", t_eval=times, rtol=1e-13, atol=1e-15)
    return np.ascontiguousarray(solution.y.T)
