"""Leadership: signed delays of the sides, and the balance between them.

A delay is the left side's time minus the right side's, + = right first. In bimanual conditions the sides are the hands
of one participant, in dyadic ones two participants. Levels are those of dyads, as in
`netboard.analysis.topics.measures`.
"""

from collections.abc import Collection, Iterator, Sequence
from functools import partial
from operator import itemgetter
from typing import TYPE_CHECKING

import pandas as pd

from netboard.analysis.extraction.conditions import STAND_INS
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.measures.lags import leadership
from netboard.analysis.topics.figure import NO_EFFECT, Drawn, due_count, new_mosaic, pictured, titled
from netboard.analysis.topics.groups import estimated, interval_text
from netboard.analysis.topics.measures import Levels, Measure, draw_levels, legend, levels_of, places
from netboard.analysis.topics.result import Result, TopicResults, plain
from netboard.analysis.topics.units import MS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_OWN = itemgetter("own_delay_20")


def _index(delays: pd.Series) -> float:
    return leadership(delays).index


QUESTIONS = (
    Measure("signed delay at 20 %", "s", "coordination", "movement", "real", itemgetter("delay_20"), compared=False),
    Measure(
        "signed delay at 20 % of each side's own peak", "s", "coordination", "movement", "real", _OWN, compared=False
    ),
    Measure("signed lag", "s", "coordination", "trial", "real", itemgetter("lag"), compared=False),
    Measure("leadership index", "1", "coordination", "movement", "balance", _OWN, level=_index, compared=False),
)
"""Leadership measures. The index uses delays at own peaks, so moving farther does not look like moving earlier."""


def leaders(study: StudyData) -> TopicResults[Levels]:
    """Return the leadership by measure, then by condition; a mean other than 0 indicates a side that leads."""
    return TopicResults.of(levels_of(study, QUESTIONS), partial(_results, changed_seats(study)))


def _results(changed: Collection[str], lead: Levels) -> Iterator[Result]:
    """Yield the mean over dyads, and each dyad's level."""
    question, group, sides = lead.measure, lead.condition.label, "+ = right first"
    yield estimated("leadership", question.name, group, lead.mean, question.unit, sides)
    for dyad, value in zip(lead.dyads, lead.values, strict=True):
        mixed = dyad in changed and lead.condition.configuration == "dyadic"
        note = f"{sides}; partners changed seats" if mixed else sides
        yield plain("leadership", question.name, f"{group}, {dyad}", float(value), question.unit, 1, "dyad", note)


def changed_seats(study: StudyData) -> tuple[str, ...]:
    """Return the dyads whose partners changed seats between analysed dyadic blocks: a side is not one participant."""
    analysed = study.analysed
    together = analysed[analysed["configuration"] == "dyadic"]
    people = together[~together[["left_by", "right_by"]].isin(STAND_INS).any(axis=1)]
    seats = people.groupby("dyad")["left_by"].nunique()
    return tuple(seats.index[seats > 1])


@pictured("Who moved first")
def picture(study: StudyData) -> Drawn:
    """Draw the leadership measures."""
    found = leaders(study).parts
    if not found:
        return "No included trial has a delay."
    names = [question.name for question in QUESTIONS if any(one.measure == question for one in found)]
    figure, axes = new_mosaic(5.0, [names[:2], names[2:]] if len(names) == 4 else [names])
    shown = tuple(dict.fromkeys(one.condition for one in found))
    at = places(shown)
    for name, letter in zip(names, "ABCD", strict=False):
        _panel(axes[name], [one for one in found if one.measure.name == name], at)
        titled(axes[name], letter, name)
    legend(figure, shown)
    return figure, _caption(study, found)


def _panel(axes: "Axes", found: Sequence[Levels], at: dict[str, float]) -> None:
    """Draw a measure: each dyad, and the mean."""
    in_ms = found[0].measure.unit == "s"
    scale = MS.scale if in_ms else 1.0
    axes.axhline(0.0, **NO_EFFECT)
    draw_levels(axes, found, at, scale)
    reach = 1.1 * max(abs(end) for end in axes.get_ylim())
    axes.set_ylim(-reach, reach)
    axes.set_ylabel("left first   [ms]   right first" if in_ms else "left first   [1]   right first")
    axes.set_xticks([])
    axes.set_xlim(-0.6, max(at.values()) + 0.6)


def _caption(study: StudyData, found: Sequence[Levels]) -> str:
    own = [one for one in found if one.measure == QUESTIONS[1]]
    known = due_count([(one.condition.label, one.mean.n, "dyad") for one in own], [one.rows for one in own], "movement")
    seats = ", ".join(changed_seats(study))
    intervals = interval_text(one.mean for one in found)
    changed = f" In {seats} partners changed seats: there a side is not one participant." if seats else ""
    return (
        "Time of the left side minus that of the right side, in cooperative movements (A, B) and by cross-correlation "
        "(C). D: number of movements with the right side first minus number with the left side first, divided by the "
        "sum of both numbers. "
        f"Large points: means over dyads with {intervals}; small points: dyads, joined. Sides are the "
        f"hands of one participant in bimanual conditions, and participants in dyadic ones.{changed} {known}"
    )
