"""Linearisation of the scene about the level board at rest: x' = A x + drives of the hands and weights.

The exponential methods solve it exactly, and the stability analysis uses it. NumPy; not for use in a tick.
"""

import numpy as np
from numpy.typing import NDArray

from netboard.physics.scene.parameters import Parts, load_mass


def board_matrix(parts: Parts, scene: np.void) -> NDArray[np.float64]:
    """Return the matrix A of (z, vz, theta, omega), of shape (4, 4): the board without balls [SI]."""
    return scene_matrix(parts, scene, 4)


def scene_matrix(parts: Parts, scene: np.void, length: int) -> NDArray[np.float64]:
    """Return the matrix A about the level board with the balls at its centre, of shape (length, length) [SI]."""
    a = np.zeros((length, length))
    arm = float(scene["l"])
    k_left, k_right = float(scene["k_left"]), float(scene["k_right"])
    c_left, c_right = float(scene["c_left"]), float(scene["c_right"])
    # Force and torque by (z, vz, theta, omega, p, vp, ...).
    force, torque = np.zeros(length), np.zeros(length)
    force[:4] = (
        -(k_left + k_right + float(scene["k_s"])),
        -(c_left + c_right + float(scene["b_z"])),
        -(k_right - k_left) * arm,
        -(c_right - c_left) * arm,
    )
    torque[:4] = (
        -(k_right - k_left) * arm,
        -(c_right - c_left) * arm,
        -(k_right + k_left) * (arm * arm),
        -(c_right + c_left) * (arm * arm) - float(scene["b_theta"]),
    )
    heavy, turning = float(scene["M"]), float(scene["I"])
    balls = range(4, length, 2)
    if parts.loaded:
        load = load_mass(parts, scene)
        torque[list(balls)] -= load * float(scene["g"])
        if parts.lagrangian:
            heavy += load * len(balls)
            if not parts.free:
                radius = float(scene["ball_height"])
                turning += load * len(balls) * (radius * radius) / float(scene["mass_ratio"])
                torque[2] += load * len(balls) * float(scene["g"]) * radius
    if parts.heaves:
        a[0, 1] = 1.0
        a[1] = force / heavy
    if parts.tilts:
        a[2, 3] = 1.0
        a[3] = torque / turning
    for i in balls if parts.free else ():
        a[i, i + 1] = 1.0
        if parts.tilts:
            if parts.lagrangian:
                a[i + 1] = float(scene["ball_height"]) * a[3]
                a[i + 1, 2] -= float(scene["mass_ratio"]) * float(scene["g"])
            else:
                a[i + 1, 2] = float(scene["ball_gravity"])
    if not parts.tilts:
        a[:, 2:4] = 0.0
    if not parts.heaves:
        a[:, 0:2] = 0.0
    return a
