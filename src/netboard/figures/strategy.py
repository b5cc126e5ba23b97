"""The paper's figure 5: ellipses of the strategies in groups of trials, and how their spread goes down."""

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes

from netboard.figures.marks import draw_dyads, new_mosaic, styled, team_look, titled
from netboard.figures.picture import Picture
from netboard.findings.strategy import EVERYBODY, Spread, TeamStrategy, strategy
from netboard.measuring.study import Study

TITLE = "Convergence of the strategy"


@styled
def picture(study: Study) -> Picture:
    """Draw how the strategy converges.

    Parameters
    ----------
    study : Study
        The study.
    """
    teams = strategy(study).teams
    if not any(np.isfinite(one.width) for team in teams for one in team.ellipses):
        why = "No group of trials has enough first braking movements for an ellipse."
        return Picture("strategy", TITLE, why, None)
    count = len(teams[0].spreads)
    wide = len(teams) * count
    above = [f"ellipses {team.team}" for team in teams for _ in range(count)]
    below = [f"spread {k}" for k in range(count) for _ in range(len(teams))]
    figure, axes = new_mosaic(4.8, [above[:wide], below[:wide]], height_ratios=[1.25, 1])
    letters = iter("ABCDEFGHIJKLMNOP")
    ellipses = [axes[f"ellipses {team.team}"] for team in teams]
    for own, team in zip(ellipses, teams, strict=True):
        _ellipses(own, team)
        title = "all participants and dyads" if team.team == EVERYBODY else team.team
        titled(own, next(letters), title)
    _alike(ellipses)
    _numbers(ellipses[0], teams[0])
    shown = [team for team in teams if team.team != EVERYBODY]
    for k in range(count):
        own = axes[f"spread {k}"]
        titled(own, next(letters), shown[0].spreads[k].quantity)
        for team in shown:
            _spread(own, team, team.spreads[k])
        own.set_ylim(bottom=0.0)
        own.set_ylabel(f"{shown[0].spreads[k].quantity} [{_unit(shown[0].spreads[k].unit)}]")
    return Picture("strategy", TITLE, _caption(study, teams), figure)


def _unit(unit: str) -> str:
    """Write powers as such."""
    return unit.replace("2", "²").replace("4", "⁴")


def _colours(count: int) -> list[tuple[float, float, float, float]]:
    """From light to dark, the later the darker."""
    return [mpl.colormaps["viridis"](x) for x in np.linspace(0.9, 0.0, count)]


def _ellipses(axes: Axes, team: TeamStrategy) -> None:
    """Draw the ellipse and the mean of each group."""
    known = [one for one in team.ellipses if np.isfinite(one.width)]
    for k, (one, colour) in enumerate(zip(known, _colours(len(known)), strict=True)):
        x, y = one.outline().T
        width = 0.9 + 1.1 * k / max(len(known) - 1, 1)
        axes.plot(x, y, color=colour, linewidth=width, label=f"_{team.team}, group {k}")
        axes.plot(*one.centre, "o", color=colour, markersize=3.5, label=f"_{team.team}, centre {k}")
    axes.set_xlabel("distance to the target [m]")


def _alike(axes: list[Axes]) -> None:
    """Give panels the same limits."""
    x = [edge for one in axes for edge in one.get_xlim()]
    y = [edge for one in axes for edge in one.get_ylim()]
    for one in axes:
        one.set_xlim(min(x), max(x))
        one.set_ylim(min(y), max(y))
        one.tick_params(labelleft=one is axes[0])
    axes[0].set_ylabel("velocity to the target [m/s]")


def _numbers(axes: Axes, team: TeamStrategy) -> None:
    """Write which trials each ellipse is of."""
    known = [k for k, one in enumerate(team.ellipses) if np.isfinite(one.width)]
    for line, (k, colour) in enumerate(zip(known, _colours(len(known)), strict=True)):
        words = f"{team.first[k]} to {team.last[k]}"
        place = (0.04, 0.03 + 0.075 * (len(known) - 1 - line))
        axes.text(*place, words, color=colour, transform=axes.transAxes, fontsize=7.5, weight="bold")


def _spread(axes: Axes, team: TeamStrategy, spread: Spread) -> None:
    """Draw one spread over the groups of trials: each dyad, the mean and its band."""
    look = team_look(team.team)
    middles = (team.first + team.last) / 2
    for dyad, values in spread.dyads.iterrows():
        draw_dyads(axes, middles, values, look.colour, f"{dyad} {team.team}", joined=True)
    means, low, high = (np.array([getattr(one, name) for one in spread.means]) for name in ("value", "low", "high"))
    axes.fill_between(middles, low, high, color=look.colour, alpha=0.15, linewidth=0.0, zorder=1)
    axes.plot(
        middles,
        means,
        color=look.colour,
        linestyle=look.line,
        marker=look.marker,
        markersize=4.5,
        zorder=4,
        label=f"_{team.team} {spread.quantity}",
    )
    known = np.flatnonzero(np.isfinite(means))
    if known.size:
        axes.annotate(
            team.team,
            (middles[known[-1]], means[known[-1]]),
            xytext=(6, 0),
            textcoords="offset points",
            color=look.colour,
            va="center",
            annotation_clip=False,
        )
    axes.set_xticks(middles, [f"{first} to {last}" for first, last in zip(team.first, team.last, strict=True)])
    axes.set_xlabel("trials of the condition [1]")


def _caption(study: Study, teams: tuple[TeamStrategy, ...]) -> str:
    how = study.readings.summaries
    extent = {
        "middle_90": "from the 5th to the 95th percentile of the scores along each component",
        "twice_p90": "twice the 90th percentile of the scores' magnitudes along each component",
        "p10_to_p90": "from the 10th to the 90th percentile of the scores along each component",
        "nine_tenths": "nine tenths of the scores' range along each component",
    }[how.extent]
    each = "; ".join(
        f"{team.team}: n = {min(one.count for one in team.ellipses)} to {max(one.count for one in team.ellipses)} trials an "
        f"ellipse, {len(team.spreads[0].dyads)} dyads"
        for team in teams
    )
    return (
        f"Ball at the onset of the first braking movement, in groups of {how.group} trials of each condition in the order "
        f"in which they were done. Ellipses: of everybody's trials of a group; centre: mean; axes: principal components, "
        f"{extent}. Below: variances of each performer's trials of a condition, averaged for each dyad (thin lines); thick "
        f"lines: means over dyads, with bands of their 95 % t intervals. {each[0].upper()}{each[1:]}."
    )
