"""Trials with known measures: closed-form movements of hands and ball, written as a recording.

Nothing of `netboard.analysis` is used here. The ball rolls to the target in minimum-jerk submovements, some back and
forth, and then rests. Both hands turn the board in minimum-jerk movements, one with a fixed delay after the other.
Forces are sines. The true value of each measure follows from these formulas, sampled at 1 kHz.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config
from netboard.recording.importing.rows import measured

RATE = 1000
HOLD = 1500
"""The hold takes this many ticks after the one at which the ball comes in [1]."""

REACH, HALF_WIDTH, ARM = 0.15, 0.035, 0.4
"""Centre and half width of the target, and from the board's middle to a hand [m]."""

IDLE = 2500
"""Ticks between two trials, in which the hands go back [1]."""

SHORT = 1
"""Samples missing from the hold in every fourth trial, whose completion time is then given instead of measured [1]."""

FORCES = (1.0, 0.7), (1.5, 0.9)
"""Size and frequency of the left hand's force and the right one's [N, Hz]."""

TREMOR = 1e-5
"""Amplitude of the tremor of both hands, at 1 Hz [m]."""

FASTER = np.radians(1.0)
STILL = 0.003
"""The paper's thresholds: of a turning board [rad/s], of a moving hand [m/s]."""

Wave = NDArray[np.float64]


@dataclass(frozen=True)
class Known:
    """A trial, and what is known of it.

    - `columns`: its samples, as an imported table has them [SI].
    - `values`: what its measures should be, by their columns in the table of trials.
    - `turns` (shape (k,)): when each movement of the board begins, from the release [s].
    - `delay`: of the left hand behind the right one in all of them [s].
    - `clear`: no peak of the ball's speed is within 0.1 s of the completion.
    """

    columns: dict[str, Wave]
    values: dict[str, float]
    turns: Wave
    delay: float
    clear: bool


def roll(time: Wave, start: float, duration: float, way: float) -> tuple[Wave, Wave]:
    """Return place and velocity of a minimum-jerk movement."""
    s = np.clip((time - start) / duration, 0.0, 1.0)
    return way * s**3 * (10.0 - 15.0 * s + 6.0 * s**2), way / duration * 30.0 * s**2 * (1.0 - s) ** 2


def _ball(time: Wave, chance: np.random.Generator) -> tuple[Wave, Wave]:
    """Roll a ball from one target to the other in one to four submovements, now and then past it and back."""
    count = int(chance.integers(1, 5))
    shares = chance.dirichlet(np.full(count, 8.0))
    past = float(chance.uniform(0.05, 0.1)) * int(chance.integers(2))
    ways = [*(shares * (2.0 * REACH + past)), *([-past] * bool(past))]
    place, velocity, at = np.full(time.size, -REACH), np.zeros(time.size), float(chance.uniform(0.3, 0.6))
    for way in ways:
        duration = float(chance.uniform(0.7, 1.3))
        more, faster = roll(time, at, duration, way)
        place, velocity, at = place + more, velocity + faster, at + duration * float(chance.uniform(0.9, 1.1))
    return place, velocity


def _hands(time: Wave, chance: np.random.Generator, end: float) -> tuple[list[Wave], list[Wave], float]:
    """Turn the board to and fro with both hands, the left one later by a delay; return heights, rates and delay."""
    delay = float(chance.integers(0, 80)) / RATE
    # Nobody is still to the last encoder step: one that is would be marked as stuck.
    heights = [TREMOR * np.sin(2.0 * pi * time)] * 2
    rates = [TREMOR * 2.0 * pi * np.cos(2.0 * pi * time)] * 2
    at, way = float(chance.uniform(0.15, 0.3)), float(chance.choice([-1.0, 1.0]))
    while at < end - 1.0:
        size, duration = way * float(chance.uniform(0.015, 0.03)), float(chance.uniform(0.5, 0.8))
        for side, (sign, late) in enumerate(((-1.0, delay), (1.0, 0.0))):
            more, faster = roll(time, at + late, duration, sign * size)
            heights[side], rates[side] = heights[side] + more, rates[side] + faster
        at, way = at + duration + delay + float(chance.uniform(0.25, 0.5)), -way
    return heights, rates, delay


