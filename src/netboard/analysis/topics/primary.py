"""The primary outcome: the declared effects by the method that counts, by all others, and the figure of the outcome.

Without a declaration the figure shows completion times by condition, and there are no results: nothing was chosen
before the data were seen.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from netboard.analysis.extraction.study import StudyData
from netboard.analysis.topics.crossing import Crossing, Levels
from netboard.analysis.topics.declared import (
    METHODS,
    MODELS,
    ByMethod,
    DeclaredAnalysis,
    DeclaredEffect,
    NoAnalysis,
    Outcome,
    assumption,
    declared_analysis,
)
from netboard.analysis.topics.figure import (
    MORE,
    NO_EFFECT,
    Drawn,
    Look,
    TopicFigure,
    draw_dyads,
    draw_mean,
    new_mosaic,
    pictured,
    titled,
)
from netboard.analysis.topics.groups import estimated, interval_text
from netboard.analysis.topics.measures import MEASURES, draw_levels, legend, levels_of, places
from netboard.analysis.topics.result import Result, cached, cautioned, plain
from netboard.analysis.topics.units import read_in
from netboard.base.looks import BLACK, PRINT_SMALL
from netboard.base.plural import plural
from netboard.base.tables.outcomes import Method

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TOPIC = "primary"


@dataclass(frozen=True, slots=True)
class Primary:
    """The declared analysis, with all numbers to report."""

    analysis: DeclaredAnalysis | NoAnalysis
    results: tuple[Result, ...]


@cached
def primary(study: StudyData) -> Primary:
    """Return the declared analysis of a study, with its results; none without a declaration."""
    found = declared_analysis(study)
    if isinstance(found, NoAnalysis):
        return Primary(found, ())
    return Primary(found, tuple(row for one in (found.primary, *found.secondary) for row in _results(one, found)))


def method_name(measure: str, method: Method) -> str:
    """Return the name of a method; of a model with its kind."""
    return f"{METHODS[method]} ({MODELS[measure][2]})" if method == "model" else METHODS[method]


def mean_result(outcome: Outcome, crossing: Crossing, levels: Levels) -> Result:
    """Return the mean of an outcome in a combination of levels as a result."""
    note = "geometric mean of dyads" if outcome.measure.ratio else "mean of dyads"
    label, unit = crossing.label(levels), outcome.measure.unit
    return estimated(TOPIC, outcome.measure.name, label, outcome.means[levels], unit, note)


def effect_result(outcome: Outcome, effect: DeclaredEffect, by: ByMethod, note: str = "") -> Result:
    """Return an effect by a method as a result."""
    name = f"{outcome.measure.name}: {by.scale}, {METHODS[by.method]}"
    unit = outcome.measure.unit if by.scale == "difference" else "1"
    return estimated(TOPIC, name, effect.name, by.estimate, unit, note)


def size_result(outcome: Outcome, effect: DeclaredEffect) -> Result:
    """Return the effect size of an effect as a result."""
    name = "g_z" if len(effect.scores) == 1 else "g"
    return estimated(TOPIC, f"{outcome.measure.name}: {name}", effect.name, effect.size, "1")


def _results(outcome: Outcome, found: DeclaredAnalysis) -> Iterator[Result]:
    """Yield the means of an outcome, its effects by the method that counts and by the others, and their sizes."""
    for levels in outcome.means:
        yield mean_result(outcome, found.crossing, levels)
    on = "primary outcome" if outcome is found.primary else "secondary outcome"
    for effect in outcome.effects:
        role = "primary contrast" if effect is found.contrast else f"secondary test, {on}"
        for by in (effect.counts, *effect.others):
            counts = f"{role}, declared method" if by is effect.counts else f"{role}, sensitivity analysis"
            note = "; ".join(filter(None, (counts, method_name(outcome.measure.name, by.method), by.tested.note)))
            yield effect_result(outcome, effect, by, note)
            p = cautioned(f"{outcome.measure.name}: p, {METHODS[by.method]}", by.tested.caution)
            shape = "; ".join(filter(None, (note, assumption(outcome.measure.name, by.method))))
            yield plain(TOPIC, p, effect.name, by.tested.p, "1", by.estimate.n, "dyad", shape)
        yield size_result(outcome, effect)
        if effect is not found.contrast:
            p = cautioned(f"{outcome.measure.name}: p, adjusted", effect.counts.tested.caution)
            note = (
                f"the larger of the primary p and of Holm's p over all {len(found.secondary_effects)} secondary tests"
            )
            yield plain(TOPIC, p, effect.name, effect.adjusted, "1", effect.counts.estimate.n, "dyad", note)


# --- figure ----------------------------------------------------------------------------------------------------------

EXPLORED = "completion time"
"""Measure of the figure of a study without a declared outcome."""


def picture(study: StudyData) -> TopicFigure:
    """Draw the primary outcome by condition, or completion times if none is declared."""
    return _exploratory(study) if isinstance(primary(study).analysis, NoAnalysis) else _declared(study)


@pictured("Completion time by condition")
def _exploratory(study: StudyData) -> Drawn:
    """Draw completion times by condition."""
    (measure,) = [one for one in MEASURES if one.name == EXPLORED]
    found = levels_of(study, [measure])
    if not found:
        return "No trial is included, so there are no completion times."
    shown, means = [one.condition for one in found], [one.mean for one in found]
    figure, axes = new_mosaic(2.8, [["levels"]])
    draw_levels(axes["levels"], found, places(shown), 1.0)
    axes["levels"].set_ylabel(f"{measure.name} [{measure.unit}]")
    axes["levels"].set_xticks([])
    legend(figure, shown)
    return figure, (
        f"Completion time in each condition. Large points: geometric means over dyads with {interval_text(means)}; "
        "small points: dyads, joined where they did several conditions. No primary outcome is declared, so this is a "
        "choice of the software."
    )


@pictured("Primary outcome", whole=True)
def _declared(study: StudyData) -> Drawn:
    """Draw the primary outcome: each dyad and the mean in each combination of levels, and the effects."""
    found = primary(study).analysis
    if isinstance(found, NoAnalysis):
        return f"There is no primary outcome: {found.why}."
    outcome, crossing = found.primary, found.crossing
    figure, axes = new_mosaic(3.0, [["levels", "effects"]], width_ratios=[1.3, 1.0])
    _levels(axes["levels"], outcome, crossing)
    titled(axes["levels"], "A", f"{outcome.measure.name} by condition")
    _effects(axes["effects"], outcome)
    titled(axes["effects"], "B", "declared effects")
    return figure, _caption(outcome, found)


def _levels(axes: "Axes", outcome: Outcome, crossing: Crossing) -> None:
    """Draw the dyads and means: levels of the first factor side by side, a colour for each level of the second."""
    unit = read_in(outcome.measure.unit, outcome.measure.name)
    first, *others = crossing.factors
    own = [level for level in first.of.of.levels if level in first.levels]
    series: dict[Levels, list[Levels]] = {}
    for levels in sorted(outcome.means, key=lambda levels: own.index(levels[0])):
        series.setdefault(levels[1:], []).append(levels)
    for place, (level, cells) in enumerate(series.items()):
        look = Look(MORE[place % len(MORE)], "os"[place % 2], MORE[place % len(MORE)], "-")
        at = {cell: k + 0.34 * (place - (len(series) - 1) / 2) for k, cell in enumerate(cells)}
        values = {at[cell] + 0.1: dyad_values(outcome, cell) * unit.scale for cell in cells}
        _dyads(axes, values, look, joined=not first.between)
        for cell in cells:
            draw_mean(axes, at[cell], outcome.means[cell], look, crossing.label(cell), scale=unit.scale)
        if others:
            label = f"{others[0].of.name} {level[0]}"
            axes.plot([], [], linestyle="none", marker=look.marker, color=look.colour, label=label)
    axes.set_xticks(range(len(own)), [f"{first.of.name} {level}" for level in own])
    axes.set_xlim(-0.6, len(own) - 0.4)
    axes.set_ylabel(f"{outcome.measure.name} {unit.in_brackets}")
    if others:
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2)


def dyad_values(outcome: Outcome, cell: Levels) -> pd.Series:
    """Return the values of the dyads in a combination of levels, by dyad [unit of the measure]."""
    return np.exp(outcome.values[cell]) if outcome.measure.ratio else outcome.values[cell]


def _dyads(axes: "Axes", at: Mapping[float, pd.Series], look: Look, *, joined: bool) -> None:
    """Draw the values of each dyad, joined between levels that the same dyad has."""
    for dyad in sorted(set().union(*(values.index for values in at.values()))):
        points = [(x, values[dyad]) for x, values in at.items() if dyad in values.index]
        x, y = zip(*points, strict=True)
        draw_dyads(axes, x, y, look.colour, f"{dyad}", joined=joined)


def _effects(axes: "Axes", outcome: Outcome) -> None:
    """Draw the effects with their confidence intervals, and the dyads' own where all dyads are one group."""
    by = outcome.effects[0].counts
    ratio = by.scale != "difference"
    unit = read_in("1" if ratio else outcome.measure.unit, f"{outcome.measure.name}: {by.scale}", "a vs b")
    axes.axvline(1.0 if ratio else 0.0, **NO_EFFECT)
    look = Look(BLACK, "o", BLACK, "-")
    for row, effect in enumerate(outcome.effects):
        draw_mean(axes, row, effect.counts.estimate, look, effect.name, scale=unit.scale, across=True)
        if len(effect.scores) == 1 and effect.counts.method != "model":
            scores = effect.scores[0].to_numpy() * unit.scale
            scores = np.exp(scores) if ratio else scores
            draw_dyads(axes, scores, np.full(len(scores), row + 0.2), BLACK, f"{effect.name}, dyads")
    breaks = {1: (": ", ":\n"), 2: (" x ", "\nx ")}
    names = [effect.name.replace(*breaks[len(effect.factors)]) for effect in outcome.effects]
    axes.set_yticks(range(len(names)), names, fontsize=PRINT_SMALL)
    axes.set_ylim(len(names) - 0.5, -0.5)
    if ratio:
        axes.set_xscale("log")
        _plain_ticks(axes)
    axes.set_xlabel(f"{by.scale} {unit.in_brackets}")


def _plain_ticks(axes: "Axes") -> None:
    """Label a logarithmic axis of ratios with plain numbers."""
    from matplotlib.ticker import MaxNLocator, NullLocator

    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")


def _caption(outcome: Outcome, found: DeclaredAnalysis) -> str:
    """Return the caption of the declared figure."""
    mean = "geometric means" if outcome.measure.ratio else "means"
    n = max(one.n for one in outcome.means.values())
    level = f"{100 * found.declaration.level:g} %"
    own = outcome.effects[0].counts
    dyads = "" if own.method == "model" or len(outcome.effects[0].scores) > 1 else "; small points: dyads"
    method = method_name(outcome.measure.name, own.method)
    return (
        f"A: {outcome.measure.name} in each compared condition. Large points: {mean} over dyads with {level} "
        f"confidence intervals; small points: dyads, joined between levels that a dyad did. B: the declared effects, "
        f"first level against second, by the declared method ({method}) with {level} confidence intervals{dyads}; the "
        f"line marks no effect. n = {plural(n, 'dyad')}."
    )
