"""Power of the declared analysis: every virtual study is decided as the report decides a real one.

The dyads have the same scores (`netboard.analysis.topics.crossing`), the declared test is the same, and the primary and
the secondary p values pass through the same gate (`netboard.analysis.statistics.contrasts.gatekept`). A declared test
that a cohort does not have, such as that of a secondary outcome without values in it, counts with a p of 1, so that the
adjusted p values of the others are those of the whole family, or larger.

The false-positive rate of a test is that without its own effect, while all other effects are as simulated: for a
secondary test the gate is then as open as it is with them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from netboard.analysis.cohort.power import (
    Array,
    CohortLevels,
    Power,
    PowerRate,
    Role,
    Scale,
    divided,
    mean_width,
    without_effect,
)
from netboard.analysis.cohort.rows import KEPT
from netboard.analysis.extraction.conditions import StudyFactor
from netboard.analysis.statistics.contrasts import gatekept
from netboard.analysis.statistics.exact_tests import SEED, least_permutation_p, permutation_p
from netboard.analysis.statistics.planned import planned_t
from netboard.analysis.topics.crossing import NotEstimable, cell_values, crossing_of, effect_name, effects_of, scores_of
from netboard.analysis.topics.declared import METHODS
from netboard.base.errors import ConfigError
from netboard.base.tables.outcomes import Declaration, Method


@dataclass(frozen=True, slots=True)
class DeclaredScores:
    """Scores of the dyads of all studies for one declared effect, as those of a real study.

    - `unit`: unit of the effect; 1 for a ratio.
    - `groups` (each of shape (studies, dyads)): scores of the dyads of one group; NaN for dyads of another, or without
      a score [unit of the measure, or 1].
    - `weights`: weight of the mean of each group [1].
    """

    measure: str
    effect: str
    unit: str
    scale: Scale
    groups: tuple[Array, ...]
    weights: tuple[float, ...]

    @property
    def means(self) -> tuple[float, ...]:
        """Mean score of each group in the whole cohort [unit; of a ratio the logarithm]."""
        return tuple(float(np.nanmean(one)) for one in self.groups)

    @property
    def mean(self) -> float:
        """The effect in the whole cohort [unit; of a ratio the logarithm]."""
        return sum(w * mean for w, mean in zip(self.weights, self.means, strict=True))

    @property
    def deviation(self) -> float:
        """Standard deviation of the scores within their groups [unit; of a ratio the logarithm]."""
        return float(np.nanstd(np.concatenate([(one - np.nanmean(one)).ravel() for one in self.groups]), ddof=1))


@dataclass(frozen=True, slots=True)
class CohortDecision:
    """What a cohort can decide of the declared analysis.

    - `scores`: those of the primary contrast first; empty if the cohort cannot decide it.
    - `missing`: declared secondary outcomes that a cohort does not have; `absent`: number of their tests [1].
    - `text`: the declared analysis, or why a cohort cannot decide it.
    """

    method: Method
    scores: tuple[DeclaredScores, ...]
    missing: tuple[str, ...]
    absent: int
    text: str


def decision_of(levels: CohortLevels, factors: Sequence[StudyFactor], declaration: Declaration) -> CohortDecision:
    """Return the scores of all declared effects in a cohort."""
    kept = {one.measure.name: one.measure for one in KEPT}
    declared = (declaration.primary, *declaration.secondary)
    why = _undecidable(declaration, set(kept))
    if why:
        return CohortDecision(declaration.method, (), (), 0, why)
    try:
        crossing = crossing_of(declaration.contrast, factors, levels.conditions)
        found = []
        for measure in [kept[name] for name in declared if name in kept]:
            values = cell_values(levels.performers[measure.name], levels.who, crossing)
            for own in effects_of(crossing):
                scores, weights = scores_of(values, crossing, own)
                if declaration.method == "permutation" and len(scores) > 1:
                    raise NotEstimable("the permutation test does not apply to a factor between dyads")
                groups = tuple(levels.arranged(one) for one in scores)
                scale: Scale = "ratio" if measure.ratio else "difference"
                unit = "1" if measure.ratio else measure.unit
                found.append(DeclaredScores(measure.name, effect_name(own), unit, scale, groups, tuple(weights)))
    except (ConfigError, NotEstimable) as error:
        return CohortDecision(declaration.method, (), (), 0, f"not decided: {error}")
    of_one = len(list(effects_of(crossing)))
    found.insert(0, found.pop(of_one - 1))
    missing = tuple(name for name in declared if name not in kept)
    secondary = len(found) - 1 + of_one * len(missing)
    text = f"primary contrast: {found[0].measure}, {found[0].effect}, {METHODS[declaration.method]}; "
    text += f"{secondary} secondary tests" if secondary else "no secondary tests"
    return CohortDecision(declaration.method, tuple(found), missing, of_one * len(missing), text)


def _undecidable(declaration: Declaration, kept: set[str]) -> str:
    """Return why no cohort can decide a declared analysis; empty if one can."""
    if not declaration.primary:
        return "none: the study declares no primary outcome, so all contrasts are exploratory"
    if declaration.primary not in kept:
        return f"not decided: a cohort has no values of the primary outcome {declaration.primary}"
    if declaration.method == "model":
        return "not decided: its method is the model of all trials, whose terms --models gives as exploratory ones"
    return ""


def declared_powers(found: CohortDecision, sizes: Sequence[int], alpha: float, trials: int) -> Iterator[Power]:
    """Yield the power of each declared test with each number of dyads, as it is decided; none without any."""
    for dyads in sizes if found.scores else ():
        groups = [[divided(group, dyads) for group in one.groups] for one in found.scores]
        own = [_tested(each, one, found.method, alpha) for each, one in zip(groups, found.scores, strict=True)]
        p = np.array([each for each, _ in own])
        null = [
            _tested(list(map(without_effect, each, one.means)), one, found.method, alpha)[0]
            for each, one in zip(groups, found.scores, strict=True)
        ]
        least = least_permutation_p(dyads) if found.method == "permutation" else 0.0
        least_p = decided(np.full((len(p), 1), least), found.absent)[:, 0]
        for place, one in enumerate(found.scores):
            role: Role = "secondary" if place else "primary"
            instead = np.vstack([p[:place], null[place][None], p[place + 1 :]])
            hits, misses = (decided(each, found.absent)[place] <= alpha for each in (p, instead))
            width, error = mean_width(own[place][1], one.scale)
            yield Power(
                role=role,
                measure=one.measure,
                contrast=one.effect,
                test=METHODS[found.method],
                dyads=dyads,
                trials=trials,
                studies=p.shape[1],
                unit=one.unit,
                scale=one.scale,
                effect=float(np.exp(one.mean)) if one.scale == "ratio" else one.mean,
                deviation=one.deviation,
                power=PowerRate.of(int(hits.sum()), p.shape[1]),
                false_positives=PowerRate.of(int(misses.sum()), p.shape[1]),
                width=width,
                width_error=error,
                least_p=float(least_p[place]) or nan,
            )


def decided(p: Array, absent: int = 0) -> Array:
    """Return the p by which each test of each study is decided: that of the primary contrast, and adjusted ones.

    - `p` (shape (tests, studies)): p of each test, the primary contrast first; NaN for a test without a result [1].
    - `absent`: number of secondary tests that count with a p of 1 [1].
    """
    others = [1.0] * absent
    each = [np.append(one[0], gatekept(one[0], [*one[1:], *others])[: len(one) - 1]) for one in p.T]
    return np.array(each).T.reshape(p.shape)


def _tested(groups: Sequence[Array], of: DeclaredScores, method: Method, alpha: float) -> tuple[Array, Array]:
    """Return p of an effect in each study, and the widths of its confidence intervals.

    A permutation test has no width here: its interval would take as many tests as all studies together.
    """
    if method == "permutation":
        (scores,) = groups
        p = permutation_p(scores, rng=np.random.default_rng(SEED))  # the arrangements of `planned_permutation`
        return p, np.full(len(p), nan)
    found = [planned_t(study, of.weights, level=1.0 - alpha) for study in zip(*groups, strict=True)]
    return np.array([each.p for each in found]), np.array([each.estimate.high - each.estimate.low for each in found])
