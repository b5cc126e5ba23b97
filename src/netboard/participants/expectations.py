"""Expected effect of the movements under way: a simulated participant's own, and those of the hidden partner.

A submovement counts as under way until its whole effect has been seen. `expected_tilt` is the tilt of the board once
all are complete. The partner is expected to mirror one's own turning, unless the force on one's hand shows otherwise.
"""

from math import inf, isnan, radians
from typing import Any

import numpy as np

from netboard.base.compiled import inlined
from netboard.participants.hand import CAPACITY
from netboard.participants.partner import follow_goal, haptic_weight, partner_height, partner_seen
from netboard.participants.senses import force_at
from netboard.participants.submovement import jerk_polynomial, minimum_jerk
from netboard.physics.arithmetic.simd import larger, smaller

INTENTS = 2 * CAPACITY
"""Submovements of a participant whose effect it has not seen yet, at most; for each hand `CAPACITY` [1]."""

BOTH = 3
"""`hands` of a participant that moves both [1]."""

TO_GOAL = 1.0
"""`partner_prediction` of a participant that estimates where the partner is going [1]."""

FORCE_HORIZON = 0.100
"""Horizon over which the partner's height is extrapolated from the force [s]."""

FORCE_WINDOW = 0.030
"""Window over which the partner's velocity is estimated [s]."""

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
def delay_to_hand(k: Any) -> float:
    """Return the delay from a planned movement to the hand: two muscle lags and the lag of the arm [s]."""
    return float(2.0 * k["muscle_lag"] + k["arm_damping"] / k["arm_stiffness"])


@inlined
def commanded_share(intent: Any, when: float) -> float:
    """Return the share of a submovement that is commanded at a time, which may be infinite [1]."""
    return 1.0 if when == inf else minimum_jerk((when - intent["start"]) / intent["duration"])


@inlined
def own_height(state: Any, side: int) -> float:
    """Return the height of an own hand as seen; NaN if it is hidden [m]."""
    return float(state["percept"]["left"] if side == 0 else state["percept"]["right"])


@inlined
def partner_height_seen(state: Any, k: Any, side: int) -> float:
    """Return the height of the partner's hand as the board showed it; NaN if one's own hand is hidden [m]."""
    return partner_seen(own_height(state, side), state["percept"]["theta"], 2.0 * side - 1.0, k["l"])


@inlined
def moved(state: Any, k: Any, side: int, when: float) -> float:
    """Return the displacement of an own hand from where it was seen to a later time [m]."""
    lag, rise = delay_to_hand(k), 0.0
    for i in range(state["intent_count"]):
        intent = state["intents"][i]
        if intent["side"] == side:
            rise += intent["displacement"] * (commanded_share(intent, when - lag) - intent["shown"])
    return rise


@inlined
def turning(state: Any, side: int) -> float:
    """Return the part of an own hand's remaining displacement that tilts the board; the rest lifts it [m]."""
    rise = 0.0
    for i in range(state["intent_count"]):
        intent = state["intents"][i]
        if intent["side"] == side:
            rise += intent["turn"] * (1.0 - intent["shown"])
    return rise


@inlined
def board_height(state: Any, k: Any) -> float:
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
def shares_done(state: Any, k: Any, times: Any) -> Any:
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
def expected_tilt(state: Any, k: Any, now: float) -> float:
    """Return the tilt of the board once all movements under way are complete [rad]."""
    lever, theta = 2.0 * k["l"], state["percept"]["theta"]
    if k["hands"] == BOTH:
        return float(theta + (moved(state, k, 1, inf) - moved(state, k, 0, inf)) / lever)
    side = k["hands"] - 1
    sign = 2.0 * side - 1.0
    own = moved(state, k, side, inf)
    other = partner_rise(state, k, now, side)
    return float(theta + sign * own / lever - sign * other / lever)


@inlined
def of_partner(intent: Any) -> float:
    """Return the displacement that is expected of the partner's hand during an own submovement [m]."""
    return float(intent["displacement"] - intent["turn"] - intent["mirrored"])


