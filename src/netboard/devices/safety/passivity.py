"""Time-domain passivity control of forces that arrive with delay. Pure; one step per millisecond.

B. Hannaford, J.-H. Ryu, Time-domain passivity control of haptic interfaces, IEEE Trans. Robotics and Automation 18
(2002); for two ports with a delay between them, J.-H. Ryu, J. Artigas, C. Preusche, Mechatronics 20 (2010).

A delayed force answers the stylus position of one round trip ago, so a spring over a network can generate energy. The
agent knows the force and, by the number of the answered sample, the height that it answers. It can therefore observe
the energy of the network without additional messages: the work at the server's end (force times displacement of the
answered samples) minus the work on the hand (force times displacement of the stylus). Work of a partner who moves the
board enters at the server's end and causes no deficit. A delay alone causes a deficit as large as that of a negative
damper of stiffness times round trip.

Rule 1: while the energy is below zero, damping dissipates the deficit, up to `MAX_DAMPING`.
Rule 2: while the deficit exceeds `STORED`, forces in the direction of motion are withheld. So even with a wrong damping
or velocity, a tick increases the deficit only by motion that the velocity estimate missed.
Rule 3: the stored energy is at most `STORED`: energy dissipated earlier must not feed an oscillation later.
Rule 4: no force is withheld from a stylus slower than `SLOW`. The power is negligible there, and a deficit must not
keep the stylus from its equilibrium for ever.

If the server extrapolates the stylus (``physics.hold``), the observer uses the sampled position: this errs on the safe
side.
"""

from math import isfinite

import numpy as np

from netboard.base.compiled import Records, kernel
from netboard.base.tick import TICK_SECONDS

STORED = 2e-3
"""Largest deficit before forces are withheld, and largest stored energy [J].

It is that of the default virtual coupling at 4.5 mm, and 11 encoder steps of a Touch at its maximum force.
"""

MAX_DAMPING = 5.0
"""Maximum damping; a device of 45 g with a velocity estimate 4 ms late remains stable with it [N s/m]."""

SLOW = 0.005
"""Speed below which the stylus counts as at rest: less than one encoder step in the longest velocity window [m/s]."""

REMEMBERED = 256
"""Number of samples whose height is stored [1]."""


PASSIVITY = np.dtype(
    [
        ("on", "<i8"),  # 1: forces pass the controller
        ("energy", "<f8"),  # into the network minus out of it [J]
        ("force", "<f8"),  # last commanded force [N]
        ("answered", "<f8"),  # height of the sample that it answers [m]
        ("height", "<f8"),  # height of the stylus then [m]
        ("open", "<i8"),  # 1: these three are known
        ("heights", "<f8", (REMEMBERED,)),  # of the last samples [m]
    ]
)
"""State of the observer and controller of one hand."""


@kernel
def restart(passivity: Records) -> None:
    """Restart at zero energy, at a time without force."""
    p = passivity[0]
    p["energy"] = p["force"] = p["answered"] = p["height"] = 0.0
    p["open"] = 0


@kernel
def remember_height(passivity: Records, seq: int, height: float) -> None:
    """Store the height of the stylus in a sample [m]."""
    passivity[0]["heights"][seq % REMEMBERED] = height


@kernel
def passive_force(passivity: Records, force: float, seq: int, height: float, velocity: float, rendered: float) -> float:
    """Limit a commanded force; see `Passivity.step`."""
    p = passivity[0]
    answered = p["heights"][seq % REMEMBERED]
    if p["open"]:
        given = 0.5 * (force + p["force"]) * (answered - p["answered"])
        p["energy"] = min(p["energy"] + given - rendered * (height - p["height"]), STORED)
    if not isfinite(p["energy"]):
        restart(passivity)  # the safety chain handles non-finite values
    p["force"], p["answered"], p["height"], p["open"] = force, answered, height, 1
    if p["energy"] >= 0.0:
        return force
    slow = abs(velocity) < SLOW
    missing = MAX_DAMPING if slow else -p["energy"] / (velocity * velocity * TICK_SECONDS)
    limited = force - min(missing, MAX_DAMPING) * velocity
    return 0.0 if p["energy"] < -STORED and not slow and limited * velocity > 0.0 else limited


class Passivity:
    """Passivity observer and controller of one hand; kernels take its ``state``."""

    def __init__(self, *, on: bool = True) -> None:
        self.state = np.zeros(1, PASSIVITY)
        self.state["on"] = on

    @property
    def energy(self) -> float:
        """Energy into the network minus energy out of it; below zero the network has generated energy [J]."""
        return float(self.state[0]["energy"])

    @energy.setter
    def energy(self, energy: float) -> None:
        self.state[0]["energy"] = energy

    def reset(self) -> None:
        """Restart at zero energy, at a time without force."""
        restart(self.state)

    def remember(self, seq: int, height: float) -> None:
        """Store the height of the stylus in a sample [m]."""
        remember_height(self.state, seq, height)

    def step(self, force: float, seq: int, height: float, velocity: float, rendered: float) -> float:
        """Limit the server's latest commanded force; return the wanted force for the safety chain [N].

        ``seq``: number of the sample that the force answers. ``height``, ``velocity``: of the stylus now [m, m/s].
        ``rendered``: force on the hand since the previous step [N].
        """
        return passive_force(self.state, force, seq, height, velocity, rendered)
