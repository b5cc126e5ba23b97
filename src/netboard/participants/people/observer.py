"""What a participant knows of its hidden partner: a Kalman filter of the dyad's mechanics, with and without the force.

A participant sees the board one visual delay ago, and feels the force on its hand one haptic delay ago. Both filters
follow `netboard.participants.people.dyad_model`; one takes what is seen and what is felt, the other only what is seen.
What the force tells is the difference of their estimates of where the partner's movement leads. So a force that tells
nothing changes nothing, whatever the stiffness of the couplings. With the model `sight` there is no force, and the
second estimate replaces what is expected of the partner.

The filters stand at the time that is seen now. Beyond it lie the forces felt since: the gains of this stretch depend
on nothing that is measured, so its estimate is a sum of the state, these forces and the commands, each with a weight
that is computed once.

Rule 1: gains are those of the stationary filter, from the covariances alone; nothing is tuned.
Rule 2: a filter begins anew when the ball is released, and where a force or a view is missing.
"""

from functools import lru_cache
from math import ceil, exp
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.base.config import Side
from netboard.base.tables.scene import Physics
from netboard.base.tables.simulated import Participant, VirtualDevice
from netboard.participants.people.dyad_model import SEEN, STATES, DyadModel, Matrix, X, dyad_model
from netboard.participants.people.partner_models import tells
from netboard.participants.people.senses import DECISION_INTERVAL
from netboard.physics.arithmetic.simd import applied, lanes_at, put

MEASURED = len(SEEN) + 1
"""Quantities that are seen and felt [1]."""

STRETCH = 256
"""Most decisions between what is seen and what is felt [1]."""

DOUBLINGS = 10
"""Doublings of the time for which a stationary filter has run [1]."""

OBSERVER = np.dtype(
    [
        ("informed", "<i8"),  # 1: the force on a hand, which depends on the partner's, is taken in
        ("sight", "<i8"),  # 1: only what is seen is taken in
        ("muscle_keep", "<f8"),  # decay factor of a muscle stage in a step [1]
        ("lag", "<i8"),  # decisions from what is seen to what is felt [1]
        # Of the filters with and without the force, the effect of each quantity of a state in a step.
        ("advance", "<f8", (2, STATES, STATES)),
        ("gains", "<f8", (2, MEASURED, STATES)),  # of each measured quantity
        ("commands", "<f8", (2, 2, STATES)),  # of one's own and of the partner's displacement in a step
        ("weight", "<f8", (2, STATES)),  # of gravity
        ("rest", "<f8", (3, STATES)),  # state at rest by own height, partner's height and ball
        ("rest_weight", "<f8", (STATES,)),  # that by gravity
        ("answers", "<f8", (2, STATES)),  # the difference by each quantity of both states
        ("answer_forces", "<f8", (STRETCH,)),  # by each force felt since
        ("answer_commands", "<f8", (STRETCH, 2)),  # by each displacement since
        ("answer_weight", "<f8"),  # by gravity [m]
    ]
)
"""Constants of an observer [SI]."""

OBSERVED = np.dtype(
    [
        ("filters", "<f8", (2, STATES)),  # states with and without the force, at the time that is seen
        ("running", "<i8"),  # 1: they have begun
        ("count", "<i8"),  # decisions in the memory, up to `STRETCH` [1]
        ("newest", "<i8"),  # place of the newest
        ("forces", "<f8", (STRETCH,)),  # perceived forces, with noise [N]
        ("commands", "<f8", (STRETCH, 2)),  # own and expected displacements in the step before each [m]
        ("commanded", "<f8", (2,)),  # own commanded and partner's expected displacement so far [m]
        ("muscle", "<f8", (2,)),  # these after the first muscle lag [m]
        ("moved", "<f8", (2,)),  # and after the second [m]
        ("noise", "<f8"),  # present noise of the perceived force [N]
        ("surprise", "<f8"),  # what force or sight tells: displacement of where the partner's movement leads [m]
    ]
)
"""State of an observer."""


