"""Convergence of the strategy (the paper's figure 5): distance and velocity of the ball at the onset of braking.

Trials of a condition form groups, by default 30 each, in the order of performance. An ellipse pools all performers'
trials of a group. A variance is that of one performer's trials of a group in one condition; variances are averaged for
each dyad, and their confidence interval is over dyads.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.extraction.study import StudyData
from netboard.analysis.measures.ellipses import FEWEST, Ellipse, convergence, groups_of
from netboard.analysis.statistics.estimates import Estimate
from netboard.analysis.topics.figure import (
    WIDTH,
    Drawn,
    apart,
    draw_dyads,
    panel_letters,
    pictured,
    sentence,
    span,
    team_colour,
    team_look,
    titled,
    trial_ticks,
)
from netboard.analysis.topics.groups import (
    Windows,
    counted,
    estimate,
    estimated,
    interval_text,
    short_last_group,
    teams,
    windows_of,
)
from netboard.analysis.topics.learning import series_of
from netboard.analysis.topics.result import Result, TopicResults, plain
from netboard.analysis.topics.units import read_in
from netboard.base.plural import plural

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TOPIC = "strategy"

EVERYBODY = "all"
"""Name of the group of all teams."""

KINDS = {
    "each": (("variance of distance", "m2"), ("variance of velocity", "m2/s2")),
    "generalised": (("generalised variance", "m4/s2"),),
}
"""Measures of spread for each setting of "variance", with their units."""

POINT = ["braking_distance", "braking_velocity"]
"""Columns of the strategy: distance and velocity."""


@dataclass(frozen=True, slots=True)
class DyadSpread:
    """One measure of spread: of each dyad (rows) in each group of trials (columns) [its unit]."""

    quantity: str
    unit: str
    dyads: pd.DataFrame
    means: tuple[Estimate, ...]
    change: Estimate


@dataclass(frozen=True, slots=True)
class TeamStrategy:
    """Strategies of a team, in groups of trials with the numbers of their first and last ones.

    The spreads are the variance of distance and of velocity; or the generalised variance of both.
    """

    team: str
    first: NDArray[np.int64]
    last: NDArray[np.int64]
    ellipses: tuple[Ellipse, ...]
    spreads: tuple[DyadSpread, ...]


def strategy(study: StudyData) -> TopicResults[TeamStrategy]:
    """Return the convergence of all teams pooled, if several, and of each with trials with a first braking movement."""
    trials = counted(study).dropna(subset=POINT)
    own = {team: trials[trials["team"] == team] for team in teams(study)}
    filled = {team: rows for team, rows in own.items() if len(rows)}
    if len(filled) > 1:
        filled = {EVERYBODY: trials, **filled}
    found = (_team(study, team, rows) for team, rows in filled.items())
    return TopicResults.of(found, partial(_results, windows=windows_of(study)))


def _team(study: StudyData, team: str, rows: pd.DataFrame) -> TeamStrategy:
    how, size = study.readings.summaries, windows_of(study).group
    order = rows["order"].to_numpy()
    together = convergence(_points(rows), groups_of(order, size), extent=how.extent, scaling=how.scaling)
    first = together.groups * size + 1
    last = np.minimum(first + size - 1, order.max())
    spreads = _of_series(study, rows)
    return TeamStrategy(
        team, first, last, together.ellipses, tuple(_spread(spreads, *kind) for kind in KINDS[how.variance])
    )


def _points(rows: pd.DataFrame) -> NDArray[np.float64]:
    return np.asarray(rows[POINT], np.float64)


def _of_series(study: StudyData, rows: pd.DataFrame) -> pd.DataFrame:
    """Return the spreads of each performer in each condition and group of trials."""
    parts, size = [], windows_of(study).group
    for series, own in rows.groupby(series_of(study, rows), sort=False):
        found = convergence(_points(own), groups_of(own["order"].to_numpy(), size))
        columns = {
            "group": found.groups,
            "variance of distance": found.variance[:, 0],
            "variance of velocity": found.variance[:, 1],
            "generalised variance": found.generalised,
        }
        place = {"dyad": own["dyad"].iloc[0], "performer": own["performer"].iloc[0], "series": series}
        parts.append(pd.DataFrame(columns).assign(**place))
    return pd.concat(parts, ignore_index=True)


def _spread(spreads: pd.DataFrame, name: str, unit: str) -> DyadSpread:
    """Average one spread for each dyad, and then over dyads; its change over the series that have both ends."""
    performers = spreads.groupby(["dyad", "performer", "group"])[name].mean()
    dyads = performers.groupby(level=["dyad", "group"]).mean().unstack("group")
    series = spreads.set_index(["dyad", "performer", "series", "group"])[name].unstack("group")
    whole = series.iloc[:, [0, -1]].dropna().groupby(level=["dyad", "performer"]).mean()
    ends = whole.groupby(level="dyad").mean()
    change = ends.iloc[:, 1] - ends.iloc[:, 0] if series.shape[1] > 1 else pd.Series(dtype=np.float64)
    return DyadSpread(
        name,
        unit,
        dyads,
        tuple(estimate(dyads[group], "positive") for group in dyads.columns),
        estimate(change, "real"),
    )


def _results(found: TeamStrategy, windows: Windows) -> Iterator[Result]:
    short = short_last_group(int(found.first[-1]), int(found.last[-1]), windows.group)
    last_note = "; ".join(filter(None, (windows.group_note, short.removesuffix("."))))
    groups = [f"{found.team}, {trials(*pair)}" for pair in zip(found.first, found.last, strict=True)]
    for group, one in zip(groups, found.ellipses, strict=True):
        note = "of all performers' trials pooled" if one.count >= FEWEST else f"fewer than {FEWEST} trials"
        yield plain(TOPIC, "area of the ellipse", group, one.area, "m2/s", one.count, "trial", note)
    ends = f"{found.team}, last group vs first"
    if len(found.ellipses) > 1:
        first, last = found.ellipses[0], found.ellipses[-1]
        change, count = last.area - first.area, first.count + last.count
        note = "; ".join(filter(None, ("of all performers' trials pooled", short.removesuffix("."))))
        yield plain(TOPIC, "change of the area of the ellipse", ends, change, "m2/s", count, "trial", note)
    for spread in found.spreads:
        for group, mean in zip(groups, spread.means, strict=True):
            yield estimated(TOPIC, spread.quantity, group, mean, spread.unit, windows.group_note)
        yield estimated(TOPIC, f"change of {spread.quantity}", ends, spread.change, spread.unit, last_note)


def trials(first: int, last: int) -> str:
    """Return the name of a group of trials."""
    return f"trials {first} to {last}"


_DISTANCE, _VELOCITY = read_in("m"), read_in("m/s")
_SCALES = np.array([_DISTANCE.scale, _VELOCITY.scale])

_ACROSS = 3
"""Panels of ellipses in a row."""


@pictured("Convergence of the strategy")
def picture(study: StudyData) -> Drawn:
    """Draw the convergence of the strategy.

    Ellipses pool all performers; variances are those within performers, averaged for each dyad.
    """
    from matplotlib.figure import Figure

    teams = strategy(study).parts
    if not any(np.isfinite(one.width) for team in teams for one in team.ellipses):
        return "No group of trials has enough first braking movements for an ellipse."
    rows = -(-len(teams) // _ACROSS)
    height = [2.7 * rows, 2.2]
    figure = Figure(figsize=(WIDTH, sum(height)))
    above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=height).flat
    grid = above.subplots(rows, min(len(teams), _ACROSS), squeeze=False, sharex=True, sharey=True)
    ellipses = list(grid.flat)[: len(teams)]
    for empty in list(grid.flat)[len(teams) :]:
        empty.set_axis_off()
    letters = panel_letters()
    for axes, team in zip(ellipses, teams, strict=True):
        _ellipses(axes, team)
        titled(axes, next(letters), "all participants and dyads" if team.team == EVERYBODY else team.team)
    for axes in ellipses[::_ACROSS]:
        axes.set_ylabel(f"velocity to the target {_VELOCITY.in_brackets}")
    for axes in ellipses[-_ACROSS:]:
        axes.set_xlabel(f"distance to the target {_DISTANCE.in_brackets}")
        axes.tick_params(labelbottom=True)
    _numbers(ellipses[min(_ACROSS, len(teams)) - 1], teams[0])
    shown = [team for team in teams if team.team != EVERYBODY]
    kinds = len(shown[0].spreads)
    for k, axes in enumerate(below.subplots(1, kinds, squeeze=False).flat):
        titled(axes, next(letters), shown[0].spreads[k].quantity)
        _spreads(axes, shown, k, windows_of(study).group)
    return figure, _caption(study, teams)


def _colours(count: int) -> list[tuple[float, float, float, float]]:
    """Return colours from light to dark, later groups darker."""
    import matplotlib as mpl

    return [mpl.colormaps["viridis"](x) for x in np.linspace(0.75, 0.0, count)]


def _ellipses(axes: "Axes", team: TeamStrategy) -> None:
    """Draw the ellipse and the mean of each group."""
    known = [one for one in team.ellipses if np.isfinite(one.width)]
    for k, (one, colour) in enumerate(zip(known, _colours(len(known)), strict=True)):
        x, y = (_SCALES * one.outline()).T
        width = 0.9 + 1.1 * k / max(len(known) - 1, 1)
        axes.plot(x, y, color=colour, linewidth=width, label=f"_{team.team}, group {k}")
        axes.plot(*(_SCALES * one.centre), "o", color=colour, markersize=3.5, label=f"_{team.team}, centre {k}")


def _numbers(axes: "Axes", team: TeamStrategy) -> None:
    """Label each ellipse with its trials."""
    known = [k for k, one in enumerate(team.ellipses) if np.isfinite(one.width)]
    for line, (k, colour) in enumerate(zip(known, _colours(len(known)), strict=True)):
        words = f"{team.first[k]} to {team.last[k]}"
        axes.text(1.03, 0.9 - 0.09 * line, words, color=colour, transform=axes.transAxes, weight="bold")
    axes.text(1.03, 0.99, "trials", transform=axes.transAxes)


def _spreads(axes: "Axes", teams: list[TeamStrategy], kind: int, size: int) -> None:
    """Draw one measure of spread over the groups of trials: each team's dyads, their mean and its band."""
    for team in teams:
        _draw_spread(axes, team, team.spreads[kind])
    last = max(int(team.last[-1]) for team in teams)
    axes.set_xticks(trial_ticks(size, last))
    axes.set_xlim(0.5, 1.22 * last)
    axes.spines["bottom"].set_bounds(1, last)
    axes.set_ylim(bottom=0.0)
    _names(axes, teams, kind)
    axes.set_xlabel("trial of the condition [1]")
    axes.set_ylabel(f"variance {read_in(teams[0].spreads[kind].unit).in_brackets}")


