"""Errors of runs from sampled hands, for each extrapolation and each signal, after 1, 3 and 10 s.

The hands of the test problem are sampled at 1 kHz, as devices are. Live, an extrapolation uses the newest sample only;
offline, an interpolation uses the next one too. The reference is the same scene under continuous movements, so errors
include sampling, extrapolation and method. Errors of the ball grow by e in 2.28 s, since its equilibrium is a saddle.
"""

from collections.abc import Iterable, Iterator
from math import exp, inf

import numpy as np

from evidence.physics.reference import ERRORS, Reference, largest
from evidence.physics.statics import ball_poles
from netboard.base.tables.scene import Physics
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.harness.results import ResultPart, Value
from netboard.benchmarks.physics.problem import STATE_NAMES, Array, Problem, multiples, styluses_at
from netboard.benchmarks.physics.tick_cost import live_rows, live_stage, live_state
from netboard.physics.hands.sampled import Hands
from netboard.physics.simulation import choose_steps, simulate

Row = tuple[Value, ...]

HORIZONS = (1.0, 3.0, 10.0)
"""Durations of the runs [s]."""

NUDGE = 1e-6
"""Initial displacement of the ball, whose growth is measured [m]."""


def live_run(problem: Problem, hold: str, age_ns: int = 0) -> tuple[Array, Array]:
    """Run a problem by the server's ticks, from samples at 1 kHz; return states and commanded forces [SI, N]."""
    stage, rows = live_stage(problem, hold), live_rows(problem, age_ns)
    stage.advance(live_state(stage, problem, age_ns), rows, 0, len(rows))
    states = np.stack([rows[name] for name in STATE_NAMES], axis=1)
    return states, np.stack([rows["left_coupling"], rows["right_coupling"]], axis=1)


def offline_run(
    problem: Problem, method: str, substeps: int = 1, *, physics: Physics | None = None, nudge: float = 0.0
) -> tuple[Array, Array]:
    """Simulate a problem offline from samples of its hands; return states and commanded forces [SI, N].

    - `physics`: another scene under the same hands.
    - `nudge`: initial displacement of the ball [m].
    """
    times = multiples(round(problem.duration / TICK_SECONDS) + 1, TICK_SECONDS)
    scene, first = physics or problem.physics, np.add(problem.first, (0.0, 0.0, 0.0, 0.0, nudge, 0.0))
    steps = choose_steps(scene, method=method, substeps=substeps)
    found = simulate(Hands(times, *styluses_at(times)), scene, tuple(first.tolist()), dt=TICK_SECONDS, steps=steps)
    return found.states[:-1], found.forces[:-1]


def _errors(name: str, states: Array, forces: Array) -> Iterator[Row]:
    """Yield a row with the largest error of each of `SIGNALS` up to each horizon, on the grid of the reference."""
    for horizon in HORIZONS:
        stop = round(horizon / 0.002)
        worst = (*(float(np.abs(states[:stop, i]).max()) for i in (0, 2, 4)), float(np.abs(forces[:stop]).max()))
        yield (name, horizon, *worst)


def expectations(problem: Problem, reference: Reference) -> Iterator[Row]:
    """Yield the errors of live ticks with each extrapolation, and of offline runs."""
    runs = {
        "live, zoh": live_run(problem, "zoh"),
        "live, cv": live_run(problem, "cv"),
        "live, ca (the default)": live_run(problem, "ca"),
        "live, ca, samples 0.5 ms old": live_run(problem, "ca", 500_000),
        "live, ca, samples 1 ms old": live_run(problem, "ca", 1_000_000),
        "offline, hermite, rk4": offline_run(problem, "rk4"),
        "offline, hermite, etdrk4": offline_run(problem, "etdrk4"),
        "offline, hermite, dop853, 0.5 ms": offline_run(problem, "dop853", 2),
    }
    for name, found in runs.items():
        yield from _errors(name, *_errors_at_reference(reference, *found))


