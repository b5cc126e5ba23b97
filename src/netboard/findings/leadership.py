"""Who moved first: signed delays of the sides, and how evenly they took the lead.

A delay is the left side's time less the right one's, + = right first. In bimanual conditions the sides are hands of one
person, in dyadic ones two people. A level is that of a dyad, as in `netboard.findings.measures`.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.lags import leadership
from netboard.analysis.statistics import Estimate, t_interval
from netboard.findings.groups import Condition, conditions, estimated
from netboard.findings.measures import PLACE, Of, rows_of
from netboard.findings.results import Result
from netboard.measuring.study import Study


@dataclass(frozen=True, slots=True)
class Question:
    """A way to say who moved first.

    Attributes
    ----------
    name, unit : str
        In words, and its SI unit.
    of : {"trial", "movement"}
        What has a delay.
    column : str
        The delay's.
    level : callable
        Takes the delays of a performer in a condition; returns one number [its unit].
    """

    name: str
    unit: str
    of: Of
    column: str
    level: Callable[[pd.Series], float]


def _mean(delays: pd.Series) -> float:
    return float(delays.mean())


def _index(delays: pd.Series) -> float:
    return leadership(delays).index


QUESTIONS = (
    Question("signed delay at 20 %", "s", "movement", "delay_20", _mean),
    Question("signed delay at 20 % of the own peak", "s", "movement", "own_delay_20", _mean),
    Question("signed lag", "s", "trial", "lag", _mean),
    Question("leadership index", "1", "movement", "own_delay_20", _index),
)
"""All of them. The index is that of the own peaks, in which moving further does not look like moving earlier."""


@dataclass(frozen=True, slots=True, eq=False)
class Lead:
    """The answer to a question in a condition.

    Attributes
    ----------
    question : Question
        What was asked.
    condition : Condition
        The condition.
    dyads : tuple of str
        The dyads that have an answer.
    values : ndarray of float64, shape (n,)
        Theirs, + = right first [the question's].
    rows : int
        Delays that there are [1].
    mean : Estimate
        Mean of the dyads, with its t interval: a side that leads in all dyads.
    """

    question: Question
    condition: Condition
    dyads: tuple[str, ...]
    values: NDArray[np.float64]
    rows: int
    mean: Estimate


@dataclass(frozen=True, slots=True)
class Leaders:
    """All answers.

    Attributes
    ----------
    leads : tuple of Lead
        By question, then by condition.
    changed : tuple of str
        Dyads whose partners changed seats between dyadic blocks: there a side is no person.
    """

    leads: tuple[Lead, ...]
    changed: tuple[str, ...]

    @property
    def results(self) -> tuple[Result, ...]:
        """The mean over dyads, and each dyad's own."""
        return tuple(row for lead in self.leads for row in self._rows(lead))

    def _rows(self, lead: Lead) -> Iterator[Result]:
        question, group, sides = lead.question, lead.condition.label, "+ = right first"
        yield estimated("leadership", question.name, group, lead.mean, question.unit, sides)
        for dyad, value in zip(lead.dyads, lead.values, strict=True):
            note = f"{sides}; partners changed seats" if dyad in self.changed else sides
            one = (float(value), np.nan, np.nan, question.unit, "")
            yield Result("leadership", question.name, f"{group}, {dyad}", *one, 1, "dyad", note)


def leaders(study: Study) -> Leaders:
    """Find who moved first.

    Parameters
    ----------
    study : Study
        The study.

    Returns
    -------
    Leaders
        The answers to all questions, for conditions in which there are any.
    """
    found = []
    for question in QUESTIONS:
        rows = rows_of(study, question.of)
        rows = rows[np.isfinite(rows[question.column])]
        people = rows.groupby(PLACE)[question.column].agg([question.level, "size"]).set_axis(["level", "rows"], axis=1)
        dyads = people.groupby(["condition", "dyad"], as_index=False).agg({"level": "mean", "rows": "sum"})
        for condition in conditions(study):
            own = dyads[dyads["condition"] == condition.name]
            if len(own):
                names, values = tuple(own["dyad"]), own["level"].to_numpy(float)
                found.append(Lead(question, condition, names, values, int(own["rows"].sum()), t_interval(values)))
    return Leaders(tuple(found), _changed_seats(study))


def _changed_seats(study: Study) -> tuple[str, ...]:
    """Name the dyads in which not always the same one sat at the left."""
    together = study.blocks[study.blocks["configuration"] == "dyadic"]
    people = together[~together[["left_by", "right_by"]].isin(["still", "robot"]).any(axis=1)]
    seats = people.groupby("dyad")["left_by"].nunique()
    return tuple(seats.index[seats > 1])
