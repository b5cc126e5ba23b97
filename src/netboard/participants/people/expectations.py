"""Expected effect of the movements under way: a simulated participant's own, and those of the hidden partner.

A submovement counts as under way until its whole effect has been seen. `expected_tilt` is the tilt of the board once
all are complete. The partner is expected to mirror one's own turning, unless the force on one's hand shows otherwise.
"""

from math import inf, isnan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.participants.people.muscles import CAPACITY
from netboard.participants.people.observer import feel, forget, observe
from netboard.participants.people.senses import force_at
from netboard.participants.people.submovement import jerk_polynomial, minimum_jerk
from netboard.physics.arithmetic.simd import larger, smaller
from netboard.task.trials.state_machine import is_free

INTENTS = 2 * CAPACITY
"""Submovements of a participant whose effect it has not seen yet, at most; for each hand `CAPACITY` [1]."""

BOTH = 3
"""`hands` of a participant that moves both [1]."""

INTENT = np.dtype(
    [
        ("side", "<i8"),  # 0: left, 1: right
        ("start", "<f8"),  # [s]
        ("duration", "<f8"),  # [s]
        ("displacement", "<f8"),  # without motor noise [m]
        ("turn", "<f8"),  # part of it that tilts the board; the rest lifts it [m]
        ("mirrored", "<f8"),  # expected displacement of the partner's hand, which tilts the board too [m]
        ("partner", "<f8"),  # height of the partner's hand as seen at the decision; NaN if unknown [m]
        ("shown", "<f8"),  # share of it whose effect has been seen [1]
    ]
)
"""An intended submovement: its expected effect until it becomes visible."""


@inlined
def delay_to_hand(k: np.void) -> float:
    """Return the delay from a planned movement to the hand: two muscle lags and the lag of the arm [s]."""
    return float(2.0 * k["muscle_lag"] + k["arm_damping"] / k["arm_stiffness"])


@inlined
def commanded_share(intent: np.void, when: float) -> float:
    """Return the share of a submovement that is commanded at a time, which may be infinite [1]."""
    return 1.0 if when == inf else minimum_jerk((when - intent["start"]) / intent["duration"])


@inlined
def own_height(state: np.void, side: int) -> float:
    """Return the height of an own hand as seen; NaN if it is hidden [m]."""
    return float(state["percept"]["left"] if side == 0 else state["percept"]["right"])


@inlined
def partner_height_seen(state: np.void, k: np.void, side: int) -> float:
    """Return the height of the partner's hand as the board showed it; NaN if one's own hand is hidden [m]."""
    return float(own_height(state, side) - (2.0 * side - 1.0) * 2.0 * k["l"] * state["percept"]["theta"])


@inlined
def moved(state: np.void, k: np.void, side: int, when: float) -> float:
    """Return the displacement of an own hand from where it was seen to a later time [m]."""
    lag, rise = delay_to_hand(k), 0.0
    for i in range(state["intent_count"]):
        intent = state["intents"][i]
        if intent["side"] == side:
            rise += intent["displacement"] * (commanded_share(intent, when - lag) - intent["shown"])
    return rise


@inlined
def turning(state: np.void, side: int) -> float:
    """Return the part of an own hand's remaining displacement that tilts the board; the rest lifts it [m]."""
    rise = 0.0
    for i in range(state["intent_count"]):
        intent = state["intents"][i]
        if intent["side"] == side:
            rise += intent["turn"] * (1.0 - intent["shown"])
    return rise


@inlined
def board_height(state: np.void, k: np.void) -> float:
    """Return the height of the board's centre after the lifting under way, if all hands lift alike [m]."""
    total, count = 0.0, 0
    for side in range(2):
        shown = own_height(state, side)
        if k["hands"] & (1 << side) and not isnan(shown):
            lifting = moved(state, k, side, inf) - turning(state, side)
            total += shown - (2.0 * side - 1.0) * k["l"] * state["percept"]["theta"] + lifting
            count += 1
    return total / count if count > 0 else state["percept"]["z"]


@inlined
def shares_done(state: np.void, k: np.void, times: NDArray[np.float64]) -> Any:
    """Return the shares, done at some times, of the tilt change under way when seen; from own hands only [1].

    Parameters
    ----------
    times : lanes
        Times after that of the percept [s].
    """
    commanded, remaining, done = times - delay_to_hand(k), 0.0, 0.0 * times
    for i in range(state["intent_count"]):
        intent = state["intents"][i]
        size = abs(intent["turn"])
        remaining += size * (1.0 - intent["shown"])
        elapsed = (commanded - intent["start"]) / intent["duration"]
        done = done + size * (jerk_polynomial(smaller(larger(elapsed, 0.0), 1.0)) - intent["shown"])
    return done / remaining if remaining > 0.0 else 0.0 * times + 1.0


@inlined
def expected_tilt(state: np.void, k: np.void) -> float:
    """Return the tilt of the board once all movements under way are complete [rad]."""
    lever, theta = 2.0 * k["l"], state["percept"]["theta"]
    if k["hands"] == BOTH:
        return float(theta + (moved(state, k, 1, inf) - moved(state, k, 0, inf)) / lever)
    side = k["hands"] - 1
    sign = 2.0 * side - 1.0
    own = moved(state, k, side, inf)
    other = partner_moved(state, k, inf) + state["reading"] * state["observed"]["surprise"]
    return float(theta + sign * own / lever - sign * other / lever)


@inlined
def of_partner(intent: np.void) -> float:
    """Return the displacement that is expected of the partner's hand during an own submovement [m]."""
    return float(intent["displacement"] - intent["turn"] - intent["mirrored"])


@inlined
def partner_moved(state: np.void, k: np.void, when: float) -> float:
    """Return the expected displacement of the partner's hand from where it was seen to a later time [m]."""
    lag, rise = delay_to_hand(k), 0.0
    for i in range(state["intent_count"]):
        intent = state["intents"][i]
        rise += of_partner(intent) * (commanded_share(intent, when - lag) - intent["shown"])
    return rise


@inlined
def observe_partner(state: np.void, k: np.void, now: float) -> None:
    """Update what is inferred of the partner, by the newest force felt and the view that is seen."""
    o, c, seen, side = state["observed"], k["observer"], state["percept"], k["hands"] - 1
    then = now - k["haptic_delay"]
    force, height = 0.0 if c["sight"] else force_at(state["senses"], then), own_height(state, side)
    if isnan(force) or isnan(height):
        forget(o)
        return
    own, other = state["moved"], state["mirrored"]
    for i in range(state["intent_count"]):
        intent = state["intents"][i]
        share = commanded_share(intent, then)
        own += intent["displacement"] * share
        other += of_partner(intent) * share
    feel(o, c, force + o["noise"], own, other)
    if is_free(seen["phase"]):
        partner, further = partner_height_seen(state, k, side), partner_moved(state, k, inf)
        observe(o, c, seen["p"], seen["theta"], height, partner, further)
    else:
        o["running"], o["surprise"] = 0, 0.0
