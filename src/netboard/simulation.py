"""A scene moved by recorded hands, offline: arrays in, arrays out. It knows no file, no clock and no trial.

Time is counted in whole numbers of a small unit, so that samples and rows of the result that fall together do so
exactly, and equal steps are equal to the bit. No step crosses a sample or a row: between two of them each drive is one
polynomial, and a method keeps its order. What is computed depends on nothing but the arguments: the same hands give the
same bits alone, in a batch, and whatever the memory at hand.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.compiled import kernel
from netboard.config import Physics
from netboard.errors import ConfigError
from netboard.methods.catalogue import METHODS, NUMBER
from netboard.methods.march import Grid, forces_along, make_grid, run
from netboard.physics.energy import Flows, Stored, stored_along, work_along
from netboard.physics.hold import between, later, moving, resting
from netboard.physics.linear import board_matrix
from netboard.physics.scene import Parts, pack_scene, parts_of, state_length
from netboard.physics.vectors import State

HOLDS = ("zoh", "cv", "ca", "hermite")
"""How a hand moves between its samples; a hold's number is its place."""

GAP = 3.0
"""Samples further apart than so many times the median are a gap [1]."""

FILL = 0.001
"""For "hermite", samples further apart are filled in to at most this, from polynomials through four of them [s]."""

FINEST = 11
"""Times are whole numbers of 10^-11 s, or of a larger power of ten where float64 does not hold that many digits [1]."""

MOST_ROWS, MOST_STEPS, MOST_TABLES = 100_000_000, 20_000_000_000, 200
"""Most rows of a result, steps of a run (some hours of them), and lengths of step of a method with tables [1]."""

TRUE_METHOD = "dop853"
"""The automatic choice, in steps that leave it an error of less than 1e-9 of what moves, fast transients included."""

LONGEST_STEP, SHORTEST_STEP = 0.005, 2e-6
GENTLE, STIFF = 0.25, 2.0
"""Its steps are at most LONGEST_STEP, and GENTLE over the fastest rate of the scene. Where that would be shorter than
SHORTEST_STEP, STIFF is enough: there, what is fast is over before the next row [s, 1]."""

_CHUNK = 20_000
_ZOH, _HERMITE = HOLDS.index("zoh"), HOLDS.index("hermite")


@dataclass(frozen=True)
class Hands:
    """Two styluses, sampled.

    Attributes
    ----------
    t : ndarray of float64, shape (n,)
        Times of the samples, increasing, at least two [s].
    z : ndarray of float64, shape (n, 2)
        Heights of the left and of the right stylus [m].
    vz : ndarray of float64, shape (n, 2)
        Their rates [m/s].
    """

    t: NDArray[np.float64]
    z: NDArray[np.float64]
    vz: NDArray[np.float64]


@dataclass(frozen=True)
class Steps:
    """How a run is stepped.

    Attributes
    ----------
    method : str
        Name of the method.
    longest : float
        No step is longer than this; infinite for whole intervals between samples and rows [s].
    substeps : int
        Equal steps that each interval is done in, at the least [1].
    fastest : float
        The fastest rate of the scene: the largest modulus of the board's eigenvalues [1/s].
    """

    method: str
    longest: float
    substeps: int
    fastest: float


@dataclass(frozen=True)
class Motion:
    """What the hands made of the scene.

    Attributes
    ----------
    t : ndarray of float64, shape (n,)
        Times of the rows [s].
    states : ndarray of float64, shape (n, length)
        z, vz, theta, omega and p, vp of each ball [SI].
    forces : ndarray of float64, shape (n, 2)
        Forces of the left and of the right hand on the board, + = up; the hands feel their opposites [N].
    steps : Steps
        How it was stepped.
    count : int
        How many steps there were [1].
    longest : float
        The longest of them [s].
    """

    t: NDArray[np.float64]
    states: NDArray[np.float64]
    forces: NDArray[np.float64]
    steps: Steps
    count: int
    longest: float


