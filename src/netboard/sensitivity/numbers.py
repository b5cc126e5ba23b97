"""The numbers that the paper reports, of a study, under a name each, so that two readings can be compared.

Means are those of `netboard.measuring.readings.Summaries`. First and last trials are pooled over everybody and both
haptic conditions, as the paper's; shares, delays and strategies are means of people or dyads, then of dyads.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.cooperation import PORTIONS
from netboard.analysis.ellipses import convergence, groups_of
from netboard.analysis.movements import mean_shares
from netboard.analysis.performance import better_dyads, level, relative_performance, summarise, trial_times
from netboard.analysis.statistics import t_interval
from netboard.measuring.study import Study
from netboard.sensitivity.readings import Family

CLASSES = ("cooperative", "competitive", "single", "still")
TEAMS = ("bimanual", "dyadic")
FORCES = ("none", "full")
PERCENT = tuple(round(100 * portion) for portion in PORTIONS)


@dataclass(frozen=True, slots=True)
class Number:
    """A number that is reported.

    Attributes
    ----------
    family : str
        Which measure it is made of.
    value : float
        The number; NaN where there is none [its unit].
    unit : str
        Its SI unit.
    """

    family: Family
    value: float
    unit: str


Numbers = dict[str, Number]
"""By name [SI]."""


def numbers(study: Study) -> Numbers:
    """Compute all of them.

    Parameters
    ----------
    study : Study
        The study.

    Returns
    -------
    dict of Number
        In a fixed order; the names are the same for studies with the same conditions.
    """
    trials = _trials(study)
    found: Numbers = {}
    for parts in (_learning, _shares, _delays, _strategies, _spreads, _better):
        found |= dict(parts(study, trials))
    return found


def _trials(study: Study) -> pd.DataFrame:
    """Trials that count, of people and dyads with a free partner, with the time that is set and their series."""
    rows = study.counted[study.counted["condition"].isin([f"{team}, {force}" for team in TEAMS for force in FORCES])]
    labels = ["dyad", "performer", "configuration"]
    if study.readings.summaries.numbering == "condition":
        labels.append("condition")
    rows = rows.assign(series=rows.groupby(labels, sort=False).ngroup())
    if study.readings.summaries.time == "all_attempts":
        rows["completion"] = _all_attempts(study.trials, rows)
    return rows


def _all_attempts(attempts: pd.DataFrame, rows: pd.DataFrame) -> NDArray[np.float64]:
    """Times of trials with those of their failed attempts."""
    times: dict[tuple[str, int], float] = {}
    for recording, own in attempts.groupby("recording", sort=False):
        completions = np.where(own["outcome"] == "success", own["completion"], np.nan)
        columns = (own["trial"].to_numpy(), own["duration"].to_numpy(), completions)
        for trial, time in zip(*trial_times(*columns, of="all_attempts"), strict=True):
            times[recording, int(trial)] = time
    return np.array([times[place] for place in zip(rows["recording"], rows["trial"], strict=True)])


def _learning(study: Study, trials: pd.DataFrame) -> Iterator[tuple[str, Number]]:
    """First and last trials."""
    how = study.readings.summaries
    families: tuple[tuple[Family, str, str, str], ...] = (
        ("time", "completion", "completion time", "s"),
        ("peaks", "peaks", "peaks", "1"),
    )
    for family, column, name, unit in families:
        for team, own in trials.groupby("configuration"):
            length = own.groupby("series")["order"].transform("max")
            parts = {"first": own[own["order"] <= how.ends], "last": own[own["order"] > length - how.ends]}
            for when, rows in parts.items():
                people = rows["performer"].to_numpy() if how.spread == "people" else None
                found = summarise(rows[column].to_numpy(np.float64), people)
                yield f"{name}, {team}, {when}", Number(family, found.mean, unit)
                yield f"SD of {name}, {team}, {when}", Number(family, found.deviation, unit)


def _shares(study: Study, trials: pd.DataFrame) -> Iterator[tuple[str, Number]]:
    """Shares of the classes of movement."""
    for condition, own in trials.groupby("condition"):
        people = np.unique(own["performer"].to_numpy(str), return_inverse=True)[1]
        found = mean_shares(own[list(CLASSES)].to_numpy(np.float64), people, of=study.readings.summaries.shares)
        for kind, share in zip(CLASSES, found, strict=True):
            yield f"{kind} share, {condition}", Number("shares", float(share), "1")


def _delays(study: Study, trials: pd.DataFrame) -> Iterator[tuple[str, Number]]:
    """Delays at the thresholds, and half the width of their intervals."""
    how = study.readings.summaries
    known = trials["condition"].unique()
    moves = study.movements[(study.movements["counts"] == 1) & (study.movements["cooperative"] == 1)]
    for condition, own in moves[moves["condition"].isin(known)].groupby("condition"):
        for percent in PERCENT:
            delay = own[f"delay_{percent}"]
            values = delay.abs() if how.delay == "absolute" else delay
            if how.intervals == "movements":
                each = values.dropna()
            else:
                each = values.groupby([own["dyad"], own["performer"]]).mean().groupby(level="dyad").mean().dropna()
            found = t_interval(each.to_numpy(np.float64), unit="one")
            yield f"delay at {percent} %, {condition}", Number("delay", found.value, "s")
            half = (found.high - found.low) / 2
            yield f"half the interval of the delay at {percent} %, {condition}", Number("delay", half, "s")


def _strategies(study: Study, trials: pd.DataFrame) -> Iterator[tuple[str, Number]]:
    """Distance and velocity at the first braking movement."""
    for condition, own in trials.groupby("condition"):
        for quantity, unit in (("distance", "m"), ("velocity", "m/s")):
            means = own.groupby(["dyad", "performer"])[f"braking_{quantity}"].mean()
            value = float(means.groupby(level="dyad").mean().mean())
            yield f"braking {quantity}, {condition}", Number("strategy", value, unit)


def _spreads(study: Study, trials: pd.DataFrame) -> Iterator[tuple[str, Number]]:
    """Ellipses of everybody's first and last groups, and how a person's or dyad's variance changes."""
    how = study.readings.summaries
    for team, own in trials.groupby("configuration"):
        own = own[own["braking_distance"].notna()]  # noqa: PLW2901
        groups, points = groups_of(own["order"].to_numpy(), how.group), _points(own)
        ends = (0, int(groups.max(initial=0)))
        chosen = np.isin(groups, ends)
        found = convergence(points[chosen], groups[chosen], extent=how.extent, scaling=how.scaling)
        for when, one in zip(("first", "last"), found.ellipses, strict=False):
            unit = "1" if how.scaling == "standardised" else "m or m/s"
            yield f"ellipse's width, {team}, {when} group", Number("strategy", one.width, unit)
            yield f"ellipse's height, {team}, {when} group", Number("strategy", one.height, unit)
            yield f"ellipse's area, {team}, {when} group", Number("strategy", one.area, "m2/s")
        ratios = np.array(
            [
                _shrinkage(_points(part), groups[own["series"] == name], how.variance, ends)
                for name, part in own.groupby("series")
            ]
        )
        for column, quantity in enumerate(("distance", "velocity")):
            value = float(np.exp(np.nanmean(np.log(ratios[:, column]))))
            yield f"variance of {quantity}, last over first, {team}", Number("strategy", value, "1")


