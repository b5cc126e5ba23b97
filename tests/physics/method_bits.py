"""Script run by a test: print a digest of each named method's results in a difficult scene.

Without compilation, or compiled for another processor, it must print the same digests.
"""

import hashlib
import json
import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "physics"))

from independent import waving
from trajectories import scene_of, trajectory

CLASSICAL = ("euler", "semi_implicit", "heun", "verlet", "midpoint", "rk4", "dop853")


def digests(methods: list[str]) -> dict[str, str]:
    """Hash of the states of each of these methods."""
    scene = scene_of(model="lagrangian", coupling="right", balls=2, ball_height=0.02, b_theta=0.001)
    start = (0.0, 0.0, 0.3, 0.0, 0.1, 0.2, -0.2, 0.0)
    return {
        method: hashlib.sha256(trajectory(scene, start, waving, 1e-3, 200, method).tobytes()).hexdigest()
        for method in methods
    }


if __name__ == "__main__":
    print(json.dumps(digests(sys.argv[1:])))  # noqa: T201
