"""System identification of a stylus: mass, damping and friction from a run with motor forces. Pure.

The model is m a + b v + fc sign(v) + k x = F(t - delay) + load, with k = 0 if no hand holds the stylus. The load is a
constant force. The delay is the time from writing a force to its effect, plus that of the position reading.

The method is output-error identification (Ljung, System Identification, 2nd ed. 1999, section 7.3). The model is
simulated under the rendered forces, window by window, and all parameters are optimised for the least squared position
error. Positions are never differentiated, so quantisation does no harm. The initial state of each window is fitted too.
The initial guess solves the weak form of the equation, multiplied by smooth test functions and integrated by parts
(Shinbrot 1957), which is linear in the parameters.

The 95 % confidence intervals treat each window as one observation (cluster-robust covariance: Liang and Zeger 1986), so
that slow disturbances, such as hand tremor, do not make them too narrow.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from scipy.signal import savgol_filter
from scipy.sparse import csr_array
from scipy.stats import t as student

from netboard.base.errors import NetboardError
from netboard.devices.setup.loop import Floats, smallest_step

WINDOW = 0.4
"""Length of a window [s]."""

EVERY = 4
"""Decimation of the compared positions; those in between add almost no information [1]."""

SMOOTHED = 31
"""Samples in the smoothing window of the initial guess [1]."""

BUMP = 0.12
"""Length of the test functions in the weak form [s]."""

SLOW = 0.004
"""Speed below which the stylus may stick; such samples are left out of the initial guess [m/s]."""

MAX_DELAY = 0.02
"""Upper bound of the delay [s]."""

NAMES = ("mass", "damping", "friction", "load", "delay", "stiffness")
"""Parameter names, in order."""

SCALES = np.array([0.05, 0.5, 0.1, 0.1, 1e-3, 50.0])
"""Typical size of each parameter, in its unit."""

STEPS = np.array([1e-4, 1e-3, 1e-4, 1e-4, 1e-5, 1e-2])
"""Steps of the finite differences, in the same units."""

TOL, MAX_ROUNDS = 1e-5, 60
"""Convergence tolerance (relative change per iteration), and limit of iterations [1]."""

CONFIDENCE = 0.95
"""Level of the confidence intervals [1]."""


class AxisRun(NamedTuple):
    """One axis of a run."""

    time: Floats  # time of each position [s]
    place: Floats  # position of the stylus [m]
    written: Floats  # time at which each force was written; it acts until the next one [s]
    force: Floats  # [N]


class ParameterEstimate(NamedTuple):
    """Estimate of one parameter."""

    value: float
    half_width: float  # half-width of the 95 % confidence interval, in the unit of the value


@dataclass(frozen=True, slots=True)
class Identified:
    """Identified mechanics of a stylus."""

    # Parameter estimates [kg, N s/m, N, N, s, N/m].
    mass: ParameterEstimate
    damping: ParameterEstimate
    friction: ParameterEstimate
    load: ParameterEstimate
    delay: ParameterEstimate
    stiffness: ParameterEstimate
    misfit: float  # root mean square of the position residuals [m]
    travel: float  # distance between the extreme positions of the run [m]
    windows: int


def identify(motion: AxisRun, held: bool) -> Identified:
    """Estimate mass, damping and friction.

    ``held``: True if a hand holds the stylus: then stiffness is estimated too, and mass and damping include the hand's.
    """
    windows = _Windows(motion)
    travel = float(np.ptp(motion.place))
    free = np.array([True, True, True, True, True, held])
    first = _first_guess(motion, held)
    least = np.where(free, [1e-3, 0.0, 0.0, -np.inf, 0.0, 0.0], 0.0)
    most = np.where(free, [50.0, 500.0, 50.0, np.inf, MAX_DELAY, 1e4], 1.0)

    def split(x: Floats) -> tuple[Floats, Floats]:
        globals_ = np.zeros(len(NAMES))
        globals_[free] = x[: free.sum()]
        return globals_, x[free.sum() :].reshape(2, -1)

    def residuals(x: Floats) -> Floats:
        return np.asarray((windows.simulate(*split(x)) - windows.places).ravel() / windows.unit)

    def slopes(x: Floats) -> csr_array:
        return windows.slopes(*split(x), free) / windows.unit

    start = np.concatenate([np.clip(first, least, most)[free], windows.start.ravel()])
    bounds = (
        np.concatenate([least[free], np.full(windows.start.size, -np.inf)]),
        np.concatenate([most[free], np.full(windows.start.size, np.inf)]),
    )
    inside = np.clip(start, bounds[0] + 1e-9, bounds[1] - 1e-9)
    scales = np.concatenate([SCALES[free], np.repeat([1e-3, 0.1], windows.count)])
    fit = least_squares(
        residuals, inside, jac=slopes, bounds=bounds, x_scale=scales, ftol=TOL, xtol=TOL, max_nfev=MAX_ROUNDS
    )
    values, half_widths = np.zeros(len(NAMES)), np.zeros(len(NAMES))
    values[free] = fit.x[: free.sum()]
    half_widths[free] = _half_widths(residuals(fit.x), slopes(fit.x), int(free.sum()), windows.count)
    mass, damping, friction, load, delay, stiffness = (
        ParameterEstimate(float(value), float(half)) for value, half in zip(values, half_widths, strict=True)
    )
    misfit = float(np.sqrt(np.mean(residuals(fit.x) ** 2)) * windows.unit)
    return Identified(mass, damping, friction, load, delay, stiffness, misfit, travel, windows.count)


class _Windows:
    """A run cut into windows, and the simulation of the model in all of them at once."""

    def __init__(self, motion: AxisRun) -> None:
        step = float(np.median(np.diff(motion.time)))
        length = round(WINDOW / step)
        self.count = (len(motion.time) - 1) // length
        if self.count < 2 * len(NAMES):
            raise NetboardError(f"the run is too short: found {len(motion.time)} readings, expected some {20 * length}")
        rows = np.arange(self.count)[:, None] * length + np.arange(length + 1)
        self._times = motion.time[rows]
        self.places = motion.place[rows][:, ::EVERY]
        smooth, speed = _smoothed(motion)
        self.start = np.stack([smooth[rows[:, 0]], speed[rows[:, 0]]])
        self.unit = max(smallest_step(motion.place), 1e-6)
        gaps = np.diff(motion.written, append=2 * motion.written[-1] - motion.written[-2])
        self._impulse = np.concatenate([[0.0], np.cumsum(motion.force * gaps)])
        self._knots = np.append(motion.written, motion.written[-1] + gaps[-1])

    def _forces(self, delay: float) -> Floats:
        """Return the mean delayed force between the readings of each window."""
        impulse = np.interp(self._times - delay, self._knots, self._impulse)
        return np.asarray(np.diff(impulse, axis=1) / np.diff(self._times, axis=1))

    def simulate(self, parameters: Floats, start: Floats) -> Floats:
        """Return the simulated positions in each window, shape (windows, samples)."""
        return self._run(parameters[:, None], start, self._forces(parameters[4]))

    def slopes(self, parameters: Floats, start: Floats, free: NDArray[np.bool_]) -> csr_array:
        """Return the Jacobian of all positions by the free parameters and each window's initial state."""
        n, lanes = self.count, [int(i) for i in np.flatnonzero(free)]
        many = np.repeat(parameters[:, None], n * (len(lanes) + 3), axis=1)
        starts = np.tile(start, len(lanes) + 3)
        forces = np.tile(self._forces(parameters[4]), (len(lanes) + 3, 1))
        for lane, which in enumerate(lanes, start=1):
            here = slice(lane * n, (lane + 1) * n)
            many[which, here] += STEPS[which]
            if NAMES[which] == "delay":
                forces[here] = self._forces(parameters[4] + STEPS[4])
        shifts = (1e-5, 1e-3)
        for k, shift in enumerate(shifts):
            starts[k, (len(lanes) + 1 + k) * n : (len(lanes) + 2 + k) * n] += shift
        runs = self._run(many, starts, forces).reshape(len(lanes) + 3, n, -1)
        changes = (runs[1:] - runs[0]).reshape(len(lanes) + 2, -1) / np.append(STEPS[lanes], shifts)[:, None]
        rows = np.arange(changes.shape[1])
        initial = len(lanes) + rows // runs.shape[2]
        columns = [*(np.full(len(rows), lane) for lane in range(len(lanes))), initial, initial + n]
        place = (np.tile(rows, len(lanes) + 2), np.concatenate(columns))
        return csr_array((changes.ravel(), place), shape=(len(rows), len(lanes) + 2 * n))

    def _run(self, parameters: Floats, start: Floats, forces: Floats) -> Floats:
        """Simulate all windows in parallel by the implicit midpoint rule with Coulomb friction.

        Friction stops a stylus that it can hold; otherwise it reduces the velocity by its share (Moreau 1999).
        """
        m, b, fc, load, _, k = parameters
        lanes, samples = forces.shape
        times = np.resize(self._times, (lanes, samples + 1))
        x, v = start[0].copy(), start[1].copy()
        places = [x]
        for i in range(samples):
            h = times[:, i + 1] - times[:, i]
            ahead = m / h + 0.5 * b + 0.25 * k * h
            pull = (m / h - 0.5 * b - 0.25 * k * h) * v + forces[:, i] + load - k * x
            then = np.sign(pull) * np.maximum(np.abs(pull) - fc, 0.0) / ahead
            x = x + 0.5 * h * (v + then)
            v = then
            if (i + 1) % EVERY == 0:
                places.append(x)
        return np.stack(places, axis=1)


