"""``make evidence ARGS=calibration``: false positive rate and power of each test in simulated studies.

Each dyad has two performers alone and both together, haptics off and on, with `TRIALS` trials each, as in the paper. In
some settings dyads differ in more than speed and haptic effect, or trials vary more when both perform (`VARIATIONS`). A
test at .05 should reject in 5 % of the studies without an effect. Fixed effects do not change the variance estimates of
the mixed model, so an effect is added to the estimates of the same studies to obtain the power.
"""

from bisect import bisect_left
from collections.abc import Callable, Iterator
from concurrent.futures import as_completed
from dataclasses import dataclass, replace
from functools import lru_cache
from math import exp, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from netboard.analysis.statistics.effect_sizes import hedges_factor, paired_effect
from netboard.analysis.statistics.effects import between_dyad_freedom, contrasts_of
from netboard.analysis.statistics.estimates import Estimate
from netboard.analysis.statistics.exact_tests import permutation_p
from netboard.analysis.statistics.factors import ModelDesign, design_of, paper_factors
from netboard.analysis.statistics.random_effects import Structure, random_effects, reduced_fit
from netboard.analysis.statistics.small_samples import (
    kenward_roger_covariance,
    kenward_roger_freedom,
    satterthwaite_freedom,
)
from netboard.base.process.workers import cores
from netboard.benchmarks.harness.processes import fresh_processes
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Tell

Array = NDArray[np.float64]

DYADS = (4, 8, 16)
"""Numbers of dyads in the simulated studies [1]."""

TRIALS = 30
"""Number of trials of a performer in each haptic condition [1]."""

SD_DYADS, SD_PERFORMERS, SD_TRIALS = 0.2, 0.1, 0.5
"""Standard deviations of the random effects of dyads and performers, and of the trials [log of the time]."""

SLOPES = (0.08, 0.3)
"""Small and large standard deviation of the haptic effect between dyads and between performers [log of the time]."""

EFFECT = -0.2
"""Effect for which power is reported: haptic feedback shortens times by 18 % [log of the time]."""

LEVEL = 0.05
"""Significance level: a test rejects if p is at most this [1]."""

METHODS = ("careful", "Satterthwaite", "Kenward-Roger", "paired t", "permutation")
"""The first three test the mixed model, the others the differences of dyads."""

TERMS = ("haptics", "haptics x configuration", "configuration", "haptics, dyadic")
"""Effects under test; power is tabulated for the first."""

VARIATIONS = (
    "configuration",
    "haptics x configuration",
    "haptics, dyadic",
    "haptics, bimanual",
    "nothing, but dyadic trials vary more",
)
"""What dyads differ in, with the standard deviation `SD_MORE`, or which trials have `SD_UNEQUAL`."""

SD_MORE = 0.3
"""Standard deviation of an effect in which dyads differ [log of the time]."""

SD_UNEQUAL = (0.3, 0.8)
"""Standard deviations of bimanual and of dyadic trials where they are unequal [log of the time]."""

HIGHEST = 0.065
"""A test at .05 that rejects more than this share is said to do so, beside its p [1]."""

CORRELATION = 0.5
"""Correlation of successive trials with the errors "AR(.5)" [1]."""

Draw = Callable[[np.random.Generator, tuple[int, ...]], Array]


def _normal(rng: np.random.Generator, size: tuple[int, ...]) -> Array:
    return rng.standard_normal(size)


def _skewed(rng: np.random.Generator, size: tuple[int, ...]) -> Array:
    """Draw log-normal values with skewness 6.2."""
    return (rng.lognormal(0.0, 1.0, size) - exp(0.5)) / sqrt((exp(1.0) - 1.0) * exp(1.0))


def _heavy(rng: np.random.Generator, size: tuple[int, ...]) -> Array:
    return rng.standard_t(4, size) / sqrt(2.0)


ERRORS: dict[str, Draw] = {"normal": _normal, "skewed": _skewed, "t4": _heavy, "AR(.5)": _normal}
"""Distributions of the errors, with variance 1; in the last one successive trials are correlated."""

