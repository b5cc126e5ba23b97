"""Delay between the sides in cooperative movements (the paper's figure 6), at fractions of a peak velocity.

The paper averages absolute delays, whose mean is positive even without a leader; the signed delay and its standard
deviation are reported as well. The paper's threshold is a fraction of the slower side's peak for both sides, which
makes the side that moves farther appear earlier. Delays at fractions of each side's own peak have no such bias and are
also reported.

The unit of a confidence interval is set: dyads, performers or single movements. The last treats movements of one
performer as independent. Contrasts between conditions always use dyads.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import nan

import numpy as np
import pandas as pd

from netboard.analysis.extraction.study import Study
from netboard.analysis.measures.cooperation import PORTIONS
from netboard.analysis.results.groups import (
    Condition,
    comparisons,
    conditions,
    estimate,
    estimated,
    of_dyads,
    with_base,
)
from netboard.analysis.results.result import Result
from netboard.analysis.statistics.estimates import Estimate

TOPIC = "delay"

PERCENT = tuple(round(100 * portion) for portion in PORTIONS)
"""Fractions of a peak [%]."""

OVER_ALL = f"mean of {PERCENT[0]} to {PERCENT[-1]} %"
"""Name of the mean over the fractions."""

RISE = f"delay at {PERCENT[-1]} % less that at {PERCENT[0]} %"
"""Name of the increase of delays with the threshold."""

APART = "thresholds at which the intervals do not overlap"
"""Name of the paper's criterion for a difference."""


@dataclass(frozen=True, slots=True)
class Delays:
    """One kind of delay in a condition.

    Attributes
    ----------
    units : DataFrame
        Delay of each unit of replication (rows) at each of `PERCENT` (columns) [s].
    dyads : DataFrame
        Delay of each dyad (rows) at each of `PERCENT` (columns) [s].
    """

    units: pd.DataFrame
    dyads: pd.DataFrame
    means: tuple[Estimate, ...]


@dataclass(frozen=True, slots=True)
class ConditionDelay:
    """The delays of a condition.

    Attributes
    ----------
    as_set : Delays
        At fractions of the set peak, absolute or signed as set.
    own_peak : Delays
        At fractions of each side's own peak, absolute or signed as set.
    signed : Delays
        At fractions of the set peak, left minus right.
    truncated : tuple of float
        Share of delays with a truncated search for a crossing, for each of `PERCENT`; NaN without delays [1].
    """

    condition: Condition
    as_set: Delays
    own_peak: Delays
    signed: Delays
    deviations: Delays
    movements: int
    truncated: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Delay:
    """The delays of all conditions."""

    conditions: tuple[ConditionDelay, ...]
    kind: str
    unit: str
    results: tuple[Result, ...]


def delay(study: Study) -> Delay:
    """Return the delays of all conditions."""
    how = study.readings.summaries
    rows = study.movements[(study.movements["counts"] == 1) & (study.movements["cooperative"] == 1)]
    found = tuple(
        _of_condition(one, rows[rows["condition"] == one.name], how.delay, how.intervals) for one in conditions(study)
    )
    return Delay(found, how.delay, how.intervals, tuple(_results(found, how.delay)))


def _of_condition(condition: Condition, rows: pd.DataFrame, kind: str, unit: str) -> ConditionDelay:
    signed = _columns(rows, "delay")
    own = _columns(rows, "own_delay")
    truncated = rows[[f"truncated_{q}" for q in PERCENT]].astype(np.float64).set_axis(list(PERCENT), axis=1)
    told = truncated.where(signed.notna() | (truncated == 1.0))
    place = rows[["dyad", "performer"]]
    deviations = signed.groupby([place["dyad"], place["performer"]]).std().rename_axis(["dyad", "performer"])
    spread_of = "dyads" if unit == "movements" else unit
    return ConditionDelay(
        condition,
        _delays(place, signed.abs() if kind == "absolute" else signed, condition, unit),
        _delays(place, own.abs() if kind == "absolute" else own, condition, unit),
        _delays(place, signed, condition, unit),
        _of_units(deviations, deviations, condition, spread_of),
        len(rows),
        tuple(told.mean(axis=0)),
    )