def _draw_spread(axes: "Axes", team: TeamStrategy, spread: DyadSpread) -> None:
    look, scale = team_look(team.team), read_in(spread.unit).scale
    middles = (team.first + team.last) / 2
    for dyad, values in spread.dyads.iterrows():
        draw_dyads(axes, middles, scale * values, look.colour, f"{dyad} {team.team}", joined=True)
    means, low, high = (
        scale * np.array([getattr(one, name) for one in spread.means]) for name in ("value", "low", "high")
    )
    axes.fill_between(
        middles, low, high, color=look.colour, alpha=0.15, linewidth=0.0, zorder=1, label=f"_{team.team}, interval"
    )
    axes.plot(
        middles,
        means,
        color=look.colour,
        linestyle=look.line,
        marker=look.marker,
        markersize=4.5,
        zorder=4,
        label=f"_{team.team}",
    )


def _names(axes: "Axes", teams: list[TeamStrategy], kind: int) -> None:
    """Write the teams' names at the ends of their lines, without overlap."""
    scale = read_in(teams[0].spreads[kind].unit).scale
    ends = {
        team.team: [scale * mean.value for mean in team.spreads[kind].means if np.isfinite(mean.value)]
        for team in teams
    }
    order = sorted((values[-1], name) for name, values in ends.items() if values)
    places = apart([value for value, _ in order], 0.09 * axes.get_ylim()[1])
    for (_, name), place in zip(order, places, strict=True):
        axes.annotate(name, (0.83, place), xycoords=("axes fraction", "data"), color=team_colour(name), va="center")


