"""Delay between the sides in cooperative movements (the paper's figure 6), at fractions of a peak velocity.

The paper averages absolute delays, whose mean is positive even without a leader; the signed delay and its standard
deviation are reported as well. The paper's threshold is a fraction of the slower side's peak for both sides, which
makes the side that moves farther appear earlier. Delays at fractions of each side's own peak have no such bias and are
also reported.

The unit of a confidence interval is set: dyads, performers or single movements. The last treats movements of one
performer as independent. Contrasts between conditions always use dyads.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from netboard.analysis.extraction.details import THRESHOLDS
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.statistics.estimates import Estimate, Range
from netboard.analysis.topics.figure import (
    Drawn,
    Look,
    beside,
    draw_dyads,
    draw_mean,
    due_count,
    fit_beside,
    in_lines,
    listed,
    look_of,
    new_mosaic,
    pictured,
    titled,
)
from netboard.analysis.topics.groups import (
    Condition,
    comparisons,
    conditions,
    estimate,
    estimated,
    interval_text,
    of_dyads,
    with_base,
)
from netboard.analysis.topics.measures import rows_of
from netboard.analysis.topics.result import Result, TopicResults, plain
from netboard.base.looks import GREY, PALE, PRINT_FINE, PRINT_SMALL, RAMP

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TOPIC = "delay"

OVER_ALL = f"mean of {THRESHOLDS[0]} to {THRESHOLDS[-1]} %"
"""Name of the mean over the fractions."""

RISE = f"delay at {THRESHOLDS[-1]} % minus that at {THRESHOLDS[0]} %"
"""Name of the increase of delays with the threshold."""

APART = "thresholds at which the intervals do not overlap"
"""Name of the paper's criterion for a difference."""


@dataclass(frozen=True, slots=True)
class DelayCurves:
    """One kind of delay in a condition: of each unit, performer or dyad (rows), at each of `THRESHOLDS` [s]."""

    units: pd.DataFrame
    performers: pd.DataFrame
    dyads: pd.DataFrame
    means: tuple[Estimate, ...]
    within: Range


@dataclass(frozen=True, slots=True)
class ConditionDelay:
    """The delays of a condition: at fractions of the set peak or of each side's own, absolute or signed as set.

    `signed` is at fractions of the set peak, left minus right; `truncated` the share of delays with a truncated search
    for a crossing, for each of `THRESHOLDS`, NaN without delays [1].
    """

    condition: Condition
    as_set: DelayCurves
    own_peak: DelayCurves
    signed: DelayCurves
    deviations: DelayCurves
    movements: int
    truncated: tuple[float, ...]


def delay(study: StudyData) -> TopicResults[ConditionDelay]:
    """Return the delays of all conditions."""
    how = study.readings.summaries
    rows = rows_of(study, "movement")
    found = tuple(
        _of_condition(one, rows[rows["condition"] == one.name], how.delay, how.intervals) for one in conditions(study)
    )
    return TopicResults(found, tuple(_results(found, how.delay)))


def _of_condition(condition: Condition, rows: pd.DataFrame, kind: str, unit: str) -> ConditionDelay:
    signed = _columns(rows, "delay")
    own = _columns(rows, "own_delay")
    truncated = _columns(rows, "truncated").astype(np.float64)
    searched = truncated.where(signed.notna() | (truncated == 1.0))
    place = rows[["dyad", "performer"]]
    deviations = signed.groupby([place["dyad"], place["performer"]]).std().rename_axis(["dyad", "performer"])
    spread_of = "dyads" if unit == "movements" else unit
    return ConditionDelay(
        condition=condition,
        as_set=_as_set(place, signed, condition, kind, unit),
        own_peak=_as_set(place, own, condition, kind, unit),
        signed=_delays(place, signed, condition, unit, "real"),
        deviations=_of_units(deviations, deviations, condition, spread_of, "positive"),
        movements=len(rows),
        truncated=tuple(searched.mean(axis=0)),
    )


def _columns(rows: pd.DataFrame, prefix: str) -> pd.DataFrame:
    """Return the columns with this prefix, named by their fractions."""
    return rows[[f"{prefix}_{q}" for q in THRESHOLDS]].set_axis(list(THRESHOLDS), axis=1)


def _as_set(place: pd.DataFrame, signed: pd.DataFrame, condition: Condition, kind: str, unit: str) -> DelayCurves:
    """Return absolute or signed delays, as set."""
    if kind == "absolute":
        return _delays(place, signed.abs(), condition, unit, "positive")
    return _delays(place, signed, condition, unit, "real")