def _columns(rows: pd.DataFrame, prefix: str) -> pd.DataFrame:
    """Return the columns of a delay, named by their fractions."""
    return rows[[f"{prefix}_{q}" for q in PERCENT]].set_axis(list(PERCENT), axis=1)


def _delays(place: pd.DataFrame, values: pd.DataFrame, condition: Condition, unit: str) -> Delays:
    performers = values.groupby([place["dyad"], place["performer"]]).mean()
    return _of_units(values, performers, condition, unit)


def _of_units(single: pd.DataFrame, performers: pd.DataFrame, condition: Condition, unit: str) -> Delays:
    """Average over the set units."""
    dyads = of_dyads(performers)
    person = "participant" if condition.configuration == "bimanual" else "dyad"
    units, of = {
        "dyads": (dyads, "dyad"),
        "people": (performers, person),
        "movements": (single, "movement"),
    }[unit]
    return Delays(units, dyads, tuple(estimate(units[q], of) for q in PERCENT))


def _results(found: tuple[ConditionDelay, ...], kind: str) -> Iterator[Result]:
    for one in found:
        yield from _of_one(one, kind)
    overall = {one.condition.name: one.as_set.dyads.mean(axis=1, skipna=False) for one in found}
    for team in dict.fromkeys(one.condition.team for one in found):
        own = [overall[one.condition.name] for one in found if one.condition.team == team]
        mean = estimate(pd.concat(own, axis=1).mean(axis=1, skipna=False))
        yield estimated(TOPIC, f"delay, {OVER_ALL}", team, mean, "s", f"{kind}; over its conditions")
    every = tuple(one.condition for one in found)
    for group, differences in comparisons(every, overall):
        yield estimated(TOPIC, f"delay, {OVER_ALL}", group, estimate(differences), "s", f"{kind}; a difference")
    by_name = {one.condition.name: one for one in found}
    for felt, base in with_base(every):
        yield _apart(f"{felt.label} less off", by_name[felt.name], by_name[base.name])


def _of_one(found: ConditionDelay, kind: str) -> Iterator[Result]:
    """Yield the results of a condition."""
    label = found.condition.label
    kinds = (
        ("delay at {} %", found.as_set, kind),
        ("delay at {} % of own peaks", found.own_peak, kind),
        ("signed delay at {} %", found.signed, "left less right"),
        ("SD of the signed delay at {} %", found.deviations, "of each performer's movements"),
    )
    for name, delays, note in kinds:
        for q, mean in zip(PERCENT, delays.means, strict=True):
            yield estimated(TOPIC, name.format(q), label, mean, "s", note)
    for q, share in zip(PERCENT, found.truncated, strict=True):
        name = f"share of searches cut off at {q} %"
        yield Result(TOPIC, name, label, share, nan, nan, "1", "", found.movements, "movement")
    dyads = found.as_set.dyads
    yield estimated(TOPIC, f"delay, {OVER_ALL}", label, estimate(dyads.mean(axis=1, skipna=False)), "s", kind)
    rise = estimate(dyads[PERCENT[-1]] - dyads[PERCENT[0]])
    yield estimated(TOPIC, RISE, label, rise, "s", f"{kind}; a difference")


def _apart(group: str, one: ConditionDelay, other: ConditionDelay) -> Result:
    """Count the fractions at which the confidence intervals of two conditions do not overlap."""
    pairs = [
        (first, second)
        for first, second in zip(one.as_set.means, other.as_set.means, strict=True)
        if np.isfinite([first.low, second.low]).all()
    ]
    apart = sum(first.high < second.low or second.high < first.low for first, second in pairs)
    value = float(apart) if pairs else nan
    note = f"intervals of {one.as_set.means[0].unit}s"
    return Result(TOPIC, APART, group, value, nan, nan, "1", "", len(pairs), "threshold", note)
