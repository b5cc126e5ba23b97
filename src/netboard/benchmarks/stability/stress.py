"""Scenes that are hard on a method: stiff couplings, large tilts, no damping, ends of the board, and perfect rest.

Every part compares with a reference with short steps, or with theory.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from netboard.base.tables.scene import Physics
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.harness.results import ResultPart, Value
from netboard.benchmarks.harness.running import Tell, no_progress
from netboard.benchmarks.physics.problem import BALL, MODELS, styluses_at
from netboard.benchmarks.stability.maps import board_matrix
from netboard.benchmarks.stability.runs import DURATION, FIXED_PLACE, make_run, scaled
from netboard.physics.arithmetic.vectors import State
from netboard.physics.scene.energy import stored_along, work_along
from netboard.physics.scene.parameters import pack_scene, parts_of
from netboard.physics.stability.method_choice import choose
from netboard.physics.stability.step_matrix import is_stable, stiffness

Array = NDArray[np.float64]

STIFF = ((10.0, 3.2), (100.0, 10.0), (1000.0, 31.6), (1000.0, 1000.0), (1.0, 1000.0))
"""Factors of k_h and c_h [1]."""

STEPPED = (
    ("rk4", TICK_SECONDS),
    ("rk4", TICK_SECONDS / 4),
    ("rk4", TICK_SECONDS / 64),
    ("midpoint", TICK_SECONDS),
    ("etd2rk", TICK_SECONDS),
    ("etdrk4", TICK_SECONDS),
)
"""Methods and steps under comparison [s]."""

FELT = 0.02
"""Force error below the resolution of hands and devices [N]."""

TILTS_DEG = (8.0, 17.0, 35.0, 49.0)


# --- stiff couplings ---------------------------------------------------------------------------------------------


def settled(physics: Physics) -> State:
    """Return the state of a board that has followed the hands for a second, by the reference method."""
    p, vp = BALL["paper", "settled"]
    before = make_run(physics, "dop853", _fine(physics), 1.0, (0.0, 0.0, 0.0, 0.0, p, 0.0), -1.0, free=False)
    return (*before.states[-1, :4].tolist(), p, vp)


def _fine(physics: Physics) -> float:
    """Return the step of the reference method, which divides a tick."""
    return TICK_SECONDS / max(math.ceil(stiffness(board_matrix(physics), TICK_SECONDS)), 8)


def force_error(physics: Physics, method: str, h: float, x: State, forces: Array) -> float:
    """Return the largest error of the hands' forces over the test motion.

    - `h`: step length, which divides a tick [s].
    """
    with np.errstate(invalid="ignore", over="ignore"):
        worst = float(np.abs(make_run(physics, method, h, DURATION, x).forces - forces).max())
    return worst if math.isfinite(worst) else math.inf


def stiff_forces(cases: Sequence[tuple[float, float]] = STIFF, tell: Tell = no_progress) -> ResultPart:
    """Compare forces in stiff scenes."""
    part = ResultPart(
        "stiff-forces",
        "Largest error of the hands' forces where couplings are stiff, against dop853 in short steps",
        (
            "k_h x, c_h x [1]",
            "largest force [N]",
            "doubt of reference [N]",
            *(f"{method} {step * 1e3:.3g} ms [N]" for method, step in STEPPED),
            "automatic choice [N]",
        ),
    )
    failures, felt = [], []
    for i, (k, c) in enumerate(cases):
        tell(f"stiff scenes: k_h x{k:g}, c_h x{c:g}", i / len(cases))
        physics = scaled(Physics(), k_h=k, c_h=c)
        x, h = settled(physics), _fine(physics)
        truth = make_run(physics, "dop853", h, DURATION, x).forces
        doubt = force_error(physics, "dop853", h / 2, x, truth)
        values: list[Value] = []
        for method, step in STEPPED:
            error = force_error(physics, method, step, x, truth)
            stable = is_stable(method, board_matrix(physics), step)
            if stable == (error > 1.0):
                failures.append(f"{method} {step * 1e3:g} ms at x{k:g}, x{c:g}: {error:.3g} N")
            values.append(error if stable else "unstable")
        chosen = choose(physics, TICK_SECONDS)
        error = force_error(physics, chosen.method, TICK_SECONDS / chosen.substeps, x, truth)
        felt.append(error)
        part.add(f"{k:g}, {c:g}", float(np.abs(truth).max()), doubt, *values, error)
    part.claim(
        "methods err by more than 1 N exactly where theory calls them unstable",
        not failures,
        "; ".join(failures) or "in every case",
    )
    part.claim(f"the automatic choice errs by less than {FELT:g} N", max(felt) < FELT, f"{max(felt):.3g} N")
    return part


# --- large tilts -------------------------------------------------------------------------------------------------


def large_tilts(tilts_deg: Sequence[float] = TILTS_DEG, tell: Tell = no_progress) -> ResultPart:
    """Compare rk4 and etdrk4, which is exact for the level board, at large tilts."""
    physics = Physics()
    z, _ = styluses_at(np.arange(0.0, DURATION, TICK_SECONDS))
    reach = float(np.abs(z[:, 1] - z[:, 0]).max()) / 2
    first: State = (0.0, 0.0, 0.0, 0.0, FIXED_PLACE, 0.0)
    part = ResultPart(
        "large-tilts",
        "Largest error of the hands' forces where the board tilts far, steps of 1 ms",
        "hands ask for [deg] | largest tilt [deg] | rk4 [N] | etdrk4 [N]",
    )
    for i, tilt in enumerate(tilts_deg):
        tell(f"large tilts: {tilt:g} deg", i / len(tilts_deg))
        spread = physics.l * math.sin(math.radians(tilt)) / reach
        go = partial(make_run, physics, duration=DURATION, spread=spread, free=False)
        start: State = (
            *go(method="dop853", h=TICK_SECONDS / 8, duration=1.0, x=first, start=-1.0).states[-1].tolist(),
        )
        truth = go(method="dop853", h=TICK_SECONDS / 8, x=start)
        errors = [
            float(np.abs(go(method=name, h=TICK_SECONDS, x=start).forces - truth.forces).max())
            for name in ("rk4", "etdrk4")
        ]
        part.add(tilt, math.degrees(float(np.abs(truth.states[:, 2]).max())), *errors)
    worst = [max(float(row[column]) for row in part.rows) for column in (2, 3)]
    part.claim("rk4 errs by less than 1e-4 N at any tilt", worst[0] < 1e-4, f"{worst[0]:.2g} N")
    part.claim("etdrk4 errs by less than 1e-3 N at any tilt", worst[1] < 1e-3, f"{worst[1]:.2g} N")
    return part


# --- ends of the board -------------------------------------------------------------------------------------------


def ball_at_ends(tell: Tell = no_progress) -> ResultPart:
    """Let a ball hit stops, and check that it stays between them and no impact adds energy."""
    kinds = [(model, share) for model in MODELS for share in (0.0, 0.5, 1.0)]
    part = ResultPart(
        "ball-at-ends",
        "A ball between stops 0.3 m from the centre, steps of 1 ms",
        "model, restitution | ticks at a stop [1] | farthest [m] | energy of those ticks [J] | "
        "most gained in one, of the ball's [1] | error of the others' balance [1]",
    )
    outside, gained, least = 0.0, 0.0, math.inf
    for i, (model, share) in enumerate(kinds):
        tell(f"ball at the ends: {model}, restitution {share:g}", i / len(kinds))
        physics = replace(Physics(), model=model, ball_stop=0.3, restitution=share)
        run_ = make_run(physics, "rk4", TICK_SECONDS, 20.0)
        z, vz = styluses_at(run_.times)
        hands = np.stack([z[:, 0], vz[:, 0], z[:, 1], vz[:, 1]], axis=1)
        parts, scene = parts_of(physics), pack_scene(physics)
        energy = stored_along(run_.states, hands, parts, scene).sum(axis=1)
        work = work_along(run_.times, run_.states, hands, parts, scene).sum(axis=1)
        struck = np.abs(run_.states[1:, 4]) == physics.ball_stop
        loss = np.where(struck, np.diff(energy), np.diff(energy - work))
        ball = 0.5 * physics.m * float(run_.states[:, 5].max()) ** 2
        blows = float(np.max(loss[struck], initial=0.0)) / ball
        part.add(
            f"{model}, {share:g}",
            int(struck.sum()),
            float(np.abs(run_.states[:, 4]).max()),
            float(loss[struck].sum()),
            blows,
            float(np.abs(loss[~struck]).sum() / np.abs(np.diff(work)).sum()),
        )
        outside, gained = max(outside, float(np.abs(run_.states[:, 4]).max()) - physics.ball_stop), max(gained, blows)
        least = min(least, float(struck.sum()))
    part.claim("the ball never passes a stop", outside <= 0.0 < least, f"{outside:+.2g} m beyond")
    part.claim("a tick at a stop adds less than 5 % of the ball's energy", gained < 0.05, f"{gained:.2g}")
    return part
