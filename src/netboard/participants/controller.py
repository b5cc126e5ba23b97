"""Controller of a simulated participant: an intermittent, predictive, delayed PD controller of the ball.

Every 10 ms the controller takes the ball as it was one visual delay ago, extrapolates it, and computes the tilt that
would bring it to rest in the target. It acts only if the expected tilt differs from this by more than a threshold and
the refractory time has passed. The action is one ballistic submovement of each own hand, which tilts the board and
moves it towards its neutral height. With one hand, the controller expects the partner to mirror most of its tilting and
to share its lifting, unless the force on its hand shows otherwise. In a bimanual block it moves both hands.

Rule 1: the inputs are `Glimpse`, the force on its own hand, and the constants of the scene; nothing else.
Rule 2: time is an argument and the random generator is passed in, so that results are reproducible.
"""

from dataclasses import dataclass
from math import radians

import numpy as np

from netboard.base.config import Side
from netboard.base.tables.experiment import Task
from netboard.base.tables.scene import Physics
from netboard.base.tables.simulated import Participant
from netboard.participants.partner import SIGN, partner_height, partner_seen
from netboard.participants.senses import BALL_FREE, Glimpse, Percept, Senses, Wander
from netboard.participants.submovement import Submovement

THINK_EVERY = 0.010
"""Interval between two decisions [s]."""

FELT_AHEAD = 0.100
"""Horizon over which the partner's height is extrapolated from the force [s]."""

FELT_SPAN = 0.030
"""Window over which the partner's velocity is estimated [s]."""

TOUCH_TIME = 0.5
"""Correlation time of the error of a height inferred from force [s]."""

MIRROR = 0.65
"""Share of one's own tilting that one expects the partner to mirror [1]. With a share of 1, two participants who
disagree about the tilt would oscillate for ever, because each takes back what the other did not mirror."""

REACTION_CV = 0.2
"""Coefficient of variation of the reaction time [1]."""

FORESIGHT_STEPS = 6
"""Number of integration steps of the ball's prediction [1]."""

LARGEST_THRESHOLD = 0.95
"""Largest threshold, as a share of the largest commanded tilt [1]. Without this limit, about one drawn threshold in two
thousand could never be exceeded. As only an action draws a new one, the participant would never act again."""

LEVEL_MARGIN = 0.7
"""Share of the levelling limits above which a participant corrects tilt or height [1]."""


@dataclass(frozen=True, slots=True)
class _Intent:
    """An intended submovement: its expected effect until it becomes visible.

    Attributes
    ----------
    move : Submovement
        The movement without motor noise.
    turn : float
        Part of the displacement that tilts the board; the rest lifts it [m].
    echo : float
        Expected displacement of the partner's hand in the opposite direction, which tilts the board too [m].
    """

    move: Submovement
    turn: float
    echo: float


