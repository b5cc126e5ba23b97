"""Cables that give: motors and encoders on one side of them, the stylus and the hand that holds it on the other.

Each axis is two masses with a spring-damper between them. The motors push, the mechanism rubs and the encoder counts on
the one side; the arm pulls on the other, which moves where the encoder does not. With 10 g on either side of 1 N/mm the
two swing at some 70 Hz, with 1 g and 100 N/mm at 2 kHz, so all that is linear is stepped by the implicit midpoint rule:
stable for every stiffness and step, and it neither damps nor feeds what swings. Coulomb friction is implicit in the
velocity at the step's end, as without cables (Moreau's time stepping), so what friction holds is at rest to the bit.
"""

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from netboard.participants.device_models import DeviceModel

CABLES = np.dtype(
    [
        ("step", "<f8"),  # of time [s]
        ("stiffness", "<f8"),  # of a cable [N/m]
        ("damping", "<f8"),  # of a cable [N s/m]
        ("pull", "<f8"),  # stiffness of the arm towards its equilibrium point [N/m]
        ("keep_motor", "<f8"),  # mass on the motors' side less what half a step's damping takes [kg]
        ("keep_tip", "<f8"),  # the same on the stylus' side [kg]
        ("across", "<f8"),  # what the step's matrix has off its diagonal [kg]
        ("tip", "<f8"),  # what it has on it for the stylus' side [kg]
        ("motor", "<f8"),  # and for the motors' side, with the other one eliminated [kg]
        ("grip", "<f8"),  # momentum that friction takes in a step at the most [N s]
        ("stop", "<f8"),  # mechanical stop of the motors' side [m]
    ]
)
"""The constants of cables as the kernel reads them."""

TIP = np.dtype([(name, "<f8") for name in ("x", "y", "z", "vx", "vy", "vz")])
"""State of the stylus' side: position [m] and velocity [m/s]."""


def pack_cables(device: DeviceModel, arm: NDArray[Any], step: float) -> NDArray[Any]:
    """Constants of cables, for the kernel.

    Parameters
    ----------
    device : DeviceModel
        The device; its cables are not rigid.
    arm : ndarray of ARM, shape (1,)
        Device and arm as they are with rigid cables.
    step : float
        Length of a step [s].

    Returns
    -------
    ndarray of CABLES, shape (1,)
        The packed record, SI units.
    """
    k, c, half = device.cable_stiffness, device.cable_damping, 0.5 * step
    motor = device.mass * (1.0 - device.tip_share)
    tip = float(arm["mass"][0]) - motor
    held = float(arm["damping"][0]) - device.damping
    pull = float(arm["stiffness"][0])
    across = -half * (c + half * k)
    on_tip = tip + half * (held + c) + half * half * (k + pull)
    on_motor = motor + half * (device.damping + c) + half * half * k
    cables = np.zeros(1, CABLES)
    cables["step"], cables["stiffness"], cables["damping"], cables["pull"] = step, k, c, pull
    cables["keep_motor"], cables["keep_tip"] = motor - half * device.damping, tip - half * held
    cables["across"], cables["tip"], cables["motor"] = across, on_tip, on_motor - across * across / on_tip
    cables["grip"], cables["stop"] = step * device.friction, device.workspace
    return cables


@numba.njit(cache=True)
def stretch(
    x: float, v: float, tip: float, rate: float, push: float, load: float, rest: float, cables: Any
) -> tuple[float, float, float, float]:
    """Move both sides of one axis by one step.

    Parameters
    ----------
    x, v : float
        Position and velocity of the motors' side [m, m/s].
    tip, rate : float
        Those of the stylus' side [m, m/s].
    push : float
        Force of the motors [N].
    load : float
        Force of the arm, but for its spring [N].
    rest : float
        Where that spring is at rest [m].
    cables : record of CABLES
        The constants.

    Returns
    -------
    x, v, tip, rate : float
        What they are after the step [m, m/s, m, m/s].
    """
    h, apart = cables["step"], rate - v
    tension = cables["stiffness"] * (tip - x + 0.25 * h * apart) + 0.5 * cables["damping"] * apart
    on_motor = cables["keep_motor"] * v + h * (push + tension)
    pulled = load + cables["pull"] * (rest - tip - 0.25 * h * rate)
    on_tip = cables["keep_tip"] * rate + h * (pulled - tension)
    moving = on_motor - cables["across"] / cables["tip"] * on_tip
    rubbed = max(moving - cables["grip"], 0.0) if moving > 0.0 else min(moving + cables["grip"], 0.0)
    then = rubbed / cables["motor"]
    there = x + 0.5 * h * (v + then)
    if abs(there) > cables["stop"]:
        there, then = cables["stop"] if there > 0.0 else -cables["stop"], 0.0
    rate_then = (on_tip - cables["across"] * then) / cables["tip"]
    return there, then, tip + 0.5 * h * (rate + rate_then), rate_then
