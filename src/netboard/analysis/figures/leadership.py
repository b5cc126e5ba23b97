"""Leadership: signed delays and the leadership index of each dyad.

The numbers come from `netboard.analysis.results.leadership`. Sides are the hands of one participant in bimanual
conditions, and participants in dyadic ones.
"""

from collections.abc import Sequence

from matplotlib.axes import Axes

from netboard.analysis.extraction.study import Study
from netboard.analysis.figures.figure import Picture
from netboard.analysis.figures.marks import draw_dyads, draw_mean, how_many, look_of, new_mosaic, styled, titled
from netboard.analysis.figures.measures import BESIDE, legend, places
from netboard.analysis.results.leadership import QUESTIONS, Leaders, leaders
from netboard.analysis.results.measures import Levels

TITLE = "Who moved first"

_MS = 1000.0


@styled
def picture(study: Study) -> Picture:
    """Draw the leadership measures."""
    found = leaders(study)
    if not found.leads:
        return Picture("leadership", TITLE, "No trial that counts has a delay.", None)
    names = [question.name for question in QUESTIONS if any(one.measure == question for one in found.leads)]
    figure, axes = new_mosaic(5.0, [names[:2], names[2:]] if len(names) == 4 else [names])
    shown = tuple(dict.fromkeys(one.condition for one in found.leads))
    at = places(shown)
    for name, letter in zip(names, "ABCD", strict=False):
        _panel(axes[name], [one for one in found.leads if one.measure.name == name], at)
        titled(axes[name], letter, name)
    legend(figure, shown)
    return Picture("leadership", TITLE, _caption(found), figure)


def _panel(axes: Axes, found: Sequence[Levels], at: dict[str, float]) -> None:
    """Draw a measure: each dyad, and the mean."""
    in_ms = found[0].measure.unit == "s"
    scale = _MS if in_ms else 1.0
    axes.axhline(0.0, color="#888888", linewidth=0.8, zorder=1)
    for team in dict.fromkeys(one.condition.team for one in found):
        own = [one for one in found if one.condition.team == team]
        for dyad in sorted({dyad for one in own for dyad in one.dyads}):
            here = [one for one in own if dyad in one.dyads]
            x = [at[one.condition.name] + BESIDE for one in here]
            y = [scale * one.values[one.dyads.index(dyad)] for one in here]
            draw_dyads(axes, x, y, look_of(own[0].condition).colour, f"{dyad} {team}", joined=True)
    for one in found:
        draw_mean(axes, at[one.condition.name], one.mean, look_of(one.condition), one.condition.name, scale=scale)
    reach = 1.1 * max(abs(end) for end in axes.get_ylim())
    axes.set_ylim(-reach, reach)
    axes.set_ylabel("left first   [ms]   right first" if in_ms else "left first   [1]   right first")
    axes.set_xticks([])
    axes.set_xlim(-0.6, max(at.values()) + 0.6)


def _caption(found: Leaders) -> str:
    own = [one for one in found.leads if one.measure == QUESTIONS[1]]
    known = how_many([(one.condition.label, one.mean.n, "dyad") for one in own], [one.rows for one in own], "movement")
    changed = (
        f" In {', '.join(found.changed)} partners changed seats: there a side is no person." if found.changed else ""
    )
    return (
        "Time of the left side less that of the right one, in cooperative movements (A, B) and by cross-correlation "
        "(C); D: movements in which the right side was first less those in which the left one was, over both. Large "
        "points: means over dyads with 95 % t intervals; small points: dyads, joined. Sides are hands of one person "
        f"in bimanual conditions, people in dyadic ones.{changed} {known}"
    )
