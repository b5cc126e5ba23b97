"""How much of an effect of forces is mechanics: what a partner would do who holds the stylus and never acts.

A force that is felt also pushes. When one side goes up, the board's spring and the couplings push the other hand down:
by 1.5 mm for every 10 mm, for a hand of 150 N/m in the paper's scene. That is movement in opposite directions, and by
the paper's rule it is cooperation. Before such movement is taken for communication, it is to be compared with that of
a passive partner: a mass, a damper and a spring.

Rule 1: what the scene does to a hand is known here only by gains or by a callable that is handed in.
Rule 2: a passive part is not all that touch does to a movement; it is what needs nobody who feels.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import ceil
from typing import Literal, NamedTuple

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import cont2discrete, lfilter

Side = Literal["left", "right"]
Respond = Callable[[NDArray[np.float64], NDArray[np.float64], Side], NDArray[np.float64]]
"""Takes the height of the active stylus, the ball, and the passive side; returns the height of the passive stylus."""
Measure = Callable[[NDArray[np.float64], NDArray[np.float64]], float]
"""Takes the heights of the left and of the right stylus in a trial; returns what is compared."""


LONGEST_STEP = 0.25e-3
"""A hand with friction is integrated in steps no longer than this, those of a simulated participant's [s]."""


@dataclass(frozen=True, slots=True)
class PassiveHand:
    """A hand that holds a stylus and never acts.

    Attributes
    ----------
    mass : float
        Of arm and device [kg].
    damping : float
        Of both [N s/m].
    stiffness : float
        Towards where it is held [N/m].
    friction : float
        Coulomb friction of the device [N].
    """

    mass: float = 0.5
    damping: float = 8.0
    stiffness: float = 150.0
    friction: float = 0.0

    def __post_init__(self) -> None:
        if not (self.mass > 0.0 and min(self.damping, self.stiffness, self.friction) >= 0.0):
            raise ValueError(f"a hand has a mass, and no negative damping, stiffness or friction; found {self}")

    def holding(self, mass: float, damping: float, friction: float) -> "PassiveHand":
        """Return the same arm with a device in its hand.

        Parameters
        ----------
        mass : float
            Apparent mass of the device [kg].
        damping : float
            Its viscous damping [N s/m].
        friction : float
            Its Coulomb friction [N].
        """
        return PassiveHand(self.mass + mass, self.damping + damping, self.stiffness, self.friction + friction)


class Gains(NamedTuple):
    """What makes the force of one hand on the board at rest, as in `netboard.physics.scene.rendering.GAINS`.

    Attributes
    ----------
    own, partner : float
        By the height of the own stylus and of the partner's [N/m].
    ball : float
        By the place of the ball along the board [N/m].
    """

    own: float
    partner: float
    ball: float


class Heights(NamedTuple):
    """What was recorded of one trial: where both styluses and the ball were.

    Attributes
    ----------
    left, right : ndarray of float64, shape (n,)
        Heights of the styluses [m].
    p : ndarray of float64, shape (n,)
        The ball along the board [m].
    """

    left: NDArray[np.float64]
    right: NDArray[np.float64]
    p: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PassiveControl:
    """An effect of forces beside the one that a passive partner would show.

    Attributes
    ----------
    effect : ndarray of float64, shape (n,)
        For each dyad, the measure with forces less that without [its own].
    passive : ndarray of float64, shape (n,)
        For each dyad, the measure of active and passive hand less that of an active hand and a still one [its own].
    share : float
        Sum of the passive effects over that of the effects: 1 = all is mechanics; NaN without an effect [1].
    n : int
        Units of replication [1].
    unit : str
        What they are.
    """

    effect: NDArray[np.float64]
    passive: NDArray[np.float64]
    share: float
    n: int
    unit: str


def passive_ratio(hand: PassiveHand, gains: Gains) -> float:
    """Return how far a passive hand comes to rest from where it was, for each metre that the partner goes.

    It is ``-partner / (stiffness + own)``: with the paper's 25.93 N/m, -0.341, -0.147 and -0.080 for hands of 50, 150
    and 300 N/m.

    Parameters
    ----------
    hand : PassiveHand
        The hand.
    gains : Gains
        Of its side.

    Returns
    -------
    float
        The ratio, negative for movement in opposite directions [1].
    """
    return -gains.partner / (hand.stiffness + gains.own)


def driven(force: ArrayLike, rate: float, hand: PassiveHand) -> NDArray[np.float64]:
    """Return how a force alone moves a passive hand: ``m z'' + b z' + k z + friction = F - F(0)``.

    Applied to the force that was rendered, it is the passive part of the recorded movement, and what is left
    of that the person's own doing, as far as the arm is linear and its stiffness known. Part of the rendered force
    answers the own movement; `passive_partner` has only what comes from elsewhere.

    Parameters
    ----------
    force : array_like, shape (n,)
        On the hand, + = up; linear between samples [N].
    rate : float
        Sampling rate [Hz].
    hand : PassiveHand
        The hand, at rest at the first sample.

    Returns
    -------
    ndarray of float64, shape (n,)
        Its height, from where it was [m].
    """
    f = np.asarray(force, dtype=float)
    if not len(f):
        return f
    if hand.friction > 0.0:
        parts = max(1, ceil(1.0 / (rate * LONGEST_STEP)))
        step = 1.0 / (rate * parts)
        return np.asarray(_rubbed(f - f[0], parts, step, hand.mass, hand.damping, hand.stiffness, hand.friction))
    above, below = _discretised(hand, rate)
    return np.asarray(lfilter(above, below, f - f[0]))


