"""Estimators of a stylus' velocity by name: adaptive windowing, and others for comparison.

`netboard.participants.body.velocity_window` has the adaptive window, `netboard.devices.contract.estimators` the others.
"""

from collections.abc import Callable, Mapping
from typing import final

import numpy as np

from netboard.base.compiled import Records, kernel
from netboard.devices.contract import estimators
from netboard.devices.contract.estimators import Estimator
from netboard.participants.body.velocity_window import AXES, SAMPLES, SLACK, make_windowed
from netboard.physics.arithmetic.simd import gathered, lane

_windowed = make_windowed(AXES)

WINDOW = np.dtype(
    [
        ("band", "<f8"),  # largest deviation of a position from the line [m]
        ("count", "<i8"),  # stored positions [1]
        ("stamps", "<i8", (SAMPLES,)),  # times of the last positions, newest first [ns]
        ("places", "<f8", (SAMPLES, AXES)),  # these positions [m]
    ]
)
"""Positions from which the velocity of one stylus is estimated."""


@kernel
def windowed_velocity(window: Records, stamp_ns: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Add a position to an array of one `WINDOW`, and return the velocity x, y, z; see `Estimator.update` [m/s]."""
    w = window[0]
    newest = gathered((x, y, z), AXES)
    w["count"], velocity = _windowed(w["stamps"], w["places"], w["count"], w["band"], stamp_ns, newest)
    return lane(velocity, 0), lane(velocity, 1), lane(velocity, 2)


@final
class Velocimeter(Estimator):
    """Adaptive-windowing estimator of stylus velocity; the velocity is 0 until the second position.

    ``resolution``: size of one encoder step, 0 for none [m].
    """

    def __init__(self, resolution: float) -> None:
        window = np.zeros(1, WINDOW)
        window["band"] = SLACK * resolution
        super().__init__(windowed_velocity, window)

    def forget(self) -> None:
        """Forget all positions."""
        self.state["count"] = 0


KINDS: Mapping[str, Callable[[float], Estimator]] = {
    "adaptive": Velocimeter,
    "chai3d": lambda resolution: estimators.chai3d(),
    "difference": lambda resolution: estimators.difference(),
    "alpha_beta": lambda resolution: estimators.alpha_beta(),
    "kalman": estimators.kalman,
}
"""Constructor of each kind of estimator, called with the encoder step [m]."""


def make(kind: str, resolution: float) -> Estimator | None:
    """Create the estimator named by ``agents.<side>.velocity``; None for ``device``, which has its own estimate.

    ``resolution``: size of one encoder step, 0 for none [m].
    """
    return None if kind == "device" else KINDS[kind](resolution)
