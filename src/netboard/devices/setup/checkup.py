"""Device checkup: findings from the readings of a device and its response to pulses. Pure: tracks in, findings out.

The criteria are those of a 1 kHz haptic loop. The period is at most 1.2 ms in 99 % and 2 ms in 99.9 % of cases, and
never longer than 4 ms. A reading takes at most half a millisecond. The noise is below two encoder steps.
"""

from collections.abc import Sequence
from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.finding import Finding, graded
from netboard.devices.contract.device import DeviceInfo
from netboard.devices.contract.profile import Mechanics
from netboard.devices.safety.chain import ZERO, Vector
from netboard.devices.setup.loop import DeviceRun, Floats, smallest_step

AXES = ("x", "y", "z")
PERIOD_MS = (1.2, 2.0, 4.0)
"""Limits of the period: 99th percentile, 99.9th percentile, maximum [ms]."""

ANSWER_MS = 0.5
"""Limit of the reading time, 99th percentile [ms]."""

MIN_HZ = 900.0
"""Lowest good rate of new positions [Hz]."""

QUIET = 1.0
"""Length of the quietest window, in which noise is measured [s]."""

NOISY = 2.0
"""Limit of the standard deviation at rest, in encoder steps [1]."""

TOUCHED = 5e-3
"""Movement below which resolution and range cannot be judged [m]."""

PULSE, PERIOD, PULSES = 0.03, 0.5, 6
"""Length of a pulse [s], interval between pulses [s], and number of pulses [1]."""

BEFORE = 100
"""Readings before a pulse that predict the position without it, and after it in which the stylus must move [1]."""

PUSHING = PERIOD * (PULSES + 0.5)
"""Duration of the whole pulse sequence [s]."""

PUSHED = "force to movement"
"""Name of the finding on the response to pulses."""

SMALLEST = 1e-5
"""Smallest movement that counts as the response to a pulse, if the device reports no resolution [m]."""

LATE_MS = 10.0
"""Latency above which the virtual coupling oscillates [ms]."""


class Pushes(NamedTuple):
    """Response of a device to force pulses."""

    # Times from writing a pulse to the first reading with movement, one for each pulse that moved the stylus [s].
    delays: tuple[float, ...]
    tried: int
    mechanical: float  # minimum part of that time due to the stylus mass; NaN without identified mechanics [s]


def examine(track: DeviceRun, info: DeviceInfo) -> tuple[Finding, ...]:
    """Check the readings of a device."""
    return (
        _rate(track),
        _answer(track),
        _positions(track),
        _resolution(track, info),
        _noise(track, info),
        _range(track),
        _buttons(track),
        _ready(track),
    )


def push_force(level: float, t: float) -> Vector:
    """Return the force of the pulse sequence at a time: short pulses, alternately up and down."""
    turn, since = divmod(t - 0.5 * PERIOD, PERIOD)
    if 0.0 <= turn < PULSES and since < PULSE:
        return 0.0, 0.0, level if turn % 2 == 0 else -level
    return ZERO


def pushes(track: DeviceRun, info: DeviceInfo, mechanics: Mechanics | None) -> Pushes:
    """Measure the latency from each pulse to the movement of the stylus."""
    fz, height = track.force[:, 2], track.place[:, 2]
    starts = np.flatnonzero((np.abs(fz[1:]) > 0.0) & (fz[:-1] == 0.0)) + 1
    delays = []
    least = max(1.5 * info.resolution, SMALLEST)
    for start in starts:
        before = slice(max(start - BEFORE, 0), start + 1)
        line = np.polynomial.Polynomial.fit(track.time[before], height[before], 1)
        moved = max(least, 4.0 * float((height[before] - line(track.time[before])).std()))
        soon = slice(start, start + BEFORE)
        after = np.abs(height[soon] - line(track.time[soon])) > moved
        first = int(np.argmax(after))
        if after[first]:
            delays.append(float(track.time[start + first] - track.written[start]))
    level = float(np.abs(fz).max(initial=0.0))
    return Pushes(tuple(delays), len(starts), _mechanical(least, level, mechanics))


