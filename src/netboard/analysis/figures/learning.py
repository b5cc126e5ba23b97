"""The paper's figure 2: completion time with movement classes, and velocity peaks, over the trials.

Lines are means of all trials with the same number, pooled over haptic conditions; points are dyads in groups of trials.
The numbers come from `netboard.analysis.results.learning`.
"""

import numpy as np
from matplotlib.axes import Axes

from netboard.analysis.extraction.study import Study
from netboard.analysis.figures.figure import BLACK, CLASSES, Picture
from netboard.analysis.figures.marks import (
    apart,
    beside,
    draw_dyads,
    draw_mean,
    many,
    new_mosaic,
    sentence,
    styled,
    team_look,
    titled,
    trial_ticks,
)
from netboard.analysis.results.groups import CLASSES as ORDER
from netboard.analysis.results.learning import Course, TeamLearning, learning
from netboard.analysis.results.windows import windows_of

TITLE = "Learning"

STACK = ("cooperative", "single", "competitive", "still")
"""From below; dark and light colours alternate, so that neighbours also differ in grey."""


@styled
def picture(study: Study) -> Picture:
    """Draw the learning of participants and dyads."""
    found = learning(study)
    if not found.teams:
        return Picture("learning", TITLE, "No trial counts, so there is no learning to show.", None)
    teams = found.teams
    rows = [[f"{kind} {one.team}" for one in teams] for kind in ("time", "peaks")]
    figure, axes = new_mosaic(4.6, rows, height_ratios=[1.35, 1])
    letters, windows = iter("ABCDEFGHIJKLMNOP"), windows_of(study)
    for one in teams:
        _areas(axes[f"time {one.team}"], one)
        titled(axes[f"time {one.team}"], next(letters), one.team)
    for one in teams:
        titled(axes[f"peaks {one.team}"], next(letters), one.team)
    narrow = len(teams) > 2
    room = 1.34 if narrow else 1.22
    for row, kind in enumerate(("time", "peaks")):
        top = max(_top(one.courses[row]) for one in teams) or 1.0
        for one in teams:
            own = axes[f"{kind} {one.team}"]
            if not np.isfinite(one.courses[row].curve.mean).any():
                own.text(0.5, 0.5, "no trial has a value", transform=own.transAxes, ha="center", fontsize=7.5)
            _course(own, one.courses[row], one.team)
            _ends(own, one.courses[row], windows.ends, top, narrow)
            own.set_ylim(0.0, room * top)
            own.set_xlim(0.5, one.courses[row].curve.order.max() + 0.5)
            own.set_xticks(trial_ticks(windows.group, int(own.get_xlim()[1])))
            if kind == "peaks":
                own.set_xlabel("trial of the condition [1]")
        unit = teams[0].courses[row].quantity.unit
        name = ("completion time", "velocity peaks")[row]
        axes[f"{kind} {teams[0].team}"].set_ylabel(f"{name} [{unit}]")
    _names(axes[f"time {teams[-1].team}"], teams[-1], 0.015 * len(teams))
    return Picture("learning", TITLE, _caption(study, teams), figure)


def _areas(axes: Axes, one: TeamLearning) -> None:
    """Draw the movement classes as stacked areas."""
    order, known = one.courses[0].curve.order, np.isfinite(one.seconds).all(axis=1)
    below = np.zeros(len(order))
    for name in STACK:
        above = below + one.seconds[:, ORDER.index(name)]
        areas = axes.fill_between(order, below, above, where=known.tolist(), color=CLASSES[name], zorder=1)
        areas.set(label=f"_{name}", edgecolor="white", linewidth=0.3)
        below = above


def _course(axes: Axes, course: Course, team: str) -> None:
    """Draw the mean of each trial, and the dyads in groups of trials."""
    on_areas = course.quantity.column == "completion"
    look = team_look(team)
    colour = BLACK if on_areas else look.colour
    look = type(look)(colour, look.marker, colour, look.line)
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


def _ends(axes: Axes, course: Course, count: int, top: float, narrow: bool) -> None:
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
        axes.text(edge, height, f"{spread.mean:.2f}{deviation}{unit}", ha=side, va="bottom", fontsize=7.5)


def _names(axes: Axes, one: TeamLearning, aside: float) -> None:
    """Write the names of the classes to the right of the areas."""
    height = axes.get_ylim()[1]
    known = one.seconds[np.isfinite(one.seconds).all(axis=1)]
    if not len(known):
        return
    tail = known[-30:].mean(axis=0)
    shown = np.array([tail[ORDER.index(name)] for name in STACK])
    places = apart(list(np.cumsum(shown) - shown / 2), 0.075 * height)
    to_right = axes.get_yaxis_transform()
    for name, place in zip(STACK, places, strict=True):
        axes.plot([1 + aside], [place], "s", color=CLASSES[name], transform=to_right, clip_on=False, markersize=5)
        axes.text(1 + 2 * aside, place, name, transform=to_right, va="center", fontsize=7.5)


def _top(course: Course) -> float:
    """Return the largest value drawn."""
    highs = [mean.high for mean in course.stages.means]
    every = np.concatenate([course.curve.mean, course.stages.dyads.to_numpy().ravel(), highs])
    return float(np.max(every, initial=0.0, where=np.isfinite(every)))


def _performers(one: TeamLearning) -> str:
    """Return the number of participants, if the performers are not dyads."""
    return f"{many(one.performers, 'participant')}, " if one.team.startswith("bimanual") else ""


def _caption(study: Study, teams: tuple[TeamLearning, ...]) -> str:
    how, windows = study.readings.summaries, windows_of(study)
    of = "trials" if how.spread == "trials" else "participants or dyads"
    people = "; ".join(
        f"{one.team}: n = {many(one.dyads, 'dyad')} ({_performers(one)}{one.trials} trials)" for one in teams
    )
    areas = "they add up to the completion time"
    if study.readings.movements.window == "whole":
        areas = "the hold is in them, so they go beyond the completion time"
    return (
        "Completion time and number of velocity peaks of the ball over the trials, all forces together. Lines: means "
        f"of all trials with the same number; areas: time of each class of movement in them ({areas}). Small points: "
        f"dyads, in groups of {windows.group} trials; large points: means over dyads with 95 % t intervals. Numbers: "
        f"mean ± SD (of {of}) of the first and the last {windows.ends} trials. {people[0].upper()}{people[1:]}."
        f"{f' {sentence(windows.note)}' if windows.note else ''}"
    )
