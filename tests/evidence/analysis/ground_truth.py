"""Synthetic trials with known values: closed-form movements of hands and ball, as the rows of a recording.

This module uses nothing of `netboard.analysis`. The ball rolls to the target in minimum-jerk submovements, sometimes
past it and back, and then rests. Both hands turn the board in minimum-jerk movements, one with a fixed delay after the
other. Forces are sines. The true value of each measure follows from these formulas, sampled at 1 kHz.
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
"""Number of ticks of the hold after the tick at which the ball enters the target [1]."""

REACH, HALF_WIDTH, ARM = 0.15, 0.035, 0.4
"""Centre and half width of the target, and distance from the middle of the board to a hand [m]."""

IDLE = 2500
"""Number of ticks between two trials, in which the hands move back [1]."""

MISSING = 1
"""Number of samples missing at the end of every fourth trial: its completion time is recorded, not measured [1]."""

FORCES = (1.0, 0.7), (1.5, 0.9)
"""Amplitude and frequency of the force of the left and of the right hand [N, Hz]."""

TREMOR = 1e-5
"""Amplitude of the tremor of both hands, at 1 Hz [m]."""

TURNING = np.radians(1.0)
STILL = 0.003
"""Thresholds of the paper for a turning board [rad/s] and a moving hand [m/s]."""

Signal = NDArray[np.float64]


@dataclass(frozen=True)
class Known:
    """A trial with its true values.

    - `columns`: samples, named as in an imported table [SI].
    - `values`: true values of the measures, named as in the table of trials [SI].
    - `turns` (shape (k,)): onsets of the movements of the board, from the release [s].
    - `delay`: delay of the left hand relative to the right hand in all movements [s].
    - `clear`: no peak of the ball's speed lies within 0.1 s of the completion.
    """

    columns: dict[str, Signal]
    values: dict[str, float]
    turns: Signal
    delay: float
    clear: bool


def roll(time: Signal, start: float, duration: float, way: float) -> tuple[Signal, Signal]:
    """Return position and velocity of a minimum-jerk movement of length `way`."""
    s = np.clip((time - start) / duration, 0.0, 1.0)
    return way * s**3 * (10.0 - 15.0 * s + 6.0 * s**2), way / duration * 30.0 * s**2 * (1.0 - s) ** 2


def _ball(time: Signal, rng: np.random.Generator) -> tuple[Signal, Signal]:
    """Roll a ball from one target to the other in one to four submovements, half of the time past it and back."""
    count = int(rng.integers(1, 5))
    shares = rng.dirichlet(np.full(count, 8.0))
    past = float(rng.uniform(0.05, 0.1)) * int(rng.integers(2))
    ways = [*(shares * (2.0 * REACH + past)), *([-past] * bool(past))]
    place, velocity, at = np.full(time.size, -REACH), np.zeros(time.size), float(rng.uniform(0.3, 0.6))
    for way in ways:
        duration = float(rng.uniform(0.7, 1.3))
        distance, velocity_change = roll(time, at, duration, way)
        place, velocity, at = place + distance, velocity + velocity_change, at + duration * float(rng.uniform(0.9, 1.1))
    return place, velocity


def _hands(time: Signal, rng: np.random.Generator, end: float) -> tuple[list[Signal], list[Signal], float]:
    """Turn the board back and forth, the left hand with a delay; return heights, velocities and the delay."""
    delay = float(rng.integers(0, 80)) / RATE
    # Without tremor the analysis would flag the styluses as stuck.
    heights = [TREMOR * np.sin(2.0 * pi * time)] * 2
    rates = [TREMOR * 2.0 * pi * np.cos(2.0 * pi * time)] * 2
    at, way = float(rng.uniform(0.15, 0.3)), float(rng.choice([-1.0, 1.0]))
    while at < end - 1.0:
        size, duration = way * float(rng.uniform(0.015, 0.03)), float(rng.uniform(0.5, 0.8))
        for side, (sign, late) in enumerate(((-1.0, delay), (1.0, 0.0))):
            distance, velocity_change = roll(time, at + late, duration, sign * size)
            heights[side], rates[side] = heights[side] + distance, rates[side] + velocity_change
        at, way = at + duration + delay + float(rng.uniform(0.25, 0.5)), -way
    return heights, rates, delay


def trial(rng: np.random.Generator, *, side: int, short: bool) -> Known:
    """Make a trial with the target at side -1 or 1; with `short`, the last sample of the hold is missing."""
    time = np.arange(12 * RATE) / RATE
    p, vp = _ball(time, rng)
    inside = np.abs(p - REACH) <= HALF_WIDTH
    edges = np.flatnonzero(np.diff(inside.astype(int), prepend=0, append=0))
    done = int(next(first for first, after in edges.reshape(-1, 2) if after - first > HOLD))
    stop = done + HOLD + 1 - MISSING * short
    (left, right), (left_v, right_v), delay = _hands(time, rng, done / RATE)
    theta, omega = (right - left) / (2.0 * ARM), (right_v - left_v) / (2.0 * ARM)
    forces = [size * np.sin(2.0 * pi * rate * time + rng.uniform(0.0, 6.0)) for size, rate in FORCES]
    columns = {
        **{"left_z": left, "right_z": right, "left_vz": left_v, "right_vz": right_v, "theta": theta, "omega": omega},
        **{"p": side * p, "vp": side * vp, "left_coupling": forces[0], "right_coupling": forces[1]},
    }
    cut = {name: values[:stop] for name, values in columns.items()}
    before = {name: values[:done] for name, values in (*columns.items(), ("inside", inside), ("speed", np.abs(vp)))}
    peaks = 1 + np.flatnonzero(np.diff(np.sign(np.diff(np.abs(vp)))) < 0)
    clear = not (np.abs(peaks - done) < RATE // 10).any()
    return Known(cut, _values(before, p[:done], done / RATE), _turns(omega[:stop]), delay, clear)


def _values(before: Mapping[str, Signal], p: Signal, completion: float) -> dict[str, float]:
    """Compute the true values of a trial from its samples before the completion."""
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


def _turns(omega: Signal) -> Signal:
    """Return the onsets of turns faster than 1 degree/s that last at least 100 ms and 1 degree [s]."""
    fast = np.concatenate([[0], (np.abs(omega) > TURNING).astype(int), [0]])
    starts, stops = (np.flatnonzero(np.diff(fast) == way) for way in (1, -1))
    angles = np.array([abs(omega[a:b].sum()) / RATE for a, b in zip(starts, stops, strict=True)])
    return np.asarray(starts[(stops - starts > RATE // 10) & (angles >= TURNING)] / RATE)


def block(count: int, seed: int) -> tuple[list[Known], NDArray[Any], Config]:
    """Make a block of trials, the rows of its recording, and its configuration."""
    rng = np.random.default_rng(seed)
    trials = [trial(rng, side=1 if k % 2 else -1, short=k % 4 == 3) for k in range(count)]
    parts: dict[str, list[Any]] = {}
    away = roll(np.arange(IDLE) / RATE, 0.3, 1.2, 1.0)[0]
    for number, known in enumerate(trials, start=1):
        size = known.columns["p"].size
        completion = np.full(size, np.nan)
        completion[-1] = known.values["completion"]
        outcome = np.full(size, "", object)
        outcome[-1] = "success"
        for name, values in known.columns.items():
            before = parts[name][-1][-1] if name in parts and name not in ("p", "vp") else values[0]
            back = float(before) - values[0]
            parts.setdefault(name, []).extend((values[0] + back * (1.0 - away), values))
        target = 1 if (number - 1) % 2 else -1
        for name, idle, moving in (
            ("trial", np.zeros(IDLE, np.int64), np.full(size, number)),
            ("target", np.full(IDLE, target), np.full(size, target)),
            ("outcome", np.full(IDLE, "", object), outcome),
            ("completion", np.full(IDLE, np.nan), completion),
        ):
            parts.setdefault(name, []).extend((idle, moving))
    columns = {name: np.concatenate(values) for name, values in parts.items()}
    config = Config()
    config = replace(config, block=replace(config.block, trials=count))
    return trials, measured(np.arange(columns["p"].size), columns), config