class Brain:
    """Controller of one simulated participant.

    Parameters
    ----------
    person : Participant
        Parameters of the participant.
    physics : Physics
        Constants of the scene, which the participant knows.
    task : Task
        Rules of the task, which the participant knows.
    sides : tuple of {"left", "right"}
        Hands of the participant: one in a dyad, both in a bimanual block.
    rng : numpy.random.Generator
        Source of the participant's variability.
    """

    def __init__(
        self,
        person: Participant,
        physics: Physics,
        task: Task,
        sides: tuple[Side, ...],
        rng: np.random.Generator,
    ) -> None:
        if not sides or len(set(sides)) != len(sides):
            raise ValueError(f"a brain moves one hand or two different ones, not {sides}")
        self._person = person
        self._physics = physics
        self._task = task
        self._sides = sides
        self._rng = rng
        self._senses = Senses(person, rng)
        self._touch = Wander(person.haptic_noise, TOUCH_TIME, rng)
        self._intents: list[_Intent] = []
        self._thought = -np.inf
        self._ready = -np.inf
        self._threshold = self._draw_threshold()
        self._phase = ""

    def step(self, now: float, glimpse: Glimpse | None, felt: float | None) -> tuple[Submovement, ...]:
        """Run `think` if `THINK_EVERY` has passed since the last decision; may be called at any rate.

        Parameters
        ----------
        now : float
            Present time [s].
        glimpse : Glimpse or None
            Newest glimpse of the participant's own display; None before the first.
        felt : float or None
            Vertical force on the participant's hand, + = up; None without haptic feedback, and with two hands [N].

        Returns
        -------
        tuple of Submovement
            New submovements; empty most of the time.
        """
        return () if now - self._thought < THINK_EVERY else self.think(now, glimpse, felt)

    def think(self, now: float, glimpse: Glimpse | None, felt: float | None) -> tuple[Submovement, ...]:
        """Take in display and force, and decide. The caller keeps the interval `THINK_EVERY` between two calls.

        Parameters
        ----------
        now : float
            Present time, later than in the previous call [s].
        glimpse : Glimpse or None
            Newest glimpse of the participant's own display; None before the first.
        felt : float or None
            Vertical force on the participant's hand, + = up; None without haptic feedback, and with two hands [N].

        Returns
        -------
        tuple of Submovement
            New submovements; empty most of the time.
        """
        dt = min(now - self._thought, 1.0)
        self._thought = now
        self._senses.take(now, glimpse, felt)
        self._touch.step(dt)
        seen = self._senses.look(now, dt)
        if seen is None:
            return ()
        self._notice(seen)
        self._intents = [i for i in self._intents if i.move.progress(seen.glimpse.time - self._lag) < 1.0]
        if now < self._ready:
            return ()
        match seen.glimpse.phase:
            case "levelling":
                return self._level(now, seen)
            case "running" | "holding":
                return self._play(now, seen)
            case _:
                return ()

    @property
    def _lag(self) -> float:
        """Delay from a planned movement to the hand: two muscle lags and the lag of the arm [s]."""
        p = self._person
        return 2.0 * p.muscle_lag + p.arm_damping / p.arm_stiffness

    def _notice(self, seen: Percept) -> None:
        """Wait for a reaction time once the release of the ball is seen."""
        phase = seen.glimpse.phase
        if phase in BALL_FREE and self._phase not in BALL_FREE:
            p = self._person
            reaction = p.reaction_time * max(0.0, 1.0 + REACTION_CV * float(self._rng.standard_normal()))
            self._ready = seen.glimpse.time + reaction
        self._phase = phase

    def _draw_threshold(self) -> float:
        """Draw the tilt error that triggers the next submovement: log-normal, limited by `LARGEST_THRESHOLD` [rad]."""
        p = self._person
        spread = float(np.sqrt(np.log1p(p.threshold_cv**2)))
        drawn = p.threshold_deg * float(np.exp(spread * self._rng.standard_normal()))
        return radians(min(drawn, LARGEST_THRESHOLD * p.max_tilt_deg))

    def _play(self, now: float, seen: Percept) -> tuple[Submovement, ...]:
        """Return the submovements that steer the ball; none if the tilt error is below the threshold."""
        expected = self._expected_tilt(now, seen)
        error = self._wanted_tilt(seen, expected) - expected
        if abs(error) <= self._threshold:
            return ()
        lift = -self._person.centring * self._height(seen)
        return self._act(now, error, lift)

    def _wanted_tilt(self, seen: Percept, expected: float) -> float:
        """Return the tilt that takes the predicted ball to the target: the PD law [rad]."""
        p, g = self._person, self._physics.g
        if g == 0.0:
            return 0.0
        ball, speed = self._foresee(seen, expected)
        most = radians(p.max_tilt_deg)
        return min(max((p.kp * (ball - seen.glimpse.target) + p.kd * speed) / g, -most), most)

    def _foresee(self, seen: Percept, expected: float) -> tuple[float, float]:
        """Predict the ball `lookahead` visual delays after it was seen, without new actions [m, m/s]."""
        p = self._person
        dt = p.lookahead * p.visual_delay / FORESIGHT_STEPS
        ball, speed = seen.p, seen.v
        for k in range(FORESIGHT_STEPS):
            share = self._share_done(seen, seen.glimpse.time + (k + 0.5) * dt)
            pull = -self._physics.g * (seen.theta + share * (expected - seen.theta))
            ball += speed * dt + pull * dt * dt / 2.0
            speed += pull * dt
        return ball, speed

    def _share_done(self, seen: Percept, when: float) -> float:
        """Return the share, done at `when`, of the tilt change under way when seen; from own hands only [1]."""
        shown = seen.glimpse.time - self._lag
        moves = [(abs(i.turn), i.move) for i in self._intents]
        going = [(size, m.progress(shown), m.progress(when - self._lag)) for size, m in moves]
        left = sum(size * (1.0 - before) for size, before, _ in going)
        return sum(size * (then - before) for size, before, then in going) / left if left > 0.0 else 1.0

    def _expected_tilt(self, now: float, seen: Percept) -> float:
        """Return the tilt of the board once all movements under way are complete [rad]."""
        lever = 2.0 * self._physics.l
        own = {side: self._under_way(side, seen) for side in self._sides}
        tilt = seen.theta + sum(SIGN[side] * rise for side, rise in own.items()) / lever
        if len(self._sides) == 2:
            return tilt
        (side,) = self._sides
        when = seen.glimpse.time - self._lag
        echo = sum(i.echo * (1.0 - i.move.progress(when)) for i in self._intents)
        likely = own[side] - self._turning(side, seen) - echo
        other = self._other_rise(now, seen, side, likely)
        return tilt - SIGN[side] * other / lever

    def _under_way(self, side: Side, seen: Percept) -> float:
        """Return the remaining displacement of an own hand from where it was seen [m]."""
        when = seen.glimpse.time - self._lag
        moves = [i.move for i in self._intents if i.move.side == side]
        return sum(m.displacement * (1.0 - m.progress(when)) for m in moves)

    def _turning(self, side: Side, seen: Percept) -> float:
        """Return the part of this displacement that tilts the board; the rest lifts it [m]."""
        when = seen.glimpse.time - self._lag
        return sum(i.turn * (1.0 - i.move.progress(when)) for i in self._intents if i.move.side == side)

    def _other_rise(self, now: float, seen: Percept, side: Side, guess: float) -> float:
        """Estimate the displacement of the partner's hand since it was seen: a guess, corrected by the force [m]."""
        p, physics = self._person, self._physics
        then = now - p.haptic_delay
        late, early = self._senses.force(then), self._senses.force(then - FELT_SPAN)
        if late is None or early is None or p.haptic_gain == 0.0 or physics.k_s == 0.0:
            return guess
        shown = self._own_height(seen, side)
        if shown is None:
            return guess
        heights = []
        for when, force in ((then - FELT_SPAN, early), (then, late)):
            own = shown + self._moved(side, seen, when)
            ball = seen.p + seen.v * (when - seen.glimpse.time)
            heights.append(partner_height(force, own, ball, side, physics))
        rate = (heights[1] - heights[0]) / FELT_SPAN
        felt = heights[1] + rate * FELT_AHEAD + self._touch.value
        rise = felt - partner_seen(shown, seen.theta, side, physics)
        return (1.0 - p.haptic_gain) * guess + p.haptic_gain * rise

    def _moved(self, side: Side, seen: Percept, when: float) -> float:
        """Return the displacement of an own hand from where it was seen to a later time [m]."""
        shown = seen.glimpse.time - self._lag
        moves = [i.move for i in self._intents if i.move.side == side]
        return sum(m.displacement * (m.progress(when - self._lag) - m.progress(shown)) for m in moves)

    @staticmethod
    def _own_height(seen: Percept, side: Side) -> float | None:
        """Return the height of an own hand as seen [m]."""
        return seen.glimpse.left if side == "left" else seen.glimpse.right

    def _height(self, seen: Percept) -> float:
        """Return the height of the board's centre after the lifting under way, if all hands lift alike [m]."""
        heights = []
        for side in self._sides:
            shown = self._own_height(seen, side)
            if shown is not None:
                lifting = self._under_way(side, seen) - self._turning(side, seen)
                heights.append(shown - SIGN[side] * self._physics.l * seen.theta + lifting)
        return sum(heights) / len(heights) if heights else seen.glimpse.z

    def _level(self, now: float, seen: Percept) -> tuple[Submovement, ...]:
        """Return the submovements that level the board at its neutral height; none if it is level."""
        task = self._task
        error = -self._expected_tilt(now, seen)
        height = self._height(seen)
        tilted = abs(error) > LEVEL_MARGIN * radians(task.level_angle_deg)
        off = abs(height) > LEVEL_MARGIN * task.level_height
        if not tilted and not off:
            return ()
        moves = self._act(now, error if tilted else 0.0, -height if off else 0.0)
        self._ready = now + moves[-1].duration + self._lag + self._person.visual_delay
        return moves

    def _act(self, now: float, turn: float, lift: float) -> tuple[Submovement, ...]:
        """Return one submovement of each own hand that tilts and lifts the board [rad, m]."""
        p = self._person
        self._threshold = self._draw_threshold()
        duration = p.movement_time * float(np.exp(p.movement_cv * self._rng.standard_normal()))
        scale = 1.0 + p.amplitude_cv * float(self._rng.standard_normal())
        both = len(self._sides) == 2
        late = self._rng.choice(self._sides) if both else ""
        wait = abs(p.bimanual_async * float(self._rng.standard_normal())) if both else 0.0
        uneven = p.bimanual_amplitude_cv / 2.0 * float(self._rng.standard_normal()) if both else 0.0
        trust = float(np.clip(p.partner_noise * self._rng.standard_normal(), -1.0, 1.0))
        moves = []
        for side in self._sides:
            share = SIGN[side] * self._physics.l * turn
            start = now + (wait if side == late else 0.0)
            echo = MIRROR * share * (1.0 + trust)
            self._intents.append(_Intent(Submovement(side, start, duration, share + lift), share, echo))
            moves.append(Submovement(side, start, duration, (share + lift) * scale * (1.0 + SIGN[side] * uneven)))
        self._ready = now + p.refractory
        return tuple(moves)
