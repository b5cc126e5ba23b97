"""Simulated studies without and with an effect: how often each test of a study rejects.

A study has two people and their dyad, haptics off and on, `TRIALS` trials each, as in the paper. Without an effect, a
test at .05 should reject .05 of the studies. The fixed effects do not change the variances that the mixed model finds,
so an effect that is there is added to the estimates: the same studies give the power.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import exp, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from netboard.analysis.statistics.effects import careful_freedom, contrasts_of
from netboard.analysis.statistics.factors import Design, design_of, paper_factors
from netboard.analysis.statistics.random_effects import random_effects
from netboard.analysis.statistics.restricted import restricted_fit
from netboard.analysis.statistics.small_samples import (
    kenward_roger_covariance,
    kenward_roger_freedom,
    satterthwaite_freedom,
)

Array = NDArray[np.float64]

DYADS = (4, 8, 16)
"""Numbers of dyads in the simulated studies [1]."""

TRIALS = 30
"""Trials of a performer per force condition [1]."""

OF_DYADS, OF_PERFORMERS, OF_TRIALS = 0.2, 0.1, 0.5
"""Standard deviations of the random effects of dyads and performers, and of trials [log of the time]."""

SLOPES = (0.08, 0.3)
"""Standard deviations of the haptic effect, of dyads and of performers: below and above the trials' noise [log]."""

EFFECT = -0.2
"""The effect whose power is told: haptics make times 18 % shorter [log of the time]."""

LEVEL = 0.05
"""Significance level: a test rejects if p is at most this [1]."""

METHODS = ("careful", "Satterthwaite", "Kenward-Roger", "paired t", "permutation")
"""The first three are of the mixed model, the others of the dyads' differences."""

TERMS = ("haptics", "haptics x configuration")
"""Effects under test."""

CORRELATION = 0.5
"""Correlation of successive trials in the correlated setting [1]."""

Draw = Callable[[np.random.Generator, tuple[int, ...]], Array]


def _normal(rng: np.random.Generator, size: tuple[int, ...]) -> Array:
    return rng.standard_normal(size)


def _skewed(rng: np.random.Generator, size: tuple[int, ...]) -> Array:
    """Draw log-normal values with skewness 6.2."""
    return (rng.lognormal(0.0, 1.0, size) - exp(0.5)) / sqrt((exp(1.0) - 1.0) * exp(1.0))


def _heavy(rng: np.random.Generator, size: tuple[int, ...]) -> Array:
    return rng.standard_t(4, size) / sqrt(2.0)


ERRORS: dict[str, Draw] = {"normal": _normal, "skewed": _skewed, "t4": _heavy, "AR(.5)": _normal}
"""What dyads, performers and trials deviate by, of variance 1; the last one has successive trials correlated."""


ALONE = 5
"""Differences of dyads alone are drawn so many times as often as studies: they cost little [1]."""


@dataclass(frozen=True, slots=True)
class Setting:
    """A kind of study.

    - `slopes`: standard deviation of the haptic effect, of dyads and of performers [log of the time].
    """

    dyads: int
    errors: str
    slopes: float


def settings() -> tuple[Setting, ...]:
    """Return all kinds of studies, smallest first."""
    return tuple(Setting(n, errors, slopes) for n in DYADS for errors in ERRORS for slopes in SLOPES)


def simulated(setting: Setting, studies: int, seed: tuple[int, ...]) -> Array:
    """Simulate studies, and test both terms by every method without and with an effect.

    Returns
    -------
    ndarray of float64, shape (2, len(TERMS), len(METHODS), studies)
        p values: without an effect, then with `EFFECT`; NaN where a model has none [1].
    """
    rng = np.random.default_rng(seed)
    p = np.full((2, len(TERMS), len(METHODS), studies), np.nan)
    gaps = np.empty((len(TERMS), studies, setting.dyads))
    for number in range(studies):
        times = _drawn(rng, setting)
        p[:, :, :3, number] = _of_model(_design(setting.dyads), times.ravel())
        gaps[:, number] = _differences(times)
    for place, effect in enumerate((0.0, EFFECT)):
        for term in range(len(TERMS)):
            shifted = gaps[term] + effect
            p[place, term, 3:] = _paired(shifted), flipped(shifted)
    return p


