"""Estimates of the partner's hand, which is hidden behind the curtain.

The board shows where the partner's hand was one visual delay ago. Its movement since then must be guessed, or inferred
from haptic feedback: at static equilibrium, the force on one's own hand determines the partner's height.
"""

from math import exp
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from netboard.base.compiled import kernel
from netboard.base.config import Side

SIGN: dict[Side, float] = {"left": -1.0, "right": 1.0}
"""Sign of each side of the board, + = right; also the sign of the tilt when the hand on that side rises [1]."""

MIN_HEIGHT_SD = 1e-5
"""Smallest standard deviation of an inferred height that the estimate of a goal assumes [m]."""

MAX_GAP = 0.1
"""Time without a force after which the estimate of a goal begins anew [s]."""

GOAL = np.dtype([("time", "<f8"), ("height", "<f8"), ("rate", "<f8"), ("goal", "<f8")])
"""Estimate of where the partner's hand is going: time of the estimate, height, its rate, goal [s, m, m/s, m]."""


@kernel
def partner_height(force: float, own: float, p: float, sign: float, scene: Any) -> float:
    """Return the height of the partner's hand, inferred from the force on one's own hand [m].

    In equilibrium ``F = (W + k_s z)/2 +- m g p/(2 l)`` and ``z = (k_h (z_left + z_right) - W)/(2 k_h + k_s)``, with
    small tilts (the paper's equations 1 to 4, at rest).

    Parameters
    ----------
    p : float
        Ball position, + = right [m].
    scene : record
        Constants of the scene, which the participant knows: M, ball, g, l, k_h, k_s [SI].
    """
    weight = (scene["M"] + scene["ball"]) * scene["g"]
    load = -2.0 * force - weight - sign * scene["ball"] * scene["g"] * p / scene["l"]
    z = load / scene["k_s"]
    return float((z * (2.0 * scene["k_h"] + scene["k_s"]) + weight) / scene["k_h"] - own)


@kernel
def partner_seen(own: float, theta: float, sign: float, l: float) -> float:  # noqa: E741
    """Return the height of the partner's hand, inferred from the tilt of the board [m].

    Parameters
    ----------
    theta : float
        Tilt of the board [rad].
    l : float
        Half the length of the board [m].
    """
    return own - sign * 2.0 * l * theta


@kernel
def haptic_weight(seen: float, drift: float, lead: float, felt: float) -> float:
    """Return the weight by reliability, 0 to 1, of the partner's height inferred from force against its prediction [1].

    The partner's height is a random walk. Vision measured it `lead` before touch did, so its variance has grown to
    ``P = seen**2 + drift * lead`` when the force measures it with the variance ``R = felt**2``: ``w = P / (P + R)``.
    Vision and touch integrate in this way (Ernst and Banks, Nature 415:429, 2002), also when the force comes from a
    partner (Takagi, Ganesh, Yoshioka, Kawato and Burdet, Nat. Hum. Behav. 1:0054, 2017).

    Parameters
    ----------
    seen : float
        Standard deviation of the height as seen [m].
    lead : float
        Time by which vision is later than touch [s].
    felt : float
        Standard deviation of the height inferred from force [m].
    """
    prior = seen * seen + drift * lead
    total = prior + felt * felt
    return prior / total if total > 0.0 else 0.0


@kernel
def towards_goal(height: float, rate: float, goal: float, speed: float, dt: float) -> tuple[float, float]:
    """Return height and rate of a hand that approaches a goal, after some time [m, m/s].

    A critically damped approach, ``h'' = speed**2 (goal - h) - 2 speed h'``, solved exactly.
    """
    keep, away = exp(-speed * dt), height - goal
    pull = rate + speed * away
    return goal + keep * (away + pull * dt), keep * (rate - speed * pull * dt)


def goal_gains(speed: float, drift: float, felt: float, dt: float) -> NDArray[np.float64]:
    """Return the gains by which an error of the height corrects height, rate and goal, shape (3,) [1, 1/s, 1].

    They are those of the stationary Kalman filter of a hand that approaches a goal that drifts as a random walk. Pairs
    infer each other's goal in this way from the force between them (Takagi, Ganesh, Yoshioka, Kawato and Burdet, Nat.
    Hum. Behav. 1:0054, 2017).

    Parameters
    ----------
    felt : float
        Standard deviation of a height inferred from force [m].
    """
    if drift == 0.0:
        return np.zeros(3)
    columns = [towards_goal(*unit, speed, dt) for unit in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    advance = np.array([[height, rate, 0.0] for height, rate in columns]).T
    advance[2, 2] = 1.0
    noise = np.zeros((3, 3))
    noise[2, 2] = drift * dt
    seen = np.array([[1.0, 0.0, 0.0]])
    error = max(felt, MIN_HEIGHT_SD) ** 2
    spread = solve_discrete_are(advance.T, seen.T, noise, np.array([[error]]))
    return np.asarray(spread[:, 0] / (spread[0, 0] + error))


@kernel
def follow_goal(estimate: Any, time: float, height: float, speed: float, gains: NDArray[np.float64]) -> None:
    """Update an estimate of the partner's goal by a height inferred from force.

    Parameters
    ----------
    estimate : record of GOAL
        Changed in place; its time is NaN before the first height.
    time : float
        Time of the height [s].
    gains : ndarray, shape (3,)
        Gains from `goal_gains` [1, 1/s, 1].
    """
    dt = time - estimate["time"]
    estimate["time"] = time
    if not dt <= MAX_GAP:
        estimate["height"], estimate["rate"], estimate["goal"] = height, 0.0, height
        return
    expected, rate = towards_goal(estimate["height"], estimate["rate"], estimate["goal"], speed, dt)
    error = height - expected
    estimate["height"], estimate["rate"] = expected + gains[0] * error, rate + gains[1] * error
    estimate["goal"] += gains[2] * error
