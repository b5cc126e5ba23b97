"""How far scenes at reduced fidelity differ from strict ones: with the same actions, and for trained policies.

A policy is a linear feedback of the true state to both hands, found by the cross-entropy method (Rubinstein 1999):
boards try policies, and the next generation is drawn about the best ones. It is then evaluated on other episodes, with
noise on its actions, because without noise all episodes with the target on the same side are alike.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config
from netboard.benchmarks.harness.results import ResultPart
from netboard.participants.batch.spaces import REDUCED, STRICT, TRUTH
from netboard.participants.environments.vector import BoardVectorEnv

Array = NDArray[np.float64]

SCALES = np.array([one.scale for one in TRUTH])
UNITS = {"true_z": ("height of the board", "mm", 1e3), "true_theta": ("tilt", "deg", np.degrees(1.0))} | {
    "true_p": ("position of the ball", "mm", 1e3),
    "left_z": ("height of a stylus", "mm", 1e3),
    "left_vz": ("velocity of a stylus", "mm/s", 1e3),
}
"""Compared numbers of the true state: description, unit, and units in 1 SI unit."""

TIMES = (0.1, 0.5, 1.0, 2.0)
"""Times since the release of the ball at which differences are printed [s]."""

BOARDS, GENERATIONS, ELITE = 256, 12, 24
"""Policies in a generation, generations, and policies about which the next one is drawn [1]."""

NOISE = 0.2
"""Standard deviation of noise on the actions while the ball is free, so that episodes differ in an evaluation [1]."""

STEP_SECONDS = 0.01

_GAINS = 6


class Played(NamedTuple):
    """Episodes of some boards: returns, successes, and times of the successful ones from the start [s]."""

    returns: Array
    success: NDArray[np.bool_]
    seconds: Array

    def row(self) -> tuple[float, float, float]:
        """Return share of successes, mean return, and mean time of the successful ones."""
        seconds = float(self.seconds[self.success].mean()) if self.success.any() else float("nan")
        return float(self.success.mean()), float(self.returns.mean()), seconds


def boards_of(fidelity: str, count: int) -> BoardVectorEnv:
    """Make boards with an agent that moves both hands and observes the true state."""
    config = Config()
    config = replace(config, block=replace(config.block, force="none"))
    return BoardVectorEnv(
        count, config=config, seat="both", truth=True, fidelity=fidelity, autoreset_mode="Disabled", copy=False
    )


def actions_by(gains: Array, observed: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the actions of linear feedback; ``gains``: (boards, 6), of lift by height and turn by tilt and ball."""
    z, vz, theta, omega, p, vp = observed[:, -len(TRUTH) :][:, :6].T
    free = observed[:, 0] == 0.0
    off = np.where(free, p - observed[:, 6] * (0.1 / SCALES[4]), 0.0)
    lift = gains[:, 0] * z + gains[:, 1] * vz
    turn = gains[:, 2] * theta + gains[:, 3] * omega + gains[:, 4] * off + gains[:, 5] * np.where(free, vp, 0.0)
    actions: NDArray[np.float32] = np.tanh(np.stack([lift - turn, lift + turn], axis=1)).astype(np.float32)
    return actions


def noisy(gains: Array, seed: int) -> Callable[[NDArray[np.float32]], NDArray[np.float32]]:
    """Return the linear feedback with noise; the board would never be level with noise before the release."""
    rng = np.random.default_rng(seed)

    def decide(observed: NDArray[np.float32]) -> NDArray[np.float32]:
        actions = actions_by(gains[np.newaxis], observed)
        noise = NOISE * rng.standard_normal(actions.shape) * (observed[:, [0]] == 0.0) * (observed[:, [7]] > 0.0)
        return np.asarray(np.clip(actions + noise, -1.0, 1.0), np.float32)

    return decide


def play(boards: BoardVectorEnv, decide: Callable[[NDArray[np.float32]], NDArray[np.float32]], seed: int) -> Played:
    """Play an episode on each board."""
    observed, _ = boards.reset(seed=seed)
    count = boards.num_envs
    returns, success, seconds = np.zeros(count), np.zeros(count, bool), np.zeros(count)
    alive = np.ones(count, bool)
    while alive.any():
        observed, reward, terminated, truncated, infos = boards.step(decide(observed))
        returns += np.where(alive, reward, 0.0)
        over = terminated | truncated
        if over.any():
            seconds = np.where(over & alive, infos["seconds"], seconds)
            success |= infos["success"] & alive
            alive &= ~over
            boards.reset(options={"reset_mask": over})
    return Played(returns, success, seconds)