def differences_alone(dyads: int, errors: str, studies: int, seed: tuple[int, ...]) -> Array:
    """Test differences of dyads that are drawn from one distribution each, without any trials.

    Returns
    -------
    ndarray of float64, shape (2, studies)
        p of the paired t test and of the permutation test [1].
    """
    gaps = ERRORS[errors](np.random.default_rng(seed), (studies, dyads))
    return np.array([_paired(gaps), flipped(gaps)])


def _paired(gaps: Array) -> Array:
    """Return p of Student's test of the differences of many studies."""
    t = gaps.mean(axis=1) / stats.sem(gaps, axis=1)
    return np.asarray(2.0 * stats.t.sf(np.abs(t), gaps.shape[1] - 1))


def _drawn(rng: np.random.Generator, setting: Setting) -> Array:
    """Draw the logarithms of the times of a study without effects: (dyad, performer, off and on, trial)."""
    draw, n = ERRORS[setting.errors], setting.dyads
    felt = np.array([-0.5, 0.5])[:, None]
    line = OF_DYADS * draw(rng, (n, 1, 1, 1)) + OF_PERFORMERS * draw(rng, (n, 3, 1, 1))
    line = line + setting.slopes * (draw(rng, (n, 1, 1, 1)) + draw(rng, (n, 3, 1, 1))) * felt
    noise = draw(rng, (n, 3, 2, TRIALS))
    if setting.errors.startswith("AR"):
        for k in range(1, TRIALS):
            noise[..., k] = CORRELATION * noise[..., k - 1] + sqrt(1.0 - CORRELATION**2) * noise[..., k]
    return np.asarray(line + OF_TRIALS * noise)


@dataclass(frozen=True, slots=True, eq=False)
class _Ready:
    """A design with what all studies of its size have in common."""

    design: Design
    sources: list[Array]
    rows: tuple[Array, ...]


@lru_cache(maxsize=len(DYADS))
def _design(dyads: int) -> _Ready:
    dyad, performer, felt, trial = (index.ravel() for index in np.indices((dyads, 3, 2, TRIALS)))
    factors = paper_factors(felt == 1, performer == 2)
    nothing = np.zeros(len(dyad))
    design = design_of(nothing, dyad, performer, factors, trial + 1)
    rows = contrasts_of(design)
    sources = list(random_effects(design, "performer")[0].values())
    return _Ready(design, sources, tuple(row for name in TERMS if (row := rows[name]) is not None))


def _of_model(ready: _Ready, times: Array) -> Array:
    """Return p of both terms by the methods of the mixed model, without and with an effect."""
    design = ready.design
    found = restricted_fit(times, design.columns, ready.sources, design.dyads)
    p = np.full((2, len(TERMS), 3), np.nan)
    if found is None:
        return p
    enlarged = kenward_roger_covariance(found.moments)
    for term, row in enumerate(ready.rows):
        value = float(row @ found.coefficients)
        errors = [sqrt(float(row @ size @ row)) for size in (found.covariance, found.covariance, enlarged)]
        free = (
            careful_freedom(design),
            satterthwaite_freedom(found.moments, row),
            kenward_roger_freedom(found.moments, row),
        )
        for place, effect in enumerate((0.0, EFFECT)):
            p[place, term] = 2.0 * stats.t.sf(abs(value + effect) / np.array(errors), free)
    return p


def _differences(times: Array) -> Array:
    """Return of each dyad haptics on less off, over both configurations and between them."""
    levels = times.mean(axis=3)
    alone, both = levels[:, :2].mean(axis=1), levels[:, 2]
    effects = alone[:, 1] - alone[:, 0], both[:, 1] - both[:, 0]
    return np.array([0.5 * (effects[0] + effects[1]), effects[1] - effects[0]])


@lru_cache(maxsize=len(DYADS))
def _signs(n: int) -> Array:
    """All changes of sign, but for the mirror images."""
    return np.array([[1.0 - 2.0 * (k >> j & 1) for j in range(n)] for k in range(2 ** (n - 1))])


def flipped(differences: Array) -> Array:
    """Return p of many permutation tests at once, as `analysis.statistics.exact_tests.permutation_test` does of one."""
    signs = _signs(differences.shape[1])
    found = np.empty(len(differences))
    for place, own in enumerate(differences):
        sums = np.abs(signs @ own)
        found[place] = float((sums >= sums[0] * (1.0 - 1e-12)).mean())
    return found
