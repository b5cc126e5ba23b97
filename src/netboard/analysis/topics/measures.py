"""List of all measures of attempts, and the level of each dyad in each condition.

A dyad's level is the mean of its performers' levels, and a performer's level the mean of its own trials, movements or
attempts. A dyad has two performers in bimanual conditions and one in dyadic ones. Every dyad therefore has equal
weight, whatever its number of trials, and is the unit of all confidence intervals. Each measure declares the range of
its values, from which the method of its intervals follows.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf, isfinite
from operator import itemgetter
from textwrap import fill
from typing import TYPE_CHECKING, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from netboard.analysis.extraction.attempts import MODERN, PAPER
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.statistics.estimates import Estimate, Range, mean_interval, t_interval
from netboard.analysis.topics.figure import (
    Drawn,
    draw_joined,
    draw_mean,
    due_count,
    handles,
    look_of,
    new_mosaic,
    pictured,
)
from netboard.analysis.topics.groups import CLASSES, Condition, conditions, counted, estimated, excluded
from netboard.analysis.topics.result import Result, TopicResults, cached
from netboard.analysis.topics.units import read_in
from netboard.base.config import SIDES
from netboard.base.looks import PRINT_SMALL
from netboard.base.tables.declared import require
from netboard.base.tables.outcomes import OUTCOMES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Of = Literal["trial", "movement", "attempt"]
Family = Literal["performance", "coordination", "forces"]

PLACE = ["condition", "dyad", "performer"]

_UNITS = {field.name: field.unit for group in (*PAPER, *MODERN) for field in group.fields}
"""Units of the measures of an attempt, which are columns of the table of trials."""

_OF_HANDS = {field.name for group in (*PAPER, *MODERN) if group.of_hands for field in group.fields}

OF_THE_BALL = (
    "not identifiable from recorded hands: it depends on the ball, and people correct a ball that rolls otherwise; "
    "a condition with the environment's force, an unrelated force, or a still or robot partner would show it"
)
"""Reason why measures of the ball have no computed control."""


@dataclass(frozen=True, slots=True)
class Measure:
    """A measure.

    Attributes
    ----------
    of : {"trial", "movement", "attempt"}
        Unit of a value: trials that count, cooperative movements in them, or attempts that succeeded or fell.
    within : {"real", "positive", "share", "balance"}
        Range of its values, in which all its confidence intervals stay (`mean_interval`).
    values : callable
        Function of these rows; returns the value of each, NaN for none [its unit].
    weights : callable or None
        Function of the rows; returns the weight of each in a performer's mean. None: equal weights.
    level : callable or None
        Function of a performer's values in a condition; returns one number [its unit]. None: their mean.
    compared : bool
        Whether conditions are compared in this measure. If not, a difference says nothing about performance.
    uncontrolled : str
        Reason why no control is computed from recorded hands; empty if one is (`netboard.analysis.topics.controls`).
    note : str
        What figures and tables say of its interpretation.
    """

    name: str
    unit: str
    family: Family
    of: Of
    within: Range
    values: Callable[[pd.DataFrame], ArrayLike]
    ratio: bool = False
    weights: Callable[[pd.DataFrame], ArrayLike] | None = None
    level: Callable[[pd.Series], float] | None = None
    compared: bool = True
    uncontrolled: str = ""
    note: str = ""

    @property
    def of_difference(self) -> Range:
        """Range of the difference of two values: from -1 to 1 for shares, any number for others."""
        return "balance" if self.within == "share" else "real"


def _share(name: str, rows: pd.DataFrame) -> ArrayLike:
    """Return a class's share of the time of trials."""
    whole = _known_time(rows)
    return np.where(whole > 0.0, rows[name] / np.where(whole > 0.0, whole, 1.0), np.nan)


def _known_time(rows: pd.DataFrame) -> NDArray[np.float64]:
    return np.asarray(rows[list(CLASSES)].to_numpy(float).sum(axis=1))


def _reaction(rows: pd.DataFrame) -> ArrayLike:
    """Return the first hand's reaction time; NaN if a hand moved already, anticipated, or a gap may hide it."""
    none = np.zeros(len(rows), bool)
    for side in SIDES:
        time, anticipated = rows[f"{side}_reaction"], rows[f"{side}_anticipated"]
        none |= ((anticipated == 1.0) | (time.isna() & anticipated.isna())).to_numpy()
    return np.where(none, np.nan, np.fmin(rows["left_reaction"], rows["right_reaction"]))