DRAWS = 5
"""Samples of dyads' differences for each simulated study [1]."""


@dataclass(frozen=True, slots=True)
class Setting:
    """Parameters of a simulated study.

    - `errors`: name of the distribution of the errors.
    - `slopes`: standard deviation of the haptic effect between dyads and between performers [log of the time].
    - `variation`: one of `VARIATIONS`; empty for none.
    """

    dyads: int
    errors: str
    slopes: float
    variation: str = ""


def settings() -> tuple[Setting, ...]:
    """Return all combinations of parameters, the smallest studies first."""
    plain = [Setting(n, errors, slopes) for n in DYADS for errors in ERRORS for slopes in SLOPES]
    return (*plain, *(Setting(n, "normal", 0.0, one) for n in DYADS for one in VARIATIONS))


def simulated(setting: Setting, studies: int, seed: tuple[int, ...]) -> Array:
    """Simulate studies, and test both terms with every method, without and with an effect.

    - returns (shape (2, terms, methods, studies)): p without an effect and with `EFFECT`; NaN if the fit fails [1].
    """
    rng = np.random.default_rng(seed)
    p = np.full((2, len(TERMS), len(METHODS), studies), np.nan)
    gaps = np.empty((len(TERMS), studies, setting.dyads))
    for number in range(studies):
        times = _drawn(rng, setting)
        p[:, :, :3, number] = _test_model(_model(setting.dyads), times.ravel())
        gaps[:, number] = _differences(times)
    for place, effect in enumerate((0.0, EFFECT)):
        for term in range(len(TERMS)):
            shifted = gaps[term] + effect
            p[place, term, 3:] = _paired(shifted), permutation_p(shifted)
    return p


def p_of_differences(dyads: int, errors: str, studies: int, seed: tuple[int, ...]) -> Array:
    """Return p of the t test and the permutation test for random differences of dyads, shape (2, studies) [1]."""
    gaps = ERRORS[errors](np.random.default_rng(seed), (studies, dyads))
    return np.array([_paired(gaps), permutation_p(gaps)])


def _paired(gaps: Array) -> Array:
    """Return p of the t test for the differences of each study."""
    t = gaps.mean(axis=1) / stats.sem(gaps, axis=1)
    return np.asarray(2.0 * stats.t.sf(np.abs(t), gaps.shape[1] - 1))


def _drawn(rng: np.random.Generator, setting: Setting) -> Array:
    """Draw the log times of a study without fixed effects, shape (dyads, performers, haptics off and on, trials)."""
    draw, n = ERRORS[setting.errors], setting.dyads
    haptics = np.array([-0.5, 0.5])[:, None]
    level = SD_DYADS * draw(rng, (n, 1, 1, 1)) + SD_PERFORMERS * draw(rng, (n, 3, 1, 1))
    level = level + setting.slopes * (draw(rng, (n, 1, 1, 1)) + draw(rng, (n, 3, 1, 1))) * haptics
    if setting.variation:
        level = level + _more(rng, draw, n, haptics, setting.variation)
    noise = draw(rng, (n, 3, 2, TRIALS))
    if setting.errors.startswith("AR"):
        for k in range(1, TRIALS):
            noise[..., k] = CORRELATION * noise[..., k - 1] + sqrt(1.0 - CORRELATION**2) * noise[..., k]
    unequal = np.array([SD_UNEQUAL[0], *SD_UNEQUAL])[:, None, None]
    return np.asarray(level + (unequal if setting.variation == VARIATIONS[-1] else SD_TRIALS) * noise)


def _more(rng: np.random.Generator, draw: Draw, n: int, haptics: Array, variation: str) -> Array:
    """Draw what dyads differ in besides speed and haptic effect, shape (dyads, performers, haptics, 1)."""
    two = np.array([0.0, 0.0, 1.0])[:, None, None]
    effects = {
        "configuration": two - 0.5 + 0.0 * haptics,
        "haptics x configuration": (two - 0.5) * haptics,
        "haptics, dyadic": two * haptics,
        "haptics, bimanual": (1.0 - two) * haptics,
    }
    return SD_MORE * draw(rng, (n, 1, 1, 1)) * effects.get(variation, 0.0 * two * haptics)


