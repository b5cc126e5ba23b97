"""Script run by a test: print digests of the results and tables of exponential methods in the named cases.

Without compilation, or compiled for another processor, it must print the same digests.
"""

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[1] / "physics"))

from independent import waving
from trajectories import sampled_trajectory, scene_of, trajectory

from netboard.physics.methods.catalogue import METHODS, NUMBER

HARD: dict[str, Any] = {"model": "lagrangian", "ball_height": 0.02, "b_theta": 0.001}
SCENES: dict[str, tuple[bool, dict[str, Any]]] = {
    "paper": (True, {}),
    "fixed, damped, one hand": (False, {"coupling": "left", "b_theta": 0.001, "balls": 2}),
    "lagrangian, one hand": (True, {**HARD, "coupling": "right", "balls": 2}),
    "lagrangian, fixed": (False, HARD),
    "hinge without balls": (True, {"board": "hinged", "balls": 0}),
    "level": (True, {"board": "level", "b_z": 0.3, "balls": 2}),
    "level, lagrangian": (True, {"board": "level", **HARD}),
}
CASES = {
    f"{method}, {name}": (method, name)
    for name, (_, values) in SCENES.items()
    for method in (("etdrk4", "exact") if values.get("board") == "level" else ("etd2rk", "etdrk4"))
}
START = (0.001, 0.02, 0.3, 0.0, 0.1, 0.2, -0.2, 0.0)


def digest_of(method: str, name: str) -> str:
    """Hash of the states of a method in a scene, and of its tables."""
    free, values = SCENES[name]
    scene = scene_of(free, **values)
    start = START[: scene.length] if scene.parts.tilts else (*START[:2], 0.0, 0.0, *START[4 : scene.length])
    digest = hashlib.sha256(trajectory(scene, start, waving, 1e-3, 60, method).tobytes())
    digest.update(sampled_trajectory(scene, start, waving, 2e-3, 60, method, 2).tobytes())
    tables = METHODS[NUMBER[method]].tables(scene.record, scene.parts, scene.length, 1e-3)
    digest.update(tables.tobytes())
    return digest.hexdigest()


def digests(cases: list[str]) -> dict[str, str]:
    """The hash of each of these cases."""
    return {case: digest_of(*CASES[case]) for case in cases}


if __name__ == "__main__":
    print(json.dumps(digests(sys.argv[1:])))  # noqa: T201
