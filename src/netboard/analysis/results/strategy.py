"""Convergence of the strategy (the paper's figure 5): distance and velocity of the ball at the onset of braking.

Trials of a condition form groups, by default 30 each, in the order of performance. An ellipse pools all performers'
trials of a group. A variance is that of one performer's trials of a group in one condition; variances are averaged for
each dyad, and their confidence interval is over dyads.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import nan

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.extraction.study import Study
from netboard.analysis.measures.ellipses import FEWEST, Ellipse, convergence, groups_of
from netboard.analysis.results.groups import counted, estimate, estimated, teams
from netboard.analysis.results.learning import series_of
from netboard.analysis.results.result import Result
from netboard.analysis.results.windows import windows_of
from netboard.analysis.statistics.estimates import Estimate

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
class Spread:
    """One measure of spread over the groups of trials.

    Attributes
    ----------
    dyads : DataFrame
        Spread of each dyad (rows) in each group (columns) [its unit].
    """

    quantity: str
    unit: str
    dyads: pd.DataFrame
    means: tuple[Estimate, ...]
    change: Estimate


@dataclass(frozen=True, slots=True)
class TeamStrategy:
    """Strategies of a team.

    Attributes
    ----------
    first, last : ndarray of int64, shape (g,)
        Numbers of the first and the last trial of each group [1].
    spreads : tuple of Spread
        Variance of distance and of velocity; or the generalised variance of both.
    """

    team: str
    first: NDArray[np.int64]
    last: NDArray[np.int64]
    ellipses: tuple[Ellipse, ...]
    spreads: tuple[Spread, ...]


@dataclass(frozen=True, slots=True)
class Strategy:
    """Strategies of all teams.

    Attributes
    ----------
    teams : tuple of TeamStrategy
        All teams pooled if there are several, then each team that has trials with a first braking movement.
    """

    teams: tuple[TeamStrategy, ...]
    results: tuple[Result, ...]


def strategy(study: Study) -> Strategy:
    """Return the convergence of the strategy."""
    trials = counted(study).dropna(subset=POINT)
    own = {team: trials[trials["team"] == team] for team in teams(study)}
    filled = {team: rows for team, rows in own.items() if len(rows)}
    if len(filled) > 1:
        filled = {EVERYBODY: trials, **filled}
    found = tuple(_team(study, team, rows) for team, rows in filled.items())
    return Strategy(found, tuple(result for one in found for result in _results(one, windows_of(study).group_note)))


def _team(study: Study, team: str, rows: pd.DataFrame) -> TeamStrategy:
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


def _of_series(study: Study, rows: pd.DataFrame) -> pd.DataFrame:
    """Return the spreads of each performer in each condition and group of trials."""
    parts, size = [], windows_of(study).group
    for _, own in rows.groupby(series_of(study, rows), sort=False):
        found = convergence(_points(own), groups_of(own["order"].to_numpy(), size))
        columns = {
            "group": found.groups,
            "variance of distance": found.variance[:, 0],
            "variance of velocity": found.variance[:, 1],
            "generalised variance": found.generalised,
        }
        parts.append(pd.DataFrame(columns).assign(dyad=own["dyad"].iloc[0], performer=own["performer"].iloc[0]))
    return pd.concat(parts, ignore_index=True)


def _spread(spreads: pd.DataFrame, name: str, unit: str) -> Spread:
    """Average one spread for each dyad, and then over dyads."""
    performers = spreads.groupby(["dyad", "performer", "group"])[name].mean()
    dyads = performers.groupby(level=["dyad", "group"]).mean().unstack("group")
    ends = dyads.iloc[:, -1] - dyads.iloc[:, 0] if dyads.shape[1] > 1 else pd.Series(dtype=np.float64)
    return Spread(name, unit, dyads, tuple(estimate(dyads[group]) for group in dyads.columns), estimate(ends))


def _results(found: TeamStrategy, windows: str) -> Iterator[Result]:
    groups = [f"{found.team}, {trials(*pair)}" for pair in zip(found.first, found.last, strict=True)]
    for group, one in zip(groups, found.ellipses, strict=True):
        note = "of everybody's trials together" if one.count >= FEWEST else f"fewer than {FEWEST} trials"
        yield Result(TOPIC, "area of the ellipse", group, one.area, nan, nan, "m2/s", "", one.count, "trial", note)
    ends = f"{found.team}, last group less first"
    if len(found.ellipses) > 1:
        first, last = found.ellipses[0], found.ellipses[-1]
        note, count = "of everybody's trials together", first.count + last.count
        yield Result(
            TOPIC,
            "change of the area of the ellipse",
            ends,
            last.area - first.area,
            nan,
            nan,
            "m2/s",
            "",
            count,
            "trial",
            note,
        )
    for spread in found.spreads:
        for group, mean in zip(groups, spread.means, strict=True):
            yield estimated(TOPIC, spread.quantity, group, mean, spread.unit, windows)
        yield estimated(TOPIC, f"change of {spread.quantity}", ends, spread.change, spread.unit, windows)


def trials(first: int, last: int) -> str:
    """Return the name of a group of trials."""
    return f"trials {first} to {last}"
