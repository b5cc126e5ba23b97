"""Learning (the paper's figure 2): completion time, movement classes and velocity peaks over the trials.

Trials with the same number in their condition are averaged over performers and haptic conditions. First and last trials
are reported as in the paper, with mean and standard deviation of single trials (or of participants, if set), and also
as means of dyads with a confidence interval.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.extraction.study import StudyData, series_labels
from netboard.analysis.measures.ellipses import groups_of
from netboard.analysis.measures.performance import (
    FirstAndLast,
    LearningCurve,
    PerformanceSummary,
    first_and_last,
    learning_curve,
)
from netboard.analysis.statistics.estimates import Estimate
from netboard.analysis.topics.figure import (
    CLASS_COLOURS,
    STACK,
    Drawn,
    apart,
    beside,
    draw_dyads,
    draw_mean,
    new_mosaic,
    panel_letters,
    pictured,
    sentence,
    team_look,
    titled,
    trial_ticks,
)
from netboard.analysis.topics.groups import (
    CLASSES,
    QUANTITIES,
    PerformanceQuantity,
    counted,
    estimate,
    estimated,
    interval_text,
    of_dyads,
    of_performers,
    over_the_same,
    teams,
    windows_of,
)
from netboard.analysis.topics.result import Result, TopicResults
from netboard.base.looks import BLACK, PRINT_SMALL
from netboard.base.plural import plural

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TOPIC = "learning"

BESIDE = 4
"""Most teams beside each other in the figure [1]."""


@dataclass(frozen=True, slots=True)
class Stages:
    """Means of dyads (rows) in consecutive groups of trials, with the numbers of their first and last trials."""

    first: NDArray[np.int64]
    last: NDArray[np.int64]
    dyads: pd.DataFrame
    means: tuple[Estimate, ...]


@dataclass(frozen=True, slots=True)
class Course:
    """One quantity over the trials of a team, with means over dyads of first trials, last trials, and last vs first.

    `of` is the unit of the standard deviations of `ends`: trials, participants or dyads; `short` is the number of
    series with too few trials for both ends, which are left out [1].
    """

    quantity: PerformanceQuantity
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
    """Learning of a team, with the mean duration of each movement class (columns) at each trial number [s].

    A series is a performer's trials in a condition.
    """

    team: str
    courses: tuple[Course, ...]
    seconds: NDArray[np.float64]
    dyads: int
    performers: int
    series: int
    trials: int


def learning(study: StudyData) -> TopicResults[TeamLearning]:
    """Return the learning of all teams."""
    trials = counted(study)
    own = {team: trials[trials["team"] == team] for team in teams(study)}
    found = (_learning(study, team, rows) for team, rows in own.items() if len(rows))
    return TopicResults.of(found, partial(_results, study))


def series_of(study: StudyData, rows: pd.DataFrame) -> pd.Series:
    """Number the series (`series_labels`)."""
    return rows.groupby(series_labels(study.readings), sort=False).ngroup()


def _learning(study: StudyData, team: str, rows: pd.DataFrame) -> TeamLearning:
    order = rows["order"].to_numpy()
    classes = [learning_curve(rows[name].to_numpy(np.float64), order).mean for name in CLASSES]
    return TeamLearning(
        team=team,
        courses=tuple(_course(study, rows, quantity) for quantity in QUANTITIES),
        seconds=np.stack(classes, axis=1),
        dyads=rows["dyad"].nunique(),
        performers=rows["performer"].nunique(),
        series=series_of(study, rows).nunique(),
        trials=len(rows),
    )


def _course(study: StudyData, rows: pd.DataFrame, quantity: PerformanceQuantity) -> Course:
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
    parts = {"first": aligned <= windows.ends, "last": late}
    performers = pd.DataFrame({when: of_performers(kept[part], quantity.column) for when, part in parts.items()})
    ends_of_dyads = over_the_same(performers)
    return Course(
        quantity=quantity,
        curve=learning_curve(values, order),
        stages=_stages(rows, quantity.column, windows.group),
        ends=ends,
        of=_unit(rows) if how.spread == "people" else "trial",
        first=estimate(of_dyads(performers["first"]), "positive"),
        last=estimate(of_dyads(performers["last"]), "positive"),
        change=estimate(ends_of_dyads["last"] - ends_of_dyads["first"], "real"),
        short=int(series[~enough].nunique()),
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
    return Stages(
        groups * size + 1, last, dyads, tuple(estimate(dyads[number], "positive") for number in dyads.columns)
    )


def _results(study: StudyData, found: TeamLearning) -> Iterator[Result]:
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
        group = f"{found.team}, last {count} vs first {count}"
        yield estimated(TOPIC, f"change of {name}", group, course.change, unit, note)


def _spread(group: str, found: PerformanceSummary, course: Course, note: str) -> Result:
    """Return a mean with its standard deviation as a result."""
    low, high = found.mean - found.deviation, found.mean + found.deviation
    interval = "SD" if found.count > 1 else ""
    unit = course.quantity.unit
    return Result(
        TOPIC, course.quantity.name, group, found.mean, low, high, unit, interval, found.count, course.of, note
    )


def _row(kind: str, band: Sequence[TeamLearning], width: int) -> list[str]:
    """Return the panels of one kind in a row of the figure, filled up with empty ones."""
    return [f"{kind} {one.team}" for one in band] + ["."] * (width - len(band))


@pictured("Learning")
def picture(study: StudyData) -> Drawn:
    """Draw the learning of participants and dyads.

    Lines are means of all trials of one number, pooled over haptic conditions; points are dyads in groups of trials.
    """
    teams = learning(study).parts
    if not teams:
        return "No trial is included, so learning cannot be shown."
    bands = [teams[first : first + BESIDE] for first in range(0, len(teams), BESIDE)]
    rows = [_row(kind, band, len(bands[0])) for band in bands for kind in ("time", "peaks")]
    figure, axes = new_mosaic(4.6 * len(bands), rows, height_ratios=[1.35, 1] * len(bands))
    letters, windows = panel_letters(), windows_of(study)
    for band in bands:
        for one in band:
            _areas(axes[f"time {one.team}"], one)
            titled(axes[f"time {one.team}"], next(letters), one.team)
        for one in band:
            titled(axes[f"peaks {one.team}"], next(letters), one.team)
    narrow = len(teams) > 2
    room = 1.34 if narrow else 1.22
    for row, kind in enumerate(("time", "peaks")):
        top = max(_top(one.courses[row]) for one in teams) or 1.0
        for one in teams:
            own = axes[f"{kind} {one.team}"]
            if not np.isfinite(one.courses[row].curve.mean).any():
                own.text(0.5, 0.5, "no trial has a value", transform=own.transAxes, ha="center", fontsize=PRINT_SMALL)
            _draw_course(own, one.courses[row], one.team)
            _ends(own, one.courses[row], windows.ends, top, narrow)
            own.set_ylim(0.0, room * top)
            own.set_xlim(0.5, one.courses[row].curve.order.max() + 0.5)
            own.set_xticks(trial_ticks(windows.group, int(own.get_xlim()[1])))
            if kind == "peaks":
                own.set_xlabel("trial of the condition [1]")
        unit = teams[0].courses[row].quantity.unit
        name = ("completion time", "velocity peaks")[row]
        for band in bands:
            axes[f"{kind} {band[0].team}"].set_ylabel(f"{name} [{unit}]")
    last = bands[0][-1]
    _names(axes[f"time {last.team}"], last, 0.015 * len(bands[0]))
    return figure, _caption(study, teams)


def _areas(axes: "Axes", one: TeamLearning) -> None:
    """Draw the movement classes as stacked areas."""
    order, known = one.courses[0].curve.order, np.isfinite(one.seconds).all(axis=1)
    below = np.zeros(len(order))
    for name in STACK:
        above = below + one.seconds[:, CLASSES.index(name)]
        areas = axes.fill_between(order, below, above, where=known.tolist(), color=CLASS_COLOURS[name], zorder=1)
        areas.set(label=f"_{name}", edgecolor="white", linewidth=0.3)
        below = above


def _draw_course(axes: "Axes", course: Course, team: str) -> None:
    """Draw the mean of each trial, and the dyads in groups of trials."""
    on_areas = course.quantity.column == "completion"
    look = team_look(team)
    colour = BLACK if on_areas else look.colour
    look = replace(look, colour=colour, face=colour)
    axes.plot(
        course.curve.order,
        course.curve.mean,
        color=colour,
        linewidth=0.6,
        alpha=0.75 if on_areas else 0.45,
        zorder=2,
        label="_each trial",
    )
    middles = (course.stages.first + course.stages.last) / 2
    dyads = course.stages.dyads
    for offset, (dyad, values) in zip(
        beside(len(dyads), 0.5 * float(np.ptp(middles[:2]))), dyads.iterrows(), strict=True
    ):
        draw_dyads(axes, middles + offset, values, colour, str(dyad))
    for middle, mean in zip(middles, course.stages.means, strict=True):
        draw_mean(axes, float(middle), mean, look, "dyads")


def _ends(axes: "Axes", course: Course, count: int, top: float, narrow: bool) -> None:
    """Label the first and last trials with mean and standard deviation, stacked if space is short."""
    last = int(course.curve.order.max())
    ends = ((course.ends.first, 1, "left"), (course.ends.last, last, "right"))
    for spread, edge, side in ends:
        if not np.isfinite(spread.mean):
            continue
        other = edge + count - 1 if side == "left" else edge - count + 1
        axes.plot([edge, other], [1.06 * top, 1.06 * top], color=BLACK, linewidth=1.0, label=f"_{side} end")
        deviation = f" ± {spread.deviation:.2f}" if np.isfinite(spread.deviation) else ""
        unit = f" {course.quantity.unit}" if course.quantity.unit != "1" else ""
        height = (1.2 if narrow and side == "right" else 1.09) * top
        axes.text(edge, height, f"{spread.mean:.2f}{deviation}{unit}", ha=side, va="bottom", fontsize=PRINT_SMALL)


def _names(axes: "Axes", one: TeamLearning, aside: float) -> None:
    """Write the names of the classes to the right of the areas."""
    height = axes.get_ylim()[1]
    known = one.seconds[np.isfinite(one.seconds).all(axis=1)]
    if not len(known):
        return
    tail = known[-30:].mean(axis=0)
    shown = np.array([tail[CLASSES.index(name)] for name in STACK])
    places = apart(list(np.cumsum(shown) - shown / 2), 0.075 * height)
    to_right = axes.get_yaxis_transform()
    for name, place in zip(STACK, places, strict=True):
        axes.plot([1 + aside], [place], "s", color=CLASS_COLOURS[name], transform=to_right, clip_on=False, markersize=5)
        axes.text(1 + 2 * aside, place, name, transform=to_right, va="center", fontsize=PRINT_SMALL)


def _top(course: Course) -> float:
    """Return the largest value drawn."""
    highs = [mean.high for mean in course.stages.means]
    every = np.concatenate([course.curve.mean, course.stages.dyads.to_numpy().ravel(), highs])
    return float(np.max(every, initial=0.0, where=np.isfinite(every)))


def _performers(one: TeamLearning) -> str:
    """Return the number of participants, if the performers are not dyads."""
    return f"{plural(one.performers, 'participant')}, " if one.team.startswith("bimanual") else ""


def _caption(study: StudyData, teams: tuple[TeamLearning, ...]) -> str:
    how, windows = study.readings.summaries, windows_of(study)
    of = "trials" if how.spread == "trials" else "participants or dyads"
    people = "; ".join(
        f"{one.team}: n = {plural(one.dyads, 'dyad')} ({_performers(one)}{one.trials} trials)" for one in teams
    )
    intervals = interval_text(mean for one in teams for course in one.courses for mean in course.stages.means)
    areas = "they add up to the completion time"
    if study.readings.movements.window == "whole":
        areas = "with the hold, so they exceed the completion time"
    return (
        "Completion time and number of velocity peaks of the ball over the trials; haptic conditions are pooled. "
        f"Lines: means of all trials with the same number; areas: time of each class of movement ({areas}). Small "
        f"points: dyads, in groups of {windows.group} trials; large points: means over dyads with {intervals}. "
        f"Numbers: mean ± SD (of {of}) of the first and the last {windows.ends} trials. "
        f"{sentence(people)}"
        f"{f' {sentence(windows.note)}' if windows.note else ''}"
    )