def judge_pushes(found: Pushes) -> Finding:
    """Check the response of a device to pulses."""
    name = PUSHED
    if len(found.delays) < max(1, found.tried // 2):
        return Finding(
            name,
            "red",
            f"{len(found.delays)} of {found.tried} pushes moved the stylus",
            "hold it loosely, or push harder; if you feel no force, check the power and the amplifiers of the device",
        )
    middle = float(np.median(found.delays)) * 1e3
    text = f"median {middle:.1f} ms, maximum {max(found.delays) * 1e3:.1f} ms over {len(found.delays)} pushes"
    figures = {"median_ms": middle, "largest_ms": max(found.delays) * 1e3}
    if np.isfinite(found.mechanical):
        mechanical = found.mechanical * 1e3
        text += f"; {mechanical:.1f} ms of it due to the mass"
        figures["mechanical_ms"] = mechanical
        late = middle - mechanical > LATE_MS
        return graded(name, not late, text, "the device answers late", figures)
    return Finding(name, "green", f"{text}; for the part due to the mass, run: netboard devices identify", "", figures)


def _mechanical(distance: float, level: float, mechanics: Mechanics | None) -> float:
    """Return the time in which a pulse moves a stylus from rest by a distance [s]."""
    if mechanics is None or not mechanics.identified:
        return np.nan
    net = level - mechanics.friction
    return sqrt(2.0 * distance * mechanics.mass / net) if net > 0.0 else inf


def _percentiles(values: Floats) -> tuple[float, float, float, float]:
    """Return median, 99th and 99.9th percentile and maximum, in milliseconds for values in seconds."""
    a, b, c, d = np.percentile(values, (50.0, 99.0, 99.9, 100.0)) * 1e3
    return float(a), float(b), float(c), float(d)


def _spread(values: Floats) -> tuple[str, dict[str, float]]:
    """Describe a distribution of times in words and as values."""
    p50, p99, p999, most = _percentiles(values)
    text = f"{p50:.3f} / {p99:.3f} / {p999:.3f} / {most:.3f} ms (50 / 99 / 99.9 / 100 %)"
    return text, {"p50_ms": p50, "p99_ms": p99, "p999_ms": p999, "largest_ms": most}


def _rate(track: DeviceRun) -> Finding:
    text, figures = _spread(np.diff(track.begun))
    figures["rate_hz"] = (len(track.begun) - 1) / float(track.begun[-1] - track.begun[0])
    good = all(figures[key] <= most for key, most in zip(("p99_ms", "p999_ms", "largest_ms"), PERIOD_MS, strict=True))
    return graded("loop", good, f"{figures['rate_hz']:.1f} Hz, period {text}", "see: netboard doctor", figures)


def _answer(track: DeviceRun) -> Finding:
    text, figures = _spread(track.took)
    return graded("read duration", figures["p99_ms"] <= ANSWER_MS, text, "slow to read", figures)


def _positions(track: DeviceRun) -> Finding:
    new = int(np.count_nonzero(np.diff(track.time) > 0.0))
    rate = new / float(track.begun[-1] - track.begun[0])
    advice = "the device is slower than the loop, so forces are computed from older positions"
    return graded("position updates", rate >= MIN_HZ, f"{rate:.0f} Hz", advice, {"rate_hz": rate})


def _resolution(track: DeviceRun, info: DeviceInfo) -> Finding:
    steps = [smallest_step(track.place[:, axis]) for axis in range(3)]
    stated = f"; the device reports {info.resolution * 1e3:.4f} mm" if info.resolution else ""
    if np.ptp(track.place, axis=0).max() < TOUCHED or not np.isfinite(min(steps)):
        return Finding("resolution", "yellow", f"not measured{stated}", "move the stylus during the test")
    words = ", ".join(f"{axis} {step * 1e3:.4f}" for axis, step in zip(AXES, steps, strict=True) if np.isfinite(step))
    coarse = bool(info.resolution) and min(steps) > 3.0 * info.resolution
    advice, figures = "coarser than the device reports", {"smallest_m": float(min(steps))}
    return graded("resolution", not coarse, f"{words} mm{stated}", advice, figures)


def _noise(track: DeviceRun, info: DeviceInfo) -> Finding:
    spread, speed = noise_at_rest(track)
    words = ", ".join(f"{axis} {value * 1e6:.1f}" for axis, value in zip(AXES, spread, strict=True))
    text = f"{words} um; velocity {speed * 1e3:.2f} mm/s (standard deviations)"
    noisy = bool(info.resolution) and max(spread) > NOISY * info.resolution
    figures = {f"{axis}_m": float(value) for axis, value in zip(AXES, spread, strict=True)} | {"speed": speed}
    advice = "lay the stylus down for a second during the test; if it was at rest, check cables and power supply"
    return graded("noise at rest", not noisy, text, advice, figures)


def _range(track: DeviceRun) -> Finding:
    low, high = track.place.min(axis=0) * 1e3, track.place.max(axis=0) * 1e3
    words = ", ".join(f"{axis} {a:.1f} to {b:.1f}" for axis, a, b in zip(AXES, low, high, strict=True))
    moved = float((high - low).max()) * 1e-3 >= TOUCHED
    return graded("range visited", moved, f"{words} mm", "move the stylus during the test")


def _buttons(track: DeviceRun) -> Finding:
    pressed = int(np.bitwise_or.reduce(track.buttons)) if len(track.buttons) else 0
    names = [str(bit) for bit in range(pressed.bit_length()) if pressed >> bit & 1]
    return Finding("buttons", "green", f"pressed: {', '.join(names)}" if names else "none was pressed")


def _ready(track: DeviceRun) -> Finding:
    share = float(track.ready.mean())
    advice = "calibrate the device, take the stylus in hand, bring it into its workspace"
    return graded("ready for forces", share > 0.0, f"{share:.0%} of the time", advice)


def noise_at_rest(track: DeviceRun) -> tuple[NDArray[np.float64], float]:
    """Return the standard deviations of the positions and of the speed in the quietest second."""
    size = min(round(QUIET * 1e3), len(track.time))
    starts: Sequence[int] = range(0, len(track.time) - size + 1, max(size // 4, 1))
    best = min(starts, key=lambda k: float(track.place[k : k + size].std(axis=0).max()))
    cut = slice(best, best + size)
    return track.place[cut].std(axis=0), float(np.sqrt((track.velocity[cut] ** 2).sum(axis=1).mean()))
