"""The paper's figure 4: shares of the movement classes in each condition.

Bars show means over dyads; the other panels show dyads and means with 95 % t intervals. The numbers come from
`netboard.analysis.results.classes`.
"""

import numpy as np
from matplotlib.axes import Axes

from netboard.analysis.extraction.study import Study
from netboard.analysis.figures.figure import CLASSES, Picture
from netboard.analysis.figures.marks import (
    apart,
    draw_dyads,
    draw_mean,
    how_many,
    look_of,
    new_mosaic,
    styled,
    titled,
)
from netboard.analysis.results.classes import Shares, classes
from netboard.analysis.results.groups import CLASSES as ORDER
from netboard.analysis.results.units import PERCENT

TITLE = "Classes of movement"

STACK = ("cooperative", "single", "competitive", "still")
"""From the left; dark and light colours alternate, so that neighbours also differ in grey."""

_READABLE = 6.0
"""Smallest share with a number in its bar [%]."""

_FEW = 4
"""Largest number of conditions for the narrow layout of dots."""

_NAME = 13.0
"""Width reserved for a name below the bars [%]."""

_BESIDE = 0.25
"""Offset of a mean from its dyads, as a fraction of the distance between conditions [1]."""


@styled
def picture(study: Study) -> Picture:
    """Draw the shares of the movement classes."""
    found = [one for one in classes(study).shares if len(one.dyads)]
    if not found:
        return Picture("classes", TITLE, "No trial that counts has a movement, so there are no shares.", None)
    many_of = _crowded(found)
    dots = [[name for name in pair for _ in range(2)] for pair in (ORDER[:2], ORDER[2:])] if many_of else [list(ORDER)]
    below = 0.5 + 0.3 * len(found)
    height = [below, 1.6, 3.2] if many_of else [below, 2.2]
    figure, axes = new_mosaic(sum(height) + 0.4, [["bars"] * len(ORDER), *dots], height_ratios=height)
    _bars(axes["bars"], found)
    titled(axes["bars"], "A", "mean shares")
    for name, letter in zip(ORDER, "BCDE", strict=True):
        _dots(axes[name], found, name)
        titled(axes[name], letter, name)
        if name == ORDER[0] or (many_of and name == ORDER[2]):
            axes[name].set_ylabel("share of the time [%]")
        if many_of and name in ORDER[:2]:
            axes[name].tick_params(axis="x", labelbottom=False)
    return Picture("classes", TITLE, _caption(study, found), figure)


def _crowded(found: list[Shares]) -> bool:
    """Return whether the team names do not fit: many conditions, or levels in the names."""
    return len(found) > _FEW or any(one.condition.among for one in found)


def _bars(axes: Axes, found: list[Shares]) -> None:
    """Draw a bar of all shares for each condition."""
    for row, one in enumerate(found):
        begin = 0.0
        for name in STACK:
            share = PERCENT.scale * one.means[ORDER.index(name)].value
            label = f"_{one.condition.name}: {name}"
            axes.barh(row, share, 0.72, begin, color=CLASSES[name], edgecolor="white", linewidth=0.6, label=label)
            if share >= _READABLE:
                axes.text(begin + share / 2, row, f"{share:.0f}", ha="center", va="center", fontsize=7.5)
            begin += share
    shares = PERCENT.scale * np.array([found[-1].means[ORDER.index(name)].value for name in STACK])
    for name, middle in zip(STACK, apart(list(np.cumsum(shares) - shares / 2), _NAME), strict=True):
        axes.text(middle, len(found) - 0.55, name, ha="center", va="top", fontsize=7.5)
    axes.set_yticks(range(len(found)), [one.condition.label for one in found])
    axes.set_ylim(len(found) + 0.05, -0.5)
    axes.set_xlim(0.0, PERCENT.scale)
    axes.set_xlabel("share of the time [%]")
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0)


def _dots(axes: Axes, found: list[Shares], name: str) -> None:
    """Draw the share of one class in each condition: each dyad, and the mean."""
    at = _places(found)
    for team in dict.fromkeys(one.condition.team for one in found):
        own = [one for one in found if one.condition.team == team]
        for dyad in sorted({dyad for one in own for dyad in one.dyads.index}):
            here = [one for one in own if dyad in one.dyads.index]
            x = [at[one.condition.name] for one in here]
            y = [PERCENT.scale * one.dyads.loc[dyad, name] for one in here]
            draw_dyads(axes, x, y, look_of(own[0].condition).colour, f"{dyad} {team}", joined=True)
    first = {one.condition.team: one for one in reversed(found)}
    for one in found:
        mean, aside = one.means[ORDER.index(name)], -_BESIDE if first[one.condition.team] is one else _BESIDE
        look, place = look_of(one.condition), at[one.condition.name] + aside
        draw_mean(axes, place, mean, look, one.condition.name, scale=PERCENT.scale)
    _named(axes, found, at)
    axes.set_xlim(-0.7, max(at.values()) + 0.7)
    axes.set_ylim(bottom=-0.04 * axes.get_ylim()[1])


def _named(axes: Axes, found: list[Shares], at: dict[str, float]) -> None:
    """Label the axis with haptic conditions, and the teams below them."""
    if _crowded(found):
        axes.set_xticks(list(at.values()), [one.condition.label for one in found], fontsize=7, rotation=90)
        return
    short = [one.condition.feeling.removeprefix("haptics ") for one in found]
    axes.set_xticks(list(at.values()), short, fontsize=7)
    teams = dict.fromkeys(one.condition.team for one in found)
    middles = [
        float(np.mean([at[one.condition.name] for one in found if one.condition.team == team])) for team in teams
    ]
    axes.set_xticks(middles, [team.replace(", ", "\n") for team in teams], minor=True, fontsize=7)
    axes.tick_params(axis="x", which="minor", length=0, pad=16)


def _places(found: list[Shares]) -> dict[str, float]:
    """Return positions of conditions, with larger gaps between teams."""
    at, place = {}, 0.0
    for before, one in zip([found[0], *found], found, strict=False):
        place += (0.0 if before is one else 1.0) + 0.5 * (before.condition.team != one.condition.team)
        at[one.condition.name] = place
    return at


def _caption(study: Study, found: list[Shares]) -> str:
    window = "from the release to the completion"
    if study.readings.movements.window == "whole":
        window = "from the release to the end of the hold"
    weight = "every trial" if study.readings.summaries.shares == "trials" else "every second"
    known = [(one.condition.label, len(one.dyads), "dyad") for one in found]
    return (
        f"Shares of the time {window} in which the sides move in opposite directions (cooperative), in the same one "
        f"(competitive), one moves (single) or none (still); {weight} of a performer counts the same. A: means over "
        "dyads. B to E: dyads (small points, joined), and means over dyads with 95 % t intervals (large). "
        f"{how_many(known)}"
    )
