"""The declared contrast of a study: its conditions, the values of the dyads in them, and its effects by each method.

An effect is a main effect of a declared factor, averaged over the levels of the other, or their interaction. Other
factors of the study are averaged over the levels that occur in all compared conditions. A dyad counts if it has a value
in all of these conditions that its levels of factors between dyads allow.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from math import prod
from typing import Any, Literal

import numpy as np
import pandas as pd
from scipy import stats

from netboard.analysis.extraction.conditions import StudyFactor
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.statistics.contrasts import holm
from netboard.analysis.statistics.effects import Model
from netboard.analysis.statistics.estimates import Estimate, mean_interval, t_interval
from netboard.analysis.statistics.exact_tests import permutation_interval
from netboard.analysis.statistics.factors import FixedFactor, interaction
from netboard.analysis.statistics.models import count_model, log_time_model, share_model
from netboard.analysis.statistics.planned import Tested, planned_effect, planned_permutation, planned_t
from netboard.analysis.topics.groups import conditions, paired_levels, performed_by
from netboard.analysis.topics.measures import Measure, exponential, levels_of_performers, measures_of, rows_of
from netboard.analysis.topics.models import trial_numbers
from netboard.analysis.topics.result import cached
from netboard.base.errors import ConfigError
from netboard.base.tables.declared import require
from netboard.base.tables.outcomes import MODELLED, OUTCOMES, Declaration, Method
from netboard.task.studies.declaration import compared_levels, contrast_of
from netboard.task.studies.factors import level_text

Levels = tuple[str, ...]
"""A level of each declared factor."""

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


@dataclass(frozen=True, slots=True)
class DeclaredFactor:
    """A factor of the declared contrast, with the two compared levels, first minus second."""

    of: StudyFactor
    levels: tuple[str, str]

    @property
    def name(self) -> str:
        """Name, for texts."""
        return "kind of block" if self.of.name == "kind" else self.of.name

    @property
    def text(self) -> str:
        """The factor with its levels, such as ``haptics: on vs off``."""
        return f"{self.of.name}: {' vs '.join(level_text(self.of.of, level) for level in self.levels)}"

    @property
    def between(self) -> bool:
        """Whether a dyad has only one of the levels."""
        return self.of.scope == "dyad"


@dataclass(frozen=True, slots=True)
class Crossing:
    """The compared conditions: the names of those in each combination of levels, in the same order of other levels."""

    factors: tuple[DeclaredFactor, ...]
    cells: Mapping[Levels, tuple[str, ...]]
    left_out: tuple[str, ...]

    @property
    def names(self) -> list[str]:
        """Names of all compared conditions."""
        return [name for names in self.cells.values() for name in names]

    def label(self, levels: Levels) -> str:
        """Return the label of a combination of levels, such as ``haptics on, kind dyadic``."""
        return ", ".join(
            f"{one.of.name} {level_text(one.of.of, level)}" for one, level in zip(self.factors, levels, strict=True)
        )


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
    """A main effect or an interaction: by the declared method, by all others, its size, and the scores of the dyads."""

    name: str
    factors: tuple[DeclaredFactor, ...]
    counts: ByMethod
    others: tuple[ByMethod, ...]
    size: Estimate
    scores: tuple[pd.Series, ...]
    corrected: float = np.nan


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


@dataclass(frozen=True, slots=True)
class NoAnalysis:
    """No declared analysis counts, and why."""

    why: str


class NotEstimable(ValueError):
    """The recordings do not allow the declared analysis; the message gives the reason."""


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
    crossing = crossing_of(study, declaration.contrast)
    primary = outcome_of(study, known[declaration.primary], crossing, declaration)
    secondary = [outcome_of(study, known[one], crossing, declaration) for one in declaration.secondary]
    return DeclaredAnalysis(declaration, crossing, primary, _corrected(secondary))


def _corrected(outcomes: Sequence[Outcome]) -> tuple[Outcome, ...]:
    """Apply Holm's correction over all effects of all secondary outcomes."""
    corrected = iter(holm([effect.counts.tested.p for one in outcomes for effect in one.effects]))
    return tuple(
        replace(one, effects=tuple(replace(effect, corrected=float(next(corrected))) for effect in one.effects))
        for one in outcomes
    )


