"""The numbers that the paper reports about a study, by name, so that two settings of the analysis can be compared.

`netboard.analysis.topics` computes most of them. This module adds the means of the strategy, the width and height of
the ellipses, and the ratio of the last group's variances to the first group's.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import nan

from evidence.analysis.open_questions import Family
from netboard.analysis.extraction.details import THRESHOLDS
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.topics.classes import classes
from netboard.analysis.topics.delay import delay
from netboard.analysis.topics.dyads import dyads
from netboard.analysis.topics.groups import CLASSES, conditions, counted, of_dyads, of_performers
from netboard.analysis.topics.learning import learning
from netboard.analysis.topics.strategy import EVERYBODY, TeamStrategy, strategy

QUANTITIES: dict[str, tuple[Family, str]] = {"completion": ("time", "completion time"), "peaks": ("peaks", "peaks")}
"""Family and name of the quantity in a column of the table of trials."""


@dataclass(frozen=True, slots=True)
class Number:
    """A reported number.

    - `value`: the number; NaN if there is none [`unit`].
    - `kind`: "mean", "spread" (standard deviation or confidence interval) or "count" (of dyads).
    """

    family: Family
    value: float
    unit: str
    kind: str = "mean"


Numbers = dict[str, Number]
"""Reported numbers by name [SI]."""


def numbers(study: StudyData, default: Numbers | None = None) -> Numbers:
    """Compute all reported numbers, in an order that depends only on the conditions of the study.

    - `default`: numbers with the default settings; those of a condition that has no trial become NaN.
    """
    found: Numbers = {name: replace(one, value=nan) for name, one in (default or {}).items()}
    for part in (_learning, _dyads, _shares, _delays, _strategies, _spreads):
        found |= dict(part(study))
    return found


def _learning(study: StudyData) -> Iterator[tuple[str, Number]]:
    """Yield means and standard deviations of the first and the last trials."""
    for team in learning(study).parts:
        for course in team.courses:
            for when, found in (("first", course.ends.first), ("last", course.ends.last)):
                family, quantity = QUANTITIES[course.quantity.column]
                name = f"{quantity}, {team.team}, {when}"
                yield name, Number(family, found.mean, course.quantity.unit)
                yield f"SD of {name}", Number(family, found.deviation, course.quantity.unit, "spread")


def _dyads(study: StudyData) -> Iterator[tuple[str, Number]]:
    """Yield the number of dyads that are better than the mean of their two participants."""
    for one in dyads(study).parts:
        name = "faster" if one.quantity.column == "completion" else "smoother"
        value = float(one.better) if one.known else nan
        yield (
            f"dyads {name} than their mean, {one.condition.haptics}",
            Number(QUANTITIES[one.quantity.column][0], value, "1", "count"),
        )


def _shares(study: StudyData) -> Iterator[tuple[str, Number]]:
    for one in classes(study).parts:
        for name, mean in zip(CLASSES, one.means, strict=True):
            yield f"{name} share, {one.condition.label}", Number("shares", mean.value, "1")


def _delays(study: StudyData) -> Iterator[tuple[str, Number]]:
    """Yield the delays at each threshold, and half the width of their confidence intervals."""
    for one in delay(study).parts:
        for percent, mean in zip(THRESHOLDS, one.as_set.means, strict=True):
            name = f"delay at {percent} %, {one.condition.label}"
            yield name, Number("delay", mean.value, "s")
            yield (
                f"half-width of the confidence interval of the {name}",
                Number("delay", (mean.high - mean.low) / 2, "s", "spread"),
            )


def _strategies(study: StudyData) -> Iterator[tuple[str, Number]]:
    """Yield mean distance and velocity at the first braking movement."""
    trials = counted(study)
    for one in conditions(study):
        of_condition = trials[trials["condition"] == one.name]
        for quantity, unit in (("distance", "m"), ("velocity", "m/s")):
            mean = float(of_dyads(of_performers(of_condition, f"braking_{quantity}")).mean())
            yield f"braking {quantity}, {one.label}", Number("strategy", mean, unit)


def _spreads(study: StudyData) -> Iterator[tuple[str, Number]]:
    """Yield the ellipses of the first and last groups of trials, and the ratios of their variances."""
    standardised = study.readings.summaries.scaling == "standardised"
    for team in strategy(study).parts:
        if team.team == EVERYBODY:
            continue
        for when, one in (("first", team.ellipses[0]), ("last", team.ellipses[-1])):
            group = f"{team.team}, {when} group"
            yield f"ellipse's width, {group}", Number("strategy", one.width, "SD" if standardised else "m, m/s")
            yield f"ellipse's height, {group}", Number("strategy", one.height, "SD" if standardised else "m, m/s")
            yield f"ellipse's area, {group}", Number("strategy", one.area, "m2/s")
        yield from _ratios(team)


def _ratios(team: TeamStrategy) -> Iterator[tuple[str, Number]]:
    """Yield the ratio of the last group's variances to the first group's; a generalised variance counts for both."""
    each = {spread.quantity: spread.means for spread in team.spreads}
    for quantity in ("distance", "velocity"):
        means = each.get(f"variance of {quantity}", team.spreads[0].means)
        value = means[-1].value / means[0].value if means[0].value > 0 else nan
        yield f"variance of {quantity}, last group over first, {team.team}", Number("strategy", value, "1")


# --- statements of the paper ---------------------------------------------------------------------------------------

Gap = Callable[[Mapping[str, float]], float]


@dataclass(frozen=True, slots=True)
class Statement:
    """A statement of the paper about the numbers.

    - `gap`: takes the values by name; returns a difference that is positive if the statement holds [of the numbers].
    """

    text: str
    gap: Gap


def _less(smaller: str, larger: str) -> Gap:
    return lambda found: found[larger] - found[smaller]


def _falls(name: str, window: str = "") -> Gap:
    return _less(f"{name}, last{window}", f"{name}, first{window}")


def _with_haptics(name: str, *, more: bool) -> Gap:
    off, on = f"{name}, haptics off", f"{name}, haptics on"
    return _less(off, on) if more else _less(on, off)


STATEMENTS = (
    Statement("alone, completion times fall from the first to the last trials", _falls("completion time, bimanual")),
    Statement("together, completion times fall", _falls("completion time, dyadic")),
    Statement("alone, peaks become fewer", _falls("peaks, bimanual")),
    Statement("together, peaks become fewer", _falls("peaks, dyadic")),
    Statement(
        "more dyads are faster than their mean with haptics than without",
        _with_haptics("dyads faster than their mean", more=True),
    ),
    Statement(
        "more dyads are smoother than their mean with haptics than without",
        _with_haptics("dyads smoother than their mean", more=True),
    ),
    Statement("with haptics, dyads move more cooperatively", _with_haptics("cooperative share, dyadic", more=True)),
    Statement("with haptics, dyads have less single movement", _with_haptics("single share, dyadic", more=False)),
    Statement(
        "with haptics, dyads have less competitive movement", _with_haptics("competitive share, dyadic", more=False)
    ),
    Statement(
        "without haptics, delays of dyads are longer than of one person (20 %)",
        _less("delay at 20 %, bimanual, haptics off", "delay at 20 %, dyadic, haptics off"),
    ),
    Statement("with haptics, delays of dyads are shorter (20 %)", _with_haptics("delay at 20 %, dyadic", more=False)),
    Statement(
        "without haptics, delays of dyads grow from 10 to 40 %",
        _less("delay at 10 %, dyadic, haptics off", "delay at 40 %, dyadic, haptics off"),
    ),
    Statement("alone, ellipses shrink", _falls("ellipse's area, bimanual", " group")),
    Statement("together, ellipses shrink", _falls("ellipse's area, dyadic", " group")),
    Statement(
        "together, the variance of the distance falls",
        lambda found: 1 - found["variance of distance, last group over first, dyadic"],
    ),
)
"""The testable statements of the paper about these numbers."""