@dataclass(frozen=True, slots=True, eq=False)
class _Model:
    """The parts of the mixed model that all studies of a size share."""

    design: ModelDesign
    structure: Structure
    rows: tuple[Array, ...]


@lru_cache(maxsize=len(DYADS))
def _model(dyads: int) -> _Model:
    dyad, performer, haptics, trial = (index.ravel() for index in np.indices((dyads, 3, 2, TRIALS)))
    factors = paper_factors(haptics == 1, performer == 2)
    nothing = np.zeros(len(dyad))
    design = design_of(nothing, dyad, performer, factors, trial + 1)
    rows = contrasts_of(design)
    structure = random_effects(design, "maximal")
    return _Model(design, structure, tuple(row for name in TERMS if (row := rows[name]) is not None))


def _test_model(model: _Model, times: Array) -> Array:
    """Test all terms with the methods of the mixed model; return p without and with an effect."""
    design = replace(model.design, values=times)
    fitted = reduced_fit(design, model.structure)
    p = np.full((2, len(TERMS), 3), np.nan)
    if fitted is None:
        return p
    found = fitted.found
    enlarged = kenward_roger_covariance(found.moments)
    for term, row in enumerate(model.rows):
        value = float(row @ found.coefficients)
        errors = [sqrt(float(row @ size @ row)) for size in (found.covariance, found.covariance, enlarged)]
        free = (
            between_dyad_freedom(design),
            satterthwaite_freedom(found.moments, row),
            kenward_roger_freedom(found.moments, row),
        )
        for place, effect in enumerate((0.0, EFFECT)):
            p[place, term] = 2.0 * stats.t.sf(abs(value + effect) / np.array(errors), free)
    return p


def _differences(times: Array) -> Array:
    """Return each dyad's effects, in the order of `TERMS`."""
    levels = times.mean(axis=3)
    alone, both = levels[:, :2].mean(axis=1), levels[:, 2]
    effects = alone[:, 1] - alone[:, 0], both[:, 1] - both[:, 0]
    together = (both - alone).mean(axis=1)
    return np.array([0.5 * (effects[0] + effects[1]), effects[1] - effects[0], together, effects[1]])


STUDIES, QUICK, PORTION = 2000, 60, 100
"""Number of simulated studies with each setting, the same with --quick, and the number in one task of a process [1]."""

LIBERAL = 0.075
"""A test at .05 that rejects more than this share is liberal (Bradley, Brit. J. Math. Stat. Psychol. 31:144, 1978)."""

