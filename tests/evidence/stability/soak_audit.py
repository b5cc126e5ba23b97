"""Energy balance after every step of the soak.

The energy of board and balls, with the springs of the couplings taken from the board to the ground, must change by the
work of the drives u at the board's ends minus the dissipation of the dampers: ``E' = u vz - c vz^2 + ...``.
This is at most ``u^2 / 4c`` for each hand, whatever the board does: the bound on the work of the hands.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.physics.batch import LANES, anywhere, column_at, numbers_at
from netboard.base.compiled import fast, inlined, relaxed
from netboard.base.tick import TICK_SECONDS
from netboard.physics.arithmetic.trig import sincos
from netboard.physics.arithmetic.vectors import plus
from netboard.physics.scene.energy import flows, stored
from netboard.physics.scene.models import rates, turned
from netboard.physics.scene.parameters import Parts
from netboard.physics.stability.method_choice import TILTS

Array = NDArray[np.float64]

MAX_TILT = max(TILTS)
"""Largest tilt for which the method is chosen [rad]."""

MAX_TURN = 0.1
"""Largest rotation in a step that a method can follow [rad]."""

THROUGH, SUPPLY, GROWTH, IMBALANCE, BEYOND = range(5)
SUMS = 5
"""Magnitudes of the flows, bound on the work of the hands, growth, growth minus work [J]; states out of range [1]."""

_rates, _flows, _stored = (relaxed(text, {sincos: anywhere}) for text in (rates, flows, stored))
_turned, _plus = relaxed(turned, {sincos: anywhere}), relaxed(plus, {})


@inlined
def _middle(u: Any, t: float) -> tuple[float, float]:
    """Return both drives at a time."""
    return u[0] + t * (u[1] + t * u[2]), u[4] + t * (u[5] + t * u[6])


@inlined
def _held(x: Any, parts: Parts, scene: Any) -> float:
    """Return the energy, with the springs of the couplings to the ground."""
    kept = _stored(x, 0.0, 0.0, parts, scene)
    return kept[0] + kept[1] + kept[2] + kept[3] + kept[4]


@inlined
def _power(x: Any, left: float, right: float, parts: Parts, scene: Any) -> tuple[float, float, float]:
    """Return the power of all flows, the sum of their magnitudes, and the upper bound."""
    _, c = _turned(x[2], parts)
    arm_rate = scene["l"] * x[3] * c
    pushed, turned_ = left * (x[1] - arm_rate), right * (x[1] + arm_rate)
    flow = _flows(x, 0.0, 0.0, 0.0, 0.0, parts, scene)
    lost = flow[2] + flow[3] + flow[4]
    size = abs(pushed) + abs(turned_) - lost + abs(flow[5])
    c_left, c_right = scene["c_left"], scene["c_right"]
    most = (0.25 * left * left / c_left if c_left > 0.0 else 0.0) + (
        0.25 * right * right / c_right if c_right > 0.0 else 0.0
    )
    return pushed + turned_ + lost + flow[5], size, most + flow[5]


@inlined
def _farthest(x: Any, length: int) -> float:
    """Return the largest distance of a ball from the centre [m]."""
    far = 0.0
    for i in range(4, length, 2):
        far = abs(x[i]) if abs(x[i]) > far else far
    return far


@inlined
def _is_beyond(x: Any, length: int, scene: Any) -> bool:
    """Return whether board or balls are outside the range for which the method was chosen."""
    slow = abs(x[3]) * TICK_SECONDS <= MAX_TURN
    return not (slow and abs(x[2]) <= MAX_TILT and _farthest(x, length) <= 2.0 * scene["l"])


@cache
def make_audit(PARTS: Parts, LENGTH: int) -> Callable[[Array, Array, Array, Array, Array], None]:
    """Compile the audit of a step's energy.

    Returns
    -------
    callable
        ``audit(before, after, hands, scenes, sums)`` adds to `sums`, of shape (blocks, SUMS, LANES), the energies of
        the step from one state to the other. Flows are integrated by Simpson's rule, with the cubic between both
        states.
    """

    @fast
    def audit(before: Any, after: Any, hands: Any, scenes: Any, sums: Any) -> None:
        h, done = TICK_SECONDS, np.empty((SUMS, LANES))
        for b in range(len(before)):
            for j in range(LANES):
                scene = numbers_at(scenes, b, j)
                x0, x1, u = column_at(before, b, j, LENGTH), column_at(after, b, j, LENGTH), column_at(hands, b, j, 8)
                left, right = _middle(u, 0.5 * h)
                last_left, last_right = _middle(u, h)
                r0, r1 = _rates(x0, u[0], u[4], PARTS, scene), _rates(x1, last_left, last_right, PARTS, scene)
                middle = _plus(_plus(_plus(_plus(x0, -0.5, x0), 0.5, x1), 0.125 * h, r0), -0.125 * h, r1)
                a, a_size, a_most = _power(x0, u[0], u[4], PARTS, scene)
                m, m_size, m_most = _power(middle, left, right, PARTS, scene)
                e, e_size, e_most = _power(x1, last_left, last_right, PARTS, scene)
                work = h / 6.0 * (a + 4.0 * m + e)
                growth = _held(x1, PARTS, scene) - _held(x0, PARTS, scene)
                struck = PARTS.stops and _farthest(x1, LENGTH) >= scene["stop"]
                done[THROUGH, j] = h / 6.0 * (a_size + 4.0 * m_size + e_size)
                done[SUPPLY, j] = h / 6.0 * (a_most + 4.0 * m_most + e_most)
                done[GROWTH, j] = growth
                done[IMBALANCE, j] = 0.0 if struck else growth - work
                done[BEYOND, j] = 1.0 if _is_beyond(x1, LENGTH, scene) else 0.0
            for k in range(SUMS):
                for j in range(LANES):
                    sums[b, k, j] += done[k, j]

    return audit