# --- conditions ------------------------------------------------------------------------------------------------------


def crossing_of(study: StudyData, contrast: str) -> Crossing:
    """Return the compared conditions of a contrast."""
    known = {one.name: one for one in reversed(study.factors)}
    factors = []
    for part in contrast_of(contrast):
        if part.factor not in known:
            raise NotEstimable(f"no recording has the factor {part.factor}")
        factors.append(DeclaredFactor(known[part.factor], compared_levels(part, known[part.factor].of.levels)))
    columns = [one.of.column for one in factors]
    rows = _tested(study.trials).drop_duplicates("condition")
    for one in factors:
        rows = rows[rows[one.of.column].isin(one.levels)]
    others = _others(study, rows, columns)
    found = {
        levels: {tuple(row[others]): row["condition"] for _, row in _where(rows, columns, levels).iterrows()}
        for levels in product(*(one.levels for one in factors))
    }
    return _crossed(tuple(factors), found)


def _crossed(factors: tuple[DeclaredFactor, ...], found: Mapping[Levels, Mapping[Levels, str]]) -> Crossing:
    """Return the conditions whose other levels occur in every combination of compared levels."""
    shared = [others for others in next(iter(found.values())) if all(others in own for own in found.values())]
    left_out = [name for own in found.values() for others, name in own.items() if others not in shared]
    crossing = Crossing(
        factors, {levels: tuple(own[one] for one in shared) for levels, own in found.items()}, tuple(left_out)
    )
    for levels, own in found.items():
        if not own:
            raise NotEstimable(f"there are no test trials with {crossing.label(levels)}")
    if not shared:
        raise NotEstimable("no two of the compared conditions have the same levels of the other factors")
    return crossing


def _tested(rows: pd.DataFrame) -> pd.DataFrame:
    return rows[rows["role"].isin(["", "test"])]


def _where(rows: pd.DataFrame, columns: Sequence[str], levels: Levels) -> pd.DataFrame:
    """Return the rows with a level in each column."""
    chosen = np.ones(len(rows), bool)
    for column, level in zip(columns, levels, strict=True):
        chosen &= (rows[column] == level).to_numpy()
    return rows[chosen]


def _others(study: StudyData, rows: pd.DataFrame, columns: Sequence[str]) -> list[str]:
    """Return the columns of other factors that vary where the compared ones, and those before, have one level each."""
    every = dict.fromkeys([*(one.column for one in study.factors), "configuration", "force", "partner"])
    kept = [*columns]
    for column in [one for one in every if one not in columns]:
        if len(rows) and rows.groupby(kept)[column].nunique().max() > 1:
            kept.append(column)
    return kept[len(columns) :]


# --- outcomes --------------------------------------------------------------------------------------------------------


def outcome_of(study: StudyData, measure: Measure, crossing: Crossing, declaration: Declaration) -> Outcome:
    """Compute an outcome in the compared conditions, by all methods."""
    values, left_out = _values(study, measure, crossing)
    modelled = measure.name in MODELS and (declaration.method == "model" or measure.name == declaration.primary)
    fit = _model(study, measure, crossing, declaration.level) if modelled else None
    effects = tuple(_effect(values, measure, crossing, factors, fit, declaration) for factors in _subsets(crossing))
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


def _subsets(crossing: Crossing) -> Iterator[tuple[DeclaredFactor, ...]]:
    """Yield the factors of each effect: main effects, then the interaction."""
    for size in range(1, len(crossing.factors) + 1):
        yield from combinations(crossing.factors, size)


