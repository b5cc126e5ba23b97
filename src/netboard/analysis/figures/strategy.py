"""The paper's figure 5: strategy ellipses of groups of trials, and the decrease of their spread.

Ellipses pool the trials of all performers; variances are those within performers, averaged for each dyad. The numbers
come from `netboard.analysis.results.strategy`.
"""

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from netboard.analysis.extraction.study import Study
from netboard.analysis.figures.figure import WIDTH, Picture
from netboard.analysis.figures.marks import (
    apart,
    draw_dyads,
    many,
    sentence,
    styled,
    team_colour,
    team_look,
    titled,
    trial_ticks,
)
from netboard.analysis.results.strategy import EVERYBODY, Spread, TeamStrategy, strategy
from netboard.analysis.results.units import read_in
from netboard.analysis.results.windows import windows_of

TITLE = "Convergence of the strategy"

_DISTANCE, _VELOCITY = read_in("m"), read_in("m/s")
_SCALES = np.array([_DISTANCE.scale, _VELOCITY.scale])

_ACROSS = 3
"""Panels of ellipses in a row."""


@styled
def picture(study: Study) -> Picture:
    """Draw the convergence of the strategy."""
    teams = strategy(study).teams
    if not any(np.isfinite(one.width) for team in teams for one in team.ellipses):
        why = "No group of trials has enough first braking movements for an ellipse."
        return Picture("strategy", TITLE, why, None)
    rows = -(-len(teams) // _ACROSS)
    height = [2.7 * rows, 2.2]
    figure = Figure(figsize=(WIDTH, sum(height)))
    above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=height).flat
    grid = above.subplots(rows, min(len(teams), _ACROSS), squeeze=False, sharex=True, sharey=True)
    ellipses = list(grid.flat)[: len(teams)]
    for empty in list(grid.flat)[len(teams) :]:
        empty.set_axis_off()
    letters = iter("ABCDEFGHIJKLMNOP")
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
    return Picture("strategy", TITLE, _caption(study, teams), figure)


def _colours(count: int) -> list[tuple[float, float, float, float]]:
    """Return colours from light to dark, later groups darker."""
    return [mpl.colormaps["viridis"](x) for x in np.linspace(0.75, 0.0, count)]


def _ellipses(axes: Axes, team: TeamStrategy) -> None:
    """Draw the ellipse and the mean of each group."""
    known = [one for one in team.ellipses if np.isfinite(one.width)]
    for k, (one, colour) in enumerate(zip(known, _colours(len(known)), strict=True)):
        x, y = (_SCALES * one.outline()).T
        width = 0.9 + 1.1 * k / max(len(known) - 1, 1)
        axes.plot(x, y, color=colour, linewidth=width, label=f"_{team.team}, group {k}")
        axes.plot(*(_SCALES * one.centre), "o", color=colour, markersize=3.5, label=f"_{team.team}, centre {k}")


def _numbers(axes: Axes, team: TeamStrategy) -> None:
    """Label each ellipse with its trials."""
    known = [k for k, one in enumerate(team.ellipses) if np.isfinite(one.width)]
    for line, (k, colour) in enumerate(zip(known, _colours(len(known)), strict=True)):
        words = f"{team.first[k]} to {team.last[k]}"
        axes.text(1.03, 0.9 - 0.09 * line, words, color=colour, transform=axes.transAxes, weight="bold")
    axes.text(1.03, 0.99, "trials", transform=axes.transAxes)


def _spreads(axes: Axes, teams: list[TeamStrategy], kind: int, size: int) -> None:
    """Draw one measure of spread over the groups of trials: each team's dyads, their mean and its band."""
    for team in teams:
        _spread(axes, team, team.spreads[kind])
    last = max(int(team.last[-1]) for team in teams)
    axes.set_xticks(trial_ticks(size, last))
    axes.set_xlim(0.5, 1.22 * last)
    axes.spines["bottom"].set_bounds(1, last)
    axes.set_ylim(bottom=0.0)
    _names(axes, teams, kind)
    axes.set_xlabel("trial of the condition [1]")
    axes.set_ylabel(f"variance {read_in(teams[0].spreads[kind].unit).in_brackets}")


def _spread(axes: Axes, team: TeamStrategy, spread: Spread) -> None:
    """Draw the spread of a team."""
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


def _names(axes: Axes, teams: list[TeamStrategy], kind: int) -> None:
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


def _caption(study: Study, teams: tuple[TeamStrategy, ...]) -> str:
    how, windows = study.readings.summaries, windows_of(study)
    extent = {
        "middle_90": "from the 5th to the 95th percentile of the scores along each component",
        "twice_p90": "twice the 90th percentile of the scores' magnitudes along each component",
        "p10_to_p90": "from the 10th to the 90th percentile of the scores along each component",
        "nine_tenths": "nine tenths of the scores' range along each component",
    }[how.extent]
    counts = [[one.count for one in team.ellipses] for team in teams]
    each = "; ".join(
        f"{team.team}: n = {many(len(team.spreads[0].dyads), 'dyad')}, {_range(count)} trials an ellipse"
        for team, count in zip(teams, counts, strict=True)
    )
    return (
        f"Ball at the onset of the first braking movement, in groups of {windows.group} trials of a condition. Above: "
        f"mean and ellipse of everybody's trials of a group; axes: principal components, {extent}. Below: variances "
        "within performers, averaged for each dyad (thin), and means over dyads with bands of 95 % t intervals "
        f"(thick). {each[0].upper()}{each[1:]}.{f' {sentence(windows.group_note)}' if windows.group_note else ''}"
    )


def _range(counts: list[int]) -> str:
    """Return the range of numbers as text."""
    low, high = min(counts), max(counts)
    return f"{low}" if low == high else f"{low} to {high}"
