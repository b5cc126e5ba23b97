"""The automatic choice of `netboard simulate` in scenes and under hands that make its steps difficult.

Each case is compared with `dop853` in steps of a twentieth of the shortest time constant. Where the equations have a
kink, those steps are at most 1 us long. Cases that fail are printed with their errors, as any other.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from netboard.base.tables.scene import Physics
from netboard.benchmarks.harness.results import ResultPart
from netboard.benchmarks.physics.problem import MODELS, styluses_at
from netboard.physics.hands.sampled import INTERPOLATIONS, Hands
from netboard.physics.simulation import Steps, choose_steps, simulate

CLAIM = 1e-9
"""Claimed error, relative to the range of each signal [1]."""

SHARE, KINK_STEP = 0.05, 1e-6
"""Steps of the reference: times the fastest rate, and at most where the equations have kinks [1, s]."""

TOUCHING = {
    "paper": Physics(),
    "lagrangian": Physics(model="lagrangian"),
    "lagrangian, friction": Physics(model="lagrangian", ball_inertia=0.4, ball_height=0.02, rolling_resistance=0.01),
}
"""Scenes in which a ball just reaches its stop, or just misses it."""

REST = (0.0, 0.0, 0.0, 0.0, 0.02, 0.2)


@dataclass(frozen=True)
class Case:
    """A scene, hands and start, and the duration of the run; `kinks`: the equations are not smooth."""

    name: str
    physics: Physics
    hands: Hands
    start: tuple[float, ...] = REST
    hold: str = "hermite"
    kinks: bool = False


def moving(duration: float, rate: float = 1000.0, jitter: float = 0.0) -> Hands:
    """Return the hands of the test problem, sampled."""
    random = np.random.default_rng(1)
    times = np.arange(round(duration * rate) + 1) / rate
    times[1:-1] += random.uniform(-jitter, jitter, len(times) - 2) / rate
    return Hands(times, *styluses_at(times))


def still(duration: float) -> Hands:
    """Return hands that do not move."""
    times = np.arange(round(duration * 1000) + 1) / 1000
    return Hands(times, np.zeros((len(times), 2)), np.zeros((len(times), 2)))


def reaching(duration: float) -> Hands:
    """Return two reaches of least jerk, whose jerk jumps at their ends, between samples."""
    times = np.arange(round(duration * 1000) + 1) / 1000
    s = np.clip((times[:, None] - [0.0103, 0.0307]) / 0.05, 0.0, 1.0)
    z = np.array([0.03, -0.02]) * (s**3 * (10 - 15 * s + 6 * s**2))
    return Hands(times, z, np.array([0.6, -0.4]) * (30 * s**2 * (1 - s) ** 2))


def cases() -> Iterator[Case]:
    """Return all cases."""
    for model, k, c in product(MODELS, (1, 10, 100, 1000), (1, 10, 100, 1000)):
        physics = Physics(model=model, k_h=200.0 * k, c_h=2.0 * c)
        yield Case(f"{model}: k_h x{k}, c_h x{c}, from rest", physics, moving(0.02))
    for hold in INTERPOLATIONS:
        yield Case(f"hands: {hold}, irregular samples", Physics(), moving(0.2, 250.0, 0.4), hold=hold)
    yield Case("hands: reaches of least jerk", Physics(model="lagrangian"), reaching(0.2))
    yield Case("hands: samples 1 us apart", Physics(), moving(0.001, 1e6))
    resting = (0.0, 0.0, 0.0, 0.0, 0.0, 0.02)
    friction = Physics(rolling_resistance=0.02, ball_inertia=0.4)
    yield Case("friction: a ball comes to rest", friction, still(0.3), resting)
    lagrangian = replace(friction, model="lagrangian", ball_height=0.02)
    yield Case("friction: the same, Lagrange's equations", lagrangian, still(0.3), resting)
    tumbling = Physics(coupling="none", k_s=0.0, rolling_resistance=0.02, g=1.0)
    yield Case(
        "friction: a board passes the vertical", tumbling, still(0.5), (0.0, 0.0, 1.0, 8.0, 0.05, 0.3), kinks=True
    )
    yield Case("a board spins", Physics(coupling="none", k_s=0.0, g=1.0), still(0.3), (0.0, 0.0, 0.0, 50.0, 0.05, 0.3))
    yield Case("release at the saddle, 1e-9 m off", Physics(), still(1.0), (*REST[:4], 1e-9, 0.0))
    large = Physics(model="lagrangian", balls=4, ball_inertia=0.4, ball_height=0.03)
    yield Case("four rolling balls", large, moving(0.1), (*REST[:4], *(0.05, 0.1, -0.1, 0.2, 0.15, -0.1, -0.05, 0.0)))


@dataclass(frozen=True)
class Outcome:
    """Steps and error of a case."""

    steps: int
    longest: float
    stiffness: float
    error: float


def outcome_of(case: Case) -> Outcome:
    """Run a case, and its reference."""
    dt = (case.hands.t[-1] - case.hands.t[0]) / 20
    automatic = choose_steps(case.physics)
    motion = simulate(case.hands, case.physics, case.start, hold=case.hold, dt=dt)
    step = min(SHARE / automatic.fastest if automatic.fastest > 0.0 else 1e-4, 1e-4)
    fine = Steps("dop853", min(step, KINK_STEP) if case.kinks else step, 1, automatic.fastest)
    exact = simulate(case.hands, case.physics, case.start, hold=case.hold, dt=dt, steps=fine)
    ranges = np.ptp(exact.states, axis=0)
    differences = np.abs(motion.states - exact.states).max(axis=0)
    errors = differences / np.where(ranges > 0.0, ranges, 1.0)
    return Outcome(motion.count, motion.longest, motion.longest * automatic.fastest, float(errors.max()))


def stress_part() -> ResultPart:
    """List all cases, the touches of a stop included."""
    part = ResultPart(
        "stress",
        "Taylor method under stress: largest difference from dop853 in short steps, over the range of each signal",
        "case | steps | longest [ms] | longest, times the fastest rate [1] | error [1]",
    )
    failed = []
    for case in cases():
        found = outcome_of(case)
        part.add(case.name, found.steps, found.longest * 1e3, found.stiffness, found.error)
        if not found.error < CLAIM:
            failed.append(f"{case.name} ({found.error:.2g})")
    part.claim("errors below 1e-09 of each range", not failed, "; ".join(failed) or f"in {len(part.rows)} cases")
    wrong = [f"{name}: {said}" for name, said in touches(part) if said]
    part.claim("touches of a stop are found, and near misses are none", not wrong, "; ".join(wrong) or "all of them")
    return part


def touches(part: ResultPart) -> Iterator[tuple[str, str]]:
    """Run balls that just reach their stop, or just miss it; yield what is wrong with each."""
    tilted = Hands(np.arange(401) / 1000, np.tile([-0.005, 0.005], (401, 1)), np.zeros((401, 2)))
    start = (0.0, 0.0, 0.0, 0.0, 0.0, 0.05)
    peaks = {title: _peak(tilted, scene, start) for title, scene in TOUCHING.items()}
    for (title, scene), depth in product(TOUCHING.items(), (1e-3, 1e-6, 1e-9, 1e-10, -1e-10, -1e-9, -1e-6)):
        physics = replace(scene, ball_stop=peaks[title] * (1.0 - depth), restitution=0.5)
        motion = simulate(tilted, physics, start)
        inside = bool(np.all(motion.states[:, 4] <= physics.ball_stop * (1.0 + 1e-9)))
        free = simulate(tilted, scene, start)
        same = bool(np.array_equal(motion.states, free.states))
        side = "beyond" if depth > 0 else "before"
        name = f"{title}: a ball's peak is {abs(depth):.0e} of its stop {side} it"
        part.add(name, motion.count, motion.longest * 1e3, motion.longest * motion.steps.fastest, float(not inside))
        yield name, "" if inside and same == (depth < 0) else f"inside the stop: {inside}, undisturbed: {same}"


def _peak(hands: Hands, scene: Physics, start: tuple[float, ...]) -> float:
    """Return how far a ball rolls uphill, by a parabola through the row nearest to the peak."""
    dt = 1e-5
    p, vp = simulate(hands, scene, start, dt=dt).states[:, 4:6].T
    i = 1 + int(np.abs(vp[1:-1]).argmin())
    return float(p[i] - vp[i] ** 2 / ((vp[i + 1] - vp[i - 1]) / dt))
