"""All results of a study in one tidy table.

Each topic is a function of the study whose result object lists its rows. An error in one topic becomes a row of its own
and does not stop the others.
"""

from collections.abc import Callable, Sequence
from math import nan
from typing import Protocol

import pandas as pd

from netboard.analysis.extraction.study import Study
from netboard.analysis.results.classes import classes
from netboard.analysis.results.contrasts import comparisons
from netboard.analysis.results.delay import delay
from netboard.analysis.results.dyads import dyads
from netboard.analysis.results.influence import influences
from netboard.analysis.results.leadership import leaders
from netboard.analysis.results.learning import learning
from netboard.analysis.results.measures import overview
from netboard.analysis.results.models import fits
from netboard.analysis.results.passive_partner import controls
from netboard.analysis.results.paths import courses
from netboard.analysis.results.quality import quality
from netboard.analysis.results.result import UNCOMPUTABLE, Result, table_of
from netboard.analysis.results.strategy import strategy

NOT_COMPUTED = "not computed"
"""Quantity of the result that replaces a topic after an error, which its note gives."""


class Finding(Protocol):
    """Result object of one topic."""

    @property
    def results(self) -> tuple[Result, ...]:
        """Return the rows to report."""


PAPER: tuple[Callable[[Study], Finding], ...] = (learning, dyads, classes, strategy, delay)
"""Topics of the paper, in the order of its figures 2 to 6."""

MODERN: tuple[Callable[[Study], Finding], ...] = (
    quality,
    overview,
    comparisons,
    fits,
    leaders,
    influences,
    controls,
    courses,
)
"""Topics beyond the paper."""

FINDINGS: tuple[Callable[[Study], Finding], ...] = PAPER + MODERN
"""All topics."""


def results_of(study: Study, findings: Sequence[Callable[[Study], Finding]] = FINDINGS) -> pd.DataFrame:
    """Compute the results of all topics."""
    return table_of(result for find in findings for result in results_in(study, find))


def results_in(study: Study, find: Callable[[Study], Finding]) -> tuple[Result, ...]:
    """Compute one topic; an error becomes a result in its place, so that other topics are unaffected."""
    try:
        return find(study).results
    except UNCOMPUTABLE as error:
        why = f"{type(error).__name__}: {error}"
        return (Result(find.__name__, NOT_COMPUTED, "", nan, nan, nan, "", "", 0, "", why),)