def train(boards: BoardVectorEnv, seed: int) -> Array:
    """Return the gains that the cross-entropy method finds."""
    rng = np.random.default_rng(seed)
    mean, spread = np.zeros(_GAINS), np.ones(_GAINS)
    for generation in range(GENERATIONS):
        gains = mean + spread * rng.standard_normal((boards.num_envs, _GAINS))
        returns = play(boards, partial(actions_by, gains), seed + generation).returns
        best = gains[np.argsort(returns)[-ELITE:]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 0.02
    return np.asarray(mean)


def policies(boards: dict[str, BoardVectorEnv], trained: dict[str, tuple[Array, float]]) -> ResultPart:
    """Evaluate the policy that was trained on each fidelity on both."""
    part = ResultPart(
        "policies",
        f"A policy trained on one fidelity and evaluated on both, with noise, in {BOARDS} other episodes each",
        "trained on | training [CPU s] | evaluated on | success | return | time [s]",
    )
    for name, (gains, taken) in trained.items():
        for other, fleet in boards.items():
            part.add(name, taken, other, *play(fleet, noisy(gains, 1), 1_000_000).row())
    return part


def differences(boards: dict[str, BoardVectorEnv], gains: Array) -> ResultPart:
    """Compare the true states of both fidelities under the actions that a policy takes on the strict one."""
    strict, reduced = boards[STRICT], boards[REDUCED]
    observed, _ = strict.reset(seed=2_000_000)
    reduced.reset(seed=2_000_000)
    states, released, decide = [], np.full(BOARDS, -1), noisy(gains, 2)
    alive = np.ones(BOARDS, bool)
    for step in range(round(20.0 / STEP_SECONDS)):
        actions = decide(observed)
        observed, _, one, cut, _ = strict.step(actions)
        seen, _, other, stopped, _ = reduced.step(actions)
        states.append((np.stack([observed, seen])[:, :, -len(TRUTH) :] * SCALES, alive.copy()))
        released = np.where((released < 0) & (observed[:, 1] + observed[:, 2] > 0.0), step, released)
        alive &= ~(one | cut | other | stopped)
        for fleet, over in ((strict, one | cut), (reduced, other | stopped)):
            if over.any():
                fleet.reset(options={"reset_mask": over})
        if not alive.any():
            break
    return _table_of(states, released)


def _table_of(states: list[tuple[Array, NDArray[np.bool_]]], released: NDArray[np.int64]) -> ResultPart:
    """Return the quantiles of the differences at some times after the release, of episodes that are under way then."""
    part = ResultPart(
        "differences",
        "Difference between strict and reduced fidelity with the same actions: median and 95 % quantile",
        "number | unit | " + " | ".join(f"{time:g} s: median, 95 %" for time in TIMES) + " | range",
    )
    both, alive = np.array([pair for pair, _ in states]), np.array([one for _, one in states])
    names = [one.name for one in TRUTH]
    for name, (words, unit, factor) in UNITS.items():
        values = both[..., names.index(name)] * factor
        cells = []
        for time in TIMES:
            steps = released + round(time / STEP_SECONDS)
            there = np.flatnonzero((released >= 0) & (steps < len(values)))
            there = there[alive[steps[there], there]]
            gaps = np.abs(values[steps[there], 0, there] - values[steps[there], 1, there])
            cells.append(f"{np.median(gaps):.3g}, {np.quantile(gaps, 0.95):.3g}" if len(gaps) else "-")
        spread = np.quantile(values[:, 0][alive], [0.025, 0.975])
        part.add(words, unit, *cells, f"{spread[0]:.3g} to {spread[1]:.3g}")
    return part


def study() -> Iterator[ResultPart]:
    """Train a policy at each fidelity, evaluate it at both, and compare states under the same actions."""
    boards = {name: boards_of(name, BOARDS) for name in (STRICT, REDUCED)}
    trained: dict[str, Any] = {}
    for name, fleet in boards.items():
        play(fleet, noisy(np.zeros(_GAINS), 0), 0)
        begun = process_time()
        trained[name] = train(fleet, 1), process_time() - begun
    yield policies(boards, trained)
    yield differences(boards, trained[REDUCED][0])
