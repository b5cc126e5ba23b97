"""Conditions of a study in a fixed order, and aggregation of trials to dyads.

The unit of replication is the dyad. Values of trials are averaged for each performer (a participant, or a dyad whose
trials both perform), and performers' means for each dyad. So each dyad is one value, whatever its number of trials and
blocks.

The paper compares 30 first with 30 last trials and groups 30 trials. Studies with shorter conditions get smaller
windows, and a note gives the reason. They follow the trials that count, not the planned ones: in a short condition,
windows of half the plan would leave out every performer of whom one trial is excluded.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isclose, isfinite, lcm, nan

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.extraction.conditions import StudyFactor, names_of
from netboard.analysis.extraction.study import StudyData, pooled, series_labels
from netboard.analysis.extraction.tables import ATTEMPT_KEY
from netboard.analysis.measures.performance import ENDS, trial_times, window_sizes
from netboard.analysis.statistics.estimates import ROUNDING, Estimate, Range, mean_interval
from netboard.analysis.topics.result import Result, cached
from netboard.base.plural import plural
from netboard.base.tables.forces import CONDITIONS
from netboard.task.studies.factors import level_text

FORCE_LABELS = {name: condition.label for name, condition in CONDITIONS.items()}
"""Name of each haptic condition, in display order."""

MAX_CONDITIONS = 6
"""Largest number of conditions in a figure, if there are factors to pool over [1]."""

CONFIGURATIONS = ("bimanual", "dyadic")
"""Configurations, in display order."""

CLASSES = ("cooperative", "competitive", "single", "still")
"""Movement classes, in the order of `netboard.analysis.measures.movements`."""


def haptics_of(force: str) -> str:
    """Return the name of a haptic condition, such as ``haptics on``; an unknown force as it is."""
    return FORCE_LABELS.get(force, force)


@dataclass(frozen=True, slots=True)
class PerformanceQuantity:
    """Performance measure of a trial, 0 or more; less is better."""

    column: str
    name: str
    unit: str


QUANTITIES = (
    PerformanceQuantity("completion", "completion time", "s"),
    PerformanceQuantity("peaks", "number of velocity peaks", "1"),
)
"""The paper's two performance measures."""


@dataclass(frozen=True, slots=True)
class Condition:
    """A condition of a study; its `role` is empty for test trials.

    `partner` is one that is neither participant, such as ``robot partner``; otherwise empty.
    """

    name: str
    configuration: str
    force: str
    partner: str
    levels: tuple[tuple[StudyFactor, str], ...] = ()
    role: str = ""

    @property
    def other_levels(self) -> tuple[str, ...]:
        """Key that comparable conditions share: levels of all other factors, and role."""
        texts = [factor.text(level) for factor, level in self.levels]
        return (*texts, self.role) if self.role else tuple(texts)

    @property
    def team(self) -> str:
        """Team: configuration, partner, levels of other factors, and a role other than test."""
        return ", ".join(filter(None, (self.configuration, self.partner, *self.other_levels)))

    @property
    def haptics(self) -> str:
        """Name of the haptic condition."""
        return haptics_of(self.force)

    @property
    def haptics_label(self) -> str:
        """Name of the haptic condition, with the levels of other factors."""
        return ", ".join((self.haptics, *self.other_levels))

    @property
    def label(self) -> str:
        """Team and haptic condition."""
        return f"{self.team}, {self.haptics}"


@cached
def conditions(study: StudyData) -> tuple[Condition, ...]:
    """Return the conditions of a study, bimanual first, and haptics off first."""
    analysed = study.analysed
    named = [factor for factor in study.factors if factor.in_names]
    caught = set(study.counted.loc[study.counted["role"] == "catch", "recording"])
    found: dict[str, Condition] = {}
    for place, row in zip(analysed.index, analysed.to_dict("records"), strict=True):
        lengths = (len(study.levels.sequences[one.name][place]) for one in named)
        trials = range(1, 1 + lcm(*(length for length in lengths if length)))
        levels = {one.name: study.levels.at(one, [place] * len(trials), trials) for one in named}
        for role in {row["role"] or "test", *(["catch"] if row["recording"] in caught else [])}:
            names = names_of(pd.DataFrame([row] * len(trials)), levels, [role] * len(trials))
            for trial, name in enumerate(names):
                own = tuple((one, levels[one.name][trial]) for one in named if levels[one.name][trial])
                who = row["configuration"], row["force"], row["partner"]
                found[name] = Condition(name, *who, own, "" if role == "test" else role)
    return tuple(sorted(found.values(), key=_place))


