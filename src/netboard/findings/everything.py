"""Every number of a study that is reported, in one tidy table."""

import pandas as pd

from netboard.findings.results import Result, table_of
from netboard.measuring.study import Study


def results_of(study: Study) -> pd.DataFrame:
    """Compute all results.

    Parameters
    ----------
    study : Study
        The study.

    Returns
    -------
    DataFrame
        The columns of `netboard.findings.results.RESULTS`.
    """
    return table_of(
        Result("completion", "completion time", str(name), mean, mean - spread, mean + spread, "s", "SD", n, "trial")
        for name, times in study.counted.groupby("condition")["completion"]
        for mean, spread, n in [(float(times.mean()), float(times.std()), len(times))]
    )
