"""A test's subprocess: print a digest of the bits of thousands of steps, and what the disk cache did.

Run in another way (without compilation, for another processor) it must print the same digest.
"""

import hashlib
import json
import math

import numpy as np

from netboard.config import Physics
from netboard.physics.hold import constant_velocity
from netboard.physics.kernels import coupling, rk4_bare, rk4_fixed, rk4_free
from netboard.physics.scene import pack_scene
from netboard.physics.trig import sincos

STEPS = [rk4_free, rk4_fixed, rk4_bare]


def digest(rounds: int) -> str:
    """Hash of every result of so many rounds of three steps, a coupling and a hold each."""
    scene = pack_scene(Physics())[0]
    spread = np.array([0.1, 1.0, 7.0, 20.0, 0.35, 1.0, 0.1, 1.0, 0.1, 1.0])
    hashed = hashlib.sha256()
    for row in (np.random.default_rng(7).uniform(-1, 1, (rounds, 10)) * spread).tolist():
        state, stylus = row[:6], row[6:]
        for step in STEPS:
            hashed.update(np.array(step(*state, *stylus, 1e-3, scene)).tobytes())
        hashed.update(np.array(coupling(*state[:4], *stylus, scene)).tobytes())
        hashed.update(np.array(sincos(1e4 * row[2])).tobytes())
        hashed.update(np.array(constant_velocity(stylus[0], stylus[1], row[4], 0.1)).tobytes())
    # The same state carried on, as in a trial: here a difference in the last digit grows.
    state = [0.0, 0.0, 0.0, 0.0, 0.05, 0.0]
    for i in range(rounds):
        wave = 0.01 * math.sin(0.004 * i)
        state = list(rk4_free(*state, -wave, 0.1, wave, -0.1, 1e-3, scene))
        hashed.update(np.array(state).tobytes())
    return hashed.hexdigest()


def cache_counts() -> list[tuple[int, int]]:
    """Hits and misses of the disk cache, for each step; nothing when nothing is compiled."""
    stats = [step.stats for step in STEPS if hasattr(step, "stats")]
    return [(sum(each.cache_hits.values()), sum(each.cache_misses.values())) for each in stats]


if __name__ == "__main__":
    print(json.dumps({"digest": digest(1500), "cache": cache_counts()}))  # noqa: T201
