"""``netboard bench analysis --calibration``: how often each test of simulated studies rejects, and its power.

A study has two people and their dyad, haptics off and on, `TRIALS` trials each, as in the paper. Without an effect, a
test at .05 should reject .05 of the studies. The fixed effects do not change the variances that the mixed model finds,
so an effect that is there is added to the estimates: the same studies give the power.
"""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import lru_cache
from math import exp, sqrt
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from netboard.analysis.statistics.effects import careful_freedom, contrasts_of
from netboard.analysis.statistics.exact_tests import permutation_p
from netboard.analysis.statistics.factors import Design, design_of, paper_factors
from netboard.analysis.statistics.random_effects import random_effects
from netboard.analysis.statistics.restricted import restricted_fit
from netboard.analysis.statistics.small_samples import (
    kenward_roger_covariance,
    kenward_roger_freedom,
    satterthwaite_freedom,
)
from netboard.benchmarks.harness.results import Folder, Part, Value, Verdict
from netboard.benchmarks.harness.running import Tell

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
"""The effect whose power is reported: haptic feedback shortens times by 18 % [log of the time]."""

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
"""Distributions of the deviations, of variance 1; in the last one successive trials are correlated."""


ALONE = 5
"""Number of draws of dyad differences for each simulated study; these draws are cheap [1]."""


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

    - returns (shape (2, terms, methods, studies)): p without an effect, then with `EFFECT`; NaN if it has none [1].
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
            p[place, term, 3:] = _paired(shifted), permutation_p(shifted)
    return p


def differences_alone(dyads: int, errors: str, studies: int, seed: tuple[int, ...]) -> Array:
    """Return p of the t and the permutation test of drawn differences of dyads, shape (2, studies) [1]."""
    gaps = ERRORS[errors](np.random.default_rng(seed), (studies, dyads))
    return np.array([_paired(gaps), permutation_p(gaps)])


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


STUDIES, QUICK, PORTION = 2000, 60, 100
"""Simulated studies of each kind, in the short form, and of one task of a process [1]."""

LIBERAL = 0.075
"""A test at .05 that rejects more than this is called liberal (Bradley, Brit. J. Math. Stat. Psychol. 31:144, 1978)."""

Counts = dict[Setting, Array]
"""Of each kind of study: how many are rejected, (no effect and effect, term, method) and how many were simulated."""


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[Part]:
    """Simulate, and write the tables."""
    del folder
    studies = QUICK if quick else STUDIES
    counts = rejected(studies, tell)
    yield about_part(studies)
    yield table_part(counts, studies, 0, 0)
    yield table_part(counts, studies, 1, 0)
    yield table_part(counts, studies, 0, 1)
    yield differences_part(ALONE * studies)


def rejected(studies: int, tell: Tell) -> Counts:
    """Simulate all kinds of studies, on all cores, and count what each test rejects."""
    every = settings()
    tasks = [
        (setting, min(PORTION, studies - first), (kind, first))
        for kind, setting in enumerate(every)
        for first in range(0, studies, PORTION)
    ]
    # The large ones first, so that no process is alone with one in the end.
    tasks.sort(key=lambda task: -task[0].dyads)
    counts = {setting: np.zeros((2, len(TERMS), len(METHODS))) for setting in every}
    with ProcessPoolExecutor(min(os.cpu_count() or 1, len(tasks)), get_context("spawn")) as pool:
        asked = {pool.submit(_rejections, *task): task[0] for task in tasks}
        for done, answer in enumerate(as_completed(asked), start=1):
            counts[asked[answer]] += answer.result()
            tell(f"{done} of {len(tasks)} portions", done / len(tasks))
    return counts


def _rejections(setting: Setting, studies: int, seed: tuple[int, ...]) -> Array:
    """A p that is not a number rejects nothing."""
    return np.asarray((simulated(setting, studies, seed) <= LEVEL).sum(axis=-1), dtype=float)


