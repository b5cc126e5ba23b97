"""What a simulated person perceives: the display and the own force, late and noisy.

Rule 1: nothing enters but what the station's display was sent (`Glimpse`) and what the own device rendered.
Rule 2: what happened after ``now - delay`` is not known yet.
Rule 3: the ball's velocity is not shown; it is estimated from what was seen of its position.
"""

from collections import deque
from dataclasses import dataclass
from math import exp, sqrt

import numpy as np

from netboard.base.tables.simulated import Participant

NOISE_TIME = 0.2
"""Correlation time of perceptual noise [s]."""

VELOCITY_SPAN = 0.05
"""The ball's velocity is judged over this time [s]."""

MEMORY = 1.0
"""Older impressions are forgotten [s]."""

BALL_FREE = ("running", "holding")
"""Phases in which the ball rolls, as a display names them."""


@dataclass(frozen=True, slots=True)
class Glimpse:
    """What a station's display shows at one moment.

    Attributes
    ----------
    time : float
        When it was shown [s].
    phase : str
        Name of the trial's phase, lower case.
    z : float
        Height of the board's centre [m].
    theta : float
        Tilt of the board, + = right end up [rad].
    p : float or None
        Ball position along the board, + = right; None without a ball [m].
    target : float
        Centre of the target along the board [m].
    left, right : float or None
        Height of the left and right hand; None where it is hidden [m].
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
        What was shown, one visual delay ago.
    theta : float
        Perceived tilt [rad].
    p : float
        Perceived ball position, 0 without a ball [m].
    v : float
        Perceived ball velocity, 0 while the ball is fixed [m/s].
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
        Standard deviation, in the unit of what it is added to.
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
        """Let time pass.

        Parameters
        ----------
        dt : float
            How much time [s].

        Returns
        -------
        float
            The new value [unit of the deviation].
        """
        keep = exp(-dt / self._time)
        kick = self._deviation * sqrt(1.0 - keep * keep)
        self.value = keep * self.value + kick * float(self._rng.standard_normal())
        return self.value


class Senses:
    """Eyes and the sense of force of one person.

    Parameters
    ----------
    person : Participant
        Delays and noise.
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
        """Remember what the display shows and the hand feels now.

        Parameters
        ----------
        now : float
            The time [s].
        glimpse : Glimpse or None
            Newest glimpse, None if nothing has been shown yet.
        felt : float or None
            Vertical force on the own hand, + = up; None where no force is rendered [N].
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
        """Perceive the display.

        Parameters
        ----------
        now : float
            The time [s].
        dt : float
            Time since the last look [s].

        Returns
        -------
        Percept or None
            What was shown one visual delay ago; None if nothing was.
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
        """Force on the own hand at a time in the past; None if none was rendered then.

        Parameters
        ----------
        when : float
            A time at least one haptic delay ago [s].

        Returns
        -------
        float or None
            Force on the hand, + = up [N].
        """
        for time, felt in reversed(self._felt):
            if time <= when:
                return felt
        return None

    def _reached(self, until: float) -> list[Glimpse]:
        """Return what was shown by a time and at most `VELOCITY_SPAN` before the newest of that, newest first."""
        reached: list[Glimpse] = []
        for g in reversed(self._seen):
            if g.time <= until:
                if reached and reached[0].time - g.time > VELOCITY_SPAN:
                    break
                reached.append(g)
        return reached


def _velocity(seen: list[Glimpse]) -> float:
    """Velocity of the free ball from its last positions, newest first [m/s]; 0 as long as there is only one."""
    last = seen[0]
    first = last
    for g in seen:
        if g.phase not in BALL_FREE:
            break
        first = g
    if first.p is None or last.p is None or last.time <= first.time:
        return 0.0
    return (last.p - first.p) / (last.time - first.time)