@lru_cache(maxsize=64)
def pack_observer(person: Participant, physics: Physics, virtual: VirtualDevice, side: Side) -> NDArray[Any]:
    """Return the constants of an observer with a hand on this side: ndarray of OBSERVER, shape (1,), shared [SI]."""
    packed = np.zeros(1, OBSERVER)
    if tells(person) == "nothing" or physics.k_h == 0.0 or physics.coupling != "both":
        return packed
    model = dyad_model(person, physics, virtual, side)
    one = packed[0]
    sight = tells(person) == "sight"
    one["informed"], one["sight"], one["lag"] = not sight, sight, stretch_of(person)
    one["muscle_keep"] = exp(-DECISION_INTERVAL / person.muscle_lag)
    one["rest"], one["rest_weight"] = model.rest.T, model.rest_weight
    for way, (haptic, sign) in enumerate(((True, 0.0), (False, 1.0)) if sight else ((True, 1.0), (False, -1.0))):
        sense, gains, spread = stationary(model, haptic)
        keep = np.eye(STATES) - gains @ sense
        one["advance"][way], one["commands"][way] = (keep @ model.advance).T, (keep @ model.commands).T
        one["weight"][way] = keep @ model.weight
        one["gains"][way, : gains.shape[1]] = gains.T
        _add_stretch(one, model, way, keep @ spread, haptic, sign)
    if sight:
        one["answers"][1, X["partner"]] -= 1.0  # from where the hand is seen
    return packed


def stretch_of(person: Participant) -> int:
    """Return the number of decisions from what is seen to what is felt [1]."""
    return max(ceil((person.visual_delay - person.haptic_delay) / DECISION_INTERVAL - 1e-9), 0)


def stationary(model: DyadModel, haptic: bool) -> tuple[Matrix, Matrix, Matrix]:
    """Return what is measured by state, the gains of the stationary filter, and the covariance before a measurement.

    The covariance is that of a filter which began in certainty ``2**DOUBLINGS`` steps ago, finite in every scene, by
    the doubling algorithm for Riccati equations (Chu, Fan, Lin and Wang, Int. J. Control 77:767, 2004).
    """
    sense = np.vstack((model.seen, model.felt)) if haptic else model.seen
    error = np.diag([*np.diag(model.seen_variance), model.felt_variance][: len(sense)])
    step, told, spread = model.advance.T, sense.T @ np.linalg.solve(error, sense), model.noise
    for _ in range(DOUBLINGS):
        solved = np.linalg.solve(np.eye(STATES) + told @ spread, np.hstack((step, told)))
        spread, told, step = (
            spread + step.T @ spread @ solved[:, :STATES],
            told + step @ solved[:, STATES:] @ step.T,
            step @ solved[:, :STATES],
        )
        spread = 0.5 * (spread + spread.T)
    gains = np.asarray(np.linalg.solve(sense @ spread @ sense.T + error, sense @ spread).T, np.float64)
    return sense, gains, spread


def _add_stretch(one: np.void, model: DyadModel, way: int, spread: Matrix, haptic: bool, sign: float) -> None:
    """Add the weights with which the state, and forces and commands since, tell the partner's aim.

    ``spread``: covariance of the state at the time that is seen; ``sign``: with which this estimate counts.
    """
    gains, _ = _follow(model, spread, int(one["lag"]), haptic)
    row = sign * model.aim
    for place in range(len(gains) - 1, -1, -1):
        told = row @ gains[place]
        one["answer_forces"][place] += told
        row = row - told * model.felt
        one["answer_commands"][place] += row @ model.commands
        one["answer_weight"] += row @ model.weight
        row = row @ model.advance
    one["answers"][way] = row


def _follow(model: DyadModel, spread: Matrix, steps: int, haptic: bool) -> tuple[list[Matrix], Matrix]:
    """Return the gains of the forces felt in some steps beyond the time that is seen, and the covariance at the end."""
    gains = []
    for _ in range(steps):
        spread = model.advance @ spread @ model.advance.T + model.noise
        gains.append(float(haptic) * (spread @ model.felt) / (model.felt @ spread @ model.felt + model.felt_variance))
        spread = spread - np.outer(gains[-1], model.felt @ spread)
    return gains, spread


