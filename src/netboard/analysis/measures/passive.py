"""Passive-partner control: how much of an effect of haptic feedback is mechanics rather than communication.

A rendered force also pushes. When one side goes up, the board's spring and the virtual couplings push the other hand
down: 1.5 mm for every 10 mm, for a hand of 150 N/m in the paper's scene. That is movement in opposite directions, and
the paper's rule calls it cooperative. Before such movement is taken for communication, compare it with that of a
passive partner: a mass, a damper and a spring.

Rule 1: the scene's action on a hand enters only as gains or as a callable.
Rule 2: the passive part is not the whole effect of touch on a movement; it is the part that needs no perception.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import ceil
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import cont2discrete, lfilter

from netboard.base.compiled import kernel

Side = Literal["left", "right"]
Respond = Callable[[NDArray[np.float64], NDArray[np.float64], Side], NDArray[np.float64]]
"""Function of the active stylus's height, ball position and passive side; returns the passive stylus's height."""
Measure = Callable[[NDArray[np.float64], NDArray[np.float64]], float]
"""Function of the heights of the left and right stylus in a trial; returns the compared quantity."""


MAX_STEP = 0.25e-3
"""Largest integration step for a hand with friction, the same as for simulated participants [s]."""


@dataclass(frozen=True, slots=True)
class PassiveHand:
    """Passive hand: it holds a stylus and never acts.

    Attributes
    ----------
    mass : float
        Mass of arm and device [kg].
    damping : float
        Damping of arm and device [N s/m].
    stiffness : float
        Stiffness towards the held position [N/m].
    friction : float
        Coulomb friction of the device [N].
    """

    mass: float = 0.5
    damping: float = 8.0
    stiffness: float = 150.0
    friction: float = 0.0

    def __post_init__(self) -> None:
        if not (self.mass > 0.0 and min(self.damping, self.stiffness, self.friction) >= 0.0):
            raise ValueError(f"expected a mass above 0, and damping, stiffness and friction of 0 or more; found {self}")

    def holding(self, mass: float, damping: float, friction: float) -> "PassiveHand":
        """Return the same arm holding a device.

        Parameters
        ----------
        mass : float
            Apparent mass of the device [kg].
        damping : float
            Viscous damping of the device [N s/m].
        friction : float
            Coulomb friction of the device [N].
        """
        return PassiveHand(self.mass + mass, self.damping + damping, self.stiffness, self.friction + friction)


class Gains(NamedTuple):
    """Gains of the static force of one hand on the board, as in `netboard.physics.scene.rendering.GAINS`.

    Attributes
    ----------
    own, partner : float
        Gain of the height of the hand's own stylus and of the partner's [N/m].
    ball : float
        Gain of the ball position along the board [N/m].
    """

    own: float
    partner: float
    ball: float


class Heights(NamedTuple):
    """Recorded positions of both styluses and the ball in one trial.

    Attributes
    ----------
    left, right : ndarray of float64, shape (n,)
        Heights of the styluses [m].
    p : ndarray of float64, shape (n,)
        Ball position along the board [m].
    """

    left: NDArray[np.float64]
    right: NDArray[np.float64]
    p: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PassiveControl:
    """Effect of haptic feedback, and its passive part.

    Attributes
    ----------
    effect : ndarray of float64, shape (n,)
        Measure with haptic feedback minus measure without, for each dyad [unit of the measure].
    passive : ndarray of float64, shape (n,)
        Measure of active and passive hand minus measure of active and still hand, for each dyad [unit of the measure].
    share : float
        Sum of the passive effects divided by the sum of the effects: 1 = all is mechanics; NaN without an effect [1].
    n : int
        Number of units of replication [1].
    unit : str
        Name of that unit.
    """

    effect: NDArray[np.float64]
    passive: NDArray[np.float64]
    share: float
    n: int
    unit: str


def driven(force: ArrayLike, rate: float, hand: PassiveHand) -> NDArray[np.float64]:
    """Return a passive hand's height relative to its start: ``m z'' + b z' + k z + friction = F - F(0)`` [m].

    For the rendered force the result is the passive part of the recorded movement. The rest is voluntary, as far as the
    arm is linear and its stiffness known. Part of the rendered force answers the hand's own movement; `passive_partner`
    includes only the force from elsewhere.

    Parameters
    ----------
    force : array_like, shape (n,)
        Force on the hand, + = up; linear between samples [N].
    """
    f = np.asarray(force, dtype=float)
    if not len(f):
        return f
    if hand.friction > 0.0:
        parts = max(1, ceil(1.0 / (rate * MAX_STEP)))
        step = 1.0 / (rate * parts)
        return np.asarray(_rubbed(f - f[0], parts, step, hand.mass, hand.damping, hand.stiffness, hand.friction))
    above, below = _discretised(hand, rate)
    return np.asarray(lfilter(above, below, f - f[0]))


@kernel
def _rubbed(
    force: NDArray[np.float64], parts: int, step: float, mass: float, damping: float, stiffness: float, friction: float
) -> NDArray[np.float64]:
    """Integrate a hand with Coulomb friction; damping and friction are implicit (Moreau), so a held hand is at rest.

    `netboard.participants.body.stylus` has the same rule. After a missing sample all values are NaN.
    """
    heights = np.zeros(len(force))
    z, v = 0.0, 0.0
    grip = step * friction / mass
    for i in range(1, len(force)):
        if not np.isfinite(force[i]) or not np.isfinite(force[i - 1]):
            heights[i:] = np.nan
            return heights
        for part in range(1, parts + 1):
            push = force[i - 1] + (force[i] - force[i - 1]) * part / parts - stiffness * z
            v += step * push / mass
            v = max(v - grip, 0.0) if v > 0.0 else min(v + grip, 0.0)
            v /= 1.0 + step * damping / mass
            z += step * v
        heights[i] = z
    return heights


@lru_cache(maxsize=256)
def _discretised(hand: PassiveHand, rate: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the filter from force to height; cached, because its design takes longer than filtering a trial."""
    above, below, _ = cont2discrete(([1.0], [hand.mass, hand.damping, hand.stiffness]), 1.0 / rate, method="foh")
    above, below = np.ravel(above), np.asarray(below)
    above.flags.writeable = below.flags.writeable = False
    return above, below