def _half_widths(residuals: Floats, slopes: csr_array, shared: int, windows: int) -> Floats:
    """Return the half-widths of the confidence intervals of the parameters that all windows share."""
    size = len(residuals) // windows
    inner, outer = np.zeros((shared, shared)), np.zeros((shared, shared))
    for w in range(windows):
        rows = slice(w * size, (w + 1) * size)
        here = slopes[rows].toarray()
        initial, common = here[:, [shared + w, shared + windows + w]], here[:, :shared]
        common = common - initial @ np.linalg.lstsq(initial, common, rcond=None)[0]
        inner += common.T @ common
        score = common.T @ residuals[rows]
        outer += np.outer(score, score)
    inverse = np.linalg.pinv(inner)
    spread = np.sqrt(np.diag(inverse @ outer @ inverse) * windows / (windows - shared))
    return np.asarray(spread * student.ppf(0.5 + 0.5 * CONFIDENCE, windows - shared))


def _first_guess(motion: AxisRun, held: bool) -> Floats:
    """Return the solution of the weak form, with one equation per test function."""
    step = float(np.median(np.diff(motion.time)))
    times = np.arange(motion.time[0], motion.time[-1], step)
    place = np.interp(times, motion.time, motion.place)
    force = motion.force[np.clip(np.searchsorted(motion.written, times, side="right") - 1, 0, None)]
    speed = np.interp(times, motion.time, _smoothed(motion)[1])
    size = round(BUMP / step)
    u = np.linspace(-1.0, 1.0, size)
    bump = CubicSpline(u, (1.0 - u * u) ** 4)
    rate = 2.0 / (step * (size - 1))
    weights = bump(u), bump(u, 1) * rate, bump(u, 2) * rate**2
    starts = np.arange(0, len(times) - size, max(size // 4, 1))
    cut = starts[:, None] + np.arange(size)
    moving = np.mean(np.abs(speed[cut]) > SLOW, axis=1) > 0.8
    if moving.sum() < 2 * len(NAMES):
        raise NetboardError("the stylus hardly moved: use more force, or check whether something holds it")
    cut = cut[moving]
    columns = [place[cut] @ weights[2], -place[cut] @ weights[1], np.sign(speed[cut]) @ weights[0]]
    columns.append(np.full(len(cut), -weights[0].sum()))
    if held:
        columns.append(place[cut] @ weights[0])
    found = np.linalg.lstsq(np.stack(columns, axis=1), force[cut] @ weights[0], rcond=None)[0]
    guess = np.zeros(len(NAMES))
    guess[:4] = found[:4]
    guess[4] = 1e-3
    guess[5] = found[4] if held else 0.0
    return guess


def _smoothed(motion: AxisRun) -> tuple[Floats, Floats]:
    """Return positions and velocities smoothed by a moving cubic (Savitzky and Golay 1964)."""
    step = float(np.median(np.diff(motion.time)))
    smooth = savgol_filter(motion.place, SMOOTHED, 3)
    return smooth, savgol_filter(motion.place, SMOOTHED, 3, deriv=1, delta=step)
