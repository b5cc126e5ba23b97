"""Script run by a test: print digests of many steps of the named scenes, and the disk cache's hits and misses.

Without compilation, or compiled for another processor, it must print the same digests.
"""

import hashlib
import json
import sys
from typing import Any

import numpy as np
from trajectories import Scene, scene_of

from netboard.physics.arithmetic.trig import sincos
from netboard.physics.hands.extrapolation import between, drives, later, moving, reached, resting
from netboard.physics.methods.catalogue import NUMBER
from netboard.physics.methods.march import make_grid, make_march, run
from netboard.physics.scene.energy import stored_along, work_along
from netboard.physics.scene.models import coupling, rates, stopped

ABOVE: dict[str, Any] = {"model": "lagrangian", "ball_height": 0.03, "ball_inertia": 0.4}
SCENES = {
    "paper": scene_of(ball_stop=0.3, restitution=0.5),
    "fixed": scene_of(False, coupling="right", b_theta=0.001),
    "bare": scene_of(balls=0),
    "lagrangian": scene_of(balls=2, ball_stop=0.3, restitution=0.5, **ABOVE),
    "friction": scene_of(b_p=0.02, rolling_resistance=0.01),
    "friction, lagrangian": scene_of(balls=2, b_p=0.02, rolling_resistance=0.01, **ABOVE),
    "lagrangian, fixed": scene_of(False, board="hinged", b_z=0.1, **ABOVE),
}


def drives_of(row: list[float]) -> tuple[float, ...]:
    """The drives of both hands through a step, from every kind of extrapolation."""
    z, vz, az, age = 0.1 * row[0], row[1], 20 * row[2], 0.01 * row[3]
    z, vz = reached(z, vz, az, age, 0.004, 0.008)
    left = moving(z, vz, az, 200.0, 2.0) if row[4] > 0 else resting(z, vz, 200.0, 2.0)
    return later((*left, *between(0.1 * row[5], row[6], 0.1 * row[7], row[8], 1e-2, 200.0, 2.0)), 1e-3 * row[9])


def result_of(scene: Scene, row: list[float]) -> list[float]:
    """Results of every kernel that takes a state."""
    spread = (0.1, 1.0, 7.0, 20.0, *(0.35, 1.0) * scene.physics.balls)
    x = tuple(a * b for a, b in zip(row, spread, strict=False))
    left, right = drives(drives_of(row), 0, 1e-3 * row[0])
    rate = rates(x, left, right, scene.parts, scene.record)
    return [*rate, *coupling(x, left, right, scene.parts, scene.record), *stopped(x, scene.parts, scene.record)]


def path_of(scene: Scene, rows: list[list[float]]) -> Any:
    """A continuous run of the scene, as in a trial, in which a difference in the last digit grows."""
    n = len(rows)
    grid = make_grid("rk4", np.full(n, 1e-3), np.full(n, 2), scene.parts, scene.length, scene.packed)
    start = (0.0, 0.0, 0.0, 0.0, 0.05, 0.1, -0.05, 0.2)[: scene.length]
    return run("rk4", start, np.array([drives_of(row) for row in rows]), grid, scene.parts, scene.packed)


def digests(names: list[str], rounds: int = 1000) -> dict[str, str]:
    """Hash of all results of this number of rounds, for each of these scenes."""
    rows = np.random.default_rng(7).uniform(-1, 1, (rounds, 10)).tolist()
    found = {"sincos": hashlib.sha256(np.array([sincos(1e4 * row[2]) for row in rows]).tobytes()).hexdigest()}
    for name in names:
        scene = SCENES[name]
        path = path_of(scene, rows)
        hands = np.array(rows + rows[:1])[:, :4]
        work = work_along(np.arange(rounds + 1) * 1e-3, path, hands, scene.parts, scene.packed)
        numbers = (
            np.array([result_of(scene, row) for row in rows]),
            path,
            stored_along(path, hands, scene.parts, scene.packed),
            work,
        )
        found[name] = hashlib.sha256(b"".join(each.tobytes() for each in numbers)).hexdigest()
    return found


def cache_counts(names: list[str]) -> list[tuple[int, int]]:
    """Hits and misses of the disk cache, for the march of each scene; empty without compilation."""
    marches: list[Any] = [make_march(NUMBER["rk4"], scene.parts) for scene in map(SCENES.__getitem__, names)]
    stats = [march.stats for march in marches if hasattr(march, "stats")]
    return [(sum(each.cache_hits.values()), sum(each.cache_misses.values())) for each in stats]


if __name__ == "__main__":
    print(json.dumps({"digests": digests(sys.argv[1:]), "cache": cache_counts(sys.argv[1:])}))  # noqa: T201
