"""The equations of the scene, written independently of the kernels (numpy, libm, no shared code).

The paper's equations are as printed. The Lagrangian model uses d'Alembert's principle instead: each ball has its own
coordinate and an acceleration written with the geometry's Jacobian, and a linear system in all coordinates is solved.
States are those of the kernels.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from netboard.base.tables.scene import Physics

Hands = Callable[[float], tuple[float, float, float, float]]
"""Maps a time to left_z, left_vz, right_z, right_vz of the styluses."""


def couplings(k: Physics) -> tuple[float, float]:
    """Which of the two hands are coupled, left and right."""
    return float(k.coupling in ("left", "both")), float(k.coupling in ("right", "both"))


def forces(x: NDArray[np.float64], hand: tuple[float, float, float, float], k: Physics) -> tuple[float, float]:
    """Forces of the hands on the board."""
    z, vz, theta, omega = x[:4]
    left, right = couplings(k)
    z_left, z_right = z - k.l * np.sin(theta), z + k.l * np.sin(theta)
    v_left, v_right = vz - k.l * omega * np.cos(theta), vz + k.l * omega * np.cos(theta)
    return (
        left * (k.k_h * (hand[0] - z_left) + k.c_h * (hand[1] - v_left)),
        right * (k.k_h * (hand[2] - z_right) + k.c_h * (hand[3] - v_right)),
    )


def paper(x: NDArray[np.float64], hand: tuple[float, float, float, float], k: Physics, free: bool) -> list[float]:
    """Rates of a state by equations 3 to 5."""
    z, vz, theta, omega = x[:4]
    p, vp = x[4::2], x[5::2]
    left, right = forces(x, hand, k)
    load = 1.0 if free or k.fixed_ball == "loads_board" else 0.0
    weight, ease = load * k.m * k.g, 1 / (1 + k.ball_inertia)
    heave = left + right - k.M * k.g - len(p) * weight * np.cos(theta) ** 2 - k.k_s * z - k.b_z * vz
    turn = ((right - left) * k.l - weight * p.sum()) * np.cos(theta) - k.b_theta * omega
    roll = (-1 if k.ball_sign == "downhill" else 1) * ease * k.g * np.sin(theta)
    out = [vz, heave / k.M if k.board != "hinged" else 0.0, omega, turn / k.I if k.board != "level" else 0.0]
    for speed in vp:
        out += [speed, roll - ease * friction(speed, theta, k) / k.m] if free else [0.0, 0.0]
    return out


def friction(speed: float, theta: float, k: Physics) -> float:
    """Force of the board against the motion of a ball: viscous, and rolling resistance with a smooth sign."""
    sign = np.sin(np.arctan2(speed, 2e-3))
    return k.b_p * speed + k.rolling_resistance * k.m * k.g * abs(np.cos(theta)) * sign


def newton(x: NDArray[np.float64], hand: tuple[float, float, float, float], k: Physics, free: bool) -> list[float]:
    """Rates of a state by Newton's law in the coordinates (z, theta, p of each ball)."""
    z, vz, theta, omega = x[:4]
    balls, r, beta = len(x[4::2]), k.ball_height, k.ball_inertia
    m = k.m if free or k.fixed_ball == "loads_board" else 0.0
    s, c = np.sin(theta), np.cos(theta)
    left, right = forces(x, hand, k)
    inertia, force = np.zeros((2 + balls, 2 + balls)), np.zeros(2 + balls)
    inertia[0, 0], inertia[1, 1] = k.M, k.I
    force[0] = left + right - k.M * k.g - k.k_s * z - k.b_z * vz
    force[1] = (right - left) * k.l * c - k.b_theta * omega
    for i, (p, speed) in enumerate(zip(x[4::2], x[5::2], strict=True)):
        vp = speed if free else 0.0
        force[2 + i] -= friction(vp, theta, k)
        across, up, spin = np.zeros((3, 2 + balls))
        across[[1, 2 + i]] = -p * s - r * c, c
        up[[0, 1, 2 + i]] = 1, p * c - r * s, s
        spin[[1, 2 + i]] = -r, 1
        inertia += m * (np.outer(across, across) + np.outer(up, up) + beta * np.outer(spin, spin))
        force -= m * across * (-2 * vp * s * omega - (p * c - r * s) * omega**2)
        force -= m * up * (2 * vp * c * omega - (p * s + r * c) * omega**2 + k.g)
    moving = [k.board != "hinged", k.board != "level", *[free] * balls]
    rates = np.zeros(2 + balls)
    rates[moving] = np.linalg.solve(inertia[np.ix_(moving, moving)], force[moving])
    out = [vz, rates[0], omega, rates[1]]
    for i, speed in enumerate(x[5::2]):
        out += [speed if free else 0.0, rates[2 + i]]
    return out


def rates(
    x: NDArray[np.float64], hand: tuple[float, float, float, float], k: Physics, free: bool = True
) -> list[float]:
    """Rates of a state by the model of the configuration."""
    return (newton if k.model == "lagrangian" else paper)(np.asarray(x), hand, k, free)


def solution(
    start: tuple[float, ...], hands: Hands, times: NDArray[np.float64], k: Physics, free: bool = True
) -> NDArray[np.float64]:
    """States at these times, by scipy's DOP853 with its tightest tolerances."""
    found = solve_ivp(
        lambda t, x: rates(x, hands(t), k, free), (0, times[-1]), start, "DOP853", times, rtol=1e-13, atol=1e-16
    )
    return np.asarray(found.y.T)


def waving(t: float) -> tuple[float, float, float, float]:
    """The hands in opposite directions, 20 mm at 0.8 Hz, plus a small common motion at 1.9 Hz."""
    w, q = 2 * math.pi * 0.8, 2 * math.pi * 1.9
    z, vz = 0.02 * math.sin(w * t), 0.02 * w * math.cos(w * t)
    lift, rise = 0.004 * math.cos(q * t), -0.004 * q * math.sin(q * t)
    return lift - z, rise - vz, lift + z, rise + vz


def still(t: float) -> tuple[float, float, float, float]:
    """Both hands at the origin."""
    return 0.0, 0.0, 0.0, 0.0
