"""The test problem of the work-precision study: two hands that move smoothly, a board, a ball that stays on it, 10 s.

The hands lift together (u) and against each other (d), each a sum of three sines: within 5.2 cm and 0.43 m/s, tilting
the board by -10.0 to +9.6 degrees. Their drives are sums of three sines too, which is the cheapest form, and every
solver gets this form. The ball leaves the board from most initial states; these were found by shooting (least
squares of its position over the run), and it stays within 7.2 cm.

`derivatives` states the equations a second time, for any arithmetic: 80-bit numbers, or the expressions of other
libraries. It shares nothing with the kernels, and so checks them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from math import atan2, hypot, pi, sin
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from netboard.base.compiled import inlined, kernel
from netboard.base.tables.scene import Physics
from netboard.physics.arithmetic.vectors import State
from netboard.physics.hands.extrapolation import between
from netboard.physics.methods.march import forces_along, make_grid, run
from netboard.physics.scene.models import rates
from netboard.physics.scene.parameters import Parts, pack_scene, parts_of

Model = Literal["paper", "lagrangian"]
Start = Literal["settled", "cold"]
Array = NDArray[np.float64]

MODELS: tuple[Model, ...] = ("paper", "lagrangian")
STARTS: tuple[Start, ...] = ("settled", "cold")
STATE_NAMES = ("z", "vz", "theta", "omega", "p", "vp")
"""Components of a state with one ball."""

SIGNALS = ("z", "theta", "p", "force")
"""Signals with errors: height [m], tilt [rad], ball [m], force of the hand with the larger error [N]."""

ERRORS = tuple(f"{name} [{unit}]" for name, unit in zip(SIGNALS, ("m", "rad", "m", "N"), strict=True))
"""Heads of the columns of their errors."""

DURATION = 10.0
"""Length of the run [s]."""

SPACING = 0.002
"""Spacing of the points at which errors are measured [s]."""

TOGETHER = ((0.016, 0.5, 0.0), (0.006, 1.3, 0.5), (0.002, 2.9, 2.0))
"""Sines of u = (z_left + z_right) / 2: amplitude, frequency, phase [m, Hz, rad]."""

AGAINST = ((0.030, 0.7, 0.5), (0.010, 1.7, 1.0), (0.004, 3.0, 1.0))
"""Sines of d = (z_right - z_left) / 2: the same [m, Hz, rad]."""

RUN_UP = 1.0
"""A settled run is preceded by this duration, from a level board at rest [s]."""

BALL: dict[tuple[Model, Start], tuple[float, float]] = {
    ("paper", "settled"): (0.02347, -0.22559),
    ("paper", "cold"): (0.01997, 0.25213),
    ("lagrangian", "settled"): (0.01505, -0.20976),
    ("lagrangian", "cold"): (0.01254, 0.23978),
}
"""Initial position and velocity of the ball, found by shooting [m, m/s]."""


@dataclass(frozen=True)
class Problem:
    """One form of the test problem.

    - `start`: ``settled``: the board has followed the hands for a while; ``cold``: it is at rest while they move
      already.
    - `duration`: length of the run [s].
    """

    model: Model
    start: Start
    duration: float = DURATION

    @property
    def name(self) -> str:
        """Model and start."""
        return f"{self.model}, {self.start}"

    @cached_property
    def physics(self) -> Physics:
        """The scene, as a configuration gives it."""
        return Physics(model=self.model)

    @cached_property
    def scene(self) -> NDArray[Any]:
        """Its numbers, for kernels."""
        return pack_scene(self.physics)

    @cached_property
    def parts(self) -> Parts:
        """Parts of its scene, for kernels."""
        return parts_of(self.physics)

    @cached_property
    def waves(self) -> Array:
        """The six waves of the drives."""
        return drive_waves(self.physics)

    @cached_property
    def times(self) -> Array:
        """Times at which errors are measured [s]."""
        return multiples(round(self.duration / SPACING) + 1, SPACING)

    @cached_property
    def first(self) -> State:
        """The first state [SI]."""
        ball = BALL[self.model, self.start]
        if self.start == "cold":
            return (0.0, 0.0, 0.0, 0.0, *ball)
        steps, h = 4000, RUN_UP / 4000
        grid = make_grid("rk4", np.full(steps, h), np.ones(steps, np.int64), self.parts, 6, self.scene)
        nodes = node_times(multiples(steps, h) - RUN_UP, h, (0.0, 0.5, 1.0))
        hands = drives_at(self.waves, nodes)
        return tuple(run("rk4", (0.0, 0.0, 0.0, 0.0, *ball), hands, grid, self.parts, self.scene)[-1].tolist())


def multiples(count: int, h: float) -> Array:
    """Return the first multiples of a time, from 0."""
    return np.arange(count, dtype=np.float64) * h


def styluses_at(times: Any, spread: float = 1.0) -> tuple[Array, Array]:
    """Return heights and velocities of the left and the right stylus, shape (..., 2) [m, m/s].

    - `spread`: factor of their movement against each other [1].
    """
    z, vz = np.zeros((*times.shape, 2)), np.zeros((*times.shape, 2))
    for waves, signs in ((TOGETHER, (1.0, 1.0)), (AGAINST, (-spread, spread))):
        for amplitude, frequency, phase in waves:
            rate = 2.0 * pi * frequency
            z += np.multiply.outer(amplitude * np.sin(rate * times + phase), signs)
            vz += np.multiply.outer(amplitude * rate * np.cos(rate * times + phase), signs)
    return z, vz


def hermite_drives(physics: Physics, times: Array, z: Array, vz: Array) -> Array:
    """Return the drives of hands that follow cubics between times (`netboard.physics.hands.extrapolation.between`).

    - `z`, `vz` (shape (n + 1, 2)): heights and velocities of the left and the right stylus [m, m/s].
    """
    of_arrays: Any = getattr(between, "py_func", between)  # as it stands, not compiled for numbers
    drives = of_arrays(z[:-1], vz[:-1], z[1:], vz[1:], np.diff(times)[:, None], physics.k_h, physics.c_h)
    return np.stack(drives, axis=-1).reshape(-1, 8)


def drive_waves(physics: Physics) -> Array:
    """Return the drives of the hands as sines: ``k a sin + c a w cos`` is one sine with another amplitude and phase.

    - returns (shape (6, 3)): amplitude, rate, phase: three waves of the drives' sum, three of right minus left [N,
      rad/s, rad].
    """
    waves = np.empty((6, 3))
    for i, (amplitude, frequency, phase) in enumerate((*TOGETHER, *AGAINST)):
        rate = 2.0 * pi * frequency
        damping = physics.c_h * rate
        waves[i] = 2.0 * amplitude * hypot(physics.k_h, damping), rate, phase + atan2(damping, physics.k_h)
    return waves


@kernel
def _fill_drives(waves: Any, times: Any, out: Any) -> None:
    for i in range(len(times)):
        out[i, 0], out[i, 1] = both_drives(waves, times[i])


@inlined
def both_drives(waves: Any, t: float) -> tuple[float, float]:
    """Return the drives of both hands at a time."""
    push, turn = 0.0, 0.0
    for i in range(3):
        push += waves[i, 0] * sin(waves[i, 1] * t + waves[i, 2])
        turn += waves[i + 3, 0] * sin(waves[i + 3, 1] * t + waves[i + 3, 2])
    return 0.5 * (push - turn), 0.5 * (push + turn)


def drives_at(waves: Array, times: Array) -> Array:
    """Return the drives of both hands at many times."""
    out = np.empty((times.size, 2))
    _fill_drives(waves, times.ravel(), out)
    return out.reshape(*times.shape, 2)


def node_times(starts: Array, h: float, nodes: tuple[float, ...]) -> Array:
    """Return the times of a method's nodes in each of its steps."""
    return np.add.outer(starts, h * np.asarray(nodes))


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