def _errors_at_reference(reference: Reference, states: Array, forces: Array) -> tuple[Array, Array]:
    """Return the errors of a run at every second tick."""
    states, forces = states[::2], forces[::2]
    return states - reference.states[: len(states)], forces - reference.forces[: len(forces)]


def left_out(problem: Problem) -> Iterator[Row]:
    """Yield the differences of more complete scenes from the paper's, with equal initial state and hands."""
    scenes = {
        "Lagrange's equations": Physics(model="lagrangian"),
        "Lagrange's, and the ball rolls (solid sphere)": Physics(model="lagrangian", ball_inertia=0.4),
        "the paper's, and the ball rolls": Physics(ball_inertia=0.4),
    }
    states, forces = offline_run(problem, "dop853", 2)
    for name, physics in scenes.items():
        other, felt = offline_run(problem, "dop853", 2, physics=physics)
        yield from _errors(name, (other - states)[::2], (felt - forces)[::2])


def growth(problem: Problem) -> list[tuple[float, float, float]]:
    """Return horizons, and the growth of an initial displacement, simulated and predicted from the saddle [s, 1, 1]."""
    here, _ = offline_run(problem, "dop853", 2)
    there, _ = offline_run(problem, "dop853", 2, nudge=NUDGE)
    pole = abs(ball_poles(1, problem.parts, problem.scene[0])[0])
    away = np.abs(there[:, 4] - here[:, 4]) / NUDGE
    return [
        (horizon, float(away[round(horizon * 1000) - 1]), (exp(pole * horizon) + exp(-pole * horizon)) / 2)
        for horizon in HORIZONS
    ]


def expect_parts(problem: Problem, reference: Reference) -> Iterator[ResultPart]:
    """Yield the tables of errors by horizon, of effects that the paper's model omits, and of the ball's divergence."""
    title = "Expected errors after each duration, from samples at 1 kHz"
    yield ResultPart("expect", title, ("run", "horizon [s]", *ERRORS), expectations(problem, reference))
    if problem.model == "paper":
        title = "Effects omitted by the paper's equations: differences"
        yield ResultPart("left-out", title, ("scene", "horizon [s]", *ERRORS), left_out(problem))
        title = f"Growth of a displacement of the ball of {NUDGE:g} m"
        yield ResultPart(
            "growth", title, "horizon [s] | growth [1] | cosh(pole of the ball * horizon) [1]", growth(problem)
        )


LIVE, OFFLINE = 1e-4, 1e-7
"""Largest claimed errors of force by sampling, live and offline [N]."""


def holds_part(cases: Iterable[tuple[Problem, Reference]]) -> ResultPart:
    """Run problems from samples: by the server's ticks with each extrapolation, and offline."""
    part = ResultPart(
        "holds",
        "Runs from samples at 1 kHz, compared with continuous movements of the hands",
        ("problem", "hold", "run by", *ERRORS, "rms of force [N]"),
    )
    for problem, reference in cases:
        runs = [(hold, "the server's tick", live_run(problem, hold)) for hold in ("zoh", "cv", "ca")]
        for method, substeps in (("rk4", 1), ("etdrk4", 1), ("dop853", 2)):
            name = f"offline, {method}, {1.0 / substeps:g} ms"
            runs.append(("hermite", name, offline_run(problem, method, substeps)))
        best: dict[str, tuple[float, str]] = {}
        for hold, name, found in runs:
            states, forces = _errors_at_reference(reference, *found)
            errors = largest(states, forces).tolist()
            part.add(problem.name, hold, name, *errors, float(np.sqrt(np.mean(forces**2))))
            best[hold] = min(best.get(hold, (inf, "")), (errors[-1], f"{hold}, {name}"))
        for name, hold, most in (("live", "ca", LIVE), ("offline", "hermite", OFFLINE)):
            force, run_by = best[hold]
            claim = f"{problem.name}: forces {name} within {most:g} N of those under continuous hands"
            part.claim(claim, force <= most, f"{force:.2g} N ({run_by})")
    return part