def _points(rows: pd.DataFrame) -> NDArray[np.float64]:
    return rows[["braking_distance", "braking_velocity"]].to_numpy(np.float64)


def _shrinkage(
    points: NDArray[np.float64], groups: NDArray[np.int64], variance: str, ends: tuple[int, int]
) -> NDArray[np.float64]:
    """Variances in the last group over those in the first one; the generalised one has no parts and stands for both."""
    spread = convergence(points, groups)
    places = [np.flatnonzero(spread.groups == end) for end in ends]
    if not all(place.size for place in places):
        return np.full(2, np.nan)
    values = (
        np.stack([spread.generalised, spread.generalised], axis=1) if variance == "generalised" else spread.variance
    )
    first, last = (values[place[0]] for place in places)
    return np.asarray(np.divide(last, first, out=np.full(2, np.nan), where=(first > 0) & (last > 0)))


def _better(study: Study, trials: pd.DataFrame) -> Iterator[tuple[str, Number]]:
    """How many dyads do better than the mean of their two participants."""
    columns: tuple[tuple[Family, str, str], ...] = (("time", "completion", "faster"), ("peaks", "peaks", "smoother"))
    for family, column, name in columns:
        for force in FORCES:
            own = trials[trials["force"] == force]
            pairs = []
            for dyad, rows in own.groupby("dyad"):
                alone = rows[rows["configuration"] == "bimanual"]
                levels = [_level(study, part, column) for _, part in alone.groupby("performer")]
                together = _level(study, rows[rows["configuration"] == "dyadic"], column)
                if len(levels) == 2:
                    pairs.append(relative_performance(levels[0], levels[1], together))
                del dyad
            yield f"dyads {name} than their mean, {force}", Number(family, float(better_dyads(pairs)[0]), "1")


