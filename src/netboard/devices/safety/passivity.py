"""Time-domain passivity control: a force that comes over a delay must not make energy. Pure; one step a millisecond.

B. Hannaford, J.-H. Ryu, Time-domain passivity control of haptic interfaces, IEEE Trans. Robotics and Automation 18
(2002); for two ports with a delay between them, J.-H. Ryu, J. Artigas, C. Preusche, Mechatronics 20 (2010).

What comes back to the hand was done to the hand as it was a round trip ago. Both are known here: the force, and by its
sample's number the height it answers. So the agent keeps the network's account without a word more on the wire: what
the server's end of the coupling gave, force times way of the answered samples, less what this end handed to the hand,
force times way of the stylus. A partner who moves the board gives at the server's end, so that work is no debt. A delay
alone makes one, as large as that of a negative damper of stiffness times round trip.

Rule 1: while the account is below zero the hand is damped, by as much as is missing and `MOST_DAMPING` at most.
Rule 2: while more than `STORED` is missing, no force may push the stylus the way it moves. So however wrong the damping
or the velocity is, a tick can add no more to the debt than what the stylus moved otherwise than it seemed to.
Rule 3: at most `STORED` is kept as credit: energy saved in calm times must not feed an oscillation later.
Rule 4: no force is withheld from a stylus slower than `SLOW`: there is next to no power in that, and a debt must not
keep it away from where it is pulled for ever.

A stylus moved on by the server (``physics.hold``) is taken where it was: that errs on the safe side.
"""

from math import isfinite

from netboard.base.tick import TICK_SECONDS

STORED = 2e-3
"""So much may be owed before forces are withheld, and so much may be saved [J]."""

MOST_DAMPING = 5.0
"""The hand is damped by at most so much; a device of 45 g with a velocity 4 ms late stands it [N s/m]."""

SLOW = 0.005
"""As good as at rest: less than one encoder step in the longest window of the velocity [m/s]."""

REMEMBERED = 256
"""Samples whose height is remembered [1]."""


class Passivity:
    """The account of one hand, and what follows from it.

    Attributes
    ----------
    energy : float
        What the network has taken less what it has given: below zero it has made energy [J].
    """

    def __init__(self) -> None:
        self._heights = [0.0] * REMEMBERED
        self.reset()

    def reset(self) -> None:
        """Begin a new account: nothing is felt just now."""
        self.energy = 0.0
        self._force = self._answered = self._height = 0.0
        self._open = False

    def remember(self, seq: int, height: float) -> None:
        """Note where the stylus was in a sample.

        Parameters
        ----------
        seq : int
            Its number [1].
        height : float
            Height of the stylus [m].
        """
        self._heights[seq % REMEMBERED] = height

    def step(self, force: float, seq: int, height: float, velocity: float, rendered: float) -> float:
        """Limit one force.

        Parameters
        ----------
        force : float
            The newest one of the server's [N].
        seq : int
            Number of the sample that it answers [1].
        height : float
            Height of the stylus now [m].
        velocity : float
            Its rate [m/s].
        rendered : float
            Force on the hand since the step before [N].

        Returns
        -------
        float
            The force to be wanted [N].
        """
        answered = self._heights[seq % REMEMBERED]
        if self._open:
            given = 0.5 * (force + self._force) * (answered - self._answered)
            self.energy = min(self.energy + given - rendered * (height - self._height), STORED)
        if not isfinite(self.energy):
            self.reset()  # what is not finite is the safety chain's business
        self._force, self._answered, self._height, self._open = force, answered, height, True
        if self.energy >= 0.0:
            return force
        slow = abs(velocity) < SLOW
        missing = MOST_DAMPING if slow else -self.energy / (velocity * velocity * TICK_SECONDS)
        limited = force - min(missing, MOST_DAMPING) * velocity
        return 0.0 if self.energy < -STORED and not slow and limited * velocity > 0.0 else limited
