"""Dyads compared with their partners alone (the paper's figure 3): completion time and number of velocity peaks.

A participant's level is that of the bimanual trials with the same haptic condition as the dyadic trials. The gain is
the mean of the two participants minus the dyad. If all dyadic blocks follow bimanual ones, the gain includes practice;
the contrast between two haptic conditions does not.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from netboard.analysis.extraction.study import StudyData
from netboard.analysis.measures.performance import (
    RelativePerformance,
    better_dyads,
    level,
    relative_performance,
)
from netboard.analysis.statistics.estimates import Estimate
from netboard.analysis.statistics.exact_tests import Test, sign_test
from netboard.analysis.topics.figure import (
    NO_EFFECT,
    Drawn,
    Look,
    draw_dyads,
    draw_mean,
    due_count,
    look_of,
    new_mosaic,
    pictured,
    titled,
)
from netboard.analysis.topics.groups import (
    QUANTITIES,
    Condition,
    PerformanceQuantity,
    conditions,
    counted,
    estimate,
    estimated,
    interval_text,
)
from netboard.analysis.topics.result import Result, TopicResults, plain
from netboard.base.looks import BLACK, FAINT, GREEN, ORANGE, PINK, PRINT_SMALL, SKY, YELLOW
from netboard.base.plural import plural
from netboard.base.tables.forces import FORCES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TOPIC = "dyads"


@dataclass(frozen=True, slots=True)
class ParticipantPoint:
    """A participant relative to the partner and the dyad."""

    dyad: str
    participant: str
    relative: RelativePerformance


@dataclass(frozen=True, slots=True)
class DyadComparison:
    """All dyads in one haptic condition and one quantity; the mean gain is participants' mean minus dyad.

    Each dyad with dyadic trials and bimanual trials of both participants has two points, and one of the `gains`.
    """

    quantity: PerformanceQuantity
    condition: Condition
    points: tuple[ParticipantPoint, ...]
    gains: pd.Series
    gain: Estimate
    better: int
    known: int
    test: Test


def dyads(study: StudyData) -> TopicResults[DyadComparison]:
    """Compare dyads with their participants, for each quantity and each haptic condition of the dyads."""
    trials, every = counted(study), conditions(study)
    alone = {(one.force, one.other_levels): one.name for one in every if one.configuration == "bimanual"}
    found = []
    for quantity in QUANTITIES:
        levels = {
            name: rows.groupby(["dyad", "performer"], sort=True)[quantity.column].apply(
                lambda values: level(values.to_numpy(np.float64), of=study.readings.summaries.level)
            )
            for name, rows in trials.groupby("condition")
        }
        for one in every:
            if one.configuration == "dyadic" and not one.partner:
                points = _points(levels, one.name, alone.get((one.force, one.other_levels), ""))
                found.append(_compare(quantity, one, points))
    return TopicResults.of(found, _results)


def _points(levels: Mapping[str, pd.Series], together: str, alone: str) -> Iterator[ParticipantPoint]:
    """Yield the points of dyads with all three levels."""
    if together not in levels or alone not in levels:
        return
    for (dyad, _), both in levels[together].items():
        own = levels[alone][levels[alone].index.get_level_values("dyad") == dyad].droplevel("dyad")
        if len(own) == 2 and np.isfinite([both, *own]).all():
            (first, of_first), (second, of_second) = own.items()
            yield ParticipantPoint(dyad, first, relative_performance(of_first, of_second, both))
            yield ParticipantPoint(dyad, second, relative_performance(of_second, of_first, both))


def _compare(quantity: PerformanceQuantity, condition: Condition, points: Iterator[ParticipantPoint]) -> DyadComparison:
    kept = tuple(points)
    gains = pd.Series({point.dyad: point.relative.gain for point in kept}, dtype=np.float64)
    # A dyad has two consecutive points, with the same gain.
    better, known = better_dyads([point.relative for point in kept[::2]])
    return DyadComparison(
        quantity, condition, kept, gains, estimate(gains, "real"), better, known, sign_test(gains.to_numpy())
    )


def _results(found: DyadComparison) -> Iterator[Result]:
    quantity, group = found.quantity, found.condition.haptics_label
    note = "" if found.known else "no dyad has trials that count in both configurations in this haptic condition"
    yield estimated(TOPIC, f"{quantity.name}: mean of the two minus dyad", group, found.gain, quantity.unit, note)
    if found.known:
        tested = f"p = {found.test.p:.3g}; {plural(found.test.n, 'dyad')} can give no p below {found.test.least_p:.3g}"
        note = f"sign test: {tested if found.test.n else 'no gain differs from zero'}"
    value = float(found.better) if found.known else nan
    name = f"{quantity.name}: dyads better than the mean of the two"
    yield plain(TOPIC, name, group, value, "1", found.known, "dyad", note)


_FORCES = dict(zip(FORCES[2:], (SKY, GREEN, PINK, ORANGE, YELLOW), strict=False))
"""Colours of the force conditions that are neither off nor on."""


@pictured("Dyads and their partners alone")
def picture(study: StudyData) -> Drawn:
    """Draw the performance of dyads relative to their participants alone.

    A plane has one point for each participant; beside it are the gains of the dyads.
    """
    found = [one for one in dyads(study).parts if one.known]
    if not found:
        return (
            "No dyad can be compared with its participants: the comparison needs counted trials in the same haptic "
            "condition, of the dyad and of each of its two participants alone."
        )
    columns = [quantity.column for quantity in QUANTITIES]
    rows = [columns, [f"gain {column}" for column in columns]]
    forces = len({one.condition.force for one in found})
    figure, axes = new_mosaic(3.65 + 0.36 * forces, rows, height_ratios=[3.05, 0.3 + 0.36 * forces])
    for quantity, letter, below in zip(QUANTITIES, "AB", "CD", strict=True):
        own = [one for one in found if one.quantity == quantity]
        _plane(axes[quantity.column], own)
        titled(axes[quantity.column], letter, quantity.name)
        _gains(axes[f"gain {quantity.column}"], own)
        titled(axes[f"gain {quantity.column}"], below, "gain of the dyad")
    return figure, _caption(found)


def _look(one: DyadComparison) -> Look:
    """Return the style: black with and without haptics; colours for parts of the force."""
    return look_of(one.condition, _FORCES.get(one.condition.force, BLACK))


def _plane(axes: "Axes", found: list[DyadComparison]) -> None:
    """Draw all participants, joined within a dyad, and the diagonal."""
    unit = found[0].quantity.unit if found else "1"
    every = [
        value
        for one in found
        for point in one.points
        for value in (point.relative.against_partner, point.relative.of_dyad)
    ]
    reach = 1.15 * max([1e-3, *map(abs, every)])
    axes.fill_between([-reach, reach], [-reach, reach], -reach, color=FAINT, zorder=0, linewidth=0.0)
    axes.plot([-reach, reach], [-reach, reach], **NO_EFFECT, label="_diagonal")
    axes.text(
        0.97 * reach, -0.97 * reach, "dyad better\nthan the mean of both", ha="right", va="bottom", fontsize=PRINT_SMALL
    )
    for one in found:
        look = _look(one)
        for first, second in zip(one.points[::2], one.points[1::2], strict=True):
            pair = (first.relative, second.relative)
            x, y = [point.against_partner for point in pair], [point.of_dyad for point in pair]
            axes.plot(
                x,
                y,
                color=look.colour,
                linewidth=0.7,
                linestyle=look.line,
                zorder=2,
                label=f"_{first.dyad} {one.condition.force}",
            )
        axes.plot(
            [point.relative.against_partner for point in one.points],
            [point.relative.of_dyad for point in one.points],
            linestyle="none",
            marker=look.marker,
            markersize=5,
            color=look.colour,
            markerfacecolor=look.face,
            zorder=3,
            label=f"_{one.condition.force}",
        )
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    axes.set_aspect("equal")
    axes.set_xlabel(f"(partner - self) / 2 [{unit}]")
    axes.set_ylabel(f"dyad - self [{unit}]")


def _gains(axes: "Axes", found: list[DyadComparison]) -> None:
    """Draw the gain of each dyad and their mean, a row for each haptic condition."""
    axes.axvline(0.0, **NO_EFFECT)
    for row, one in enumerate(found):
        look, gains = _look(one), one.gains
        draw_dyads(axes, gains, np.full(len(gains), row + 0.27), look.colour, one.condition.force)
        draw_mean(axes, row, one.gain, look, one.condition.force, across=True)
    names = [f"{one.condition.haptics_label}:\n{one.better} of {one.known} dyads better" for one in found]
    axes.set_yticks(range(len(found)), names)
    axes.set_ylim(max(len(found), 1) - 0.5, -0.5)
    axes.set_xlabel(f"mean of the two alone minus dyad [{found[0].quantity.unit if found else '1'}]")


def _caption(found: list[DyadComparison]) -> str:
    known = [(f"{one.condition.haptics_label}, {one.quantity.name}", one.known, "dyad") for one in found]
    least = [one.test.least_p for one in found if np.isfinite(one.test.least_p)]
    power = ""
    if least:
        power = (
            f" Exploratory, without correction: {plural(len(least), 'sign test')} of these gains, whose smallest "
            f"possible p is {min(least):.3g} with this number of dyads."
        )
    intervals = interval_text(one.gain for one in found)
    return (
        "A, B: one point for each participant, with the two of a dyad joined. To the right: the participant alone is "
        "better than the partner alone, in the same haptic condition. Upwards: the dyad takes longer than the "
        "participant alone. "
        f"C, D: gains of the dyads (small points); large points: their means with {intervals}. "
        f"{due_count(known)}{power}"
    )
