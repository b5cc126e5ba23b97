"""Perception of a simulated participant: display and rendered force, with delay and noise.

Rule 1: the only inputs are the views of the station's display (`Glimpse`) and the force rendered by its device.
Rule 2: nothing after ``now - delay`` is known yet.
Rule 3: the ball's velocity is not displayed; it is estimated from the positions seen.
"""

from collections import deque
from dataclasses import dataclass
from math import exp, sqrt

import numpy as np

from netboard.base.tables.simulated import Participant

NOISE_TIME = 0.2
"""Correlation time of perceptual noise [s]."""

VELOCITY_SPAN = 0.05
"""Window over which the ball's velocity is estimated [s]."""

MEMORY = 1.0
"""Time for which glimpses and forces are kept [s]."""

BALL_FREE = ("running", "holding")
"""Phases in which the ball is free, as a view names them."""


@dataclass(frozen=True, slots=True)
class Glimpse:
    """What a station's display shows at one time.

    Attributes
    ----------
    time : float
        Time of display [s].
    phase : str
        Name of the trial's phase, in lower case.
    z : float
        Height of the board's centre [m].
    theta : float
        Tilt of the board, + = right end up [rad].
    p : float or None
        Ball position along the board, + = right; None without a ball [m].
    target : float
        Centre of the target along the board [m].
    left, right : float or None
        Height of the left and right hand; None if hidden [m].
    """

    time: float
    phase: str
    z: float
    theta: float
    p: float | None
    target: float
    left: float | None
    right: float | None


@dataclass(frozen=True, slots=True)
class Percept:
    """What is perceived of a `Glimpse`.

    Attributes
    ----------
    glimpse : Glimpse
        The glimpse shown one visual delay ago.
    theta : float
        Perceived tilt [rad].
    p : float
        Perceived ball position; 0 without a ball [m].
    v : float
        Perceived ball velocity; 0 while the ball is fixed [m/s].
    """

    glimpse: Glimpse
    theta: float
    p: float
    v: float


class Wander:
    """Coloured Gaussian noise (Ornstein-Uhlenbeck).

    Parameters
    ----------
    deviation : float
        Standard deviation, in the unit of the quantity that the noise is added to.
    time : float
        Correlation time [s].
    rng : numpy.random.Generator
        Source of randomness.
    """

    def __init__(self, deviation: float, time: float, rng: np.random.Generator) -> None:
        self._deviation = deviation
        self._time = time
        self._rng = rng
        self.value = deviation * float(rng.standard_normal())

    def step(self, dt: float) -> float:
        """Advance the noise in time.

        Parameters
        ----------
        dt : float
            Elapsed time [s].

        Returns
        -------
        float
            New value [unit of the deviation].
        """
        keep = exp(-dt / self._time)
        kick = self._deviation * sqrt(1.0 - keep * keep)
        self.value = keep * self.value + kick * float(self._rng.standard_normal())
        return self.value


class Senses:
    """Vision and force perception of one simulated participant.

    Parameters
    ----------
    person : Participant
        Delays and noise of the participant.
    rng : numpy.random.Generator
        Source of the noise.
    """

    def __init__(self, person: Participant, rng: np.random.Generator) -> None:
        self._person = person
        self._seen: deque[Glimpse] = deque()
        self._felt: deque[tuple[float, float]] = deque()
        self._p = Wander(person.position_noise, NOISE_TIME, rng)
        self._v = Wander(person.velocity_noise, NOISE_TIME, rng)
        self._theta = Wander(float(np.radians(person.tilt_noise_deg)), NOISE_TIME, rng)

    def take(self, now: float, glimpse: Glimpse | None, felt: float | None) -> None:
        """Store what the display shows and what the hand feels now.

        Parameters
        ----------
        now : float
            Present time [s].
        glimpse : Glimpse or None
            Newest glimpse; None if nothing has been displayed yet.
        felt : float or None
            Vertical force on the participant's hand, + = up; None without haptic feedback [N].
        """
        if glimpse is not None and (not self._seen or glimpse.time > self._seen[-1].time):
            self._seen.append(glimpse)
        if felt is None:
            self._felt.clear()
        else:
            self._felt.append((now, felt))
        while self._seen and self._seen[0].time < now - MEMORY and len(self._seen) > 1:
            self._seen.popleft()
        while self._felt and self._felt[0][0] < now - MEMORY:
            self._felt.popleft()

    def look(self, now: float, dt: float) -> Percept | None:
        """Return what is perceived of the display now.

        Parameters
        ----------
        now : float
            Present time [s].
        dt : float
            Time since the last call [s].

        Returns
        -------
        Percept or None
            Percept of the glimpse shown one visual delay ago; None if there was none.
        """
        dp, dv, dtheta = self._p.step(dt), self._v.step(dt), self._theta.step(dt)
        reached = self._reached(now - self._person.visual_delay)
        if not reached:
            return None
        g = reached[0]
        if g.p is None:
            return Percept(g, g.theta + dtheta, 0.0, 0.0)
        if g.phase not in BALL_FREE:
            return Percept(g, g.theta + dtheta, g.p + dp, 0.0)
        return Percept(g, g.theta + dtheta, g.p + dp, _velocity(reached) + dv)

    def force(self, when: float) -> float | None:
        """Return the force on the participant's hand at a time in the past.

        Parameters
        ----------
        when : float
            A time at least one haptic delay ago [s].

        Returns
        -------
        float or None
            Force on the hand, + = up; None if none was rendered then [N].
        """
        for time, felt in reversed(self._felt):
            if time <= when:
                return felt
        return None

    def _reached(self, until: float) -> list[Glimpse]:
        """Return the glimpses up to a time, as far back as `VELOCITY_SPAN` before the newest, newest first."""
        reached: list[Glimpse] = []
        for g in reversed(self._seen):
            if g.time <= until:
                if reached and reached[0].time - g.time > VELOCITY_SPAN:
                    break
                reached.append(g)
        return reached


def _velocity(seen: list[Glimpse]) -> float:
    """Return the velocity of the free ball from its last positions, newest first; 0 with only one [m/s]."""
    last = seen[0]
    first = last
    for g in seen:
        if g.phase not in BALL_FREE:
            break
        first = g
    if first.p is None or last.p is None or last.time <= first.time:
        return 0.0
    return (last.p - first.p) / (last.time - first.time)
