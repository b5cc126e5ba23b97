"""Corrupted samples in live ticks: jumps, losses, invalid values, tremor, coarse quantisation.

The hands rest, the trial begins, and then they move as in the test problem. The samples of half a second are corrupted.
All outputs of a tick must be finite, forces must not exceed those that the coupling computes from the samples used, and
half a second later no effect may remain. The last requirement is checked with a fixed ball, because the motion of a
free ball is unstable.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Config
from netboard.base.tick import OUTPUT, STATE, TICK, TICK_SECONDS
from netboard.benchmarks.harness.results import ResultPart
from netboard.benchmarks.physics.problem import styluses_at
from netboard.benchmarks.physics.tick_cost import sampled_rows
from netboard.stage.stage import Stage, make_stage
from netboard.task.trials.state_machine import Cause

REST, WHOLE = 1200, 4000
"""Ticks for which the hands rest, and ticks in all [1]."""

CORRUPTED = slice(2500, 3000)
AFTER = slice(3500, 4000)

AGE_NS = 300_000
"""Age of the samples when a tick begins [ns]."""

MAX_REMAINDER = 1e-6
"""Largest remainder of a disturbance in height and tilt [m, rad]."""

Rows = NDArray[Any]
Corruption = Callable[[Rows], None]
"""Function that corrupts the rows of the disturbed time."""


def smooth_rows() -> Rows:
    """Return ticks with samples of hands that rest, then move smoothly."""
    times = (np.arange(WHOLE) - REST) * TICK_SECONDS - AGE_NS * 1e-9
    start = np.clip(times / 0.5, 0.0, 1.0)[:, None]
    share, rate = start**2 * (3.0 - 2.0 * start), 6.0 * start * (1.0 - start) / 0.5
    z, vz = styluses_at(times)
    return sampled_rows(share * z, share * vz + rate * z, 10**9, AGE_NS)


def _jump(rows: Rows) -> None:
    rows["left_sent_z"][::50] += 0.1


def _seen_jump(rows: Rows) -> None:
    rows["left_sent_z"][::50] += 0.1
    rows["left_sent_vz"] = np.gradient(rows["left_sent_z"], TICK_SECONDS)


def _drop_outs(rows: Rows) -> None:
    for length, first in ((1, 0), (5, 50), (20, 100), (100, 200)):
        rows["left_live"][first : first + length] = 0


def _losses(rows: Rows) -> None:
    rows["left_live"][np.random.default_rng(1).random(len(rows)) < 0.3] = 0


def _not_numbers(rows: Rows) -> None:
    rows["left_sent_z"][::7], rows["left_sent_vz"][::11] = np.nan, np.nan
    rows["right_sent_z"][::13], rows["right_sent_vz"][::17] = np.inf, -np.inf


def _frozen(rows: Rows) -> None:
    for name in ("left_stamp_ns", "left_seq", "left_sent_z", "left_sent_vz"):
        rows[name] = rows[name][0]


def _frozen_fast(rows: Rows) -> None:
    _frozen(rows)
    rows["left_sent_vz"] = 1.0


def _tremor(rows: Rows) -> None:
    turn = 2.0 * np.pi * 100.0
    t = np.arange(len(rows)) * TICK_SECONDS
    rows["left_sent_z"] += 0.002 * np.sin(turn * t)
    rows["left_sent_vz"] += 0.002 * turn * np.cos(turn * t)


def _quantised(rows: Rows) -> None:
    for side in SIDES:
        rows[f"{side}_sent_z"] = np.round(rows[f"{side}_sent_z"] / 0.001) * 0.001
        rows[f"{side}_sent_vz"] = np.gradient(rows[f"{side}_sent_z"], TICK_SECONDS)


def _clocks(rows: Rows) -> None:
    rows["left_stamp_ns"][::3] += 10**9
    rows["left_stamp_ns"][1::3] -= 10**9
    rows["right_stamp_ns"] = rows["right_stamp_ns"][0]


def _huge(rows: Rows) -> None:
    rows["left_sent_z"][::9], rows["left_sent_vz"][::10] = 1e300, -1e300


def _huge_rates(rows: Rows) -> None:
    for side in SIDES:
        rows[f"{side}_stamp_ns"], rows[f"{side}_sent_vz"] = rows["time_ns"], 1e300


def _denormal(rows: Rows) -> None:
    for side in SIDES:
        rows[f"{side}_sent_z"], rows[f"{side}_sent_vz"] = 5e-324, -5e-324


KINDS: dict[str, Corruption] = {
    "jumps of 10 cm, back in a tick": _jump,
    "the same, and seen in the rate": _seen_jump,
    "drop-outs of 1 to 100 ms": _drop_outs,
    "3 of 10 samples lost": _losses,
    "NaN and infinite samples": _not_numbers,
    "frozen": _frozen,
    "frozen at 1 m/s": _frozen_fast,
    "tremor of 2 mm at 100 Hz": _tremor,
    "quantised to 1 mm": _quantised,
    "clocks a second off": _clocks,
    "samples of 1e300": _huge,
    "rates of 1e300": _huge_rates,
    "denormal samples": _denormal,
}


def play(stage: Stage, rows: Rows, started: bool) -> Rows:
    """Run the live tick over rows."""
    played = rows.copy()
    if started:
        played["command"][0] = Cause.START
    stage.advance(stage.initial(), played, 0, len(played))
    return played


def corrupted_samples(config: Config) -> ResultPart:
    """Run all kinds of corrupted samples and tabulate the results."""
    stage, smooth = make_stage(config), smooth_rows()
    calm = play(stage, smooth, started=False)
    part = ResultPart(
        "odd-hands",
        "Odd hands for half a second, through the live tick",
        "samples | not finite [1] | largest force of a coupling [N] | what it may be [N] | faults [1] | "
        "left 0.5 s later [m, rad]",
    )
    lost, large, kept = [], [], []
    for kind, corrupt in KINDS.items():
        corrupted = smooth.copy()
        corrupt(corrupted[CORRUPTED])
        fixed, rolling = play(stage, corrupted, started=False), play(stage, corrupted, started=True)
        not_finite = sum(_not_finite(played) for played in (fixed, rolling))
        force, most = _forces(fixed, rolling, config)
        remainder = max(float(np.abs(fixed[name][AFTER] - calm[name][AFTER]).max()) for name in ("z", "theta"))
        faults = int(np.count_nonzero(rolling["event"] == Cause.FAULT))
        part.add(kind, not_finite, force, most, faults, remainder)
        lost += [kind] if not_finite else []
        large += [kind] if not force <= most else []
        kept += [kind] if not remainder <= MAX_REMAINDER else []
    part.claim("everything that comes out is finite", not lost, _named(lost))
    part.claim("forces are within what the coupling makes of the samples used", not large, _named(large))
    part.claim(f"board is back to within {MAX_REMAINDER:g} m and rad", not kept, _named(kept))
    return part


def _named(kinds: Sequence[str]) -> str:
    return f"not with {', '.join(kinds)}" if kinds else "with all"


def _not_finite(rows: Rows) -> int:
    """Count the non-finite numbers in states and outputs."""
    names = [name for name in (*(STATE.names or ()), *(OUTPUT.names or ())) if TICK[name].kind == "f"]
    return sum(int(np.count_nonzero(~np.isfinite(rows[name]))) for name in names)


def _forces(fixed: Rows, rolling: Rows, config: Config) -> tuple[float, float]:
    """Return the largest coupling force, and its bound from the samples used [N].

    Coupling and board are passive: the board's ends move no farther and no faster than twice the hands. Two samples a
    tick apart differ by the whole range at most.
    """
    physics = config.physics
    force, most = 0.0, 0.0
    for rows in (fixed, rolling):
        for side in SIDES:
            force = max(force, float(np.abs(rows[f"{side}_coupling"]).max()))
        used = max(float(np.abs(rows[f"{side}_used_vz"]).max()) for side in SIDES)
        speed = min(used, 2.0 * config.task.stylus_range / TICK_SECONDS)
        weight = (physics.M + physics.balls * physics.m) * physics.g
        most = max(most, 3.0 * (physics.k_h * config.task.stylus_range + physics.c_h * speed + weight))
    return force, most
