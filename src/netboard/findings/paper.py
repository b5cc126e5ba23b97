"""What the paper reported (arXiv:2203.01287, line 161), and the same numbers of a study beside it."""

import pandas as pd

from netboard.measuring.study import Study
from netboard.measuring.tables import count, number, words

REPORTED = (
    ("bimanual", "first", 5.71, 4.48),
    ("bimanual", "last", 3.61, 3.08),
    ("dyadic", "first", 4.33, 2.92),
    ("dyadic", "last", 3.62, 2.23),
)
"""Configuration, which trials, mean and standard deviation of their completion times [s]."""

COMPARISON = (
    words("figure", "figure of the paper"),
    count("line", "line of the paper's source"),
    words("quantity", "what it is"),
    words("group", "of whom and when"),
    words("kind", "what can be compared: a number, a count, a direction (rises, falls, unchanged), or words"),
    words("said", "what the paper says, shortened"),
    number("reported", "the paper's number", "in column unit"),
    number("reported_sd", "its standard deviation, of single trials", "in column unit"),
    count("reported_of", "of how many a count is; 0 if it is none"),
    number("value", "the study's number", "in column unit"),
    number("low", "lower end of its interval", "in column unit"),
    number("high", "upper end of its interval", "in column unit"),
    words("unit", "SI unit"),
    words("interval", "what the interval is"),
    count("n", "of how many the study's number is made"),
    words("of", "of what"),
    number("difference", "the study's number less the paper's", "in column unit"),
    number("difference_sd", "the same in standard deviations of the paper", "1"),
    words("verdict", "whether both agree"),
    words("note", "what must be known to read it"),
)
"""Columns of the comparison."""


def compare(study: Study) -> pd.DataFrame:
    """Put a study's numbers beside those of the paper.

    Parameters
    ----------
    study : Study
        The study.

    Returns
    -------
    DataFrame
        The columns of `COMPARISON`, a row for each of `REPORTED`.
    """
    counted, ends = study.counted, study.readings.summaries.ends
    longest = counted.groupby(["performer", "condition"])["order"].transform("max")
    chosen = {"first": counted["order"] <= ends, "last": counted["order"] > longest - ends}
    rows = []
    for team, which, reported, deviation in REPORTED:
        times = counted.loc[chosen[which] & (counted["configuration"] == team), "completion"]
        mean, spread = float(times.mean()), float(times.std())
        group = f"{team}, {which} {ends}"
        head = ("2AB", 161, "completion time", group, "number", "", reported, deviation, 0)
        found = (mean, mean - spread, mean + spread, "s", "SD", len(times), "trial")
        away = (mean - reported) / deviation
        rows.append(
            (*head, *found, mean - reported, away, f"{away:+.2f} SD" if len(times) else "not in this study", "")
        )
    return pd.DataFrame(rows, columns=[field.name for field in COMPARISON])