def _values(study: StudyData, measure: Measure, crossing: Crossing) -> tuple[dict[Levels, pd.Series], tuple[str, ...]]:
    """Return the values of complete dyads in each combination of levels, and the dyads that are left out.

    A value of a ratio measure is a logarithm. A dyad has no value at levels of a factor between dyads that it has not.
    """
    levels = levels_of_performers(study, measure)
    levels = levels[levels["condition"].isin(crossing.names)]
    performers = levels.pivot(index=["dyad", "performer"], columns="condition", values="level")
    who = performed_by(conditions(study))
    found: dict[Levels, pd.Series] = {}
    taken: set[str] = set()
    for group in _groups(crossing):
        names = [name for cell in group for name in crossing.cells[cell]]
        own = performers.reindex(columns=names).dropna(how="all")
        complete = paired_levels(own, who, names).dropna()
        if twice := taken & set(complete.index):
            raise NotEstimable(f"dyad {min(twice)} has several levels of a factor that varies between dyads")
        taken |= set(complete.index)
        found |= {cell: complete[list(crossing.cells[cell])].mean(axis=1) for cell in group}
    return found, tuple(sorted(set(levels["dyad"]) - taken))


def _groups(crossing: Crossing) -> list[list[Levels]]:
    """Return the combinations of levels that one dyad can have, for each combination of levels between dyads."""
    found: dict[Levels, list[Levels]] = {}
    for levels in crossing.cells:
        pairs = zip(crossing.factors, levels, strict=True)
        found.setdefault(tuple(level for one, level in pairs if one.between), []).append(levels)
    return list(found.values())


def _effect(
    values: Mapping[Levels, pd.Series],
    measure: Measure,
    crossing: Crossing,
    factors: tuple[DeclaredFactor, ...],
    fit: Model | None,
    declaration: Declaration,
) -> DeclaredEffect:
    scores, weights = _scores(values, crossing, factors)
    by: dict[Method, ByMethod] = {"t": _by_scores(measure, "t", planned_t(scores, weights, level=declaration.level))}
    if len(scores) == 1:
        tested = planned_permutation(scores[0], level=declaration.level)
        by["permutation"] = _by_scores(measure, "permutation", tested)
    if fit is not None:
        by["model"] = ByMethod("model", MODELS[measure.name][1], _by_model(fit, factors))
    if declaration.method not in by:
        raise NotEstimable(f"the method {METHODS[declaration.method]} does not apply to {measure.name}")
    name = " x ".join(one.text for one in factors)
    others = tuple(one for method, one in by.items() if method != declaration.method)
    size = planned_effect(scores, weights, level=declaration.level)
    return DeclaredEffect(name, factors, by[declaration.method], others, size, tuple(scores))


def _scores(
    values: Mapping[Levels, pd.Series], crossing: Crossing, factors: tuple[DeclaredFactor, ...]
) -> tuple[list[pd.Series], list[float]]:
    """Return the dyads' scores in each group of dyads, and the weight of each group's mean."""

    def weight(levels: Levels, *, between: bool) -> float:
        pairs = zip(crossing.factors, levels, strict=True)
        return prod(_sign(one, level, factors) for one, level in pairs if one.between == between)

    groups = _groups(crossing)
    scores = [pd.concat([values[one] * weight(one, between=False) for one in group], axis=1) for group in groups]
    return [one.sum(axis=1) for one in scores], [weight(group[0], between=True) for group in groups]


def _sign(one: DeclaredFactor, level: str, factors: tuple[DeclaredFactor, ...]) -> float:
    """Return the weight of a level: a difference if the effect has the factor, otherwise a mean."""
    if one not in factors:
        return 0.5
    return 1.0 if level == one.levels[0] else -1.0


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
    rows = _tested(rows_of(study, measure.of))
    rows = rows[rows["condition"].isin(crossing.names)]
    if measure.of == "attempt":
        rows = rows.assign(order=trial_numbers(rows))
    values = np.asarray(measure.values(rows), dtype=float)
    if measure.ratio:
        values = np.where(values > 0.0, values, np.nan)
    own = [FixedFactor(one.of.column, rows[one.of.column].to_numpy(str), one.levels[::-1]) for one in crossing.factors]
    others = _others(study, rows, [one.name for one in own])
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