def trial(chance: np.random.Generator, *, side: int, short: bool) -> Known:
    """Make a trial with the target at a side; with `short`, one whose last sample of the hold is missing."""
    time = np.arange(12 * RATE) / RATE
    p, vp = _ball(time, chance)
    inside = np.abs(p - REACH) <= HALF_WIDTH
    edges = np.flatnonzero(np.diff(inside.astype(int), prepend=0, append=0))
    done = int(next(first for first, after in edges.reshape(-1, 2) if after - first > HOLD))
    stop = done + HOLD + 1 - SHORT * short
    (left, right), (left_v, right_v), delay = _hands(time, chance, done / RATE)
    theta, omega = (right - left) / (2.0 * ARM), (right_v - left_v) / (2.0 * ARM)
    forces = [size * np.sin(2.0 * pi * rate * time + chance.uniform(0.0, 6.0)) for size, rate in FORCES]
    columns = {
        **{"left_z": left, "right_z": right, "left_vz": left_v, "right_vz": right_v, "theta": theta, "omega": omega},
        **{"p": side * p, "vp": side * vp, "left_coupling": forces[0], "right_coupling": forces[1]},
    }
    cut = {name: values[:stop] for name, values in columns.items()}
    before = {name: values[:done] for name, values in (*columns.items(), ("inside", inside), ("speed", np.abs(vp)))}
    peaks = 1 + np.flatnonzero(np.diff(np.sign(np.diff(np.abs(vp)))) < 0)
    clear = not (np.abs(peaks - done) < RATE // 10).any()
    return Known(cut, _values(before, p[:done], done / RATE), _turns(omega[:stop]), delay, clear)


def _values(before: Mapping[str, Wave], p: Wave, completion: float) -> dict[str, float]:
    """Say what the measures of a trial should be, from its samples before the completion."""
    left, right, speed = before["left_vz"], before["right_vz"], before["speed"]
    moves = [np.sign(one) * (np.abs(one) >= STILL) for one in (left, right)]
    both = moves[0] * moves[1]
    rises = np.diff(np.sign(np.diff(speed)))
    entries = np.count_nonzero(np.diff(before["inside"].astype(int)) == 1) + 1
    far = p - REACH - HALF_WIDTH
    values: dict[str, float] = {
        "completion": completion,
        "entries": float(entries),
        "peaks": float(np.count_nonzero(rises < 0)),
        "cooperative": np.count_nonzero(both < 0) / RATE,
        "competitive": np.count_nonzero(both > 0) / RATE,
        "single": np.count_nonzero((both == 0) & (moves[0] + moves[1] != 0)) / RATE,
        "still": np.count_nonzero((moves[0] == 0) & (moves[1] == 0)) / RATE,
        "in_target": np.count_nonzero(before["inside"]) / RATE,
        "overshoots": float(np.count_nonzero(np.diff((far > 0).astype(int)) == 1)),
        "overshoot": max(float(far.max()), 0.0),
    }
    for side, velocity in (("left", left), ("right", right)):
        force = before[f"{side}_coupling"]
        values[f"{side}_power"] = float(np.mean(force * velocity))
        values[f"{side}_effort"] = float(np.sum(force**2)) / RATE
        moved = np.flatnonzero(np.abs(velocity) >= STILL)
        values[f"{side}_reaction"] = moved[0] / RATE if moved.size else np.nan
    return values


def _turns(omega: Wave) -> Wave:
    """Return when the board begins to turn faster than 1 degree/s, for 100 ms and 1 degree at least [s]."""
    fast = np.concatenate([[0], (np.abs(omega) > FASTER).astype(int), [0]])
    starts, stops = (np.flatnonzero(np.diff(fast) == way) for way in (1, -1))
    angles = np.array([abs(omega[a:b].sum()) / RATE for a, b in zip(starts, stops, strict=True)])
    return np.asarray(starts[(stops - starts > RATE // 10) & (angles >= FASTER)] / RATE)


def block(count: int, seed: int) -> tuple[list[Known], NDArray[Any], Config]:
    """Make a block of trials, as the rows of a recording."""
    chance = np.random.default_rng(seed)
    trials = [trial(chance, side=1 if k % 2 else -1, short=k % 4 == 3) for k in range(count)]
    parts: dict[str, list[Any]] = {}
    away = roll(np.arange(IDLE) / RATE, 0.3, 1.2, 1.0)[0]
    for number, known in enumerate(trials, start=1):
        size = known.columns["p"].size
        told = np.full(size, np.nan)
        told[-1] = known.values["completion"]
        words = np.full(size, "", object)
        words[-1] = "success"
        for name, values in known.columns.items():
            before = parts[name][-1][-1] if name in parts and name not in ("p", "vp") else values[0]
            back = float(before) - values[0]
            parts.setdefault(name, []).extend((values[0] + back * (1.0 - away), values))
        target = 1 if (number - 1) % 2 else -1
        for name, idle, own in (
            ("trial", np.zeros(IDLE, np.int64), np.full(size, number)),
            ("target", np.full(IDLE, target), np.full(size, target)),
            ("outcome", np.full(IDLE, "", object), words),
            ("completion", np.full(IDLE, np.nan), told),
        ):
            parts.setdefault(name, []).extend((idle, own))
    columns = {name: np.concatenate(values) for name, values in parts.items()}
    config = Config()
    config = replace(config, block=replace(config.block, trials=count))
    return trials, measured(np.arange(columns["p"].size), columns), config
