"""``make evidence ARGS=velocity``: lag, noise, error and cost of the velocity estimators, and the largest stable delay.

Movements have a closed form and are read each millisecond in the encoder steps of a Touch; the estimators are those
that agents run. The largest stable delay is that of the paper's virtual coupling on a bare stylus, with the board's end
fixed: from the eigenvalues of the whole sampled loop for linear estimators, and from runs for all of them.

In that loop each millisecond the position is read, the velocity estimated, and the force ``-k x - c v`` computed. The
force acts for one millisecond, after a delay of whole milliseconds. The mass is stepped exactly. Linear estimators are
written as linear systems, so that the whole loop is one matrix; runs use the estimators themselves.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import pi
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from netboard.base.config import Config
from netboard.base.looks import PRINT_BODY
from netboard.base.tick import TICK_NS, TICK_SECONDS
from netboard.benchmarks.harness.results import Folder, ResultPart, Value
from netboard.benchmarks.harness.running import Tell
from netboard.devices.contract.estimators import WINDOW_NS, Estimator, alpha_beta_gains, kalman_gains
from netboard.devices.contract.velocity import KINDS
from netboard.participants.body.device_models import MODELS

Array = NDArray[np.float64]

IDEAL = "ideal"
"""Name of an estimator that knows the true velocity."""

TOUCH = MODELS["touch"]
START = 0.01
"""Distance of the mass from its equilibrium at the release [m]."""

LARGEST = 60
"""Largest delay tried [ms]."""


@dataclass(frozen=True)
class Loop:
    """A mass on a virtual coupling.

    - `mass`, `b`: mass and damping of the device [kg, N s/m].
    - `stiffness`, `damping`: those of the coupling [N/m, N s/m].
    """

    mass: float
    b: float
    stiffness: float
    damping: float

    def step(self) -> tuple[Array, Array]:
        """Return the matrices of a tick for position and velocity, and for a constant force."""
        rates = np.array([[0.0, 1.0, 0.0], [0.0, -self.b / self.mass, 1.0 / self.mass], [0.0, 0.0, 0.0]])
        whole = expm(TICK_SECONDS * rates)
        return whole[:2, :2], whole[:2, 2]


def linear_estimator(kind: str) -> tuple[Array, Array, Array, float]:
    """Return an estimator as a linear system: next state = A state + B position, velocity = C state + D position."""
    if kind in ("difference", "chai3d"):
        n = 1 if kind == "difference" else WINDOW_NS // TICK_NS
        span = n * TICK_SECONDS
        return np.eye(n, k=-1), np.eye(n)[0], -np.eye(n)[-1] / span, 1.0 / span
    if kind not in ("alpha_beta", "kalman"):
        raise ValueError(f"the estimator {kind} is not linear")
    order = 2 if kind == "alpha_beta" else 3
    gains = np.array(alpha_beta_gains() if kind == "alpha_beta" else kalman_gains(TOUCH.resolution))[:order]
    motion = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])[:order, :order]
    closed = motion - np.outer(gains, motion[0])
    return closed, gains, closed[1] / TICK_SECONDS, float(gains[1]) / TICK_SECONDS


def radius_of(loop: Loop, kind: str, delay: int) -> float:
    """Return the spectral radius of the whole loop, which is stable below 1."""
    by_itself, by_force = loop.step()
    a, b, c, d = linear_estimator(kind) if kind != IDEAL else (np.zeros((0, 0)), np.zeros(0), np.zeros(0), 0.0)
    inner = len(b)
    size = 2 + inner + delay
    force = np.zeros(size)
    force[0] = -loop.stiffness - loop.damping * d
    force[1] = -loop.damping if kind == IDEAL else 0.0
    force[2 : 2 + inner] = -loop.damping * c
    whole = np.zeros((size, size))
    whole[:2, :2] = by_itself
    whole[2 : 2 + inner, 2 : 2 + inner] = a
    whole[2 : 2 + inner, 0] = b
    if delay == 0:
        whole[:2] += np.outer(by_force, force)
    else:
        whole[:2, -1] += by_force
        whole[2 + inner] = force
        whole[3 + inner :, 2 + inner : -1] = np.eye(delay - 1)
    return float(np.abs(np.linalg.eigvals(whole)).max())


def settles(loop: Loop, kind: str, delay: int, seconds: float) -> bool:
    """Return whether the released mass swings less in the last quarter, in a run with encoder steps."""
    meter = KINDS[kind](TOUCH.resolution) if kind != IDEAL else None
    ((_, xv), (_, vv)), (xf, vf) = (part.tolist() for part in loop.step())
    x, v, largest = START, 0.0, 0.0
    coming = [0.0] * delay
    ticks = round(seconds / TICK_SECONDS)
    for k in range(ticks):
        seen = round(x / TOUCH.resolution) * TOUCH.resolution
        rate = v if meter is None else meter.update(k * TICK_NS, 0.0, 0.0, seen)[2]
        coming.append(-loop.stiffness * seen - loop.damping * rate)
        force = coming.pop(0)
        x, v = x + xv * v + xf * force, vv * v + vf * force
        if abs(x) > 10.0 * START:
            return False
        if k > 3 * ticks // 4:
            largest = max(largest, abs(x))
    return largest < START


def largest_delay(loop: Loop, kind: str) -> int:
    """Return the largest delay at which the loop is stable, by its eigenvalues."""
    return _largest(lambda delay: radius_of(loop, kind, delay) < 1.0)


def largest_played(loop: Loop, kind: str, seconds: float) -> int:
    """Return the largest delay at which a run settles."""
    return _largest(lambda delay: settles(loop, kind, delay, seconds))


def _largest(holds: Callable[[int], bool]) -> int:
    """Return the last stable delay before the first unstable one [ms]."""
    delay = -1
    while delay < LARGEST and holds(delay + 1):
        delay += 1
    return delay


OFFSETS, QUICK_OFFSETS = 20, 5
"""Number of start positions within an encoder step, for each movement [1]."""

UPDATES, QUICK_UPDATES = 100_000, 10_000
"""Number of updates in one timing; the fastest of `GOES` timings counts [1]."""

GOES = 5

SECONDS, QUICK_SECONDS = 8.0, 3.0
"""Duration of a run with delayed forces [s]."""

RUN_UP = 100
"""Samples before the measurement starts [1]."""


@dataclass(frozen=True)
class Movement:
    """A movement in closed form: its height and its velocity at times [m, m/s]."""

    name: str
    samples: int
    height: Callable[[Array], Array]
    rate: Callable[[Array], Array]


def _steady(speed: float) -> Movement:
    return Movement(f"{speed * 1e3:.0f} mm/s", 2000, lambda t: speed * t, lambda t: np.full(len(t), speed))


def _wave(name: str, size: float, frequency: float) -> Movement:
    turn = 2.0 * pi * frequency
    return Movement(name, 2000, lambda t: size * np.sin(turn * t), lambda t: size * turn * np.cos(turn * t))


def _reach(distance: float, start: float, duration: float) -> Movement:
    """A minimum-jerk movement from rest to rest (Flash and Hogan 1985)."""

    def share(t: Array) -> Array:
        return np.clip((t - start) / duration, 0.0, 1.0)

    return Movement(
        "reach",
        round(1e3 * (2.0 * start + duration)),
        lambda t: distance * share(t) ** 3 * (10.0 + share(t) * (6.0 * share(t) - 15.0)),
        lambda t: distance / duration * 30.0 * share(t) ** 2 * (1.0 - share(t)) ** 2,
    )


ACCELERATION = 1.0
"""Acceleration of the movement from which the lag is measured [m/s2]."""

RAMP = Movement("ramp", 500, lambda t: 0.5 * ACCELERATION * t**2, lambda t: ACCELERATION * t)
REST = _wave("rest", 0.02e-3, 9.0)
SLOW, FAST = _steady(0.0103), _steady(0.3017)
REACH = _reach(0.1, 0.15, 0.4)
SINE = _wave("10 Hz", 0.002, 10.0)


def errors_of(kind: str, movement: Movement, offsets: int) -> tuple[Array, Array]:
    """Return the errors of an estimator on a movement."""
    t = np.arange(movement.samples, dtype=np.float64) * TICK_SECONDS
    rate = movement.rate(t)
    found = []
    for k in range(offsets):
        offset = (k + 0.5) / offsets * TOUCH.resolution
        seen = np.round((movement.height(t) + offset) / TOUCH.resolution) * TOUCH.resolution
        found.append(follow(KINDS[kind](TOUCH.resolution), seen) - rate)
    return t[RUN_UP:], np.array(found)[:, RUN_UP:]


def follow(meter: Estimator, heights: Array) -> Array:
    """Return the estimates for heights that are read each tick."""
    return np.array([meter.update(k * TICK_NS, 0.0, 0.0, z)[2] for k, z in enumerate(heights.tolist())])


def time_of(kind: str, updates: int) -> float:
    """Return the duration of an update, for a stylus that moves on all axes."""
    t = TICK_SECONDS * np.arange(updates)
    path = np.round(0.02 * np.sin(np.outer(t, (3.0, 5.0, 7.0))) / TOUCH.resolution) * TOUCH.resolution
    samples = [(k * TICK_NS, *place) for k, place in enumerate(path.tolist())]
    best = np.inf
    for _ in range(GOES):
        update = KINDS[kind](TOUCH.resolution).update
        update(*samples[0])
        began = perf_counter()
        for sample in samples:
            update(*sample)
        best = min(best, perf_counter() - began)
    return float(best / updates)


def figures(*, quick: bool, tell: Tell) -> ResultPart:
    """Measure lag, noise, errors and time of each estimator."""
    offsets, updates = (QUICK_OFFSETS, QUICK_UPDATES) if quick else (OFFSETS, UPDATES)
    part = ResultPart(
        "estimators",
        f"Velocity from encoder steps of {TOUCH.resolution * 1e3:g} mm, read each ms",
        f"estimator | lag [ms] | rms at rest [mm/s] | rms at {SLOW.name} [mm/s] | rms at {FAST.name} [mm/s] | "
        "largest on a reach [mm/s] | largest at 10 Hz [mm/s] | update [ns]",
    )
    for i, kind in enumerate(KINDS):
        tell(f"movements: {kind}", i / len(KINDS))
        _, ramp = errors_of(kind, RAMP, offsets)
        lag = -float(ramp.mean()) / ACCELERATION
        noises = [1e3 * float(np.sqrt(np.mean(errors_of(kind, m, offsets)[1] ** 2))) for m in (REST, SLOW, FAST)]
        largest = [1e3 * float(np.abs(errors_of(kind, m, offsets)[1]).max()) for m in (REACH, SINE)]
        part.add(kind, 1e3 * lag, *noises, *largest, 1e9 * time_of(kind, updates))
    return part


def delays(*, quick: bool, tell: Tell) -> ResultPart:
    """Find the largest stable delay of the paper's virtual coupling for a bare stylus, with each estimator."""
    physics = Config().physics
    loops = [Loop(TOUCH.mass, b, physics.k_h, physics.c_h) for b in (0.0, TOUCH.damping)]
    part = ResultPart(
        "delays",
        f"Largest delay of {physics.k_h:g} N/m, {physics.c_h:g} N s/m on a bare stylus of {TOUCH.mass * 1e3:g} g",
        ("estimator", *(f"{how}, {loop.b:g} N s/m [ms]" for loop in loops for how in ("theory", "runs"))),
    )
    differ: list[str] = []
    kinds = (IDEAL, *KINDS)
    for i, kind in enumerate(kinds):
        tell(f"late forces: {kind}", i / len(kinds))
        row: list[Value] = []
        for loop in loops:
            theory = "-" if kind == "adaptive" else largest_delay(loop, kind)
            run = largest_played(loop, kind, QUICK_SECONDS if quick else SECONDS)
            row += [theory, run]
            if kind != "adaptive" and theory != run:
                differ.append(f"{kind}, {loop.b:g} N s/m: {theory} and {run} ms")
        part.add(kind, *row)
    part.claim(
        "runs in encoder steps settle up to the delay that eigenvalues allow, and not beyond",
        not differ,
        "; ".join(differ) or f"{2 * (len(kinds) - 1)} of {2 * (len(kinds) - 1)}",
    )
    # The linear rule: K < (b + B) / (T / 2 + delay) (Gil et al. 2009).
    limits = [1e3 * ((loop.b + loop.damping) / loop.stiffness - TICK_SECONDS / 2.0) for loop in loops]
    ideal = list(zip(map(int, part.rows[0][1::2]), limits, strict=True))
    part.claim(
        "the ideal one comes close to the linear rule, from below",
        all(limit - 2.5 < found <= limit for found, limit in ideal),
        ", ".join(f"{found} of {limit:.1f} ms" for found, limit in ideal),
    )
    return part


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Run the parts of the study, and draw their results if matplotlib is installed."""
    found = figures(quick=quick, tell=tell)
    yield found
    late = delays(quick=quick, tell=tell)
    folder.save("velocity", lambda: draw(found, late))
    yield late


def draw(found: ResultPart, late: ResultPart) -> Any:
    """Draw errors on a reach and on a sine, and for each estimator its noise and the largest stable delay."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15.0, 5.0), layout="constrained")
    reach, sine, trade = figure.subplots(1, 3)
    for kind in KINDS:
        strength = 0.3 if kind == "difference" else 1.0
        t, error = errors_of(kind, REACH, 1)
        reach.plot(t, 1e3 * error[0], label=kind, linewidth=1.0, alpha=strength)
        t, error = errors_of(kind, SINE, 1)
        shown = slice(0, round(0.2 / TICK_SECONDS))
        sine.plot(t[shown], 1e3 * error[0][shown], linewidth=1.0, alpha=strength)
    delay_of = {str(row[0]): row[2] for row in late.rows}
    for row in found.rows:
        kind, noise = str(row[0]), float(np.float64(row[3]))
        trade.plot(noise, delay_of[kind], marker="o")
        trade.annotate(kind, (noise, delay_of[kind]), textcoords="offset points", xytext=(6, 4))
    for ax, title in ((reach, "minimum-jerk reach, 0.1 m in 0.4 s"), (sine, "2 mm at 10 Hz")):
        ax.set_title(title)
        ax.set_xlabel("time [s]")
        ax.set_ylabel("error of the velocity [mm/s]")
        ax.grid(True, alpha=0.3)
    reach.legend(loc="best", fontsize=PRINT_BODY)
    trade.set_xscale("log")
    trade.set_title("to the left: quieter; up: more delay is left")
    trade.set_xlabel(str(found.columns[3]))
    trade.set_ylabel(f"largest delay: {late.columns[2]}")
    trade.margins(0.3)
    trade.grid(True, alpha=0.3)
    return figure
