"""Every measure in every condition: each dyad, and the mean over dyads with its 95 % t interval.

The numbers come from `netboard.analysis.results.measures`. Other figures with many small panels use `grid`, `places`
and `legend` from here.
"""

from collections.abc import Sequence
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from netboard.analysis.extraction.study import Study
from netboard.analysis.figures.figure import Picture
from netboard.analysis.figures.marks import draw_dyads, draw_mean, how_many, look_of, new_mosaic, styled
from netboard.analysis.results.groups import Condition
from netboard.analysis.results.measures import MEASURES, Levels, overview
from netboard.analysis.results.units import read_in

Where = Literal["outside upper center", "outside lower center"]

TITLE = "All measures"

COLUMNS = 4
"""Panels in a row [1]."""

TEAM_GAP = 0.5
"""Extra distance between the conditions of two teams [1]."""


BESIDE = 0.22
"""Distance from a mean to its dyads [1]."""


_WIDE = 100
"""Characters of labels in a row of a legend [1]."""


@styled
def picture(study: Study) -> Picture:
    """Draw all measures."""
    found = overview(study).levels
    if not found:
        return Picture("measures", TITLE, "No trial counts, so there is nothing to measure.", None)
    names = [measure.name for measure in MEASURES if any(one.measure.name == measure.name for one in found)]
    shown = tuple(dict.fromkeys(one.condition for one in found))
    figure, axes = grid(names, 1.35)
    for name in names:
        _panel(axes[name], [one for one in found if one.measure.name == name], places(shown))
    legend(figure, shown)
    return Picture("measures", TITLE, _caption(found, shown), figure)


def grid(names: Sequence[str], height: float, columns: int = COLUMNS) -> tuple[Figure, dict[str, Axes]]:
    """Return a new figure with many small panels."""
    rows = [list(names[k : k + columns]) for k in range(0, len(names), columns)]
    rows[-1] += ["."] * (columns - len(rows[-1])) if len(rows) > 1 else []
    return new_mosaic(0.35 + height * len(rows), rows)


def places(shown: Sequence[Condition]) -> dict[str, float]:
    """Return positions of conditions, with larger gaps between teams."""
    teams = list(dict.fromkeys(one.team for one in shown))
    return {one.name: k + TEAM_GAP * teams.index(one.team) for k, one in enumerate(shown)}


def legend(figure: Figure, shown: Sequence[Condition], where: Where = "outside upper center") -> None:
    """Draw a legend of the conditions beside the panels."""
    looks = [look_of(one) for one in shown]
    handles = [
        Line2D([], [], linestyle="none", marker=look.marker, color=look.colour, markerfacecolor=look.face, markersize=5)
        for look in looks
    ]
    labels = [one.label for one in shown]
    figure.legend(handles, labels, loc=where, ncols=_columns(labels), handletextpad=0.2)


def _columns(labels: Sequence[str]) -> int:
    """Return the number of legend columns that fit in a row [1]."""
    most = 4 if len(labels) <= 4 else 3
    return max(1, min(most, _WIDE // max(map(len, labels), default=1)))


def _panel(axes: Axes, found: Sequence[Levels], at: dict[str, float]) -> None:
    """Draw a measure, with dyads joined within a team."""
    measure = found[0].measure
    unit = read_in(measure.unit, measure.name)
    for team in dict.fromkeys(one.condition.team for one in found):
        own = [one for one in found if one.condition.team == team]
        for dyad in sorted({dyad for one in own for dyad in one.dyads}):
            here = [one for one in own if dyad in one.dyads]
            x = [at[one.condition.name] + BESIDE for one in here]
            y = [unit.scale * one.values[one.dyads.index(dyad)] for one in here]
            draw_dyads(axes, x, y, look_of(own[0].condition).colour, f"{dyad} {team}", joined=True)
    for one in found:
        look, name = look_of(one.condition), one.condition.name
        draw_mean(axes, at[name], one.mean, look, name, scale=unit.scale)
    axes.margins(y=0.08)
    axes.set_title(measure.name, loc="left", fontsize=7.5)
    axes.set_ylabel(unit.in_brackets, fontsize=7)
    axes.tick_params(axis="y", labelsize=6.5)
    axes.set_xlim(-0.6, max(at.values()) + 0.6)
    axes.set_xticks([])


def _caption(found: Sequence[Levels], shown: Sequence[Condition]) -> str:
    known = [
        (condition.label, max(one.mean.n for one in found if one.condition == condition), "dyad") for condition in shown
    ]
    fewer = [one for one in found if one.mean.n < max(other.mean.n for other in found)]
    less = f" Fewer have: {', '.join(dict.fromkeys(one.measure.name for one in fewer))}." if fewer else ""
    return (
        "All measures in each condition. Large points: means over dyads with 95 % t intervals; small points: dyads, "
        "joined. Completion times: geometric means; SPARC and LDLJ: smoother nearer to zero; reaction times: of the "
        "first hand, sooner of two people by chance. On a light board mechanics makes the share of forces a half, and "
        f"the interaction force half the spring's pull. {how_many(known)}{less}"
    )