def _both(name: str, rows: pd.DataFrame) -> pd.Series:
    return rows[f"left_{name}"] + rows[f"right_{name}"]


def _exchanged(rows: pd.DataFrame) -> pd.Series:
    return rows["to_left"] + rows["to_right"]


def _fell(rows: pd.DataFrame) -> pd.Series:
    return rows["outcome"] == "fell"


def _of_trials(
    name: str,
    source: str,
    family: Family,
    within: Range,
    *,
    compared: bool = True,
    ratio: bool = False,
    note: str = "",
) -> Measure:
    """Return the measure of a column of the table of trials, in its unit."""
    if source not in _UNITS:
        raise RuntimeError(
            f'measure "{name}" in analysis/topics/measures.py: the table of trials has no column "{source}"; expected '
            "one of a Group in analysis/extraction/attempts.py"
        )
    unit, values = _UNITS[source], itemgetter(source)
    why = "" if source in _OF_HANDS else OF_THE_BALL
    made = Measure(name, unit, family, "trial", within, values, compared=compared, ratio=ratio, note=note)
    return replace(made, uncontrolled=why)


def _magnitude(name: str, rows: pd.DataFrame) -> pd.Series:
    return rows[name].abs()


MEASURES = (
    _of_trials("completion time", "completion", "performance", "positive", ratio=True, note="geometric mean"),
    _of_trials("velocity peaks", "peaks", "performance", "positive", note="NP, of the ball's speed"),
    _of_trials("SPARC", "sparc", "performance", "real"),
    _of_trials("LDLJ", "ldlj", "performance", "real"),
    Measure(
        "reaction time",
        "s",
        "performance",
        "trial",
        "positive",
        _reaction,
        note="of the hand that moves first (of two people, the shorter of two times); none in trials with anticipation",
    ),
    _of_trials("time in target", "in_target", "performance", "positive", note="before the hold"),
    _of_trials("overshoots", "overshoots", "performance", "positive"),
    _of_trials("largest overshoot", "overshoot", "performance", "positive", compared=False),
    Measure(
        "falls per attempt",
        "1",
        "performance",
        "attempt",
        "share",
        _fell,
        uncontrolled=OF_THE_BALL,
    ),
    *(Measure(f"{name} share", "1", "coordination", "trial", "share", partial(_share, name)) for name in CLASSES),
    Measure(
        "|delay at 20 %|",
        "s",
        "coordination",
        "movement",
        "positive",
        partial(_magnitude, "delay_20"),
        note="of cooperative movements",
    ),
    Measure("|lag|", "s", "coordination", "trial", "positive", partial(_magnitude, "lag"), note="by cross-correlation"),
    _of_trials("correlation of the hands", "correlation", "coordination", "balance", compared=False),
    Measure("effort", "N2 s", "forces", "trial", "positive", partial(_both, "effort")),
    _of_trials(
        "interaction force",
        "interaction",
        "forces",
        "positive",
        note="mean magnitude of the forces that cancel in the tilt: on a light board half the spring force",
    ),
    Measure("exchanged energy", "J", "forces", "trial", "positive", _exchanged),
    *(
        Measure(f"work {kind}", "J", "forces", "trial", "positive", partial(_both, kind), compared=False, note=note)
        for kind, note in (("given", "of both hands on the coupling"), ("received", "by both hands from the coupling"))
    ),
    *(
        _of_trials(f"power, {side}", f"{side}_power", "forces", "real", compared=False, note=note)
        for side, note in ((side, f"mean, of the {side} hand on the coupling") for side in SIDES)
    ),
    _of_trials(
        "force share, right",
        "force_share",
        "forces",
        "share",
        compared=False,
        note="of the right hand, without static support: on a light board always one half",
    ),
)


require("compared MEASURES in analysis/topics/measures.py", [one.name for one in MEASURES if one.compared], OUTCOMES)


def rows_of(study: StudyData, of: Of) -> pd.DataFrame:
    """Return the rows with a value: trials that count, their cooperative movements, or attempts.

    Attempts are those that succeeded or fell and are not excluded.
    """
    if of == "trial":
        return counted(study)
    if of == "movement":
        return study.movements[(study.movements["counts"] == 1) & (study.movements["cooperative"] == 1)]
    return study.trials[~excluded(study) & study.trials["outcome"].isin(["success", "fell"])]


def levels(study: StudyData, measure: Measure) -> pd.DataFrame:
    """Return the level of each dyad in each condition (a ratio measure's logarithm), and its number of ``rows``."""
    performers = levels_of_performers(study, measure)
    return performers.groupby(["condition", "dyad"], as_index=False).agg(level=("level", "mean"), rows=("rows", "sum"))


