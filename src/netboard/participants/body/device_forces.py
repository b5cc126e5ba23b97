"""Kernels of the forces on a device, for real and simulated ones alike: lateral fixture and motor limit.

The lateral fixture is a spring-damper that holds the stylus on the vertical line x = y = 0. The agent computes it from
its own reading, so it needs no network. It is the same in all blocks. Its force passes the safety chain like any other.
"""

import numpy as np

from netboard.base.compiled import inlined, kernel


@kernel
def fixture_force(k: float, c: float, place: float, rate: float) -> float:
    """Return the force of the fixture along one axis [N].

    ``place``, ``rate``: distance of the stylus from the line, and its rate of change [m, m/s].
    """
    return -k * place - c * rate


@inlined
def within(limit: float, fx: float, fy: float, fz: float) -> tuple[float, float, float]:
    """Scale a force down to a limit [N]; a force that is not finite, or a limit that is none, gives zero."""
    # No vector is longer than the sum of its parts, and roots take long.
    if abs(fx) + abs(fy) + abs(fz) <= limit < np.inf:
        return fx, fy, fz
    size = np.hypot(np.hypot(fx, fy), fz)
    if not (size < np.inf and limit >= 0.0):
        return 0.0, 0.0, 0.0
    if size <= limit:
        return fx, fy, fz
    share = limit / size
    return fx * share, fy * share, fz * share