def _delays(place: pd.DataFrame, values: pd.DataFrame, condition: Condition, unit: str, within: Range) -> DelayCurves:
    performers = values.groupby([place["dyad"], place["performer"]]).mean()
    return _of_units(values, performers, condition, unit, within)


def _of_units(
    single: pd.DataFrame, performers: pd.DataFrame, condition: Condition, unit: str, within: Range
) -> DelayCurves:
    """Average over the set units."""
    dyads = of_dyads(performers)
    person = "participant" if condition.configuration == "bimanual" else "dyad"
    units, of = {
        "dyads": (dyads, "dyad"),
        "people": (performers, person),
        "movements": (single, "movement"),
    }[unit]
    return DelayCurves(units, performers, dyads, tuple(estimate(units[q], within, of) for q in THRESHOLDS), within)


def _results(found: tuple[ConditionDelay, ...], kind: str) -> Iterator[Result]:
    for one in found:
        yield from _of_one(one, kind)
    overall = {one.condition.name: one.as_set.dyads.mean(axis=1, skipna=False) for one in found}
    for team in dict.fromkeys(one.condition.team for one in found):
        own = [overall[one.condition.name] for one in found if one.condition.team == team]
        mean = estimate(pd.concat(own, axis=1).mean(axis=1, skipna=False), found[0].as_set.within)
        yield estimated(TOPIC, f"delay, {OVER_ALL}", team, mean, "s", f"{kind}; mean over its haptic conditions")
    every = tuple(one.condition for one in found)
    performers = {one.condition.name: one.as_set.performers.mean(axis=1, skipna=False) for one in found}
    for group, differences in comparisons(every, performers):
        yield estimated(TOPIC, f"delay, {OVER_ALL}", group, estimate(differences, "real"), "s", f"{kind}; a difference")
    by_name = {one.condition.name: one for one in found}
    for felt, base in with_base(every):
        yield _apart(f"{felt.label} vs off", by_name[felt.name], by_name[base.name])


def _of_one(found: ConditionDelay, kind: str) -> Iterator[Result]:
    label = found.condition.label
    kinds = (
        ("delay at {} %", found.as_set, kind),
        ("delay at {} % of own peaks", found.own_peak, kind),
        ("signed delay at {} %", found.signed, "left minus right"),
        ("SD of the signed delay at {} %", found.deviations, "of each performer's movements"),
    )
    for name, delays, note in kinds:
        for q, mean in zip(THRESHOLDS, delays.means, strict=True):
            yield estimated(TOPIC, name.format(q), label, mean, "s", note)
    for q, share in zip(THRESHOLDS, found.truncated, strict=True):
        name = f"share of searches cut off at {q} %"
        yield plain(TOPIC, name, label, share, "1", found.movements, "movement")
    dyads = found.as_set.dyads
    mean = estimate(dyads.mean(axis=1, skipna=False), found.as_set.within)
    yield estimated(TOPIC, f"delay, {OVER_ALL}", label, mean, "s", kind)
    rise = estimate(dyads[THRESHOLDS[-1]] - dyads[THRESHOLDS[0]], "real")
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
    return plain(TOPIC, APART, group, value, "1", len(pairs), "threshold", note)


_MS = 1000.0
_WIDTH = 0.6
_BESIDE = 0.09
_FEW = 4
"""Largest number of conditions with panels side by side."""

_GREYS = RAMP


@pictured("Delay between the sides")
def picture(study: StudyData) -> Drawn:
    """Draw the delays of all conditions.

    The panel of delays at each side's own peak has no bias from a common threshold.
    """
    kind = study.readings.summaries.delay
    shown = [one for one in delay(study).parts if any(np.isfinite(mean.value) for mean in one.as_set.means)]
    if not shown:
        return "No included trial has a cooperative movement, so there are no delays."
    names = [in_lines(one.condition) for one in shown]
    few = len(shown) <= _FEW and fit_beside(names, 0.5)
    layout = [["set", "set"], ["own", "signed"]] if few else [["set"], ["own"], ["signed"]]
    figure, axes = new_mosaic(5.0 if few else 7.2, layout, height_ratios=[1.25, 1] if few else None)
    panels: tuple[tuple[str, str, Callable[[ConditionDelay], DelayCurves]], ...] = (
        ("set", f"{kind} delay, {_threshold(study)}", lambda one: one.as_set),
        ("own", f"{kind} delay, each side's own peak", lambda one: one.own_peak),
        ("signed", "signed delay, left minus right", lambda one: one.signed),
    )
    for (name, title, delays), letter in zip(panels, "ABC", strict=True):
        titled(axes[name], letter, title)
        _panel(axes[name], shown, delays)
    _deviations(axes["signed"], shown)
    if few:
        _portions(axes["set"], len(shown))
    for name in () if few else ("set", "own"):
        axes[name].tick_params(axis="x", labelbottom=False)
    return figure, _caption(study, shown)


