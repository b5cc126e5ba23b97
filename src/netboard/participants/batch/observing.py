"""What agents of scenes at full fidelity do, observe and are rewarded for: kernels over the arrays of a batch."""

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Numbers, inlined, kernel
from netboard.base.tick import START_NS, TICK_NS
from netboard.participants.batch.arrays import LANES, SceneArrays, Viewers
from netboard.participants.batch.spaces import BOUND
from netboard.participants.batch.stepping import ENDED_IN_FAILURE, ENDED_IN_SUCCESS
from netboard.task.trials.state_machine import Phase, is_free

_LEVELLING, _RUNNING, _HOLDING = (int(phase) for phase in (Phase.LEVELLING, Phase.RUNNING, Phase.HOLDING))


@inlined
def _potential(s: np.void, distance: float) -> float:
    """Return how far a trial has come: -2 to 0."""
    if is_free(s["phase"]):
        return float(-min(1.0, abs(s["p"] - s["target"] * distance) / (2.0 * distance)))
    return float(-1.0 - 0.5 * min(1.0, abs(s["theta"]) / 0.2) - 0.5 * min(1.0, abs(s["z"]) / 0.05))


@kernel
def score(sc: SceneArrays, limit: int, distance: float, weights: Numbers, potential: Numbers, reward: Numbers) -> None:
    """Write the reward of each scene; ``weights``: of the time in a tick and in a step, progress, success, failure."""
    for i in range(len(reward)):
        reward[i] = -weights[1]
        if sc.ended[i] == ENDED_IN_SUCCESS:
            reward[i] += weights[3]
        elif sc.ended[i] == ENDED_IN_FAILURE:
            reward[i] -= weights[4] + weights[0] * max(limit - sc.ticks[i], 0) + weights[2] * (potential[i] + 2.0)
        else:
            now = _potential(sc.states[i], distance)
            reward[i] += weights[2] * (now - potential[i])
            potential[i] = now


@inlined
def _clipped(value: float) -> float:
    """Return an observed number within its bounds, 0 for what is hidden."""
    return 0.0 if np.isnan(value) else min(max(value, -BOUND), BOUND)


@kernel
def observe(
    sc: SceneArrays,
    viewers: Viewers,
    a: int,
    hands: NDArray[np.int64],
    truth: bool,
    view: Numbers,
    hand: Numbers,
    true: Numbers,
    out: NDArray[np.float32],
) -> None:
    """Write what an agent observes in each scene: views, own hands and, if it may, the true state."""
    views = viewers.seen.shape[2] - 1
    for i in range(len(out)):
        g, j, at = i // LANES, i % LANES, 0
        row, newest = out[i], viewers.following[a, i] - viewers.every[a]
        now = (START_NS + (sc.ticks[i] - 1) * TICK_NS) * 1e-9
        first = 1 if newest >= sc.ticks[i] - 1 else 0
        for k in range(first, first + views):
            seen = viewers.seen[a, i, k]
            known = not np.isnan(seen["time"])
            phase = seen["phase"]
            row[at] = 1.0 if known and phase == _LEVELLING else 0.0
            row[at + 1] = 1.0 if known and phase == _RUNNING else 0.0
            row[at + 2] = 1.0 if known and phase == _HOLDING else 0.0
            row[at + 3], row[at + 4] = _clipped(seen["z"] / view[3]), _clipped(seen["theta"] / view[4])
            row[at + 5], row[at + 6] = _clipped(seen["p"] / view[5]), _clipped(seen["target"] / view[6])
            row[at + 7] = _clipped((now - seen["time"]) / view[7])
            at += 8
        for side in range(2):
            if hands[side]:
                row[at] = _clipped(sc.reading[g, side, j] / hand[0])
                row[at + 1] = _clipped(sc.reading[g, 2 + side, j] / hand[1])
                row[at + 2] = _clipped(sc.motor[g, side, j] / hand[2])
                at += 3
        if truth:
            s = sc.states[i]
            row[at], row[at + 1] = _clipped(s["z"] / true[0]), _clipped(s["vz"] / true[1])
            row[at + 2], row[at + 3] = _clipped(s["theta"] / true[2]), _clipped(s["omega"] / true[3])
            row[at + 4], row[at + 5] = _clipped(s["p"] / true[4]), _clipped(s["vp"] / true[5])
            row[at + 6], row[at + 7] = _clipped(sc.place[g, 0, j] / true[6]), _clipped(sc.v[g, 0, j] / true[7])
            row[at + 8], row[at + 9] = _clipped(sc.place[g, 1, j] / true[8]), _clipped(sc.v[g, 1, j] / true[9])


@kernel
def act(
    sc: SceneArrays,
    side: int,
    column: int,
    rows: NDArray[np.int64],
    scale: Numbers,
    offset: Numbers,
    actions: NDArray[np.float32],
) -> None:
    """Let one hand of each scene do what is decided; ``rows``: what the columns of the actions are."""
    for i in range(len(actions)):
        g, j = i // LANES, i % LANES
        for k in range(len(rows)):
            value = min(max(float(actions[i, column + k]), -1.0), 1.0)
            sc.doing[g, rows[k], side, j] = offset[k] + scale[k] * value
