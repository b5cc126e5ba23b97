"""Movement classes (the paper's figure 4): shares of time with cooperative, competitive, single or no movement.

Shares are computed for each trial, averaged for each performer and then for each dyad. A setting decides whether every
trial or every second has equal weight within a performer.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.extraction.study import StudyData
from netboard.analysis.measures.movements import Average, mean_shares
from netboard.analysis.statistics.estimates import Estimate
from netboard.analysis.topics.figure import (
    CLASS_COLOURS,
    STACK,
    Drawn,
    apart,
    draw_joined,
    draw_mean,
    due_count,
    look_of,
    new_mosaic,
    pictured,
    titled,
)
from netboard.analysis.topics.groups import (
    CLASSES,
    Condition,
    comparisons,
    conditions,
    counted,
    estimate,
    estimated,
    interval_text,
    of_dyads,
)
from netboard.analysis.topics.measures import places
from netboard.analysis.topics.result import Result, TopicResults
from netboard.analysis.topics.units import PERCENT
from netboard.base.looks import PRINT_SMALL

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TOPIC = "classes"


@dataclass(frozen=True, slots=True)
class Shares:
    """Shares of the classes (columns) in a condition: of each dyad and performer, or of each dyad (rows) [1]."""

    condition: Condition
    performers: pd.DataFrame
    dyads: pd.DataFrame
    means: tuple[Estimate, ...]


def classes(study: StudyData) -> TopicResults[Shares]:
    """Return the shares of the movement classes in all conditions."""
    trials = counted(study)
    found = tuple(
        _shares(one, trials[trials["condition"] == one.name], study.readings.summaries.shares)
        for one in conditions(study)
    )
    return TopicResults(found, tuple(_results(found)))


def _shares(condition: Condition, rows: pd.DataFrame, of: Average) -> Shares:
    each = {
        key: mean_shares(own[list(CLASSES)].to_numpy(np.float64), of=of)
        for key, own in rows.groupby(["dyad", "performer"])
    }
    performers = _table(each)
    dyads = of_dyads(performers)
    return Shares(condition, performers, dyads, tuple(estimate(dyads[name], "share") for name in CLASSES))


def _table(each: dict[tuple[str, str], NDArray[np.float64]]) -> pd.DataFrame:
    """Return shares as a table; performers without shares are left out."""
    known = {key: values for key, values in each.items() if np.isfinite(values).all()}
    index = pd.MultiIndex.from_tuples(list(known), names=["dyad", "performer"]) if known else _NOBODY
    return pd.DataFrame(np.array(list(known.values())).reshape(-1, len(CLASSES)), index, columns=list(CLASSES))


_NOBODY = pd.MultiIndex.from_arrays([[], []], names=["dyad", "performer"])


def _results(found: tuple[Shares, ...]) -> Iterator[Result]:
    for one in found:
        for name, mean in zip(CLASSES, one.means, strict=True):
            yield estimated(TOPIC, f"share of {_words(name)}", one.condition.label, mean, "1")
    every = tuple(one.condition for one in found)
    for name in CLASSES:
        values = {one.condition.name: one.performers[name] for one in found}
        for group, differences in comparisons(every, values):
            yield estimated(
                TOPIC, f"share of {_words(name)}", group, estimate(differences, "balance"), "1", "a difference"
            )


def _words(name: str) -> str:
    return "stillness" if name == "still" else f"{name} movement"


_READABLE = 6.0
"""Smallest share with a number in its bar [%]."""

_FEW = 4
"""Largest number of conditions for the narrow layout of dots."""

_NAME = 13.0
"""Width reserved for a name below the bars [%]."""

_BESIDE = 0.25
"""Offset of a mean from its dyads, as a fraction of the distance between conditions [1]."""


@pictured("Classes of movement")
def picture(study: StudyData) -> Drawn:
    """Draw the shares of the movement classes.

    Bars show means over dyads; the other panels show dyads and means with confidence intervals.
    """
    found = [one for one in classes(study).parts if len(one.dyads)]
    if not found:
        return "No included trial has a movement, so there are no shares."
    crowded = _crowded(found)
    dots = (
        [[name for name in pair for _ in range(2)] for pair in (CLASSES[:2], CLASSES[2:])]
        if crowded
        else [list(CLASSES)]
    )
    below = 0.5 + 0.3 * len(found)
    height = [below, 1.6, 3.2] if crowded else [below, 2.2]
    figure, axes = new_mosaic(sum(height) + 0.4, [["bars"] * len(CLASSES), *dots], height_ratios=height)
    _bars(axes["bars"], found)
    titled(axes["bars"], "A", "mean shares")
    for name, letter in zip(CLASSES, "BCDE", strict=True):
        _dots(axes[name], found, name)
        titled(axes[name], letter, name)
        if name == CLASSES[0] or (crowded and name == CLASSES[2]):
            axes[name].set_ylabel("share of the time [%]")
        if crowded and name in CLASSES[:2]:
            axes[name].tick_params(axis="x", labelbottom=False)
    return figure, _caption(study, found)


def _crowded(found: list[Shares]) -> bool:
    """Return whether the team names do not fit: many conditions, or levels in the names."""
    return len(found) > _FEW or any(one.condition.other_levels for one in found)


def _bars(axes: "Axes", found: list[Shares]) -> None:
    """Draw a bar of all shares for each condition."""
    for row, one in enumerate(found):
        begin = 0.0
        for name in STACK:
            share = PERCENT.scale * one.means[CLASSES.index(name)].value
            label = f"_{one.condition.name}: {name}"
            axes.barh(row, share, 0.72, begin, color=CLASS_COLOURS[name], edgecolor="white", linewidth=0.6, label=label)
            if share >= _READABLE:
                axes.text(begin + share / 2, row, f"{share:.0f}", ha="center", va="center", fontsize=PRINT_SMALL)
            begin += share
    shares = PERCENT.scale * np.array([found[-1].means[CLASSES.index(name)].value for name in STACK])
    for name, middle in zip(STACK, apart(list(np.cumsum(shares) - shares / 2), _NAME), strict=True):
        axes.text(middle, len(found) - 0.55, name, ha="center", va="top", fontsize=PRINT_SMALL)
    axes.set_yticks(range(len(found)), [one.condition.label for one in found])
    axes.set_ylim(len(found) + 0.05, -0.5)
    axes.set_xlim(0.0, PERCENT.scale)
    axes.set_xlabel("share of the time [%]")
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0)


def _dots(axes: "Axes", found: list[Shares], name: str) -> None:
    """Draw the share of one class in each condition: each dyad, and the mean."""
    at = places([one.condition for one in found])
    draw_joined(axes, [(one.condition, one.dyads[name].to_dict()) for one in found], at, PERCENT.scale)
    first = {one.condition.team: one for one in reversed(found)}
    for one in found:
        mean, aside = one.means[CLASSES.index(name)], -_BESIDE if first[one.condition.team] is one else _BESIDE
        look, place = look_of(one.condition), at[one.condition.name] + aside
        draw_mean(axes, place, mean, look, one.condition.name, scale=PERCENT.scale)
    _named(axes, found, at)
    axes.set_xlim(-0.7, max(at.values()) + 0.7)
    axes.set_ylim(bottom=-0.04 * axes.get_ylim()[1])


def _named(axes: "Axes", found: list[Shares], at: dict[str, float]) -> None:
    """Label the axis with haptic conditions, and the teams below them."""
    if _crowded(found):
        axes.set_xticks(list(at.values()), [one.condition.label for one in found], fontsize=PRINT_SMALL, rotation=90)
        return
    short = [one.condition.haptics.removeprefix("haptics ") for one in found]
    axes.set_xticks(list(at.values()), short, fontsize=PRINT_SMALL)
    teams = dict.fromkeys(one.condition.team for one in found)
    middles = [
        float(np.mean([at[one.condition.name] for one in found if one.condition.team == team])) for team in teams
    ]
    axes.set_xticks(middles, [team.replace(", ", "\n") for team in teams], minor=True, fontsize=PRINT_SMALL)
    axes.tick_params(axis="x", which="minor", length=0, pad=16)


def _caption(study: StudyData, found: list[Shares]) -> str:
    window = "from the release to the completion"
    if study.readings.movements.window == "whole":
        window = "from the release to the end of the hold"
    weight = "Every trial" if study.readings.summaries.shares == "trials" else "Every second"
    known = [(one.condition.label, len(one.dyads), "dyad") for one in found]
    return (
        f"Shares of the time {window}. Cooperative: the sides move in opposite directions; competitive: in the same "
        f"direction; single: one side moves; still: none moves. {weight} of a performer has equal weight. A: means "
        "over dyads. B to E: dyads (small points, joined); large points: means over dyads with "
        f"{interval_text(mean for one in found for mean in one.means)}. "
        f"{due_count(known)}"
    )