@cached
def bounded(study: StudyData) -> tuple[StudyData, str]:
    """Pool over as few factors as needed to fit the conditions in a figure, and say which; empty for none."""
    cells = len(conditions(study))
    named = [one for one in reversed(study.factors) if one.in_names]
    within_first = sorted(named, key=lambda one: one.scope != "trial")
    over: list[StudyFactor] = []
    fewer = study
    while len(conditions(fewer)) > MAX_CONDITIONS and len(over) < len(within_first):
        over.append(within_first[len(over)])
        fewer = pooled(study, [one.name for one in over])
    if not over:
        return study, ""
    each = "; ".join(f"{one.name} ({', '.join(level_text(one.of, level) for level in one.of.levels)})" for one in over)
    return fewer, f"Pooled over {each}: the study has {cells} conditions, which tables and models distinguish."


def of_blocks(study: StudyData) -> tuple[Condition, ...]:
    """Return the conditions of blocks, without the levels of factors that vary within them."""
    return conditions(pooled(study, [factor.name for factor in study.factors if factor.scope == "trial"]))


def labels_of(study: StudyData) -> dict[str, str]:
    """Return the label of each condition of trials or blocks, as the results name it."""
    return {one.name: one.label for one in (*of_blocks(study), *conditions(study))}


def block_labels(study: StudyData) -> dict[str, str]:
    """Return the labels of all blocks' conditions, even if not analysed or with a factor that varies within."""
    known = {one.name: one.label for one in of_blocks(study)}
    return {name: known.get(name, name) for name in study.blocks["condition"]}


def _place(condition: Condition) -> tuple[int, str, tuple[int, ...], str, int, str]:
    """Return the sort key of a condition."""
    known = list(FORCE_LABELS)
    return (
        CONFIGURATIONS.index(condition.configuration),
        condition.partner,
        tuple(factor.of.levels.index(level) for factor, level in condition.levels),
        condition.role,
        known.index(condition.force) if condition.force in known else len(known),
        condition.name,
    )


def teams(study: StudyData) -> tuple[str, ...]:
    """Return the teams of a study, in the order of its conditions."""
    return tuple(dict.fromkeys(condition.team for condition in conditions(study)))


def counted(study: StudyData) -> pd.DataFrame:
    """Return the trials that count, with team and completion time as set.

    Where the time of failed attempts counts too, those in the same recording are added.
    """
    team_of = {condition.name: condition.team for condition in conditions(study)}
    rows = study.counted.assign(team=study.counted["condition"].map(team_of))
    if study.readings.summaries.time == "all_attempts":
        rows["completion"] = _times_of_all_attempts(study).reindex(rows.index)
    return rows


def excluded(study: StudyData) -> NDArray[np.bool_]:
    """Return whether each attempt of a study is excluded."""
    left_out = pd.MultiIndex.from_frame(study.exclusions[ATTEMPT_KEY])
    return np.asarray(pd.MultiIndex.from_frame(study.trials[ATTEMPT_KEY]).isin(left_out))


def _times_of_all_attempts(study: StudyData) -> pd.Series:
    """Return the time of each trial that counts, including its failed attempts."""
    trials = study.trials[(study.trials["counts"] == 1) | (study.trials["outcome"] != "success")]
    found = [pd.Series(dtype=np.float64)]
    for _, own in trials.groupby("recording", sort=False):
        counts = own["counts"].to_numpy() == 1
        completions = np.where(counts, own["completion"], np.nan)
        numbers, times = trial_times(
            own["trial"].to_numpy(), own["duration"].to_numpy(), completions, of="all_attempts"
        )
        kept = own["trial"][counts]
        found.append(pd.Series(times[np.searchsorted(numbers, kept)], kept.index))
    return pd.concat([one for one in found if len(one)] or found)


def of_performers(rows: pd.DataFrame, column: str) -> pd.Series:
    """Average a column for each performer."""
    return rows.groupby(["dyad", "performer"])[column].mean()


def of_dyads(means: pd.Series) -> pd.Series:
    """Average performers' values for each dyad."""
    return means.groupby(level="dyad").mean()


def over_the_same(performers: pd.DataFrame) -> pd.DataFrame:
    """Return the levels of each dyad in columns that are compared, over the performers who have a value in all."""
    return performers.dropna().groupby(level="dyad").mean()


