"""The controller of a simulated person: an intermittent, predictive, delayed PD controller of the ball.

Every 10 ms the brain looks one visual delay into the past, extrapolates the ball, and asks which tilt would bring it to
rest in the target. It acts only where the tilt it expects anyway is off by more than a threshold and a refractory time
has passed, and then by one ballistic submovement of each own hand, which turns the board and lifts it towards its
neutral height. A brain with one hand expects its partner to mirror most of its turning and to share its lifting, unless
the force on its hand says otherwise; a brain with both hands moves both.

Rule 1: the brain sees `Glimpse`, feels its own force, and knows the scene's constants; nothing else.
Rule 2: time is an argument and randomness comes from the generator handed in, so a brain can be repeated.
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
"""Time between two decisions [s]."""

FELT_AHEAD = 0.100
"""The partner's height is extrapolated over this time from what was felt [s]."""

FELT_SPAN = 0.030
"""The partner's velocity is judged over this time [s]."""

TOUCH_TIME = 0.5
"""Correlation time of the error of a height that is inferred from a force [s]."""

MIRROR = 0.65
"""Share of one's own turning that one expects of the partner. With all of it two people who disagree about the tilt
would answer each other's absence for ever: each takes back what the other did not mirror [1]."""

REACTION_CV = 0.2
"""Variability of the reaction time [1]."""

FORESIGHT_STEPS = 6
"""Steps in which the ball's way is thought ahead [1]."""

LARGEST_THRESHOLD = 0.95
"""No threshold is more than this share of the largest tilt asked for. One in some two thousand would be so large that
no tilt is ever off by more, and it is drawn anew only by acting: the person would watch ball after ball fall [1]."""

LEVEL_MARGIN = 0.7
"""When levelling, a person corrects what is off by more than this share of the limit [1]."""


@dataclass(frozen=True, slots=True)
class _Intent:
    """A submovement as it was meant: what the brain expects of it until it is seen.

    Attributes
    ----------
    move : Submovement
        The movement, without the noise of its execution.
    turn : float
        The part of its displacement that turns the board; the rest lifts it [m].
    echo : float
        How far the partner's hand is thought to go the other way to turn the board too [m].
    """

    move: Submovement
    turn: float
    echo: float


