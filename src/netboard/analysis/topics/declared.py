"""The declared analysis of a study: the effects on each outcome by each method, and how they are decided.

The primary contrast is the interaction of the two declared factors, or the effect of the only one, on the primary
outcome by the declared method. Its p is compared with the level as it is. All other declared effects are secondary, and
have adjusted p values (`netboard.analysis.statistics.contrasts.gatekept`). Everything else is exploratory.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import pandas as pd
from scipy import stats

from netboard.analysis.extraction.study import StudyData
from netboard.analysis.statistics.contrasts import gatekept
from netboard.analysis.statistics.effects import Model
from netboard.analysis.statistics.estimates import Estimate, mean_interval, t_interval
from netboard.analysis.statistics.exact_tests import SYMMETRIC, permutation_interval
from netboard.analysis.statistics.factors import FixedFactor, interaction
from netboard.analysis.statistics.models import count_model, log_time_model, share_model
from netboard.analysis.statistics.planned import NORMAL, Tested, planned_effect, planned_permutation, planned_t
from netboard.analysis.statistics.random_effects import NORMAL_EFFECTS
from netboard.analysis.topics.crossing import (
    Crossing,
    DeclaredFactor,
    Levels,
    NotEstimable,
    cell_values,
    crossing_of,
    effect_name,
    effects_of,
    other_columns,
    scores_of,
    tested_rows,
)
from netboard.analysis.topics.groups import conditions, performed_by
from netboard.analysis.topics.measures import Measure, exponential, levels_of_performers, measures_of, rows_of
from netboard.analysis.topics.models import trial_numbers
from netboard.analysis.topics.result import cached
from netboard.base.errors import ConfigError
from netboard.base.tables.declared import require
from netboard.base.tables.outcomes import MODELLED, OUTCOMES, Declaration, Method

Scale = Literal["difference", "ratio", "ratio of odds"]

METHODS: dict[Method, str] = {"t": "t test", "permutation": "permutation test", "model": "model of all trials"}
"""Name of each method in results."""

MODELS: dict[str, tuple[Callable[..., Model], Scale, str]] = {
    "completion time": (log_time_model, "ratio", "linear mixed model of log times, REML, Kenward-Roger"),
    "velocity peaks": (count_model, "ratio", "Poisson GEE"),
    "falls per attempt": (share_model, "ratio of odds", "logistic GEE"),
}
"""Model of all trials of an outcome, the scale of its effects, and its name."""

require("MODELS in analysis/topics/declared.py", MODELS, MODELLED)


def assumption(measure: str, method: Method) -> str:
    """Return the assumption by which a method has more false positives than its level; empty for none known."""
    if method == "model":
        return NORMAL_EFFECTS if MODELS[measure][0] is log_time_model else ""
    return NORMAL if method == "t" else SYMMETRIC


@dataclass(frozen=True, slots=True)
class ByMethod:
    """An effect by one method; the estimate is on the scale of the effect."""

    method: Method
    scale: Scale
    tested: Tested

    @property
    def estimate(self) -> Estimate:
        """Estimate with its confidence interval."""
        return self.tested.estimate


@dataclass(frozen=True, slots=True, eq=False)
class DeclaredEffect:
    """A main effect or an interaction: by the declared method, by all others, its size, and the scores of the dyads.

    `adjusted` is the p by which it is decided: that of the primary contrast, or a secondary p after `gatekept` [1].
    """

    name: str
    factors: tuple[DeclaredFactor, ...]
    counts: ByMethod
    others: tuple[ByMethod, ...]
    size: Estimate
    scores: tuple[pd.Series, ...]
    adjusted: float = np.nan


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """An outcome: its mean in each combination of levels with the values of the dyads, and its effects."""

    measure: Measure
    means: Mapping[Levels, Estimate]
    values: Mapping[Levels, pd.Series]
    effects: tuple[DeclaredEffect, ...]
    left_out: tuple[str, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class DeclaredAnalysis:
    """The declared analysis of a study."""

    declaration: Declaration
    crossing: Crossing
    primary: Outcome
    secondary: tuple[Outcome, ...]

    @property
    def contrast(self) -> DeclaredEffect:
        """The primary contrast: the interaction of two declared factors, or the effect of the only one."""
        return self.primary.effects[-1]

    @property
    def secondary_effects(self) -> tuple[DeclaredEffect, ...]:
        """The secondary tests: the other effects on the primary outcome, and all on the secondary outcomes."""
        return (*self.primary.effects[:-1], *(effect for one in self.secondary for effect in one.effects))

    @property
    def least_adjusted(self) -> float:
        """Smallest possible adjusted p of a secondary test; NaN without one [1]."""
        least = [one.counts.tested.least_p for one in self.secondary_effects]
        return min(map(float, gatekept(self.contrast.counts.tested.least_p, least)), default=np.nan)


@dataclass(frozen=True, slots=True)
class NoAnalysis:
    """No declared analysis counts, and why."""

    why: str


@cached
def declared_analysis(study: StudyData) -> DeclaredAnalysis | NoAnalysis:
    """Compute the declared analysis of a study, or say why there is none."""
    declared = [one for one in study.declarations if one.primary]
    if not declared:
        return NoAnalysis("none is declared")
    if len(declared) > 1:
        return NoAnalysis(f"the recordings declare {len(declared)} different ones")
    (only,) = declared
    try:
        return _computed(study, only)
    except (ConfigError, NotEstimable) as error:
        return NoAnalysis(f"it cannot be computed: {error}")


def _computed(study: StudyData, declaration: Declaration) -> DeclaredAnalysis:
    known = {one.name: one for one in measures_of(study)}
    unknown = [one for one in (declaration.primary, *declaration.secondary) if one not in OUTCOMES]
    if unknown:
        raise NotEstimable(f'there is no measure "{unknown[0]}"')
    crossing = crossing_of(declaration.contrast, study.factors, study.trials)
    primary = outcome_of(study, known[declaration.primary], crossing, declaration)
    secondary = [outcome_of(study, known[one], crossing, declaration) for one in declaration.secondary]
    return DeclaredAnalysis(declaration, crossing, *_decided(primary, secondary))


def _decided(primary: Outcome, secondary: Sequence[Outcome]) -> tuple[Outcome, tuple[Outcome, ...]]:
    """Adjust the p values of all effects but the primary contrast, which is the gate of the others."""
    outcomes = primary, *secondary
    *others, contrast = primary.effects
    tested = [*others, *(effect for one in secondary for effect in one.effects)]
    p = gatekept(contrast.counts.tested.p, [effect.counts.tested.p for effect in tested])
    adjusted = dict(zip(map(id, tested), map(float, p), strict=True)) | {id(contrast): contrast.counts.tested.p}
    own, *rest = (
        replace(one, effects=tuple(replace(effect, adjusted=adjusted[id(effect)]) for effect in one.effects))
        for one in outcomes
    )
    return own, tuple(rest)


# --- outcomes --------------------------------------------------------------------------------------------------------


def outcome_of(study: StudyData, measure: Measure, crossing: Crossing, declaration: Declaration) -> Outcome:
    """Compute an outcome in the compared conditions, by all methods."""
    values, left_out = _values(study, measure, crossing)
    modelled = measure.name in MODELS and (declaration.method == "model" or measure.name == declaration.primary)
    fit = _model(study, measure, crossing, declaration.level) if modelled else None
    effects = tuple(_effect(values, measure, crossing, factors, fit, declaration) for factors in effects_of(crossing))
    notes = []
    if left_out:
        notes.append(f"left out, because a value is missing in a compared condition: {', '.join(left_out)}")
    if crossing.left_out:
        notes.append(f"conditions without a counterpart are left out: {', '.join(crossing.left_out)}")
    means = {levels: _mean(values[levels], measure, declaration.level) for levels in crossing.cells}
    return Outcome(measure, means, values, effects, left_out, tuple(notes))


def _mean(values: pd.Series, measure: Measure, level: float) -> Estimate:
    if measure.ratio:
        return exponential(t_interval(values.to_numpy(), level=level))
    return mean_interval(values.to_numpy(), measure.within, level=level)


def _values(study: StudyData, measure: Measure, crossing: Crossing) -> tuple[dict[Levels, pd.Series], tuple[str, ...]]:
    """Return the values of complete dyads in each combination of levels, and the dyads that are left out.

    A value of a ratio measure is a logarithm.
    """
    levels = levels_of_performers(study, measure)
    levels = levels[levels["condition"].isin(crossing.names)]
    performers = levels.pivot(index=["dyad", "performer"], columns="condition", values="level")
    found = cell_values(performers, performed_by(conditions(study)), crossing)
    return found, tuple(sorted(set(levels["dyad"]).difference(*(own.index for own in found.values()))))


def _effect(
    values: Mapping[Levels, pd.Series],
    measure: Measure,
    crossing: Crossing,
    factors: tuple[DeclaredFactor, ...],
    fit: Model | None,
    declaration: Declaration,
) -> DeclaredEffect:
    scores, weights = scores_of(values, crossing, factors)
    by: dict[Method, ByMethod] = {"t": _by_scores(measure, "t", planned_t(scores, weights, level=declaration.level))}
    if len(scores) == 1:
        tested = planned_permutation(scores[0], level=declaration.level)
        by["permutation"] = _by_scores(measure, "permutation", tested)
    if fit is not None:
        by["model"] = ByMethod("model", MODELS[measure.name][1], _by_model(fit, factors))
    if declaration.method not in by:
        raise NotEstimable(f"the method {METHODS[declaration.method]} does not apply to {measure.name}")
    others = tuple(one for method, one in by.items() if method != declaration.method)
    size = planned_effect(scores, weights, level=declaration.level)
    return DeclaredEffect(effect_name(factors), factors, by[declaration.method], others, size, tuple(scores))


def _by_scores(measure: Measure, method: Method, tested: Tested) -> ByMethod:
    if measure.ratio:
        tested = replace(tested, estimate=exponential(tested.estimate))
    return ByMethod(method, "ratio" if measure.ratio else "difference", tested)


def equivalence_interval(effect: DeclaredEffect) -> Estimate:
    """Return the confidence interval of two one-sided tests, of level 2 level - 1, by the method that counts.

    Schuirmann, J. Pharmacokinet. Biopharm. 15:657, 1987: effects outside it are rejected one-sidedly at 1 - level.
    """
    found = effect.counts.estimate
    level = 2.0 * found.level - 1.0
    ratio = effect.counts.scale != "difference"
    if effect.counts.method == "permutation":
        narrow = permutation_interval(effect.scores[0], level=level)
        return exponential(narrow) if ratio else narrow
    value, low, high = np.log([found.value, found.low, found.high]) if ratio else (found.value, found.low, found.high)
    free = effect.counts.tested.free
    half = (high - low) / 2.0 * float(stats.t.ppf(0.5 + level / 2.0, free) / stats.t.ppf(0.5 + found.level / 2.0, free))
    narrow = replace(found, value=float(value), low=float(value - half), high=float(value + half), level=level)
    return exponential(narrow) if ratio else narrow


# --- model -----------------------------------------------------------------------------------------------------------


def _model(study: StudyData, measure: Measure, crossing: Crossing, level: float) -> Model:
    """Fit the model of all trials in the compared conditions, with the declared factors first."""
    rows = tested_rows(rows_of(study, measure.of))
    rows = rows[rows["condition"].isin(crossing.names)]
    if measure.of == "attempt":
        rows = rows.assign(order=trial_numbers(rows))
    values = np.asarray(measure.values(rows), dtype=float)
    if measure.ratio:
        values = np.where(values > 0.0, values, np.nan)
    own = [FixedFactor(one.of.column, rows[one.of.column].to_numpy(str), one.levels[::-1]) for one in crossing.factors]
    others = other_columns(study.factors, rows, [one.name for one in own])
    further = [FixedFactor(column, rows[column].to_numpy(str)) for column in others]
    fit = MODELS[measure.name][0]
    return fit(values, rows["dyad"], rows["performer"], (*own, *further), rows["order"], level=level)


def _by_model(fit: Model, factors: tuple[DeclaredFactor, ...]) -> Tested:
    """Return an effect of a model: by Kenward and Roger's method for a mixed model, else with its own interval."""
    names = [one.of.column for one in factors]
    effect = fit.effect(names[0] if len(names) == 1 else interaction(*names))
    found: Any = next((one for one in effect.others if one.method == "Kenward-Roger"), effect)
    statistic = found.estimate.value / found.error if found.error > 0.0 else np.nan
    why = "" if np.isfinite(found.p) else "; ".join(fit.notes)
    return Tested(found.ratio, statistic, found.free, found.p, why, fit.caution)