def uncertainty(person: Participant, physics: Physics, virtual: VirtualDevice, haptic: bool) -> float:
    """Return the standard deviation of the estimate of where the partner's movement leads [m].

    It is that of the filter with or without the force, at the time of the newest force felt.
    """
    model = dyad_model(person, physics, virtual, "left")
    sense, gains, spread = stationary(model, haptic)
    _, spread = _follow(model, spread - gains @ sense @ spread, stretch_of(person), haptic)
    return float(np.sqrt(model.aim @ spread @ model.aim))


@inlined
def forget(o: np.void) -> None:
    """Begin anew: nothing is known from the force."""
    o["running"] = o["count"] = 0
    o["surprise"] = 0.0


@inlined
def feel(o: np.void, c: np.void, force: float, own: float, other: float) -> None:
    """Store a perceived force, and the displacements of both aims in the step before it.

    Parameters
    ----------
    own, other : float
        Displacements commanded of one's own hand, and expected of the partner's, since the participant began [m].
    """
    place, keep = (o["newest"] + 1) % STRETCH, c["muscle_keep"]
    o["newest"], o["count"] = place, min(o["count"] + 1, STRETCH)
    o["forces"][place] = force
    for hand in range(2):
        wanted, before = own if hand == 0 else other, o["moved"][hand]
        middle = 0.5 * (wanted + o["commanded"][hand])
        first = middle + (o["muscle"][hand] - middle) * keep
        second = 0.5 * (first + o["muscle"][hand])
        moved = second + (before - second) * keep
        o["commanded"][hand], o["muscle"][hand], o["moved"][hand] = wanted, first, moved
        o["commands"][place, hand] = moved - before


@inlined
def observe(o: np.void, c: np.void, p: float, theta: float, own: float, partner: float, further: float) -> None:
    """Take what is seen, and update what the force tells; nothing before the memory holds forces since then.

    Parameters
    ----------
    p, theta : float
        Ball and tilt as seen [m, rad].
    own, partner : float
        Heights of one's own hand and of the partner's, as the board shows it [m].
    further : float
        How far the partner is expected to move from there, which `sight` replaces [m].
    """
    lag = c["lag"]
    if o["count"] <= lag:
        return
    oldest = (o["newest"] - lag) % STRETCH
    if o["running"] == 0:
        _begin(o, c, p, own, partner)
    else:
        force, moved, other = o["forces"][oldest], o["commands"][oldest, 0], o["commands"][oldest, 1]
        for way in range(2):
            _update(o["filters"], c, way, (p, theta, own, force, moved, other))
    told = c["answer_weight"]
    for place in range(STATES):
        told += c["answers"][0, place] * o["filters"][0, place] + c["answers"][1, place] * o["filters"][1, place]
    for step in range(lag):
        place = (oldest + 1 + step) % STRETCH
        told += c["answer_forces"][step] * o["forces"][place]
        told += c["answer_commands"][step, 0] * o["commands"][place, 0]
        told += c["answer_commands"][step, 1] * o["commands"][place, 1]
    o["surprise"] = told - further if c["sight"] else told


@inlined
def _begin(o: np.void, c: np.void, p: float, own: float, partner: float) -> None:
    """Begin with hands and board at rest."""
    o["running"] = 1
    rest = lanes_at(c["rest_weight"], 0, STATES)
    rest = rest + own * lanes_at(c["rest"], 0, STATES) + partner * lanes_at(c["rest"], STATES, STATES)
    rest = rest + p * lanes_at(c["rest"], 2 * STATES, STATES)
    put(o["filters"], 0, rest)
    put(o["filters"], STATES, rest)


@inlined
def _update(state: Any, c: np.void, way: int, given: Any) -> None:
    """Advance a filter by a step, and take what was measured at its end."""
    total = lanes_at(c["weight"], way * STATES, STATES)
    total = total + given[4] * lanes_at(c["commands"], (2 * way) * STATES, STATES)
    total = total + given[5] * lanes_at(c["commands"], (2 * way + 1) * STATES, STATES)
    for j in range(MEASURED):
        total = total + given[j] * lanes_at(c["gains"], (MEASURED * way + j) * STATES, STATES)
    advanced = applied(c["advance"], way * STATES * STATES, lanes_at(state, way * STATES, STATES), STATES)
    put(state, way * STATES, total + advanced)
