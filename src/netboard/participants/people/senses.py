"""Perception of a simulated participant: display and rendered force, with delay and noise.

Rule 1: the only inputs are the views of the station's display (`Glimpse`) and the force rendered by its device.
Rule 2: nothing after ``now - delay`` is known yet.
Rule 3: the ball's velocity is not displayed; it is estimated from the positions seen.
"""

from dataclasses import dataclass
from math import exp, isnan, nan, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, inlined, kernel
from netboard.participants.policy import SEEN
from netboard.stage.curtain import NO_PHASE
from netboard.task.trials.state_machine import Phase, is_free

DECISION_INTERVAL = 0.010
"""Interval between two decisions of a participant, who then looks and feels [s]."""

MEMORY = 2.2
"""Time for which glimpses and forces are kept: more than the longest delay of a participant [s]."""

ROOM = 256
"""Glimpses and forces that are kept at most; a participant takes one each `DECISION_INTERVAL` [1]."""

_PHASES = {phase.name.lower(): int(phase) for phase in Phase}


@dataclass(frozen=True, slots=True)
class Glimpse:
    """What a station's display shows at one time [s], in the terms and units of `netboard.stage.view.View`."""

    time: float
    phase: str
    z: float
    theta: float
    p: float | None  # None without a ball
    target: float
    left: float | None  # None if hidden
    right: float | None


FELT = np.dtype([("time", "<f8"), ("force", "<f8")])
"""A force on the hand, + = up; NaN without haptic feedback [s, N]."""

NOISES = ("noise_p", "noise_v", "noise_theta")

SENSES = np.dtype(
    [
        ("seen", SEEN, (ROOM,)),
        ("felt", FELT, (ROOM,)),
        ("first_seen", "<i8"),  # place of the oldest glimpse [1]
        ("seen_count", "<i8"),
        ("first_felt", "<i8"),
        ("felt_count", "<i8"),
        *((name, "<f8") for name in NOISES),  # present perceptual noise of ball, its velocity and tilt [m, m/s, rad]
    ]
)
"""What a participant remembers of display and force."""

PERCEPT = np.dtype([*((name, SEEN[name]) for name in SEEN.names or ()), ("v", "<f8")])
"""What is perceived: the glimpse shown one visual delay ago, with noise, and the ball's velocity [m/s]."""


def write_glimpse(glimpse: Glimpse | None, place: NDArray[Any]) -> None:
    """Write a glimpse for the kernels into an array of SEEN, shape (1,); without one its time is NaN."""
    if glimpse is None:
        place["time"] = nan
        return
    shown = (glimpse.p, glimpse.left, glimpse.right)
    p, left, right = (nan if value is None else value for value in shown)
    phase = _PHASES.get(glimpse.phase, NO_PHASE)
    place[0] = (glimpse.time, phase, glimpse.z, glimpse.theta, p, glimpse.target, left, right)


@inlined
def ou_factors(time: float, dt: float) -> tuple[float, float]:
    """Return how much of a coloured Gaussian noise remains after dt, and how much of its deviation is new [1].

    The noise is an Ornstein-Uhlenbeck process of this correlation time [s].
    """
    keep = exp(-dt / time)
    return keep, sqrt(1.0 - keep * keep)


@kernel
def store(senses: np.void, now: float, glimpse: np.void, felt: float) -> None:
    """Store what the display shows and what the hand feels now."""
    seen, count = senses["seen"], senses["seen_count"]
    newest = seen[(senses["first_seen"] + count - 1) % ROOM]["time"]
    if not isnan(glimpse["time"]) and (count == 0 or glimpse["time"] > newest):
        if count == ROOM:
            senses["first_seen"] = (senses["first_seen"] + 1) % ROOM
            count -= 1
        place = seen[(senses["first_seen"] + count) % ROOM]
        place["time"], place["phase"] = glimpse["time"], glimpse["phase"]
        place["z"], place["theta"] = glimpse["z"], glimpse["theta"]
        place["p"], place["target"] = glimpse["p"], glimpse["target"]
        place["left"], place["right"] = glimpse["left"], glimpse["right"]
        count += 1
    while count > 1 and seen[senses["first_seen"]]["time"] < now - MEMORY:
        senses["first_seen"] = (senses["first_seen"] + 1) % ROOM
        count -= 1
    senses["seen_count"] = count
    _store_force(senses, now, felt)