def levels_of_performers(study: StudyData, measure: Measure, rows: pd.DataFrame | None = None) -> pd.DataFrame:
    """Return the level of each performer in each condition, as `levels` those of dyads, from its `rows_of` by default.

    A setting decides whether trials or seconds have equal weight in shares.
    """
    rows = rows_of(study, measure.of) if rows is None else rows
    values = np.asarray(measure.values(rows), dtype=float)
    if measure.ratio:
        values = np.log(np.where(values > 0.0, values, np.nan))
    weights = np.ones(len(rows)) if measure.weights is None else np.asarray(measure.weights(rows), dtype=float)
    table = rows[PLACE].assign(value=values, sum=values * weights, weight=weights, rows=1)[np.isfinite(values)]
    performers = table.groupby(PLACE, as_index=False)
    if measure.level is not None:
        return performers.agg(level=("value", measure.level), rows=("rows", "sum"))
    sums = performers[["sum", "weight", "rows"]].sum()
    return sums.assign(level=sums["sum"] / sums["weight"])


def measures_of(study: StudyData) -> tuple[Measure, ...]:
    """Return `MEASURES`; with the reading ``summaries.shares = "time"``, shares are weighted by time."""
    if study.readings.summaries.shares == "trials":
        return MEASURES
    shares = {f"{name} share" for name in CLASSES}
    return tuple(replace(one, weights=_known_time) if one.name in shares else one for one in MEASURES)


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """A measure in a condition: the levels of the dyads, and their mean with its t interval [unit of the measure].

    For a ratio measure, geometric means, and the mean computed on the logarithm.
    """

    measure: Measure
    condition: Condition
    dyads: tuple[str, ...]
    values: NDArray[np.float64]
    rows: int
    mean: Estimate


def levels_of(study: StudyData, measures: Iterable[Measure]) -> tuple[Levels, ...]:
    """Return the levels of measures, with their means, in every condition that has values, by measure first."""
    found = []
    for measure in measures:
        table = levels(study, measure)
        for condition in conditions(study):
            own = table[table["condition"] == condition.name]
            if not len(own):
                continue
            values, rows = own["level"].to_numpy(), int(own["rows"].sum())
            mean = exponential(t_interval(values)) if measure.ratio else _mean(measure, values, rows)
            values = np.exp(values) if measure.ratio else values
            found.append(Levels(measure, condition, tuple(own["dyad"]), values, rows, mean))
    return tuple(found)


def _mean(measure: Measure, values: NDArray[np.float64], rows: int) -> Estimate:
    """Return the mean over dyads; a share of attempts has no more information than the attempts."""
    return mean_interval(values, measure.within, events=rows if measure.of == "attempt" else inf)


@cached
def overview(study: StudyData) -> TopicResults[Levels]:
    """Return the level of every measure in every condition."""
    return TopicResults.of(levels_of(study, measures_of(study)), _results)


def _results(one: Levels) -> Iterator[Result]:
    """Yield the mean of a measure in a condition, with the number of its values."""
    note = "; ".join(filter(None, (one.measure.note, f"of {one.rows} {one.measure.of}s")))
    yield estimated("measures", one.measure.name, one.condition.label, one.mean, one.measure.unit, note)


def exponential(estimate: Estimate) -> Estimate:
    """Transform an estimate back from its logarithm; the method of its interval says so."""
    value, low, high = (float(np.exp(x)) for x in (estimate.value, estimate.low, estimate.high))
    return replace(estimate, value=value, low=low, high=high, method=f"{estimate.method} on the log scale")


Where = Literal["outside upper center", "outside lower center"]

COLUMNS = 4
"""Panels in a row [1]."""

TEAM_GAP = 0.5
"""Extra distance between the conditions of two teams [1]."""


BESIDE = 0.22
"""Distance from a mean to its dyads [1]."""


_WIDE = 100
"""Characters of labels in a row of a legend [1]."""

_TITLE = 20
"""Characters in a line of a panel's title [1]."""


@pictured("All measures")
def picture(study: StudyData) -> Drawn:
    """Draw all measures."""
    found = overview(study).parts
    if not found:
        return "No trial is included, so there are no measures."
    names = [measure.name for measure in MEASURES if any(one.measure.name == measure.name for one in found)]
    shown = tuple(dict.fromkeys(one.condition for one in found))
    figure, axes = grid(names, 1.35)
    for name in names:
        _panel(axes[name], [one for one in found if one.measure.name == name], places(shown))
    legend(figure, shown)
    return figure, _caption(found, shown)