@numba.njit(cache=True)
def _rubbed(
    force: NDArray[np.float64],
    parts: int,
    step: float,
    mass: float,
    damping: float,
    stiffness: float,
    friction: float,
) -> NDArray[np.float64]:
    """Integrate a hand with Coulomb friction; damping and friction are implicit (Moreau), so a held hand is at rest.

    `netboard.participants.hand` has the same rule. After a missing sample nothing is known any more.
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
    """Return the filter from force to height: it takes longer to find than a trial to filter, and hands recur."""
    above, below, _ = cont2discrete(([1.0], [hand.mass, hand.damping, hand.stiffness]), 1.0 / rate, method="foh")
    above, below = np.ravel(above), np.asarray(below)
    above.flags.writeable = below.flags.writeable = False
    return above, below


def passive_partner(
    active: ArrayLike, p: ArrayLike, rate: float, hand: PassiveHand, gains: Gains
) -> NDArray[np.float64]:
    """Return how a passive hand moves when the partner and the ball do what they did, and forces are felt.

    The board is at rest between the hands at all times, which it is within some 10 ms. A hand without friction is an
    upper bound: friction of the device (0.26 N of a Touch) holds most of this movement.

    Parameters
    ----------
    active : array_like, shape (n,)
        Height of the partner's stylus [m].
    p : array_like, shape (n,)
        The ball along the board [m].
    rate : float
        Sampling rate [Hz].
    hand : PassiveHand
        The hand, at rest at the first sample.
    gains : Gains
        Of its side.

    Returns
    -------
    ndarray of float64, shape (n,)
        Its height, from where it was [m].
    """
    push = -gains.partner * np.asarray(active, dtype=float) - gains.ball * np.asarray(p, dtype=float)
    return driven(push, rate, replace(hand, stiffness=hand.stiffness + gains.own))


def linear_partner(rate: float, hand: PassiveHand, left: Gains, right: Gains) -> Respond:
    """Make a passive partner for `passive_control`, out of `passive_partner`.

    Parameters
    ----------
    rate : float
        Sampling rate [Hz].
    hand : PassiveHand
        The hand.
    left, right : Gains
        Of both sides.

    Returns
    -------
    callable
        The partner.
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
    """Compare the effect of forces with that on a partner who never acts.

    In each trial with forces either side in turn keeps its recorded movement and the other is replaced: by the passive
    partner, and by one who does not move, as a passive one does without forces. The difference of the measure between
    the two is the passive effect. An interval of the share is that of
    `netboard.analysis.statistics.estimates.bootstrap` with `ratio_of_sums` of `passive` and `effect`.

    Parameters
    ----------
    with_forces, without : sequence of sequence of Heights
        For each dyad, its trials with and without forces.
    respond : callable
        The passive partner: takes the height of the active stylus, the ball, and the passive side; returns a height.
    measure : callable
        Takes the heights of the left and of the right stylus; returns, say, the share of cooperative movement.
    unit : str
        What is replicated.

    Returns
    -------
    PassiveControl
        Both effects in each dyad, and the share of the one in the other.

    Raises
    ------
    ValueError
        If there are not as many dyads with forces as without, or a dyad has no trial of a kind.
    """
    if len(with_forces) != len(without) or not all(map(len, [*with_forces, *without])):
        raise ValueError("each dyad has trials with and without forces; found some that have not")
    live = np.array([[_mean_of(trials, measure) for trials in kind] for kind in (with_forces, without)])
    effect = live[0] - live[1]
    passive = np.array([np.mean([_passive(trial, respond, measure) for trial in trials]) for trials in with_forces])
    total = float(effect.sum())
    return PassiveControl(effect, passive, float(passive.sum()) / total if total else np.nan, len(effect), unit)


def _mean_of(trials: Sequence[Heights], measure: Measure) -> float:
    """Average a measure over trials."""
    return float(np.mean([measure(trial.left, trial.right) for trial in trials]))


def _passive(trial: Heights, respond: Respond, measure: Measure) -> float:
    """Measure what forces do to a passive partner, at either side."""
    still = np.zeros_like(trial.p)
    of_right = measure(trial.left, respond(trial.left, trial.p, "right")) - measure(trial.left, still)
    of_left = measure(respond(trial.right, trial.p, "left"), trial.right) - measure(still, trial.right)
    return 0.5 * (of_right + of_left)