def find_gaps(t: NDArray[np.float64]) -> NDArray[np.int64]:
    """Find samples after which a gap begins.

    Parameters
    ----------
    t : ndarray of float64, shape (n,)
        Times of the samples, increasing [s].

    Returns
    -------
    ndarray of int64, shape (gaps,)
        Their numbers, from 0 [1].
    """
    intervals = np.diff(t)
    return np.flatnonzero(intervals > GAP * np.median(intervals))


def choose_steps(physics: Physics, free: bool = True, method: str = "auto", substeps: int = 1) -> Steps:
    """Choose how a scene is stepped.

    Parameters
    ----------
    physics : Physics
        The scene.
    free : bool
        The balls roll; otherwise they are fixed.
    method : str
        Name of a method, which takes each interval in as many steps as asked for; "auto" for one that is as good as
        exact, in as many as it needs.
    substeps : int
        Equal steps that each interval is done in, at the least [1].

    Returns
    -------
    Steps
        The choice.

    Raises
    ------
    ConfigError
        If there is no such method, or not for this scene.
    """
    # Of the board alone: what balls add to its inertia only makes it slower.
    parts = parts_of(physics, free)._replace(lagrangian=False)
    fastest = float(np.abs(np.linalg.eigvals(board_matrix(parts, pack_scene(physics)[0]))).max())
    if method == "auto":
        longest = LONGEST_STEP
        if fastest > 0.0:
            longest = min(longest, max(GENTLE / fastest, min(STIFF / fastest, SHORTEST_STEP)))
        return Steps(TRUE_METHOD, longest, substeps, fastest)
    if method not in NUMBER:
        raise ConfigError(f'method: found "{method}", expected auto or one of {", ".join(NUMBER)}')
    if method == "exact" and parts.tilts:
        raise ConfigError('method: found "exact", which is for boards that cannot tilt (physics.board = "level")')
    return Steps(method, np.inf, substeps, fastest)


def check_start(physics: Physics, start: State, free: bool) -> None:
    """Check that a scene can be in a state.

    Parameters
    ----------
    physics : Physics
        The scene.
    start : tuple of float
        The state [SI].
    free : bool
        The balls roll; otherwise they are fixed.

    Raises
    ------
    ConfigError
        If it cannot.
    """
    if len(start) != state_length(physics):
        raise ConfigError(f"p0, v0: found {len(start) // 2 - 2} balls, expected {physics.balls} (physics.balls)")
    if not np.all(np.isfinite(start)):
        raise ConfigError("the initial state is not finite")
    if physics.board == "hinged" and start[1] != 0.0:
        raise ConfigError(f"vz0: found {start[1]:g}, expected 0: a hinged board cannot heave")
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
    """Move a scene by hands, from their first sample to their last.

    Parameters
    ----------
    hands : Hands
        The styluses.
    physics : Physics
        The scene.
    start : tuple of float
        The state at the first sample [SI].
    free : bool
        The balls roll; otherwise they are fixed.
    hold : str
        How a hand moves between its samples, one of `HOLDS`.
    dt : float
        Time from row to row of the result [s].
    steps : Steps or None
        How it is stepped; None for the automatic choice.
    progress : callable
        Gets the share that is done, now and then.

    Returns
    -------
    Motion
        The result.

    Raises
    ------
    ConfigError
        If the start does not fit the scene, there is too much to do, or the state does not stay finite.
    """
    check_start(physics, start, free)
    steps = steps or choose_steps(physics, free)
    parts, scene = parts_of(physics, free), pack_scene(physics)
    scale = _scale_of(hands.t)
    source = _make_source(hands, hold, scale)
    line = _make_timeline(source.ticks, dt, scale)
    grid = _make_grid(line, steps, parts, len(start), scene)
    longest = float((grid.lengths / grid.counts).max(initial=0.0))
    states, forces = np.empty((len(line.rows), len(start))), np.empty((len(line.rows), 2))
    x, done = tuple(float(value) for value in start), 0
    for first in range(0, len(line.knots), _CHUNK):
        last = min(first + _CHUNK, len(line.knots) - 1)
        drives = _drives_along(source, line.knots[first : last + 1], scale, HOLDS.index(hold), scene)
        found = run(steps.method, x, drives[:-1], _cut(grid, first, last), parts, scene)
        x = tuple(found[-1].tolist())
        end = int(np.searchsorted(line.rows, first + _CHUNK))
        here = line.rows[done:end] - first
        states[done:end] = found[here]
        forces[done:end] = forces_along(states[done:end], np.ascontiguousarray(drives[here][:, (0, 4)]), parts, scene)
        _check_finite(states[done:end], line.times[done:end], steps, longest)
        done = end
        progress(done / len(line.rows))
    return Motion(line.times, states, forces, steps, int(grid.counts.sum()), longest)