def grid(names: Sequence[str], height: float, columns: int = COLUMNS) -> "tuple[Figure, dict[str, Axes]]":
    """Return a new figure with many small panels."""
    rows = [list(names[k : k + columns]) for k in range(0, len(names), columns)]
    rows[-1] += ["."] * (columns - len(rows[-1])) if len(rows) > 1 else []
    return new_mosaic(0.35 + height * len(rows), rows)


def places(shown: Sequence[Condition]) -> dict[str, float]:
    """Return positions of conditions, with larger gaps between teams."""
    teams = list(dict.fromkeys(one.team for one in shown))
    return {one.name: k + TEAM_GAP * teams.index(one.team) for k, one in enumerate(shown)}


def legend(figure: "Figure", shown: Sequence[Condition], where: Where = "outside upper center") -> None:
    """Draw a legend of the conditions beside the panels."""
    labels = [one.label for one in shown]
    figure.legend(
        handles([look_of(one) for one in shown]), labels, loc=where, ncols=_columns(labels), handletextpad=0.2
    )


def _columns(labels: Sequence[str]) -> int:
    """Return the number of legend columns that fit in a row [1]."""
    most = 4 if len(labels) <= 4 else 3
    return max(1, min(most, _WIDE // max(map(len, labels), default=1)))


def draw_levels(axes: "Axes", found: Sequence[Levels], at: dict[str, float], scale: float) -> None:
    """Draw each dyad, joined within a team, and beside it the mean, in every condition, times `scale`."""
    values = [(one.condition, dict(zip(one.dyads, one.values, strict=True))) for one in found]
    draw_joined(axes, values, {name: place + BESIDE for name, place in at.items()}, scale)
    for one in found:
        draw_mean(axes, at[one.condition.name], one.mean, look_of(one.condition), one.condition.name, scale=scale)


def _panel(axes: "Axes", found: Sequence[Levels], at: dict[str, float]) -> None:
    """Draw a measure, with dyads joined within a team."""
    measure = found[0].measure
    unit = read_in(measure.unit, measure.name)
    draw_levels(axes, found, at, unit.scale)
    axes.margins(y=0.08)
    if measure.within == "share":
        _widen(axes, NARROWEST * unit.scale)
    axes.set_title(fill(measure.name, _TITLE), loc="left", fontsize=PRINT_SMALL)
    axes.set_ylabel(unit.in_brackets, fontsize=PRINT_SMALL)
    axes.tick_params(axis="y", labelsize=6.5)
    axes.set_xlim(-0.6, max(at.values()) + 0.6)
    axes.set_xticks([])


NARROWEST = 0.02
"""Smallest range of an axis of shares: on a narrower one, no difference would look like a large one [1]."""


def _widen(axes: "Axes", least: float) -> None:
    """Widen the vertical axis, about its middle, to a smallest range."""
    low, high = axes.get_ylim()
    if high - low < least:
        middle = (low + high) / 2
        axes.set_ylim(middle - least / 2, middle + least / 2)


def _caption(found: Sequence[Levels], shown: Sequence[Condition]) -> str:
    known = [
        (condition.label, max(one.mean.n for one in found if one.condition == condition), "dyad") for condition in shown
    ]
    fewer = [one for one in found if one.mean.n < max(other.mean.n for other in found)]
    less = f" Fewer dyads have: {', '.join(dict.fromkeys(one.measure.name for one in fewer))}." if fewer else ""
    return (
        "All measures in each condition. Large points: means over dyads with 95 % confidence intervals, whose method "
        f"follows from the range of the measure ({_methods(found)}); small points: dyads, joined. Completion times: "
        "geometric means; SPARC and LDLJ: closer to zero is smoother; reaction times: of the hand that moves first (of "
        "two participants, the shorter of two times). On a light board, mechanics alone makes the share of forces one "
        f"half, and the interaction force half the spring force. {due_count(known)}{less}"
    )


def _methods(found: Sequence[Levels]) -> str:
    """Return each method of a confidence interval with the measures that have it."""
    named: dict[str, dict[str, None]] = {}
    for one in found:
        if isfinite(one.mean.low):
            named.setdefault(one.mean.method, {})[one.measure.name] = None
    return "; ".join(f"{method}: {', '.join(names)}" for method, names in named.items()) or "none from one dyad"