def performed_by(every: Iterable[Condition]) -> dict[str, object]:
    """Return who performs each condition, by name: equal for conditions with the same performers."""
    return {one.name: (one.configuration, one.partner) for one in every}


def paired_levels(performers: pd.DataFrame, who: Mapping[str, object], names: Sequence[str]) -> pd.DataFrame:
    """Return the levels of each dyad in conditions that are compared; NaN where nothing can be compared.

    `performers` has the level of each dyad and performer (rows) in each condition (columns); `who` performs each
    condition, as from `performed_by`. Only performers with a value in all of these conditions of their configuration
    count: else a performer's own speed would be taken for an effect. Between configurations, moreover, a dyad needs a
    value of each of its performers.
    """
    compared = {who[name]: [other for other in names if who[other] == who[name]] for name in names}
    parts = []
    for own, chosen in compared.items():
        levels = over_the_same(performers[chosen])
        if len(compared) > 1:
            known = performers[[name for name in performers.columns if who[name] == own]].dropna(how="all")
            incomplete = known.index.difference(performers[chosen].dropna().index)
            levels = levels.drop(incomplete.unique("dyad"), errors="ignore")
        parts.append(levels)
    return pd.concat(parts, axis=1).reindex(performers.index.unique("dyad"))


def with_base(every: tuple[Condition, ...]) -> Iterator[tuple[Condition, Condition]]:
    """Yield each condition with haptic feedback, and the same team's condition without it.

    The level of a factor that determines the force, such as ``none``, ``direct`` and ``delayed``, differs between them.
    """
    force_factors = _force_factors(every)
    bases: dict[object, list[Condition]] = {}
    for one in every:
        if one.force == "none":
            bases.setdefault(_comparison_key(one, force_factors), []).append(one)
    for one in every:
        found = bases.get(_comparison_key(one, force_factors), [])
        if one.force != "none" and len(found) == 1:
            yield one, found[0]


def _force_factors(every: Iterable[Condition]) -> set[str]:
    """Return the factors within dyads whose levels have one force each, one of them none and one another."""
    forces: dict[str, dict[str, set[str]]] = {}
    for one in every:
        for factor, level in one.levels:
            if factor.scope != "dyad":
                forces.setdefault(factor.name, {}).setdefault(level, set()).add(one.force)
    found = {name: list(of.values()) for name, of in forces.items() if all(len(own) == 1 for own in of.values())}
    return {name for name, of in found.items() if {"none"} in of and of.count({"none"}) < len(of)}


def _comparison_key(one: Condition, force_factors: set[str]) -> object:
    """Return what two conditions share that may differ only in the force and in the levels of these factors."""
    levels = [(factor.name, "" if factor.name in force_factors else level) for factor, level in one.levels]
    return one.configuration, one.partner, tuple(levels), one.role


def comparisons(every: tuple[Condition, ...], values: Mapping[str, pd.Series]) -> Iterator[tuple[str, pd.Series]]:
    """Yield the contrasts of interest by name, as within-dyad differences, from performers' values in each condition.

    Such as ``dyadic, haptics on vs off`` for each haptic condition minus haptics off; or ``dyadic vs bimanual``,
    over the haptic conditions that both have; or as in `by_factor`.
    """
    performers, who = pd.DataFrame(values).rename_axis(["dyad", "performer"]), performed_by(every)

    def difference(first: Sequence[str], second: Sequence[str]) -> pd.Series:
        levels = paired_levels(performers, who, [*first, *second])
        each = [levels[one] - levels[other] for one, other in zip(first, second, strict=True)]
        return pd.concat(each, axis=1).mean(axis=1, skipna=False).dropna()

    for one, base in with_base(every):
        yield f"{one.label} vs off", difference([one.name], [base.name])
    for among in dict.fromkeys(one.other_levels for one in every):
        own = [one for one in every if one.other_levels == among and not one.partner]
        alone = {one.force: one.name for one in own if one.configuration == "bimanual"}
        together = {one.force: one.name for one in own if one.configuration == "dyadic"}
        shared = [force for force in alone if force in together]
        if shared:
            name = ", ".join(("dyadic vs bimanual", *among))
            yield name, difference([together[force] for force in shared], [alone[force] for force in shared])
    for name, one, other in by_factor(every):
        yield name, difference([one.name], [other.name])


