"""Dyads compared with their partners alone (the paper's figure 3): completion time and number of velocity peaks.

A participant's level is that of the bimanual trials with the same haptic condition as the dyadic trials. The gain is
the mean of the two participants minus the dyad. If all dyadic blocks follow bimanual ones, the gain includes practice;
the contrast between two haptic conditions does not.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import nan

import numpy as np
import pandas as pd

from netboard.analysis.extraction.study import Study
from netboard.analysis.measures.performance import (
    RelativePerformance,
    better_dyads,
    level,
    relative_performance,
)
from netboard.analysis.results.groups import (
    QUANTITIES,
    Condition,
    Quantity,
    conditions,
    counted,
    estimate,
    estimated,
)
from netboard.analysis.results.result import Result
from netboard.analysis.statistics.estimates import Estimate
from netboard.analysis.statistics.exact_tests import Test, sign_test

TOPIC = "dyads"


@dataclass(frozen=True, slots=True)
class Point:
    """A participant relative to the partner and the dyad."""

    dyad: str
    participant: str
    relative: RelativePerformance


@dataclass(frozen=True, slots=True)
class Comparison:
    """All dyads in one haptic condition and one quantity.

    Attributes
    ----------
    points : tuple of Point
        Two points for each dyad with dyadic trials and bimanual trials of both participants.
    gain : Estimate
        Mean gain over dyads: mean of the participants minus the dyad.
    """

    quantity: Quantity
    condition: Condition
    points: tuple[Point, ...]
    gain: Estimate
    better: int
    known: int
    test: Test

    @property
    def gains(self) -> pd.Series:
        """Gain of each dyad [as the quantity]."""
        return pd.Series({point.dyad: point.relative.gain for point in self.points}, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Dyads:
    """Dyads compared with their partners.

    Attributes
    ----------
    comparisons : tuple of Comparison
        One for each quantity and each haptic condition of the dyads.
    """

    comparisons: tuple[Comparison, ...]
    results: tuple[Result, ...]


def dyads(study: Study) -> Dyads:
    """Compare dyads with their participants."""
    trials, every = counted(study), conditions(study)
    alone = {(one.force, one.among): one.name for one in every if one.configuration == "bimanual"}
    found = []
    for quantity in QUANTITIES:
        levels = {
            name: rows.groupby(["dyad", "performer"], sort=True)[quantity.column].apply(
                lambda values: level(values.to_numpy(np.float64), of=study.readings.summaries.level)
            )
            for name, rows in trials.groupby("condition")
        }
        for one in every:
            if one.configuration == "dyadic" and not one.partner:
                points = _points(levels, one.name, alone.get((one.force, one.among), ""))
                found.append(_compare(quantity, one, points))
    return Dyads(tuple(found), tuple(result for one in found for result in _results(one)))


def _points(levels: Mapping[str, pd.Series], together: str, alone: str) -> Iterator[Point]:
    """Yield the points of dyads with all three levels."""
    if together not in levels or alone not in levels:
        return
    for (dyad, _), both in levels[together].items():
        own = levels[alone][levels[alone].index.get_level_values("dyad") == dyad].droplevel("dyad")
        if len(own) == 2 and np.isfinite([both, *own]).all():
            (first, of_first), (second, of_second) = own.items()
            yield Point(dyad, first, relative_performance(of_first, of_second, both))
            yield Point(dyad, second, relative_performance(of_second, of_first, both))


def _compare(quantity: Quantity, condition: Condition, points: Iterator[Point]) -> Comparison:
    kept = tuple(points)
    gains = pd.Series({point.dyad: point.relative.gain for point in kept}, dtype=np.float64)
    better, known = better_dyads([point.relative for point in kept[::2]])
    return Comparison(quantity, condition, kept, estimate(gains), better, known, sign_test(gains.to_numpy()))


def _results(found: Comparison) -> Iterator[Result]:
    quantity, group = found.quantity, found.condition.felt
    note = "" if found.known else "no dyad performed in both configurations with this force"
    yield estimated(TOPIC, f"{quantity.name}: mean of the two less dyad", group, found.gain, quantity.unit, note)
    if found.known:
        dyads = "1 dyad" if found.test.n == 1 else f"{found.test.n} dyads"
        tested = f"p = {found.test.p:.3g}; {dyads} can give no p below {found.test.least_p:.3g}"
        note = f"sign test: {tested if found.test.n else 'no gain differs from zero'}"
    value = float(found.better) if found.known else nan
    name = f"{quantity.name}: dyads better than the mean of the two"
    yield Result(TOPIC, name, group, value, nan, nan, "1", "", found.known, "dyad", note)
