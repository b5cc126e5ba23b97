"""All results of a study in one tidy table."""

from collections.abc import Callable, Sequence
from math import nan
from typing import Protocol

import pandas as pd

from netboard.findings.classes import classes
from netboard.findings.contrasts import comparisons
from netboard.findings.delay import delay
from netboard.findings.dyads import dyads
from netboard.findings.influence import influences
from netboard.findings.leadership import leaders
from netboard.findings.learning import learning
from netboard.findings.measures import overview
from netboard.findings.models import fits
from netboard.findings.passive_partner import controls
from netboard.findings.paths import courses
from netboard.findings.quality import quality
from netboard.findings.results import UNCOMPUTABLE, Result, table_of
from netboard.findings.strategy import strategy
from netboard.measuring.study import Study

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