def about_part(studies: int) -> Part:
    """Say what is simulated."""
    rows: list[tuple[Value, ...]] = [
        ("simulated studies of each kind", studies),
        ("dyads", ", ".join(map(str, DYADS))),
        ("performers of a dyad, trials of each with and without forces", f"3, {TRIALS}"),
        ("SD of dyads, performers and trials [log]", f"{OF_DYADS:g}, {OF_PERFORMERS:g}, {OF_TRIALS:g}"),
        ("SD of the haptic effect, of dyads and of performers [log]", " or ".join(f"{one:g}" for one in SLOPES)),
        ("effect whose power is told [log]", f"{EFFECT:g}"),
        ("tests reject at p", LEVEL),
    ]
    return Part("about", "What was simulated", ("", "of what"), rows)


TITLES = {
    (0, 0): ("false-positives", "False positives of the test of haptics at .05, with 95 % Monte-Carlo intervals"),
    (1, 0): ("power", f"Power of the test of haptics at .05, effect {EFFECT:g} on the log scale"),
    (0, 1): ("interaction", "False positives of the test of haptics x configuration at .05"),
}


def table_part(counts: Counts, studies: int, place: int, term: int) -> Part:
    """Write what share of the studies each test rejects.

    - `place`, `term`: without or with an effect, and number of the term [1].
    """
    name, title = TITLES[place, term]
    rows: list[tuple[Value, ...]] = []
    for setting, found in counts.items():
        cells = [share(int(count), studies) for count in found[place, term]]
        rows.append((setting.dyads, setting.errors, f"{setting.slopes:g}", *cells))
    verdicts = _verdicts(counts, studies) if (place, term) == (0, 0) else []
    heads = ("dyads", "errors", "SD of effect [log]", *METHODS)
    return Part(name, title, heads, rows, verdicts)


def differences_part(samples: int) -> Part:
    """Write what share of samples of dyads' differences the paired tests reject, where their mean is zero."""
    rows: list[tuple[Value, ...]] = []
    worst: dict[str, list[float]] = {"normal": [], "skewed": []}
    for kind, errors in enumerate(name for name in ERRORS if not name.startswith("AR")):
        for dyads in DYADS:
            p = differences_alone(dyads, errors, samples, (kind, dyads))
            counts = (p <= LEVEL).sum(axis=1)
            rows.append((dyads, errors, *(share(int(count), samples) for count in counts)))
            if errors in worst:
                worst[errors].append(float(counts[1]) / samples)
    verdict = Verdict(
        "the permutation test keeps .05 where differences are symmetric, and does not where they are skewed",
        max(worst["normal"]) <= LIBERAL < max(worst["skewed"]),
        f"at most {max(worst['normal']):.3f} of normal ones, and up to {max(worst['skewed']):.3f} of log-normal ones",
    )
    title = f"False positives of tests of dyads' differences, {samples} samples of each kind"
    return Part("differences", title, ("dyads", "differences", *METHODS[3:]), rows, [verdict])


def share(count: int, of: int) -> str:
    """Write a share with its interval of Clopper and Pearson."""
    found = stats.binomtest(count, of).proportion_ci(method="exact")
    return f"{count / of:.3f} ({found.low:.3f}-{found.high:.3f})"


def _verdicts(counts: Counts, studies: int) -> list[Verdict]:
    """Say which tests of the mixed model keep what they promise under normal errors."""
    normal = {setting: found[0, 0] / studies for setting, found in counts.items() if setting.errors == "normal"}
    verdicts = []
    for method in ("careful", "Satterthwaite", "Kenward-Roger"):
        rates = [float(found[METHODS.index(method)]) for found in normal.values()]
        claim = f"with normal errors {method} rejects no more than {LIBERAL:g} where there is no effect"
        # The short form is too short to tell .05 from .075: it allows for its own error.
        slack = 3.0 * (LEVEL * (1.0 - LEVEL) / studies) ** 0.5 if studies < STUDIES else 0.0
        verdicts.append(Verdict(claim, max(rates) <= LIBERAL + slack, f"{min(rates):.3f} to {max(rates):.3f}"))
    return verdicts
