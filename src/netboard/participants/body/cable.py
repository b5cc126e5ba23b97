"""Compliant cables of a haptic device: motors and encoders on one side, stylus and hand on the other.

Each axis is two masses with a spring-damper between them. Motor force, friction and encoder act on the motor side, the
arm on the stylus side. So the stylus can move without the encoder (a non-collocated resonance). With 10 g on either
side of 1 N/mm the resonance is at some 70 Hz, with 1 g and 100 N/mm at 2 kHz.

All linear terms are integrated with the implicit midpoint rule: it is stable for every stiffness and step, and neither
damps nor excites oscillations. Coulomb friction is implicit in the velocity at the end of the step, as without cables
(Moreau's time stepping), so a mass held by friction is exactly at rest.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import kernel
from netboard.participants.body.device_models import DeviceModel

CABLES = np.dtype(
    [
        ("step", "<f8"),  # length of a time step [s]
        ("stiffness", "<f8"),  # cable stiffness [N/m]
        ("damping", "<f8"),  # cable damping [N s/m]
        ("pull", "<f8"),  # stiffness of the arm towards its equilibrium point [N/m]
        ("keep_motor", "<f8"),  # mass on the motor side minus half a step of its damping [kg]
        ("keep_tip", "<f8"),  # the same on the stylus side [kg]
        ("across", "<f8"),  # off-diagonal element of the step's 2 x 2 matrix [kg]
        ("tip", "<f8"),  # its diagonal element of the stylus side [kg]
        ("motor", "<f8"),  # that of the motor side, after eliminating the stylus side [kg]
        ("grip", "<f8"),  # largest momentum that friction can take in a step [N s]
        ("stop", "<f8"),  # mechanical stop of the motor side [m]
    ]
)
"""Constants of the cables, as one record for the kernel."""

TIP = np.dtype([(name, "<f8") for name in ("x", "y", "z", "vx", "vy", "vz")])
"""State of the stylus side: position [m] and velocity [m/s]."""


def pack_cables(
    device: DeviceModel, mass: float, friction: float, impedance: tuple[float, float], step: float
) -> NDArray[Any]:
    """Return the constants of compliant cables, packed for the kernel: ndarray of CABLES, shape (1,) [SI].

    Parameters
    ----------
    device : DeviceModel
        The device; its cable stiffness is not zero.
    mass, friction, impedance
        What the hand adds, as in `netboard.participants.body.stylus.HandMechanics`.
    step : float
        Length of a step [s].
    """
    k, c, half = device.cable_stiffness, device.cable_damping, 0.5 * step
    pull, held = impedance
    motor = device.mass * (1.0 - device.tip_share)
    tip = device.mass + mass - motor
    across = -half * (c + half * k)
    on_tip = tip + half * (held + c) + half * half * (k + pull)
    on_motor = motor + half * (device.damping + c) + half * half * k
    cables = np.zeros(1, CABLES)
    cables["step"], cables["stiffness"], cables["damping"], cables["pull"] = step, k, c, pull
    cables["keep_motor"], cables["keep_tip"] = motor - half * device.damping, tip - half * held
    cables["across"], cables["tip"], cables["motor"] = across, on_tip, on_motor - across * across / on_tip
    cables["grip"], cables["stop"] = step * (device.friction - friction), device.workspace
    return cables


@kernel
def stretch(
    x: float, v: float, tip: float, rate: float, push: float, load: float, rest: float, cables: np.void
) -> tuple[float, float, float, float]:
    """Advance both sides of one axis by one step; return x, v, tip and rate after it [m, m/s, m, m/s].

    Parameters
    ----------
    x, v : float
        Position and velocity of the motor side [m, m/s].
    tip, rate : float
        Position and velocity of the stylus side [m, m/s].
    push : float
        Force of the motors [N].
    load : float
        Force of the arm without its spring force [N].
    rest : float
        Equilibrium point of the arm's spring [m].
    """
    h, slip = cables["step"], rate - v
    tension = cables["stiffness"] * (tip - x + 0.25 * h * slip) + 0.5 * cables["damping"] * slip
    on_motor = cables["keep_motor"] * v + h * (push + tension)
    pulled = load + cables["pull"] * (rest - tip - 0.25 * h * rate)
    on_tip = cables["keep_tip"] * rate + h * (pulled - tension)
    moving = on_motor - cables["across"] / cables["tip"] * on_tip
    rubbed = max(moving - cables["grip"], 0.0) if moving > 0.0 else min(moving + cables["grip"], 0.0)
    new_v = rubbed / cables["motor"]
    new_x = x + 0.5 * h * (v + new_v)
    if abs(new_x) > cables["stop"]:
        new_x, new_v = cables["stop"] if new_x > 0.0 else -cables["stop"], 0.0
    new_rate = (on_tip - cables["across"] * new_v) / cables["tip"]
    return new_x, new_v, tip + 0.5 * h * (rate + new_rate), new_rate