def _caption(study: StudyData, teams: tuple[TeamStrategy, ...]) -> str:
    how, windows = study.readings.summaries, windows_of(study)
    extent = {
        "middle_90": "from the 5th to the 95th percentile of the scores along each component",
        "twice_p90": "twice the 90th percentile of the scores' magnitudes along each component",
        "p10_to_p90": "from the 10th to the 90th percentile of the scores along each component",
        "nine_tenths": "nine tenths of the scores' range along each component",
    }[how.extent]
    counts = [[one.count for one in team.ellipses] for team in teams]
    each = "; ".join(
        f"{team.team}: n = {plural(len(team.spreads[0].dyads), 'dyad')}, {span(count)} trials an ellipse"
        for team, count in zip(teams, counts, strict=True)
    )
    intervals = interval_text(mean for team in teams for one in team.spreads for mean in one.means)
    longest = max(teams, key=lambda team: int(team.last[-1]))
    short = short_last_group(int(longest.first[-1]), int(longest.last[-1]), windows.group)
    return (
        f"Ball at the onset of the first braking movement, in groups of {windows.group} trials of a condition. Above: "
        f"mean and ellipse of all trials of a group; axes: principal components, {extent}. Below: variances within "
        "performers; thin lines: averages of each dyad; thick lines: means over dyads, with bands of "
        f"{intervals}. {sentence(each)}{f' {sentence(windows.group_note)}' if windows.group_note else ''}"
        f"{f' {short}' if short else ''}"
    )
