"""The test problem of the work-precision study: two hands that move smoothly, a board, a ball that stays on it, 10 s.

The hands lift together (u) and against each other (d), each a sum of three sines: within 5.2 cm and 0.43 m/s, tilting
the board by -10.0 to +9.6 degrees. Their drives are sums of three sines too, which is the cheapest form, and every
solver gets this form. The ball leaves the board from most initial states; these were found by shooting (least
squares of its position over the run), and it stays within 7.2 cm.
"""

from dataclasses import dataclass
from functools import cached_property
from math import atan2, hypot, pi, sin
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined, kernel
from netboard.base.tables.scene import Physics
from netboard.physics.arithmetic.vectors import State
from netboard.physics.hands.extrapolation import between
from netboard.physics.methods.march import make_grid, run
from netboard.physics.scene.parameters import Parts, pack_scene, parts_of

Model = Literal["paper", "lagrangian"]
Start = Literal["settled", "cold"]
Array = NDArray[np.float64]

MODELS: tuple[Model, ...] = ("paper", "lagrangian")
STARTS: tuple[Start, ...] = ("settled", "cold")
STATE_NAMES = ("z", "vz", "theta", "omega", "p", "vp")
"""Components of a state with one ball."""

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


def styluses_at(times: NDArray[np.floating[Any]], spread: float = 1.0) -> tuple[Array, Array]:
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
def _fill_drives(waves: NDArray[np.float64], times: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    for i in range(len(times)):
        out[i, 0], out[i, 1] = both_drives(waves, times[i])


@inlined
def both_drives(waves: NDArray[np.float64], t: float) -> tuple[float, float]:
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
