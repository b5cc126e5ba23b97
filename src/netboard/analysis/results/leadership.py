"""Leadership: signed delays of the sides, and the balance between them.

A delay is the left side's time minus the right side's, + = right first. In bimanual conditions the sides are the hands
of one participant, in dyadic ones two participants. Levels are those of dyads, as in
`netboard.analysis.results.measures`.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from netboard.analysis.extraction.study import Study
from netboard.analysis.measures.lags import leadership
from netboard.analysis.results.groups import estimated
from netboard.analysis.results.measures import Levels, Measure, column, levels_of
from netboard.analysis.results.result import Result

_OWN = column("own_delay_20")


def _index(delays: pd.Series) -> float:
    return leadership(delays).index


QUESTIONS = (
    Measure("signed delay at 20 %", "s", "coordination", "movement", column("delay_20"), compared=False),
    Measure("signed delay at 20 % of the own peak", "s", "coordination", "movement", _OWN, compared=False),
    Measure("signed lag", "s", "coordination", "trial", column("lag"), compared=False),
    Measure("leadership index", "1", "coordination", "movement", _OWN, level=_index, compared=False),
)
"""Leadership measures. The index uses delays at own peaks, so moving farther does not look like moving earlier."""


@dataclass(frozen=True, slots=True)
class Leaders:
    """Leadership in all conditions.

    Attributes
    ----------
    leads : tuple of Levels
        By measure, then by condition. A mean other than 0 indicates a side that leads across dyads.
    changed : tuple of str
        Dyads whose partners changed seats between dyadic blocks, so that a side is not one participant.
    """

    leads: tuple[Levels, ...]
    changed: tuple[str, ...]

    @property
    def results(self) -> tuple[Result, ...]:
        """Return the mean over dyads, and each dyad's level."""
        return tuple(row for lead in self.leads for row in self._rows(lead))

    def _rows(self, lead: Levels) -> Iterator[Result]:
        question, group, sides = lead.measure, lead.condition.label, "+ = right first"
        yield estimated("leadership", question.name, group, lead.mean, question.unit, sides)
        for dyad, value in zip(lead.dyads, lead.values, strict=True):
            note = f"{sides}; partners changed seats" if dyad in self.changed else sides
            one = (float(value), np.nan, np.nan, question.unit, "")
            yield Result("leadership", question.name, f"{group}, {dyad}", *one, 1, "dyad", note)


def leaders(study: Study) -> Leaders:
    """Return the leadership in all conditions.

    Returns
    -------
    Leaders
        All measures, for conditions with values.
    """
    return Leaders(levels_of(study, QUESTIONS), _changed_seats(study))


def _changed_seats(study: Study) -> tuple[str, ...]:
    """Return the dyads whose left seat was taken by more than one participant."""
    together = study.blocks[study.blocks["configuration"] == "dyadic"]
    people = together[~together[["left_by", "right_by"]].isin(["still", "robot"]).any(axis=1)]
    seats = people.groupby("dyad")["left_by"].nunique()
    return tuple(seats.index[seats > 1])