def by_factor(every: tuple[Condition, ...]) -> Iterator[tuple[str, Condition, Condition]]:
    """Yield pairs of conditions that differ in the level of one further factor, or in the haptic condition.

    Named such as ``mass heavy (0.05 kg) vs light (0.02 kg), dyadic, haptics on``: each level minus the first level
    that exists under otherwise equal conditions. Haptic conditions are compared in this way if there is none without
    haptics.
    """
    for place in range(max((len(one.levels) for one in every), default=0)):
        first: dict[object, Condition] = {}
        for one in every:
            if place >= len(one.levels):
                continue
            factor, level = one.levels[place]
            others = (*one.levels[:place], *one.levels[place + 1 :])
            base = first.setdefault((factor.name, one.configuration, one.force, one.partner, others, one.role), one)
            if base is not one:
                other = factor.text(base.levels[place][1]).removeprefix(f"{factor.name} ")
                rest = replace(one, levels=others).label
                yield f"{factor.text(level)} vs {other}, {rest}", one, base
    felt: dict[str, Condition] = {}
    for one in every:
        base = felt.setdefault(one.team, one)
        if base is not one and base.force != "none":
            yield f"{one.haptics} vs {base.haptics}, {one.team}", one, base


def estimate(values: pd.Series, within: Range, of: str = "dyad") -> Estimate:
    """Estimate the mean of the units, with a confidence interval that stays in the range of the quantity."""
    return mean_interval(values.to_numpy(dtype=np.float64), within, unit=of)


def interval_text(estimates: Iterable[Estimate]) -> str:
    """Return the level and the methods of intervals, such as ``95 % confidence intervals (Wilson)``."""
    known = [one for one in estimates if isfinite(one.low)]
    levels = dict.fromkeys(f"{100 * one.level:.0f} %" for one in known)
    methods = dict.fromkeys(one.method for one in known)
    text = " ".join(filter(None, (" or ".join(levels), "confidence intervals")))
    return f"{text} ({'; '.join(methods)})" if methods else text


def estimated(topic: str, quantity: str, group: str, found: Estimate, unit: str, note: str = "") -> Result:
    """Return an estimate, with its confidence interval and its number of units, as a result.

    An interval without width is none: the variation between units, from which it is made, is unknown.
    """
    few = {0: f"no {found.unit} has a value", 1: f"no interval from one {found.unit}"}.get(found.n, "")
    interval = f"{100 * found.level:.0f} % {found.method}" if found.n > 1 else ""
    if isclose(found.low, found.high, rel_tol=ROUNDING):
        few = f"no interval: every {found.unit} has the same value, so the variation between them is unknown"
        found, interval = replace(found, low=nan, high=nan), ""
    note = "; ".join(filter(None, (note, few)))
    return Result(topic, quantity, group, found.value, found.low, found.high, unit, interval, found.n, found.unit, note)


def simulated(study: StudyData) -> str:
    """Return a sentence if participants of a study are simulated; otherwise an empty text."""
    marks = study.blocks["simulated"]
    if not len(marks) or not marks.any():
        return ""
    some = "Some of the participants are simulated."
    return "Simulated participants: no evidence about people." if marks.all() else some


SHORTER = 0.25
"""Largest share of the series with fewer trials than the windows require [1]."""


@dataclass(frozen=True, slots=True)
class Windows:
    """Window sizes of a study, and why they are not the paper's; the notes are empty for the paper's or set sizes."""

    ends: int
    group: int
    ends_note: str = ""
    group_note: str = ""

    @property
    def note(self) -> str:
        """Both notes, each once."""
        return "; ".join(dict.fromkeys(filter(None, (self.ends_note, self.group_note))))


def short_last_group(first: int, last: int, size: int) -> str:
    """Return a sentence about a last group with fewer trials than the others; empty if it is whole."""
    count = last - first + 1
    return f"The last group has only {plural(count, 'trial')} ({first} to {last})." if count < size else ""


def windows_of(study: StudyData) -> Windows:
    """Return the windows of a study: as set, or the paper's 30, or as many as short conditions allow."""
    how = study.readings.summaries
    trials = counted(study)
    if not len(trials):
        return Windows(how.ends or ENDS, how.group or ENDS)
    lengths = trials.groupby(["team", *series_labels(study.readings)]).size()
    usual = int(lengths.groupby(level="team").quantile(SHORTER).min())
    ends, group = window_sizes(usual)

    def note(size: int) -> str:
        why = f"windows of {size} trials, because a condition has only {usual}; the paper's have {ENDS}"
        return why if size < ENDS else ""

    return Windows(
        how.ends or ends,
        how.group or group,
        "" if how.ends else note(ends),
        "" if how.group else note(group),
    )