@inlined
def _force_tells(k: Any) -> bool:
    """Return whether the force on a hand depends on the partner's height: not without the springs of the board."""
    return bool(k["k_h"] > 0.0 and k["k_s"] > 0.0)


@inlined
def partner_rise(state: Any, k: Any, now: float, side: int) -> float:
    """Return the expected displacement of the partner's hand since it was seen, corrected by the force [m].

    The correction is where the unforeseen part of the partner's movement leads, times its weight by reliability. That
    part is the difference between the height inferred from the force and the height expected then. It is carried on at
    its present rate, or to its estimated goal.
    """
    then = now - k["haptic_delay"]
    late, early = force_at(state["senses"], then), force_at(state["senses"], then - FORCE_WINDOW)
    shown = partner_height_seen(state, k, side)
    expected = partner_moved(state, k, inf)
    unknown = isnan(late) or isnan(early) or isnan(shown)
    weight = felt_weight(state, k)
    if unknown or weight == 0.0 or not _force_tells(k):
        return expected
    if k["partner_prediction"] == TO_GOAL:
        return float(expected + weight * (state["goal"]["goal"] + partner_mirrored(state, k, inf) - shown - expected))
    surprise = partner_at(state, k, then, late, side) - shown - partner_moved(state, k, then)
    before = (
        partner_at(state, k, then - FORCE_WINDOW, early, side) - shown - partner_moved(state, k, then - FORCE_WINDOW)
    )
    rate = (surprise - before) / FORCE_WINDOW
    return float(expected + weight * (surprise + rate * FORCE_HORIZON + state["haptic_error"]))


@inlined
def partner_moved(state: Any, k: Any, when: float) -> float:
    """Return the expected displacement of the partner's hand from where it was seen to a later time [m]."""
    lag, rise = delay_to_hand(k), 0.0
    for i in range(state["intent_count"]):
        intent = state["intents"][i]
        rise += of_partner(intent) * (commanded_share(intent, when - lag) - intent["shown"])
    return rise


@inlined
def partner_mirrored(state: Any, k: Any, when: float) -> float:
    """Return the displacement expected of the partner in all own submovements up to a time [m]."""
    lag, rise = delay_to_hand(k), state["mirrored"]
    for i in range(state["intent_count"]):
        intent = state["intents"][i]
        rise += of_partner(intent) * commanded_share(intent, when - lag)
    return float(rise)


@inlined
def follow_partner(state: Any, k: Any, now: float) -> None:
    """Update the estimated goal of the unforeseen part of the partner's movement by the newest force felt."""
    then, side = now - k["haptic_delay"], k["hands"] - 1
    force = force_at(state["senses"], then)
    if isnan(force) or isnan(own_height(state, side)) or not _force_tells(k):
        return
    height = partner_at(state, k, then, force, side) + state["haptic_error"] - partner_mirrored(state, k, then)
    follow_goal(state["goal"], then, height, k["goal_speed"], k["goal_gains"])


@inlined
def partner_at(state: Any, k: Any, when: float, force: float, side: int) -> float:
    """Return the height of the partner's hand at a time, inferred from the force then [m]."""
    seen = state["percept"]
    own = own_height(state, side) + moved(state, k, side, when)
    return partner_height(force, own, seen["p"] + seen["v"] * (when - seen["time"]), 2.0 * side - 1.0, k)


@inlined
def felt_weight(state: Any, k: Any) -> float:
    """Return the weight of the height inferred from force against the visual prediction [1]."""
    if k["haptic_gain"] >= 0.0:
        return float(k["haptic_gain"])
    seen = state["learning_factor"] * 2.0 * k["l"] * radians(k["tilt_noise_deg"])
    lead = max(k["visual_delay"] - k["haptic_delay"], 0.0)
    return haptic_weight(seen, partner_drift(k), lead, state["learning_factor"] * k["haptic_noise"])


@inlined
def partner_drift(k: Any) -> float:
    """Return the variance of the partner's unforeseen movement per time [m2/s].

    The partner is taken to make, in each movement time, one unforeseen movement of `partner_noise` times the hand's
    part in the largest tilt.
    """
    return float((k["partner_noise"] * k["l"] * radians(k["max_tilt_deg"])) ** 2 / k["movement_time"])