def _threshold(study: StudyData) -> str:
    of = "the slower side's peak" if study.readings.delays.threshold == "slower_side" else "each side's own peak"
    return f"threshold at a portion of {of}"


def _panel(axes: "Axes", shown: list[ConditionDelay], delays: Callable[[ConditionDelay], DelayCurves]) -> None:
    """Draw one kind of delay in each condition and at each fraction, darker for higher fractions."""
    for place, one in enumerate(shown):
        look, found = look_of(one.condition), delays(one)
        few = len(found.units) <= 40
        for offset, q, grey, mean in zip(beside(len(THRESHOLDS), _WIDTH), THRESHOLDS, _GREYS, found.means, strict=True):
            label = f"{one.condition.name}, {q} %"
            units = (found.units if few else found.dyads)[q]
            draw_dyads(axes, np.full(len(units), place + offset + _BESIDE), _MS * units, look.colour, f"{label}, units")
            face = "white" if look.face == "white" else grey
            draw_mean(axes, place + offset, mean, Look(grey, look.marker, face, look.line), label, scale=_MS)
    names = [in_lines(one.condition) for one in shown]
    if len(shown) <= _FEW and fit_beside(names):
        axes.set_xticks(range(len(shown)), names, fontsize=PRINT_SMALL)
    else:
        axes.set_xticks(range(len(shown)), [one.condition.label for one in shown], fontsize=PRINT_SMALL, rotation=90)
    axes.set_xlim(-0.5, len(shown) - 0.5)
    axes.set_ylabel("delay [ms]")
    if axes.get_ylim()[0] < 0.0:
        axes.axhline(0.0, color=GREY, linewidth=0.8, zorder=0)
    else:
        axes.set_ylim(bottom=0.0)


def _deviations(axes: "Axes", shown: list[ConditionDelay]) -> None:
    """Draw the standard deviation of the signed delays as pale bars."""
    axes.use_sticky_edges = False
    for place, one in enumerate(shown):
        for offset, q, mean, spread in zip(
            beside(len(THRESHOLDS), _WIDTH), THRESHOLDS, one.signed.means, one.deviations.means, strict=True
        ):
            if np.isfinite([mean.value, spread.value]).all():
                axes.bar(
                    place + offset,
                    2 * _MS * spread.value,
                    0.13,
                    _MS * (mean.value - spread.value),
                    color=PALE,
                    zorder=0,
                    label=f"_{one.condition.name}, {q} %, SD",
                )


def _portions(axes: "Axes", count: int) -> None:
    """Label the axis with the fractions."""
    ticks = [place + offset for place in range(count) for offset in beside(len(THRESHOLDS), _WIDTH)]
    names = [f"{q}" if k else f"{q} %" for _ in range(count) for k, q in enumerate(THRESHOLDS)]
    axes.set_xticks(ticks, names, minor=True, fontsize=PRINT_FINE)
    axes.tick_params(axis="x", which="minor", length=2, pad=1)
    axes.tick_params(axis="x", which="major", length=0, pad=11)


def _caption(study: StudyData, shown: list[ConditionDelay]) -> str:
    of = {"dyads": "dyads", "people": "participants alone and dyads together", "movements": "single movements"}
    unit = study.readings.summaries.intervals
    known = [(one.condition.label, one.as_set.means[0].n, one.as_set.means[0].unit) for one in shown]
    each = due_count(known, [one.movements for one in shown], "movement")
    warning = (
        " Movements of one performer are not independent, so these confidence intervals are too narrow."
        if unit == "movements"
        else ""
    )
    intervals = interval_text(mean for one in shown for own in (one.as_set, one.signed) for mean in own.means)
    few = of["dyads" if unit == "movements" else unit]
    return (
        "Delay between the two sides in cooperative movements, when they reach "
        f"{listed([str(q) for q in THRESHOLDS])} % of a peak velocity (darker: higher). Large points: means with "
        f"{intervals} over {of[unit]}; small points: {few}. B: without the bias of a common threshold for both sides. "
        f"C: pale bars are mean ± SD within performers.{warning} {each}"
    )