Counts = dict[Setting, Array]
"""Number of rejections in each setting, shape (no effect and effect, terms, methods)."""


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Simulate studies and tabulate the rejections."""
    studies = QUICK if quick else STUDIES
    counts = rejections(studies, tell)
    yield about_part(studies)
    yield table_part(counts, studies, 0, 0)
    yield table_part(counts, studies, 1, 0)
    yield table_part(counts, studies, 0, 1)
    yield variations_part(counts, studies)
    yield differences_part(DRAWS * studies)
    yield effect_sizes_part(DRAWS * studies)


def rejections(studies: int, tell: Tell) -> Counts:
    """Simulate studies with all settings on all cores, and count the rejections of each test."""
    tasks = [
        (setting, min(PORTION, studies - first), (kind, first))
        for kind, setting in enumerate(settings())
        for first in range(0, studies, PORTION)
    ]
    # The largest studies first, so that all processes end at about the same time.
    tasks.sort(key=lambda task: -task[0].dyads)
    counts = {setting: np.zeros((2, len(TERMS), len(METHODS))) for setting in settings()}
    with fresh_processes(min(cores(), len(tasks))) as pool:
        futures = {pool.submit(_count_rejections, *task): task[0] for task in tasks}
        for done, answer in enumerate(as_completed(futures), start=1):
            counts[futures[answer]] += answer.result()
            tell(f"{done} of {len(tasks)} portions", done / len(tasks))
    return counts


def _count_rejections(setting: Setting, studies: int, seed: tuple[int, ...]) -> Array:
    """Count the rejections in some studies; a p of NaN does not reject."""
    return np.asarray((simulated(setting, studies, seed) <= LEVEL).sum(axis=-1), dtype=float)


def about_part(studies: int) -> ResultPart:
    """Tabulate the parameters of the simulation."""
    return ResultPart(
        "about",
        "Simulated studies",
        "quantity | value",
        [
            ("simulated studies with each setting", studies),
            ("dyads", ", ".join(map(str, DYADS))),
            ("performers of a dyad, trials of each per haptic condition", f"3, {TRIALS}"),
            ("SD of dyads, performers and trials [log]", f"{SD_DYADS:g}, {SD_PERFORMERS:g}, {SD_TRIALS:g}"),
            (
                "SD of the haptic effect between dyads and between performers [log]",
                " or ".join(f"{one:g}" for one in SLOPES),
            ),
            ("SD of a further effect in which dyads differ [log]", f"{SD_MORE:g}"),
            ("unequal SD of bimanual and of dyadic trials [log]", " and ".join(f"{one:g}" for one in SD_UNEQUAL)),
            ("effect for the power [log]", f"{EFFECT:g}"),
            ("significance level", LEVEL),
        ],
    )


TITLES = {
    (0, 0): ("false-positives", "False positives of the test of haptics at .05, with 95 % confidence intervals"),
    (1, 0): ("power", f"Power of the test of haptics at .05, effect {EFFECT:g} on the log scale"),
    (0, 1): ("interaction", "False positives of the test of haptics x configuration at .05"),
}


def table_part(counts: Counts, studies: int, place: int, term: int) -> ResultPart:
    """Tabulate the share of studies in which each test rejects.

    - `place`, `term`: 0 without an effect, 1 with `EFFECT`; index of the term in `TERMS` [1].
    """
    name, title = TITLES[place, term]
    part = ResultPart(name, title, ("dyads", "errors", "SD of effect [log]", *METHODS))
    for setting, found in counts.items():
        if setting.variation:
            continue
        cells = [share(int(count), studies) for count in found[place, term]]
        part.add(setting.dyads, setting.errors, f"{setting.slopes:g}", *cells)
    if (place, term) == (0, 0):
        _claim_not_liberal(part, counts, studies)
    return part


def variations_part(counts: Counts, studies: int) -> ResultPart:
    """Tabulate the false positive rate of all terms where dyads differ in one effect, or trials in their variance."""
    part = ResultPart(
        "variations",
        f"False positives at .05 where dyads differ in one effect (SD {SD_MORE:g}), or variances are unequal",
        ("dyads", "dyads differ in", "effect under test", *METHODS),
    )
    worst = np.zeros(len(METHODS))
    for setting, found in counts.items():
        for term, name in enumerate(TERMS if setting.variation else ()):
            part.add(setting.dyads, setting.variation, name, *(share(int(one), studies) for one in found[0, term]))
            worst = np.maximum(worst, found[0, term] / studies)
    slack = 3.0 * sqrt(LEVEL * (1.0 - LEVEL) / studies)
    for method, rate in zip(METHODS, worst, strict=True):
        claim = f"{method} rejects at most {HIGHEST:g} in these settings, but for the Monte Carlo error"
        part.claim(claim, bool(rate <= max(HIGHEST, LEVEL + slack)), f"at most {rate:.3f}")
    return part


def differences_part(samples: int) -> ResultPart:
    """Tabulate the false positive rate of the paired tests for differences of dyads with mean 0."""
    part = ResultPart(
        "differences",
        f"False positives of tests of dyads' differences, {samples} samples for each row",
        ("dyads", "differences", *METHODS[3:]),
    )
    worst: dict[str, list[float]] = {"normal": [], "skewed": []}
    for kind, errors in enumerate(name for name in ERRORS if not name.startswith("AR")):
        for dyads in DYADS:
            p = p_of_differences(dyads, errors, samples, (kind, dyads))
            counts = (p <= LEVEL).sum(axis=1)
            part.add(dyads, errors, *(share(int(count), samples) for count in counts))
            if errors in worst:
                worst[errors].append(float(counts[1]) / samples)
    part.claim(
        "the permutation test keeps .05 for normal differences, and exceeds it for skewed ones",
        max(worst["normal"]) <= LIBERAL < max(worst["skewed"]),
        f"at most {max(worst['normal']):.3f} for normal, and up to {max(worst['skewed']):.3f} for log-normal ones",
    )
    return part


EFFECT_SIZES = (0.0, 0.5, 1.0, 2.0)
"""True effect sizes of simulated differences [1]."""


def effect_sizes_part(samples: int) -> ResultPart:
    """Tabulate the coverage of the interval of g_z, and of the same interval multiplied by Hedges' correction."""
    part = ResultPart(
        "effect-sizes",
        f"Coverage of the 95 % confidence interval of g_z, normal differences, {samples} samples for each row",
        ("dyads", "true effect size", "limits of the true effect", "the same limits, multiplied by the correction"),
    )
    covered = []
    for dyads in DYADS:
        for true in EFFECT_SIZES:
            own, shrunk = coverage(dyads, true, samples)
            part.add(dyads, f"{true:g}", share(own, samples), share(shrunk, samples))
            covered.append(own / samples)
    error = 4.0 * sqrt(LEVEL * (1.0 - LEVEL) / samples)
    part.claim(
        "the interval of g_z has its nominal coverage of .95, but for the Monte Carlo error",
        max(abs(one - (1.0 - LEVEL)) for one in covered) <= error,
        f"{min(covered):.3f} to {max(covered):.3f}",
    )
    return part


