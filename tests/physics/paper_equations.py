"""The paper's equations once more, written independently of the kernels (numpy, libm, no shared code)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853, solve_ivp

from netboard.config import Physics

Hands = Callable[[float], tuple[float, float, float, float]]


def derivatives(t: float, y: NDArray[np.float64], hands: Hands, k: Physics) -> list[float]:
    z, vz, theta, omega, p, vp = y
    left_z, left_vz, right_z, right_vz = hands(t)
    z_left, z_right = z - k.l * np.sin(theta), z + k.l * np.sin(theta)
    v_left, v_right = vz - k.l * omega * np.cos(theta), vz + k.l * omega * np.cos(theta)
    f_left = k.k_h * (left_z - z_left) + k.c_h * (left_vz - v_left)
    f_right = k.k_h * (right_z - z_right) + k.c_h * (right_vz - v_right)
    sign = -1 if k.ball_sign == "downhill" else 1
    return [
        vz,
        (f_left + f_right - k.M * k.g - k.m * k.g * np.cos(theta) ** 2 - k.k_s * z) / k.M,
        omega,
        ((f_right - f_left) * k.l * np.cos(theta) - k.m * k.g * p * np.cos(theta)) / k.I,
        vp,
        sign * k.g * np.sin(theta),
    ]


def solution(start: NDArray[np.float64], hands: Hands, times: NDArray[np.float64], k: Physics) -> NDArray[np.float64]:
    """States at these times, shape (times, 6), by scipy's DOP853 at its tightest."""
    found = solve_ivp(
        derivatives, (0, times[-1]), start, "DOP853", times, rtol=1e-12, atol=1e-15, max_step=5e-3, args=(hands, k)
    )
    return found.y.T


def after(start: NDArray[np.float64], hands: Hands, h: float, k: Physics) -> NDArray[np.float64]:
    """The state a short time later; hands are given from the start of that time."""
    solver = DOP853(lambda t, y: derivatives(t, y, hands, k), 0.0, start, h, first_step=h, rtol=1e-10, atol=1e-14)
    while solver.status == "running":
        solver.step()
    return solver.y


def moving(left: float, left_rate: float, right: float, right_rate: float) -> Hands:
    """Hands of constant velocity."""
    return lambda t: (left + left_rate * t, left_rate, right + right_rate * t, right_rate)


STILL = moving(0.0, 0.0, 0.0, 0.0)
