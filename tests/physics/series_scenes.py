"""Series of random states of every kind of scene, in plain Python: prints how far they are from the equations.

One line for each scene: its name, the difference of its coefficients of order 1 from the rates (relative), and of the
sum of the series from dop853 in short steps. `tests/physics/test_taylor.py` runs it with NUMBA_DISABLE_JIT=1.
"""

import sys
from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from netboard.base.tables.friction import COLUMNS
from netboard.base.tables.scene import Physics
from netboard.physics.hands.extrapolation import later
from netboard.physics.methods.dop853 import dop853
from netboard.physics.scene.models import rates
from netboard.physics.scene.parameters import numbers_of, pack_scene, parts_of, state_length
from netboard.physics.scene.series import LEFT, RIGHT, STATE, begin_series, extend_series, table_of

_STEP: Any = dop853
ORDER, TIME, STEPS = 20, 1e-4, 2


def scenes() -> Iterator[tuple[str, Physics, bool]]:
    for model, board, balls, free in product(("paper", "lagrangian"), ("free", "hinged", "level"), (0, 1, 2), (1, 0)):
        name = f"{model}, {board}, {balls} {'free' if free else 'fixed'}"
        yield name, Physics(model=model, board=board, balls=balls), bool(free)  # type: ignore[arg-type]
    for model, coupling in product(("paper", "lagrangian"), ("left", "right", "none")):
        damped = Physics(model=model, coupling=coupling, b_theta=0.01, b_z=0.3)  # type: ignore[arg-type]
        yield f"{model}, coupling {coupling}, damped", damped, True
        resisted = Physics(model=model, balls=2, ball_inertia=0.4, rolling_resistance=0.01, b_p=0.05)  # type: ignore[arg-type]
        yield f"{model}, friction", resisted, True
    for free in (True, False):
        above = Physics(model="lagrangian", balls=2, ball_inertia=0.4, ball_height=0.03)
        yield f"rolling above the board, {free}", above, free
    yield "carried", Physics(model="lagrangian", ball_height=0.03, fixed_ball="carried"), False
    yield "printed", Physics(ball_sign="printed"), True


def compare(physics: Physics, free: bool, random: np.random.Generator) -> tuple[float, float]:
    parts, scene, length = parts_of(physics, free), pack_scene(physics)[0], state_length(physics)
    start = random.normal(0.0, 0.2, length)
    start[5::2] = np.where(free, np.sign(start[5::2]) * (0.1 + np.abs(start[5::2])), 0.0)  # beyond the smooth sign
    start[:2] *= parts.heaves
    start[2:4] *= parts.tilts
    x = tuple(start.tolist())
    drives = tuple((random.normal(0.0, 1.0, 8) * np.array([1.0, 3.0, 9.0, 20.0] * 2)).tolist())
    table = table_of(length)
    table[LEFT : LEFT + 4], table[RIGHT : RIGHT + 4] = drives[:4], drives[4:]
    mass = begin_series(x, 1.0, parts, scene, table)
    for n in range(ORDER):
        extend_series(n, x, mass, 1.0, parts, numbers_of(scene), table)
    rate = np.array(rates(x, drives[0], drives[4], parts, scene))
    series = table[STATE : STATE + length * COLUMNS].reshape(length, COLUMNS)
    first = np.abs(rate - series[:, 1]).max() / np.abs(rate).max()
    for step in range(STEPS):
        x = _STEP(x, TIME / STEPS, later(drives, step * TIME / STEPS), None, parts, scene)
    summed = series[:, : ORDER + 1] @ TIME ** np.arange(ORDER + 1)
    return float(first), float(np.abs(np.array(x) - summed).max())


if __name__ == "__main__":
    generator = np.random.default_rng(1)
    for title, chosen, free_balls in scenes():
        sys.stdout.write(" ".join([title, *map(str, compare(chosen, free_balls, generator))]) + "\n")