def coverage(dyads: int, true: float, samples: int) -> tuple[int, int]:
    """Count the samples whose interval of g_z covers the true effect size: as it is, and multiplied by the correction.

    The intervals depend on the sample through its effect size alone, and grow with it. So the covering ones are those
    between two effect sizes, which a search finds.
    """
    drawn = np.random.default_rng((dyads, round(10 * true))).normal(true, 1.0, (samples, dyads))
    order = np.argsort(drawn.mean(axis=1) / drawn.std(axis=1, ddof=1))
    factor = hedges_factor(dyads - 1)

    def first(above: Callable[[Estimate], bool]) -> int:
        """Return the rank of the first sample whose interval is so far up."""
        return bisect_left(order, True, key=lambda one: above(paired_effect(drawn[one], correction="hedges")))

    own = first(lambda one: one.low > true) - first(lambda one: one.high >= true)
    shrunk = first(lambda one: factor * one.low > true) - first(lambda one: factor * one.high >= true)
    return own, shrunk


def share(count: int, of: int) -> str:
    """Format a share with its Clopper-Pearson confidence interval (95 %)."""
    found = stats.binomtest(count, of).proportion_ci(method="exact")
    return f"{count / of:.3f} ({found.low:.3f}-{found.high:.3f})"


def _claim_not_liberal(part: ResultPart, counts: Counts, studies: int) -> None:
    """Check that the tests of the mixed model are not liberal with normal errors."""
    normal = [
        found[0, 0] / studies
        for setting, found in counts.items()
        if setting.errors == "normal" and not setting.variation
    ]
    # With --quick, .05 and .075 do not differ significantly: allow for the Monte Carlo error.
    slack = 3.0 * (LEVEL * (1.0 - LEVEL) / studies) ** 0.5 if studies < STUDIES else 0.0
    for method, rates in zip(METHODS[:3], np.transpose(normal), strict=False):
        claim = f"with normal errors and no effect, {method} rejects at most {LIBERAL:g}"
        part.claim(claim, bool(rates.max() <= LIBERAL + slack), f"{rates.min():.3f} to {rates.max():.3f}")
