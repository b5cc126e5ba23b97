"""All results of a study in one tidy table."""

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
"""Quantity of a result that stands for all of its topic, because of an error that its note tells."""


class Finding(Protocol):
    """What is found in a study."""

    @property
    def results(self) -> tuple[Result, ...]:
        """What of it is reported."""


PAPER: tuple[Callable[[Study], Finding], ...] = (learning, dyads, classes, strategy, delay)
"""What the paper reports, in the order of its figures 2 to 6."""

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
"""What a reader of today asks besides."""

FINDINGS: tuple[Callable[[Study], Finding], ...] = PAPER + MODERN
"""All that is found."""


def results_of(study: Study, findings: Sequence[Callable[[Study], Finding]] = FINDINGS) -> pd.DataFrame:
    """Find everything."""
    return table_of(result for find in findings for result in results_in(study, find))


def results_in(study: Study, find: Callable[[Study], Finding]) -> tuple[Result, ...]:
    """Find one thing; if it cannot be computed, say so in its place: all else of an analysis does not depend on it."""
    try:
        return find(study).results
    except UNCOMPUTABLE as error:
        why = f"{type(error).__name__}: {error}"
        return (Result(find.__name__, NOT_COMPUTED, "", nan, nan, nan, "", "", 0, "", why),)