def passive_partner(
    active: ArrayLike, p: ArrayLike, rate: float, hand: PassiveHand, gains: Gains
) -> NDArray[np.float64]:
    """Return the height of a passive hand relative to its start, moved by partner and ball through haptic feedback [m].

    The board is taken to be in static equilibrium between the hands, which it reaches within about 10 ms. A hand
    without friction gives an upper bound: device friction (0.26 N for a Touch) suppresses most of this movement.

    Parameters
    ----------
    active : array_like, shape (n,)
        Height of the partner's stylus [m].
    gains : Gains
        Gains of its side.
    """
    push = -gains.partner * np.asarray(active, dtype=float) - gains.ball * np.asarray(p, dtype=float)
    return driven(push, rate, replace(hand, stiffness=hand.stiffness + gains.own))


def linear_partner(rate: float, hand: PassiveHand, left: Gains, right: Gains) -> Respond:
    """Return a passive partner for `passive_control`, based on `passive_partner`.

    Parameters
    ----------
    left, right : Gains
        Gains of the board that each hand feels.
    """

    def respond(active: NDArray[np.float64], p: NDArray[np.float64], side: Side) -> NDArray[np.float64]:
        return passive_partner(active, p, rate, hand, left if side == "left" else right)

    return respond


def passive_control(
    with_forces: Sequence[Sequence[Heights]],
    without: Sequence[Sequence[Heights]],
    respond: Respond,
    measure: Measure,
    *,
    unit: str = "dyad",
) -> PassiveControl:
    """Compare the effect of haptic feedback with its effect on a passive partner.

    In each trial with haptic feedback each side in turn keeps its recorded movement, and the other side is replaced
    twice: by the passive partner and by a motionless partner, which is what a passive partner is without haptic
    feedback. The passive effect is the difference of the measure between the two. For a confidence interval of the
    share, use `netboard.analysis.statistics.estimates.bootstrap` with `ratio_of_sums` of `passive` and `effect`.

    Parameters
    ----------
    with_forces, without : sequence of sequence of Heights
        Trials of each dyad with and without haptic feedback, at least one of each kind.
    respond : callable
        Passive partner: a function of the active stylus's height, the ball position and the passive side; returns a
        height.
    measure : callable
        Function of the heights of the left and right stylus, for example the share of cooperative movement.
    """
    if len(with_forces) != len(without) or not all(map(len, [*with_forces, *without])):
        raise ValueError(
            "expected trials with and without haptic feedback in each dyad; found dyads that lack one of them"
        )
    live = np.array([[_mean_of(trials, measure) for trials in kind] for kind in (with_forces, without)])
    effect = live[0] - live[1]
    passive = np.array([np.mean([_passive(trial, respond, measure) for trial in trials]) for trials in with_forces])
    total = float(effect.sum())
    return PassiveControl(effect, passive, float(passive.sum()) / total if total else np.nan, len(effect), unit)


def _mean_of(trials: Sequence[Heights], measure: Measure) -> float:
    return float(np.mean([measure(trial.left, trial.right) for trial in trials]))


def _passive(trial: Heights, respond: Respond, measure: Measure) -> float:
    """Return the effect of haptic feedback on a passive partner, averaged over both sides."""
    still = np.zeros_like(trial.p)
    of_right = measure(trial.left, respond(trial.left, trial.p, "right")) - measure(trial.left, still)
    of_left = measure(respond(trial.right, trial.p, "left"), trial.right) - measure(still, trial.right)
    return 0.5 * (of_right + of_left)
