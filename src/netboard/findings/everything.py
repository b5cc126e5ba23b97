"""All results of a study in one tidy table."""

from collections.abc import Callable
from typing import Protocol

import pandas as pd

from netboard.findings.classes import classes
from netboard.findings.delay import delay
from netboard.findings.dyads import dyads
from netboard.findings.learning import learning
from netboard.findings.results import Result, table_of
from netboard.findings.strategy import strategy
from netboard.measuring.study import Study


class Finding(Protocol):
    """What is found in a study."""

    @property
    def results(self) -> tuple[Result, ...]:
        """What of it is reported."""


PAPER: tuple[Callable[[Study], Finding], ...] = (learning, dyads, classes, strategy, delay)
"""What the paper reports, in the order of its figures 2 to 6."""

FINDINGS: tuple[Callable[[Study], Finding], ...] = PAPER
"""All that is found."""


def results_of(study: Study) -> pd.DataFrame:
    """Find everything.

    Parameters
    ----------
    study : Study
        The study.

    Returns
    -------
    DataFrame
        The columns of `netboard.findings.results.RESULTS`.
    """
    return table_of(result for find in FINDINGS for result in find(study).results)
