"""Offline simulation of a scene under recorded hands: arrays in, arrays out, without files, clocks and trials.

No step crosses a sample: between two of them each drive is one polynomial, so a method keeps its order. The Taylor
method gives rows within its steps; the steps of all others end at rows, too. The result is a pure function of the
arguments: the same hands give the same bits, alone and in a batch.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.errors import ConfigError
from netboard.base.tables.scene import Physics, friction_rate
from netboard.physics.arithmetic.vectors import State
from netboard.physics.hands.sampled import Hands, Held, drives_along, hold_hands, styluses_along
from netboard.physics.methods.catalogue import METHODS, NUMBER
from netboard.physics.methods.march import TimeGrid, forces_along, make_grid, run
from netboard.physics.methods.taylor import make_taylor, order_for
from netboard.physics.scene.energy import Powers, StoredEnergy, stored_along, work_along
from netboard.physics.scene.linear import board_matrix
from netboard.physics.scene.parameters import Parts, pack_scene, parts_of, state_length
from netboard.physics.scene.series import table_of
from netboard.physics.stability.step_matrix import is_stable

MAX_ROWS, MAX_STEPS, MAX_TABLES = 100_000_000, 2_000_000_000, 200
"""Limits of output rows, of steps of a run (many minutes), and of step sizes of a method with tables [1]."""

SERIES_METHOD = "taylor"
"""Method of the automatic choice: `netboard.physics.methods.taylor`, with steps from a tolerance."""

TOLERANCE = 1e-12
"""Its error in a step, relative to the largest speed [1]."""

SERIES_STIFFNESS = 4.0
"""The fastest rate times the step of the Taylor method is at least this where the rate limits the step [1]."""

REFERENCE_METHOD = "dop853"
"""Method of the automatic choice where a number of steps is requested; its relative error is below 1e-9."""

MAX_STEP, MIN_STEP = 0.005, 2e-6
ACCURATE_STIFFNESS, STABLE_STIFFNESS = 0.25, 2.0
"""Limits of its steps. The fastest rate times the step is at most ACCURATE_STIFFNESS; where that step would be shorter
than MIN_STEP, STABLE_STIFFNESS suffices, because fast transients end before the next row [s, 1]."""

ITERATIVE = ("verlet", "midpoint")
MAX_ITERATED_STIFFNESS = 1.8
"""Methods that find the friction of balls by a fixed-point iteration, and the largest fastest rate of friction times
the step for which it converges: above 2 it diverges, and just below it is not done after its last iteration [1]."""

OFFLINE_METHODS = (SERIES_METHOD, *NUMBER)
"""Names of all methods [1]."""

_CHUNK = 20_000


@dataclass(frozen=True)
class Steps:
    """Integration method and step size of a run.

    Attributes
    ----------
    method : str
        Word of the method in ``physics.method``, or ``taylor`` for steps from a tolerance.
    longest : float
        Largest step; infinite for whole intervals between samples and rows, and for steps from a tolerance [s].
    substeps : int
        Smallest number of equal steps per interval [1].
    fastest : float
        The fastest rate of the scene: the largest modulus of the board's eigenvalues [1/s].
    """

    method: str
    longest: float
    substeps: int
    fastest: float


@dataclass(frozen=True)
class Motion:
    """Result of a simulation.

    Attributes
    ----------
    t : ndarray of float64, shape (n,)
        Times of the rows [s].
    states : ndarray of float64, shape (n, length)
        z, vz, theta, omega and p, vp of each ball [SI].
    forces : ndarray of float64, shape (n, 2)
        Forces of the left and of the right hand on the board, + = up; the hands feel their opposites [N].
    steps : Steps
        Integration method and step size.
    count : int
        Number of steps [1].
    longest : float
        Longest step taken [s].
    """

    t: NDArray[np.float64]
    states: NDArray[np.float64]
    forces: NDArray[np.float64]
    steps: Steps
    count: int
    longest: float


def choose_steps(physics: Physics, free: bool = True, method: str = "auto", substeps: int = 1) -> Steps:
    """Choose integration method and step size of a scene.

    Parameters
    ----------
    method : str
        Name of a method, which takes `substeps` steps per interval; "auto" for a reference solution with as many steps
        as it needs: "taylor", or "dop853" where `substeps` are requested.
    substeps : int
        Smallest number of equal steps per interval [1].

    Raises
    ------
    ConfigError
        If the method does not exist or does not suit the scene.
    """
    # Board alone: the inertia of balls only makes it slower.
    parts = parts_of(physics, free)._replace(lagrangian=False)
    fastest = float(np.abs(np.linalg.eigvals(board_matrix(parts, pack_scene(physics)[0]))).max())
    fastest = max(fastest, friction_rate(physics) if free else 0.0)
    if method == SERIES_METHOD and substeps > 1:
        raise ConfigError(f"substeps: found {substeps}, expected 1: the tolerance of taylor gives the length of steps")
    if method == SERIES_METHOD or (method == "auto" and substeps == 1):
        return Steps(SERIES_METHOD, np.inf, 1, fastest)
    if method == "auto":
        longest = MAX_STEP
        if fastest > 0.0:
            longest = min(longest, max(ACCURATE_STIFFNESS / fastest, min(STABLE_STIFFNESS / fastest, MIN_STEP)))
        return Steps(REFERENCE_METHOD, longest, substeps, fastest)
    if method not in NUMBER:
        raise ConfigError(f'method: found "{method}", expected auto or one of {", ".join(OFFLINE_METHODS)}')
    if method == "exact" and (parts.tilts or parts.resisted):
        raise ConfigError(
            'method: found "exact", which is for boards that cannot tilt (physics.board = "level") and balls without '
            "friction"
        )
    return Steps(method, np.inf, substeps, fastest)


def check_start(physics: Physics, start: State, free: bool) -> None:
    """Raise a `ConfigError` for an initial state that is impossible for a scene.

    Parameters
    ----------
    start : tuple of float
        State at the first sample [SI].
    """
    if len(start) != state_length(physics):
        raise ConfigError(f"p0, v0: found {len(start) // 2 - 2} balls, expected {physics.balls} (physics.balls)")
    if not np.all(np.isfinite(start)):
        raise ConfigError("the initial state is not finite")
    if physics.board == "hinged" and start[:2] != (0.0, 0.0):
        raise ConfigError(f"z0, vz0: found {start[0]:g} and {start[1]:g}, expected 0: a hinged board cannot heave")
    if physics.board == "level" and start[2:4] != (0.0, 0.0):
        raise ConfigError(f"theta0, omega0: found {start[2]:g} and {start[3]:g}, expected 0: a level board cannot tilt")
    for p, vp in zip(start[4::2], start[5::2], strict=True):
        if not free and vp != 0.0:
            raise ConfigError(f"v0: found {vp:g}, expected 0: the ball is fixed")
        if free and 0.0 < physics.ball_stop < abs(p):
            raise ConfigError(f"p0: found {p:g}, expected within the stops, {physics.ball_stop:g} m from the centre")


def simulate(
    hands: Hands,
    physics: Physics,
    start: State,
    *,
    free: bool = True,
    hold: str = "hermite",
    dt: float = 1e-3,
    steps: Steps | None = None,
    progress: Callable[[float], object] = lambda share: None,
) -> Motion:
    """Simulate a scene under hands, from their first sample to their last.

    Parameters
    ----------
    hands : Hands
        Samples of both styluses.
    start : tuple of float
        State at the first sample [SI].
    hold : str
        Motion of a hand between samples, one of `netboard.physics.hands.sampled.INTERPOLATIONS`.
    dt : float
        Interval of the output rows [s].
    steps : Steps or None
        Method and step size; None for the automatic choice.
    progress : callable
        Called with the completed share [1].

    Raises
    ------
    ConfigError
        If the initial state does not fit the scene, a limit is exceeded, or the state becomes non-finite.
    """
    check_start(physics, start, free)
    steps = steps or choose_steps(physics, free)
    parts, scene = parts_of(physics, free), pack_scene(physics)
    held = hold_hands(hands, hold)
    rows = _make_rows(held, dt)
    x = tuple(float(value) for value in start)
    march = _by_series if steps.method == SERIES_METHOD else _by_grid
    states, forces, done, count, longest = np.empty((len(rows), len(start))), np.empty((len(rows), 2)), 0, 0, 0.0
    for found in march(held, rows, steps, x, parts, scene):
        here = slice(done, done + len(found.states))
        drives = drives_along(held, rows[here], scene)
        states[here] = found.states
        forces[here] = forces_along(found.states, np.ascontiguousarray(drives[:, (0, 4)]), parts, scene)
        done, count, longest = here.stop, count + found.count, max(longest, found.longest)
        _check_finite(states[here], rows[here] / held.scale, steps, longest)
        progress(done / len(rows))
    return Motion(rows / held.scale, states, forces, steps, count, longest)


def is_stably_integrated(motion: Motion, physics: Physics, free: bool = True) -> bool:
    """Return whether the method was stable for the linearised scene and its friction; if not, the result is invalid."""
    matrix = board_matrix(parts_of(physics, free), pack_scene(physics)[0])
    method, step, rate = motion.steps.method, motion.longest, 0.0
    if method == SERIES_METHOD:  # its tolerance shortens steps that are not stable
        return True
    if free and physics.balls > 0:  # of a ball alone: where friction moves the board too, its rate is only larger
        rate = friction_rate(replace(physics, model="paper")) / physics.balls
    if method in ITERATIVE and step * rate > MAX_ITERATED_STIFFNESS:
        return False
    coasting = np.array([[0.0, 1.0], [0.0, 0.0]])
    slowed = coasting - np.diag([0.0, rate])  # exponential methods solve the coasting ball alone exactly
    return is_stable(method, matrix, step, matrix) and is_stable(method, slowed, step, coasting)


def columns_of(motion: Motion) -> dict[str, NDArray[np.float64]]:
    """Name the columns of a result.

    Returns
    -------
    dict of str to ndarray of float64, shape (n,)
        t, z, vz, theta, omega, then p, vp of the first ball, p2, vp2 of the second, and f_left, f_right [SI].
    """
    names = ["z", "vz", "theta", "omega"]
    for ball in range(1, motion.states.shape[1] // 2 - 1):
        names += ["p", "vp"] if ball == 1 else [f"p{ball}", f"vp{ball}"]
    columns = {"t": motion.t, **dict(zip(names, motion.states.T, strict=True))}
    return {**columns, "f_left": motion.forces[:, 0], "f_right": motion.forces[:, 1]}


def energies_of(motion: Motion, hands: Hands, physics: Physics, free: bool = True) -> dict[str, NDArray[np.float64]]:
    """Return stored energies and the work of each flow since the first row.

    Parameters
    ----------
    motion : Motion
        Result of a simulation with ``hold="hermite"``.
    hands : Hands
        Samples of both styluses in that simulation.

    Returns
    -------
    dict of str to ndarray of float64, shape (n,)
        ``E_`` and the fields of `netboard.physics.scene.energy.StoredEnergy`, ``W_`` and those of
        `netboard.physics.scene.energy.Powers` (``W_friction`` only with friction of balls). Except for the integration
        error and impacts at stops, the sum of all E less that of all W is constant [J].

    Raises
    ------
    ConfigError
        If the rows are so far apart for the scene that the work is not finite.
    """
    parts, scene, held = parts_of(physics, free), pack_scene(physics), hold_hands(hands, "hermite")
    styluses = styluses_along(held, np.rint(motion.t * held.scale).astype(np.int64))
    stored = stored_along(motion.states, styluses, parts, scene)
    works = work_along(motion.t, motion.states, styluses, parts, scene)
    if not np.isfinite(works).all():
        raise ConfigError(
            f"--energy: work is integrated from row to row, and the fastest motion of this scene "
            f"({motion.steps.fastest:.3g} /s) is too quick for rows {np.diff(motion.t).max():.3g} s apart; use a "
            "smaller --dt, or leave --energy out"
        )
    columns = {f"E_{name}": stored[:, i] for i, name in enumerate(StoredEnergy._fields)}
    flows = [name for name in Powers._fields if name != "friction" or parts.resisted]
    return {**columns, **{f"W_{name}": works[:, Powers._fields.index(name)] for name in flows}}


# --- steps --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Rows:
    """The next rows of a run, and the number of steps that led to them, with the longest of these [SI, 1, s]."""

    states: NDArray[np.float64]
    count: int
    longest: float


def _make_rows(held: Held, dt: float) -> NDArray[np.int64]:
    """Return the times of the rows, in ticks."""
    samples, scale = held.ticks, held.scale
    span = samples[-1] - samples[0]
    if not 100.0 <= dt * scale <= span + 0.5:
        raise ConfigError(f"dt: found {dt:g}, expected from {100.0 / scale:g} s to the {span / scale:g} s of the hands")
    count = np.floor(span / (dt * scale) + 1e-6) + 1
    if count > MAX_ROWS:
        raise ConfigError(f"dt: found {dt:g}, which makes {count:.3g} rows, expected at most {MAX_ROWS:.3g}")
    rows: NDArray[np.int64] = samples[0] + np.rint(np.arange(int(count)) * (dt * scale)).astype(np.int64)
    rows[-1] = min(rows[-1], samples[-1])
    return rows


def _check_count(count: float, steps: Steps) -> None:
    """Refuse a run of too many steps."""
    if count > MAX_STEPS:
        raise ConfigError(
            f"method: {steps.method} needs {count:.3g} steps for a scene this quick ({steps.fastest:.3g} /s), "
            f"expected at most {MAX_STEPS:.3g}; choose another, such as etdrk4, or shorter hands"
        )


def _by_series(
    held: Held, rows: NDArray[np.int64], steps: Steps, x: State, parts: Parts, scene: NDArray[Any]
) -> Iterator[_Rows]:
    """Integrate from sample to sample by the Taylor method; yield the rows of each chunk."""
    joints = np.append(held.ticks[held.ticks < rows[-1]], rows[-1])
    lengths = np.diff(joints) / held.scale
    _check_count(float(np.maximum(lengths * steps.fastest / SERIES_STIFFNESS, 1.0).sum()), steps)
    within = np.searchsorted(joints, rows) - 1  # the interval of each row; it belongs to the interval that it ends
    ends = np.searchsorted(within, np.arange(len(lengths)), side="right")
    moments = (rows - joints[np.maximum(within, 0)]) / held.scale
    march, table = make_taylor(parts), table_of(len(x))
    yield _Rows(np.array([x]), 0, 0.0)
    for first in range(0, len(lengths), _CHUNK):
        last = min(first + _CHUNK, len(lengths))
        done = 1 if first == 0 else int(ends[first - 1])
        out = np.empty((int(ends[last - 1]) - done, len(x)))
        drives = drives_along(held, joints[first:last], scene)
        here = lengths[first:last], ends[first:last] - done, moments[done : done + len(out)]
        x, count, longest = march(x, drives, *here, TOLERANCE, order_for(TOLERANCE), scene, table, out)
        yield _Rows(out, count, longest)


def _by_grid(
    held: Held, rows: NDArray[np.int64], steps: Steps, x: State, parts: Parts, scene: NDArray[Any]
) -> Iterator[_Rows]:
    """Integrate in equal steps between samples and rows; yield the rows of each chunk."""
    knots = np.concatenate((rows, held.ticks[held.ticks <= rows[-1]]))
    knots.sort(kind="stable")  # two runs to merge
    knots = knots[np.diff(knots, prepend=knots[0] - 1) > 0]
    places, done = np.searchsorted(knots, rows), 0
    grid = _make_grid(np.diff(knots) / held.scale, steps, parts, len(x), scene)
    for first in range(0, len(knots), _CHUNK):
        last = min(first + _CHUNK, len(knots) - 1)
        drives = drives_along(held, knots[first:last], scene)
        here = _cut(grid, first, last)
        found = run(steps.method, x, drives, here, parts, scene)
        x = tuple(found[-1].tolist())
        end = int(np.searchsorted(places, first + _CHUNK))
        longest = float((here.lengths / here.counts).max(initial=0.0))
        yield _Rows(found[places[done:end] - first], int(here.counts.sum()), longest)
        done = end


def _make_grid(lengths: NDArray[np.float64], steps: Steps, parts: Parts, length: int, scene: NDArray[Any]) -> TimeGrid:
    """Divide the intervals into steps."""
    counts = np.maximum(np.ceil(lengths / steps.longest - 1e-6), steps.substeps)
    _check_count(float(counts.sum()), steps)
    tabled = METHODS[NUMBER[steps.method]].tables(scene[0], parts, length, 1e-3).size > 0
    kinds = len(np.unique(lengths / counts)) if tabled else 1
    if kinds > MAX_TABLES:
        raise ConfigError(
            f"method: {steps.method} needs a table for each length of step, and samples and rows make {kinds} of them, "
            f"expected at most {MAX_TABLES}; choose another method, such as auto or rk4"
        )
    return make_grid(steps.method, lengths, counts.astype(np.int64), parts, length, scene)


def _cut(grid: TimeGrid, first: int, last: int) -> TimeGrid:
    """Return a section of the steps."""
    return TimeGrid(grid.lengths[first:last], grid.counts[first:last], grid.kinds[first:last], grid.tables)


def _check_finite(states: NDArray[np.float64], times: NDArray[np.float64], steps: Steps, longest: float) -> None:
    """Raise an error if a state is not finite."""
    lost = np.flatnonzero(~np.isfinite(states).all(axis=1))
    if len(lost):
        raise ConfigError(
            f"the state is not finite from t = {times[lost[0]]:g} s on, with {steps.method} in steps of {longest:.4g} "
            f"s, {longest * steps.fastest:.3g} of the scene's shortest time constant; use --method auto, a smaller "
            "--dt or more --substeps"
        )