@inlined
def _store_force(senses: np.void, now: float, felt: float) -> None:
    """Store the force on the hand; without haptic feedback, forget all forces."""
    forces, count = senses["felt"], senses["felt_count"]
    if isnan(felt):
        senses["felt_count"] = 0
        return
    if count == ROOM:
        senses["first_felt"] = (senses["first_felt"] + 1) % ROOM
        count -= 1
    place = forces[(senses["first_felt"] + count) % ROOM]
    place["time"], place["force"] = now, felt
    count += 1
    while count > 0 and forces[senses["first_felt"]]["time"] < now - MEMORY:
        senses["first_felt"] = (senses["first_felt"] + 1) % ROOM
        count -= 1
    senses["felt_count"] = count


@inlined
def _newest_until(ring: Records, first: int, count: int, until: float) -> int:
    """Return the place, counted from the oldest, of the newest entry that is not later than a time; -1 for none."""
    if count == 0:
        return -1
    age = ring[(first + count - 1) % ROOM]["time"] - until
    place = count - 1 - int(min(max(age / DECISION_INTERVAL, 0.0), count - 1.0))  # it is there, or near
    while place + 1 < count and ring[(first + place + 1) % ROOM]["time"] <= until:
        place += 1
    while place >= 0 and ring[(first + place) % ROOM]["time"] > until:
        place -= 1
    return place


@kernel
def perceive(senses: np.void, until: float, span: float, percept: np.void) -> bool:
    """Perceive the display as it was at a time, with present perceptual noise; return whether anything was displayed.

    Parameters
    ----------
    until : float
        One visual delay ago [s].
    span : float
        Window over which the ball's velocity is estimated [s].
    percept : record of PERCEPT
        The percept, written.
    """
    seen, first = senses["seen"], senses["first_seen"]
    last = _newest_until(seen, first, senses["seen_count"], until)
    if last < 0:
        return False
    g = seen[(first + last) % ROOM]
    percept["time"], percept["phase"], percept["z"] = g["time"], g["phase"], g["z"]
    percept["target"], percept["left"], percept["right"] = g["target"], g["left"], g["right"]
    percept["theta"] = g["theta"] + senses["noise_theta"]
    percept["p"] = percept["v"] = 0.0
    if not isnan(g["p"]):
        percept["p"] = g["p"] + senses["noise_p"]
        if is_free(g["phase"]):
            percept["v"] = _velocity(senses, last, span) + senses["noise_v"]
    return True


@inlined
def _velocity(senses: np.void, last: int, span: float) -> float:
    """Return the velocity of the free ball from its positions within a window; 0 with only one [m/s]."""
    seen, first = senses["seen"], senses["first_seen"]
    end = seen[(first + last) % ROOM]
    begin = end
    place = last
    while place >= 0:
        g = seen[(first + place) % ROOM]
        if end["time"] - g["time"] > span or not is_free(g["phase"]):
            break
        begin = g
        place -= 1
    if end["time"] <= begin["time"] or isnan(begin["p"]):
        return 0.0
    return float((end["p"] - begin["p"]) / (end["time"] - begin["time"]))


@kernel
def force_at(senses: np.void, when: float) -> float:
    """Return the force on the participant's hand at a past time, + = up; NaN if none was rendered then [N]."""
    forces, first = senses["felt"], senses["first_felt"]
    place = _newest_until(forces, first, senses["felt_count"], when)
    return float(forces[(first + place) % ROOM]["force"]) if place >= 0 else nan