def columns_of(motion: Motion) -> dict[str, NDArray[np.float64]]:
    """Name the columns of a result.

    Parameters
    ----------
    motion : Motion
        The result.

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
    """Say where the energy of a result is, and what it went through since the first row.

    Parameters
    ----------
    motion : Motion
        The result, with "hermite".
    hands : Hands
        The styluses that it is of.
    physics : Physics
        The scene that it is of.
    free : bool
        The balls roll; otherwise they are fixed.

    Returns
    -------
    dict of str to ndarray of float64, shape (n,)
        E_ and the fields of `netboard.physics.energy.Stored`, W_ and those of `netboard.physics.energy.Flows`: but for
        the error, and for what stops take, the sum of all E less that of all W stays what it is [J].
    """
    parts, scene, scale = parts_of(physics, free), pack_scene(physics), _scale_of(hands.t)
    source, rows = _make_source(hands, "hermite", scale), np.rint(motion.t * scale).astype(np.int64)
    styluses = np.empty((len(rows), 4))
    for first, k, c in ((0, 1.0, 0.0), (1, 0.0, 1.0)):  # the drives of a coupling of only k = 1 are heights, of c rates
        unit = np.zeros_like(scene)
        unit["k_left"], unit["k_right"], unit["c_left"], unit["c_right"] = k, k, c, c
        styluses[:, first::2] = _drives_along(source, rows, scale, _HERMITE, unit)[:, (0, 4)]
    stored = stored_along(motion.states, styluses, parts, scene)
    works = work_along(motion.t, motion.states, styluses, parts, scene)
    columns = {f"E_{name}": stored[:, i] for i, name in enumerate(Stored._fields)}
    return {**columns, **{f"W_{name}": works[:, i] for i, name in enumerate(Flows._fields)}}


# --- hands -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Source:
    """Two hands as the hold has them: what each does from a time on, until the next. Times are ticks of 1/scale s."""

    ticks: NDArray[np.int64]
    z: NDArray[np.float64]
    vz: NDArray[np.float64]
    az: NDArray[np.float64]


def _scale_of(t: NDArray[np.float64]) -> float:
    """Return how many ticks a second has."""
    digits = np.floor(-np.log10(4.0 * np.spacing(np.abs(t).max())))
    return float(10.0 ** min(FINEST, int(digits)))


def _make_source(hands: Hands, hold: str, scale: float) -> _Source:
    """Return the samples, with what belongs between them."""
    ticks = np.rint(hands.t * scale).astype(np.int64)
    close = np.flatnonzero(np.diff(ticks) <= 0)
    if len(close):
        raise ConfigError(f"t: samples {close[0] + 1} and {close[0] + 2} are less than {1 / scale:g} s apart")
    az = np.zeros_like(hands.vz)
    if hold == "ca":
        az[1:] = np.diff(hands.vz, axis=0) / (np.diff(ticks) / scale)[:, None]
    source, gaps = _Source(ticks, hands.z, hands.vz, az), find_gaps(hands.t)
    return _filled(source, gaps, scale) if hold == "hermite" else _rested(source, gaps, hold, scale)


def _rested(source: _Source, gaps: NDArray[np.int64], hold: str, scale: float) -> _Source:
    """Let the sample before a gap count for the usual time; from then on the stylus rests where it got to."""
    usual = int(np.median(np.diff(source.ticks)))
    z, age = source.z[gaps], usual / scale
    if hold != "zoh":
        z = z + source.vz[gaps] * age + 0.5 * source.az[gaps] * (age * age)
    return _Source(
        np.insert(source.ticks, gaps + 1, source.ticks[gaps] + usual),
        np.insert(source.z, gaps + 1, z, axis=0),
        np.insert(source.vz, gaps + 1, 0.0, axis=0),
        np.insert(source.az, gaps + 1, 0.0, axis=0),
    )


def _filled(source: _Source, gaps: NDArray[np.int64], scale: float) -> _Source:
    """Fill in samples that are far apart, gaps apart, so that a cubic between two is as good as the samples are."""
    ticks = source.ticks
    parts = np.ceil(np.diff(ticks) / (FILL * scale) - 1e-6).astype(np.int64)
    parts[gaps] = 1
    if parts.max() == 1:
        return source
    first = np.concatenate(([0], np.cumsum(parts)))
    filled = _Source(
        np.empty(first[-1] + 1, np.int64), np.empty((first[-1] + 1, 2)), np.empty((first[-1] + 1, 2)), source.az
    )
    ends = np.concatenate((gaps, [len(ticks) - 1]))
    _fill(ticks, source.z, source.vz, parts, first, ends, scale, filled.ticks, filled.z, filled.vz)
    return filled


@kernel
def _fill(
    ticks: Any,
    z: Any,
    vz: Any,
    parts: Any,
    first: Any,
    ends: Any,
    scale: float,
    out_ticks: Any,
    out_z: Any,
    out_vz: Any,
) -> None:
    """Write the samples and what is between them: osculating polynomials through four (Newton's form, nodes twice)."""
    x, c = np.empty(8), np.empty(8)
    begin, run_number = 0, 0
    for i in range(len(ticks)):
        out_ticks[first[i]], out_z[first[i]], out_vz[first[i]] = ticks[i], z[i], vz[i]
        if i == ends[run_number]:  # the last sample before a gap
            begin, run_number = i + 1, run_number + 1
            continue
        # The two samples and their neighbours, as far as there are any on this side of a gap.
        low = max(min(i - 1, ends[run_number] - 3), begin)
        nodes = min(low + 4, ends[run_number] + 1) - low
        for hand in range(2):
            for j in range(2 * nodes):
                x[j], c[j] = (ticks[low + j // 2] - ticks[i]) / scale, z[low + j // 2, hand]
            for order in range(1, 2 * nodes):
                for j in range(2 * nodes - 1, order - 1, -1):
                    if order == 1 and j % 2 == 1:
                        c[j] = vz[low + j // 2, hand]
                    else:
                        c[j] = (c[j] - c[j - 1]) / (x[j] - x[j - order])
            for part in range(1, parts[i]):
                tick = ticks[i] + (part * (ticks[i + 1] - ticks[i])) // parts[i]
                t, value, slope = (tick - ticks[i]) / scale, 0.0, 0.0
                for j in range(2 * nodes - 1, -1, -1):
                    slope = slope * (t - x[j]) + value
                    value = value * (t - x[j]) + c[j]
                out_ticks[first[i] + part] = tick
                out_z[first[i] + part, hand], out_vz[first[i] + part, hand] = value, slope


def _drives_along(
    source: _Source, knots: NDArray[np.int64], scale: float, hold: int, scene: NDArray[Any]
) -> NDArray[np.float64]:
    """Return the polynomials of both drives from each knot on, shape (knots, 8)."""
    samples = np.searchsorted(source.ticks, knots, side="right") - 1
    out = np.empty((len(knots), 8))
    _write_drives(knots, samples, source.ticks, scale, source.z, source.vz, source.az, hold, scene[0], out)
    return out


@kernel
def _write_drives(
    knots: Any, samples: Any, ticks: Any, scale: float, z: Any, vz: Any, az: Any, hold: int, scene: Any, out: Any
) -> None:
    """Write the drives, each counted from its knot."""
    k_left, c_left, k_right, c_right = scene["k_left"], scene["c_left"], scene["k_right"], scene["c_right"]
    for n in range(len(knots)):
        i = samples[n]
        if hold == _HERMITE and i + 1 < len(ticks):
            gap = (ticks[i + 1] - ticks[i]) / scale
            left = between(z[i, 0], vz[i, 0], z[i + 1, 0], vz[i + 1, 0], gap, k_left, c_left)
            right = between(z[i, 1], vz[i, 1], z[i + 1, 1], vz[i + 1, 1], gap, k_right, c_right)
        elif hold == _HERMITE or hold == _ZOH:
            left, right = resting(z[i, 0], vz[i, 0], k_left, c_left), resting(z[i, 1], vz[i, 1], k_right, c_right)
        else:
            left = moving(z[i, 0], vz[i, 0], az[i, 0], k_left, c_left)
            right = moving(z[i, 1], vz[i, 1], az[i, 1], k_right, c_right)
        u = later(
            (left[0], left[1], left[2], left[3], right[0], right[1], right[2], right[3]), (knots[n] - ticks[i]) / scale
        )
        for j in range(8):
            out[n, j] = u[j]


# --- time --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Timeline:
    """Rows of the result and knots: times, in ticks, of either rows or samples."""

    scale: float
    knots: NDArray[np.int64]
    rows: NDArray[np.int64]  # which knot each row is
    times: NDArray[np.float64]  # of the rows [s]


def _make_timeline(samples: NDArray[np.int64], dt: float, scale: float) -> _Timeline:
    """Lay out samples and rows."""
    span = samples[-1] - samples[0]
    if not 100.0 <= dt * scale <= span + 0.5:
        raise ConfigError(f"dt: found {dt:g}, expected from {100.0 / scale:g} s to the {span / scale:g} s of the hands")
    count = np.floor(span / (dt * scale) + 1e-6) + 1
    if count > MOST_ROWS:
        raise ConfigError(f"dt: found {dt:g}, which makes {count:.3g} rows, expected at most {MOST_ROWS:.3g}")
    rows = samples[0] + np.rint(np.arange(int(count)) * (dt * scale)).astype(np.int64)
    rows = np.minimum(rows, samples[-1])
    knots = np.union1d(rows, samples[samples <= rows[-1]])
    return _Timeline(scale, knots, np.searchsorted(knots, rows), rows / scale)


def _make_grid(line: _Timeline, steps: Steps, parts: Parts, length: int, scene: NDArray[Any]) -> Grid:
    """Lay out the steps."""
    lengths = np.diff(line.knots) / line.scale
    counts = np.maximum(np.ceil(lengths / steps.longest - 1e-6), steps.substeps)
    if counts.sum() > MOST_STEPS:
        raise ConfigError(
            f"the scene is so quick ({steps.fastest:.3g} /s) that {steps.method} needs {counts.sum():.3g} steps, expected "
            f"at most {MOST_STEPS:.3g}; choose another method, such as etdrk4, or shorter hands"
        )
    tabled = METHODS[NUMBER[steps.method]].tables(scene[0], parts, length, 1e-3).size > 0
    kinds = len(np.unique(lengths / counts)) if tabled else 1
    if kinds > MOST_TABLES:
        raise ConfigError(
            f"method: {steps.method} needs a table for each length of step, and samples and rows make {kinds} of them, "
            f"expected at most {MOST_TABLES}; choose another method, such as auto or rk4"
        )
    return make_grid(steps.method, lengths, counts.astype(np.int64), parts, length, scene)


def _cut(grid: Grid, first: int, last: int) -> Grid:
    """Return some of the steps."""
    return Grid(grid.lengths[first:last], grid.counts[first:last], grid.kinds[first:last], grid.tables)


def _check_finite(states: NDArray[np.float64], times: NDArray[np.float64], steps: Steps, longest: float) -> None:
    """Refuse a state that is not finite."""
    lost = np.flatnonzero(~np.isfinite(states).all(axis=1))
    if len(lost):
        raise ConfigError(
            f"the state is not finite from t = {times[lost[0]]:g} s on, with {steps.method} in steps of {longest:.4g} s, "
            f"which are {longest * steps.fastest:.3g} of the scene's shortest time constant ({1 / steps.fastest:.3g} s); "
            "use --method auto, a smaller --dt or more --substeps"
        )
