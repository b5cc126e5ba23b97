"""Learning (the paper's figure 2): completion time, movement classes and velocity peaks over the trials.

Trials with the same number in their condition are averaged over performers and haptic conditions. First and last trials
are reported as in the paper, with mean and standard deviation of single trials (or of participants, if set), and also
as means of dyads with a confidence interval.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.extraction.study import Study
from netboard.analysis.measures.ellipses import groups_of
from netboard.analysis.measures.performance import (
    FirstAndLast,
    LearningCurve,
    Summary,
    first_and_last,
    learning_curve,
)
from netboard.analysis.results.groups import (
    CLASSES,
    QUANTITIES,
    Quantity,
    counted,
    estimate,
    estimated,
    of_dyads,
    of_performers,
    teams,
)
from netboard.analysis.results.result import Result
from netboard.analysis.results.windows import windows_of
from netboard.analysis.statistics.estimates import Estimate

TOPIC = "learning"


@dataclass(frozen=True, slots=True)
class Stages:
    """Means of dyads in consecutive groups of trials.

    Attributes
    ----------
    first, last : ndarray of int64, shape (g,)
        Numbers of the first and the last trial of each group [1].
    dyads : DataFrame
        Mean of each dyad (rows) in each group (columns) [as the quantity].
    """

    first: NDArray[np.int64]
    last: NDArray[np.int64]
    dyads: pd.DataFrame
    means: tuple[Estimate, ...]


@dataclass(frozen=True, slots=True)
class Course:
    """One quantity over the trials of a team.

    Attributes
    ----------
    of : str
        Unit of the standard deviations of `ends`: trials, participants or dyads.
    first, last, change : Estimate
        Means over dyads of first trials, last trials, and last minus first.
    short : int
        Number of series with too few trials for both ends, which are left out [1].
    """

    quantity: Quantity
    curve: LearningCurve
    stages: Stages
    ends: FirstAndLast
    of: str
    first: Estimate
    last: Estimate
    change: Estimate
    short: int


@dataclass(frozen=True, slots=True)
class TeamLearning:
    """Learning of a team.

    Attributes
    ----------
    seconds : ndarray, shape (k, 4)
        Mean duration of each movement class at each trial number [s].
    dyads, performers, series, trials : int
        Numbers of dyads, performers, series and trials; a series is a performer's trials in a condition [1].
    """

    team: str
    courses: tuple[Course, ...]
    seconds: NDArray[np.float64]
    dyads: int
    performers: int
    series: int
    trials: int


@dataclass(frozen=True, slots=True)
class Learning:
    """Learning of all teams."""

    teams: tuple[TeamLearning, ...]
    results: tuple[Result, ...]


def learning(study: Study) -> Learning:
    """Return the learning of all teams."""
    trials = counted(study)
    own = {team: trials[trials["team"] == team] for team in teams(study)}
    found = tuple(_learning(study, team, rows) for team, rows in own.items() if len(rows))
    return Learning(found, tuple(result for one in found for result in _results(study, one)))


def series_of(study: Study, rows: pd.DataFrame) -> pd.Series:
    """Number the series: trials of a performer that the settings number together."""
    labels = ["dyad", "performer", "configuration"]
    if study.readings.summaries.numbering == "condition":
        labels.append("condition")
    return rows.groupby(labels, sort=False).ngroup()


def _learning(study: Study, team: str, rows: pd.DataFrame) -> TeamLearning:
    order = rows["order"].to_numpy()
    classes = [learning_curve(rows[name].to_numpy(np.float64), order).mean for name in CLASSES]
    return TeamLearning(
        team,
        tuple(_course(study, rows, quantity) for quantity in QUANTITIES),
        np.stack(classes, axis=1),
        rows["dyad"].nunique(),
        rows["performer"].nunique(),
        series_of(study, rows).nunique(),
        len(rows),
    )


def _course(study: Study, rows: pd.DataFrame, quantity: Quantity) -> Course:
    how, windows = study.readings.summaries, windows_of(study)
    values, order = rows[quantity.column].to_numpy(np.float64), rows["order"].to_numpy()
    series = series_of(study, rows)
    length = rows["order"].groupby(series).transform("max").to_numpy()
    enough = length >= 2 * windows.ends
    kept, own, longest = rows[enough], length[enough], int(length[enough].max(initial=0))
    # The last trials of a shorter series are aligned with those of the longest one.
    late = kept["order"].to_numpy() > own - windows.ends
    aligned = kept["order"].to_numpy() + late * (longest - own)
    people = kept["performer"].to_numpy() if how.spread == "people" else None
    ends = first_and_last(values[enough], aligned, count=windows.ends, length=longest, people=people)
    first, last = (of_dyads(of_performers(kept[part], quantity.column)) for part in (aligned <= windows.ends, late))
    return Course(
        quantity,
        learning_curve(values, order),
        _stages(rows, quantity.column, windows.group),
        ends,
        _unit(rows) if how.spread == "people" else "trial",
        estimate(first),
        estimate(last),
        estimate(last - first),
        int(series[~enough].nunique()),
    )


def _unit(rows: pd.DataFrame) -> str:
    """Return what a performer is: a participant or a dyad."""
    return "participant" if (rows["configuration"] == "bimanual").all() else "dyad"


def _stages(rows: pd.DataFrame, column: str, size: int) -> Stages:
    """Average groups of consecutive trials for each dyad."""
    order = rows["order"].to_numpy()
    group = pd.Series(groups_of(order, size), rows.index, name="group")
    means = rows.groupby(["dyad", "performer", group])[column].mean()
    dyads = means.groupby(level=["dyad", "group"]).mean().unstack("group")
    groups = dyads.columns.to_numpy(np.int64)
    last = np.minimum((groups + 1) * size, order.max())
    return Stages(groups * size + 1, last, dyads, tuple(estimate(dyads[number]) for number in dyads.columns))


def _results(study: Study, found: TeamLearning) -> Iterator[Result]:
    windows = windows_of(study)
    count = windows.ends
    for course in found.courses:
        name, unit = course.quantity.name, course.quantity.unit
        short = f"{course.short} of {found.series} have fewer than {2 * count} trials and are left out"
        note = "; ".join(word for word in (short if course.short else "", windows.ends_note) if word)
        for when, spread, mean in (
            (f"first {count}", course.ends.first, course.first),
            (f"last {count}", course.ends.last, course.last),
        ):
            group = f"{found.team}, {when}"
            yield _spread(group, spread, course, note)
            yield estimated(TOPIC, f"{name}, mean of dyads", group, mean, unit, note)
        group = f"{found.team}, last {count} less first {count}"
        yield estimated(TOPIC, f"change of {name}", group, course.change, unit, note)


def _spread(group: str, found: Summary, course: Course, note: str) -> Result:
    """Return a mean with its standard deviation as a result."""
    low, high = found.mean - found.deviation, found.mean + found.deviation
    interval = "SD" if found.count > 1 else ""
    unit = course.quantity.unit
    return Result(
        TOPIC, course.quantity.name, group, found.mean, low, high, unit, interval, found.count, course.of, note
    )