def _level(study: Study, rows: pd.DataFrame, column: str) -> float:
    return level(rows.sort_values(["block", "trial"])[column].to_numpy(np.float64), of=study.readings.summaries.level)


# --- what follows from them ---------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Statement:
    """Something that the paper says.

    Attributes
    ----------
    words : str
        What.
    gap : callable
        Takes the values by name; gives a difference that is positive if it is so [of the numbers in it].
    """

    words: str
    gap: Callable[[Mapping[str, float]], float]


def _falls(name: str) -> Callable[[Mapping[str, float]], float]:
    return lambda found: found[f"{name}, first"] - found[f"{name}, last"]


def _less(smaller: str, larger: str) -> Callable[[Mapping[str, float]], float]:
    return lambda found: found[larger] - found[smaller]


def _shrinks(name: str) -> Callable[[Mapping[str, float]], float]:
    return lambda found: found[f"{name}, first group"] - found[f"{name}, last group"]


STATEMENTS = (
    Statement("alone, completion times fall from the first to the last trials", _falls("completion time, bimanual")),
    Statement("together, completion times fall", _falls("completion time, dyadic")),
    Statement("alone, peaks become fewer", _falls("peaks, bimanual")),
    Statement("together, peaks become fewer", _falls("peaks, dyadic")),
    Statement(
        "more dyads are faster than their mean with haptics than without",
        _less("dyads faster than their mean, none", "dyads faster than their mean, full"),
    ),
    Statement(
        "more dyads are smoother than their mean with haptics than without",
        _less("dyads smoother than their mean, none", "dyads smoother than their mean, full"),
    ),
    Statement(
        "with haptics, dyads move more cooperatively",
        _less("cooperative share, dyadic, none", "cooperative share, dyadic, full"),
    ),
    Statement(
        "with haptics, dyads have less single movement",
        _less("single share, dyadic, full", "single share, dyadic, none"),
    ),
    Statement(
        "with haptics, dyads have less competitive movement",
        _less("competitive share, dyadic, full", "competitive share, dyadic, none"),
    ),
    Statement(
        "without haptics, delays of dyads are longer than of one person (20 %)",
        _less("delay at 20 %, bimanual, none", "delay at 20 %, dyadic, none"),
    ),
    Statement(
        "with haptics, delays of dyads are shorter (20 %)",
        _less("delay at 20 %, dyadic, full", "delay at 20 %, dyadic, none"),
    ),
    Statement(
        "without haptics, delays of dyads grow from 10 to 40 %",
        _less("delay at 10 %, dyadic, none", "delay at 40 %, dyadic, none"),
    ),
    Statement("alone, ellipses shrink", _shrinks("ellipse's area, bimanual")),
    Statement("together, ellipses shrink", _shrinks("ellipse's area, dyadic")),
    Statement(
        "together, the variance of the distance falls",
        lambda found: 1 - found["variance of distance, last over first, dyadic"],
    ),
)
"""What the paper says of these numbers, as far as it can come out one way or the other."""
