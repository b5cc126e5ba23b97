"""Tables of the effects of disturbances on the measures of an attempt."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evidence.analysis.disturbances import DISTURBANCES
from evidence.analysis.remeasuring import Remeasured
from netboard.benchmarks.harness.results import ResultPart

MEASURES = (
    ("completion", "completion [ms]", 1e3),
    ("peaks", "peaks", 1.0),
    ("cooperative", "cooperative [%]", 100.0),
    ("still", "still [%]", 100.0),
    ("delay_10", "delay 10 % [ms]", 1e3),
    ("delay_40", "delay 40 % [ms]", 1e3),
    ("braking_distance", "braking distance [mm]", 1e3),
    ("braking_velocity", "braking velocity [mm/s]", 1e3),
    ("sparc", "SPARC", 1.0),
    ("ldlj", "LDLJ", 1.0),
)
"""Measures in the table: name, column heading, and factor to the unit."""

NEGLIGIBLE = 5e-4
"""Changes below this are shown as 0 [unit of the column]."""


@dataclass(frozen=True, slots=True)
class Shift:
    """Effect of a disturbance on a measure.

    - `bias`, `deviation`: mean and standard deviation of the attempts' differences [unit of the measure].
    - `count`: number of attempts with a value in both [1].
    - `lost`: number of attempts that lose their value [1].
    """

    bias: float
    deviation: float
    count: int
    lost: int

    @property
    def largest(self) -> float:
        """Larger of bias and deviation; 0 if too few attempts have a value."""
        return max(abs(self.bias), self.deviation) if self.count > 1 else 0.0


def shift(found: Sequence[Remeasured], number: int, name: str) -> Shift:
    """Compare each disturbed attempt with the same one undisturbed."""
    undisturbed = np.concatenate([one.undisturbed[number][name] for one in found])
    disturbed = np.concatenate([one.disturbed[number][name] for one in found])
    both = np.isfinite(undisturbed) & np.isfinite(disturbed)
    differences = (disturbed - undisturbed)[both]
    lost = int(np.count_nonzero(np.isfinite(undisturbed) & ~np.isfinite(disturbed)))
    if differences.size < 2:
        return Shift(math.nan, math.nan, int(differences.size), lost)
    return Shift(float(differences.mean()), float(differences.std(ddof=1)), int(differences.size), lost)


def disturbances_part(found: Sequence[Remeasured]) -> ResultPart:
    """Tabulate mean and standard deviation of the differences."""
    means = []
    for name, _, factor in MEASURES:
        undisturbed = np.concatenate([one.undisturbed[0][name] for one in found])
        means.append(f"{factor * np.nanmean(undisturbed):.3g}" if np.isfinite(undisturbed).any() else "none")
    part = ResultPart(
        "disturbances",
        "Effect of disturbances on an attempt's measures: mean (standard deviation); "
        "L: share of attempts without a value",
        ("disturbance", "size", *(label for _, label, _ in MEASURES)),
        [("undisturbed: mean", "", *means)],
    )
    for number, one in enumerate(DISTURBANCES):
        shifts = {name: shift(found, number, name) for name, _, _ in MEASURES}
        part.add(one.kind, one.size, *(_cell(shifts[name], factor) for name, _, factor in MEASURES))
        if one.kind.startswith("offset"):
            largest = max(shifts[name].largest * factor for name, _, factor in MEASURES)
            part.claim("an offset of a stylus changes no measure", largest < 1e-6, f"{largest:.2g} at most")
    for kind, name, sign, claim in (
        ("noise of the ball, peaks of any size", "peaks", 1, "noise of the ball adds peaks"),
        ("noise of the styluses", "still", -1, "noise of the styluses reduces stillness"),
    ):
        number = max(place for place, one in enumerate(DISTURBANCES) if one.kind == kind)
        bias = shift(found, number, name).bias
        part.claim(claim, sign * bias > 0, f"{bias:+.3g} at {DISTURBANCES[number].size}")
    return part


def _cell(one: Shift, factor: float) -> str:
    """Format bias and deviation; 0 if both are negligible."""
    lost = f" L {100 * one.lost / (one.count + one.lost):.2g} %" if one.lost else ""
    if one.count < 2:
        return f"all lost{lost}" if one.lost else "none"
    if factor * one.largest < NEGLIGIBLE:
        return f"0{lost}"
    bias, deviation = factor * one.bias, factor * one.deviation
    digits = 1 - math.floor(math.log10(factor * one.largest))
    return f"{bias:+.{max(digits, 0)}f} ({deviation:.{max(digits, 0)}f}){lost}"


def all_disturbances_part(found: Sequence[Remeasured]) -> ResultPart:
    """List the differences of all measures in SI units."""
    part = ResultPart(
        "disturbances-all",
        "Effect of disturbances on all measures, in SI units",
        "disturbance | size | settings | measure | mean | bias | SD | attempts | lost",
        on_screen=False,
    )
    for number, one in enumerate(DISTURBANCES):
        for name in found[0].undisturbed[number]:
            undisturbed = np.concatenate([each.undisturbed[number][name] for each in found])
            mean = float(np.nanmean(undisturbed)) if np.isfinite(undisturbed).any() else math.nan
            found_shift = shift(found, number, name)
            part.add(
                *(one.kind, one.size, " ".join(one.settings), name, mean),
                *(found_shift.bias, found_shift.deviation, found_shift.count, found_shift.lost),
            )
    return part