class Brain:
    """One person's controller.

    Parameters
    ----------
    person : Participant
        The person's parameters.
    physics : Physics
        The scene, as the person has got to know it.
    task : Task
        The rules, as the person has been told them.
    sides : tuple of {"left", "right"}
        The hands of this person: one in a dyad, both in a bimanual block.
    rng : numpy.random.Generator
        Source of the person's variability.
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
        """Look, feel, and perhaps decide; may be called as often as one likes.

        Parameters
        ----------
        now : float
            The time [s].
        glimpse : Glimpse or None
            The newest glimpse of the own display, None before the first.
        felt : float or None
            Vertical force on the own hand, + = up; None where no force is rendered, and with two hands [N].

        Returns
        -------
        tuple of Submovement
            What to do, empty most of the time.
        """
        return () if now - self._thought < THINK_EVERY else self.think(now, glimpse, felt)

    def think(self, now: float, glimpse: Glimpse | None, felt: float | None) -> tuple[Submovement, ...]:
        """Do the same now: for whoever keeps the time between two decisions, `THINK_EVERY`, by itself.

        Parameters
        ----------
        now : float
            The time, later than that of the decision before [s].
        glimpse : Glimpse or None
            The newest glimpse of the own display, None before the first.
        felt : float or None
            Vertical force on the own hand, + = up; None where no force is rendered, and with two hands [N].

        Returns
        -------
        tuple of Submovement
            What to do, empty most of the time.
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
        """Time by which a hand follows what is asked of it: both muscle lags and the arm's own [s]."""
        p = self._person
        return 2.0 * p.muscle_lag + p.arm_damping / p.arm_stiffness

    def _notice(self, seen: Percept) -> None:
        """Take a reaction time when the ball is seen to be released."""
        phase = seen.glimpse.phase
        if phase in BALL_FREE and self._phase not in BALL_FREE:
            p = self._person
            reaction = p.reaction_time * max(0.0, 1.0 + REACTION_CV * float(self._rng.standard_normal()))
            self._ready = seen.glimpse.time + reaction
        self._phase = phase

    def _draw_threshold(self) -> float:
        """Tilt error that triggers the next submovement; log-normal, but never too large to be reached [rad]."""
        p = self._person
        spread = float(np.sqrt(np.log1p(p.threshold_cv**2)))
        drawn = p.threshold_deg * float(np.exp(spread * self._rng.standard_normal()))
        return radians(min(drawn, LARGEST_THRESHOLD * p.max_tilt_deg))

    def _play(self, now: float, seen: Percept) -> tuple[Submovement, ...]:
        """Steer the ball."""
        expected = self._expected_tilt(now, seen)
        error = self._wanted_tilt(seen, expected) - expected
        if abs(error) <= self._threshold:
            return ()
        lift = -self._person.centring * self._height(seen)
        return self._act(now, error, lift)

    def _wanted_tilt(self, seen: Percept, expected: float) -> float:
        """Tilt that takes the predicted ball to the target [rad]."""
        p, g = self._person, self._physics.g
        if g == 0.0:
            return 0.0
        ball, speed = self._foresee(seen, expected)
        most = radians(p.max_tilt_deg)
        return min(max((p.kp * (ball - seen.glimpse.target) + p.kd * speed) / g, -most), most)

    def _foresee(self, seen: Percept, expected: float) -> tuple[float, float]:
        """Position and velocity of the ball `lookahead` visual delays after it was seen, if nothing new is done."""
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
        """Share of the change of tilt under way when seen that is done at a later time, judged by the own hands [1]."""
        shown = seen.glimpse.time - self._lag
        moves = [(abs(i.turn), i.move) for i in self._intents]
        going = [(size, m.progress(shown), m.progress(when - self._lag)) for size, m in moves]
        left = sum(size * (1.0 - before) for size, before, _ in going)
        return sum(size * (then - before) for size, before, then in going) / left if left > 0.0 else 1.0

    def _expected_tilt(self, now: float, seen: Percept) -> float:
        """Tilt the board will have when all that is under way is done [rad]."""
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
        """How far an own hand will still move from where it was seen [m]."""
        when = seen.glimpse.time - self._lag
        moves = [i.move for i in self._intents if i.move.side == side]
        return sum(m.displacement * (1.0 - m.progress(when)) for m in moves)

    def _turning(self, side: Side, seen: Percept) -> float:
        """The part of that movement that is meant to turn the board; the rest is meant to lift it [m]."""
        when = seen.glimpse.time - self._lag
        return sum(i.turn * (1.0 - i.move.progress(when)) for i in self._intents if i.move.side == side)

    def _other_rise(self, now: float, seen: Percept, side: Side, guess: float) -> float:
        """How far the partner's hand will have moved from where it was seen: a guess, corrected by what is felt [m]."""
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
        """How far an own hand has moved from where it was seen to where it was at a later time [m]."""
        shown = seen.glimpse.time - self._lag
        moves = [i.move for i in self._intents if i.move.side == side]
        return sum(m.displacement * (m.progress(when - self._lag) - m.progress(shown)) for m in moves)

    @staticmethod
    def _own_height(seen: Percept, side: Side) -> float | None:
        """Height of an own hand as seen [m]."""
        return seen.glimpse.left if side == "left" else seen.glimpse.right

    def _height(self, seen: Percept) -> float:
        """Height of the middle between the hands when the lifting under way is done, by all hands alike [m]."""
        heights = []
        for side in self._sides:
            shown = self._own_height(seen, side)
            if shown is not None:
                lifting = self._under_way(side, seen) - self._turning(side, seen)
                heights.append(shown - SIGN[side] * self._physics.l * seen.theta + lifting)
        return sum(heights) / len(heights) if heights else seen.glimpse.z

    def _level(self, now: float, seen: Percept) -> tuple[Submovement, ...]:
        """Make the board horizontal, at the height asked for."""
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
        """Turn and lift the board by one submovement of each own hand."""
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
