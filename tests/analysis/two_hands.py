"""Movements whose measures are known: two hands that tilt a board, and a ball that rolls on it.

The board follows the hands at once (theta = (z_right - z_left) / 2l), which the paper's board does within ten
milliseconds; the hands move as minimum-jerk movements.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

ARM = 0.25
GRAVITY = 9.81


def minimum_jerk(times: NDArray[np.float64], start: float, duration: float, distance: float) -> NDArray[np.float64]:
    """Position in a minimum-jerk movement from rest to rest (Flash and Hogan 1985)."""
    s = np.clip((times - start) / duration, 0, 1)
    return distance * (10 * s**3 - 15 * s**4 + 6 * s**5)


def minimum_jerk_rate(
    times: NDArray[np.float64], start: float, duration: float, distance: float
) -> NDArray[np.float64]:
    s = np.clip((times - start) / duration, 0, 1)
    return distance / duration * 30 * s**2 * (1 - s) ** 2


def time_to_portion(portion: float, duration: float) -> float:
    """Time at which a minimum-jerk movement reaches a fraction of its peak velocity: 16 s2 (1 - s)2 = f, s < 1/2."""
    return duration * (1 - np.sqrt(1 - np.sqrt(portion))) / 2


@dataclass(frozen=True)
class TwoHands:
    """Exact movements of two hands and of the board that they tilt."""

    rate: float
    times: NDArray[np.float64]
    left_z: NDArray[np.float64]
    right_z: NDArray[np.float64]
    left_vz: NDArray[np.float64]
    right_vz: NDArray[np.float64]

    @property
    def theta(self) -> NDArray[np.float64]:
        return (self.right_z - self.left_z) / (2 * ARM)

    @property
    def omega(self) -> NDArray[np.float64]:
        return (self.right_vz - self.left_vz) / (2 * ARM)


Movement = tuple[float, float, float]


def two_hands(left: list[Movement], right: list[Movement], length: float = 3.0, rate: float = 1000.0) -> TwoHands:
    """Hands that make minimum-jerk movements of (start, duration, distance), + = up."""
    times = np.arange(round(length * rate) + 1) / rate
    zeros = np.zeros_like(times)
    z = [sum((minimum_jerk(times, *one) for one in side), zeros) for side in (left, right)]
    vz = [sum((minimum_jerk_rate(times, *one) for one in side), zeros) for side in (left, right)]
    return TwoHands(rate, times, z[0], z[1], vz[0], vz[1])


def rolled(
    theta: NDArray[np.float64], rate: float, p: float, release: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Position and velocity of a ball held at p that rolls downhill after the release, by the trapezoidal rule."""
    a = -GRAVITY * np.sin(theta)
    a[:release] = 0
    v = np.concatenate([[0], np.cumsum((a[1:] + a[:-1]) / 2)]) / rate
    return p + np.concatenate([[0], np.cumsum((v[1:] + v[:-1]) / 2)]) / rate, v
