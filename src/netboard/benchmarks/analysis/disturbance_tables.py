"""Effects of disturbances on the measures of an attempt, as tables; and filters as ratios of two polynomials."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from netboard.benchmarks.analysis.again import Fulfilled
from netboard.benchmarks.analysis.disturbances import DISTURBANCES
from netboard.benchmarks.harness.results import Part, Value, Verdict

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
"""Measures of an attempt that are shown, and the factor to the unit."""

NOTHING = 5e-4
"""Changes below this count as none [as shown]."""


@dataclass(frozen=True, slots=True)
class Shift:
    """Effect of a disturbance on a measure.

    - `bias`, `deviation`: mean and standard deviation of the differences of attempts [as the measure].
    """

    bias: float
    deviation: float
    count: int
    lost: int


def shift(found: Sequence[Fulfilled], number: int, name: str) -> Shift:
    """Compare each attempt with itself."""
    calm = np.concatenate([one.calm[number][name] for one in found])
    shaken = np.concatenate([one.disturbed[number][name] for one in found])
    both = np.isfinite(calm) & np.isfinite(shaken)
    differences = (shaken - calm)[both]
    lost = int(np.count_nonzero(np.isfinite(calm) & ~np.isfinite(shaken)))
    if differences.size < 2:
        return Shift(math.nan, math.nan, int(differences.size), lost)
    return Shift(float(differences.mean()), float(differences.std(ddof=1)), int(differences.size), lost)


def disturbances_part(found: Sequence[Fulfilled]) -> Part:
    """Show bias and spread of the differences."""
    means = []
    for name, _, factor in MEASURES:
        calm = np.concatenate([one.calm[0][name] for one in found])
        means.append(f"{factor * np.nanmean(calm):.3g}" if np.isfinite(calm).any() else "none")
    rows: list[tuple[Value, ...]] = [("undisturbed: mean", "", *means)]
    for number, one in enumerate(DISTURBANCES):
        cells = [_cell(shift(found, number, name), factor) for name, _, factor in MEASURES]
        rows.append((one.kind, one.size, *cells))
    columns = ("disturbance", "size", *(label for _, label, _ in MEASURES))
    title = "What disturbances add to an attempt's measures: mean (standard deviation); L: so many attempts lose it"
    return Part("disturbances", title, columns, rows, list(_verdicts(found)))


def _verdicts(found: Sequence[Fulfilled]) -> Iterator[Verdict]:
    """Yield what must be so of any recordings."""
    largest = {
        one: max((_largest(shift(found, number, name)) * factor for name, _, factor in MEASURES), default=0.0)
        for number, one in enumerate(DISTURBANCES)
    }
    offsets = [size for one, size in largest.items() if one.kind.startswith("offset")]
    yield Verdict("an offset of a stylus moves no measure", max(offsets) < 1e-6, f"{max(offsets):.2g} at most")
    for kind, name, sign, word in (
        ("noise of the ball, peaks of any size", "peaks", 1, "adds peaks"),
        ("noise of the styluses", "still", -1, "leaves less stillness"),
    ):
        number = max(place for place, one in enumerate(DISTURBANCES) if one.kind == kind)
        bias = shift(found, number, name).bias
        yield Verdict(f"{kind} {word}", sign * bias > 0, f"{bias:+.3g} at {DISTURBANCES[number].size}")


def _largest(one: Shift) -> float:
    return max(abs(one.bias), one.deviation) if one.count > 1 else 0.0


def _cell(one: Shift, factor: float) -> str:
    """Write bias and deviation; nothing where nothing changes."""
    lost = f" L {100 * one.lost / (one.count + one.lost):.2g} %" if one.lost else ""
    if one.count < 2:
        return f"all lost{lost}" if one.lost else "none"
    if factor * max(abs(one.bias), one.deviation) < NOTHING:
        return f"0{lost}"
    bias, deviation = factor * one.bias, factor * one.deviation
    digits = 1 - math.floor(math.log10(max(deviation, abs(bias))))
    return f"{bias:+.{max(digits, 0)}f} ({deviation:.{max(digits, 0)}f}){lost}"


def all_disturbances_part(found: Sequence[Fulfilled]) -> Part:
    """List all differences in SI units."""
    rows: list[tuple[Value, ...]] = []
    for number, one in enumerate(DISTURBANCES):
        for name in found[0].calm[number]:
            calm = np.concatenate([each.calm[number][name] for each in found])
            mean = float(np.nanmean(calm)) if np.isfinite(calm).any() else math.nan
            found_shift = shift(found, number, name)
            rows.append(
                (
                    *(one.kind, one.size, " ".join(one.settings), name, mean),
                    *(found_shift.bias, found_shift.deviation, found_shift.count, found_shift.lost),
                )
            )
    columns = ("disturbance", "size", "readings", "measure", "mean", "bias", "SD", "attempts", "lost")
    return Part("disturbances-all", "All of them, in SI units", columns, rows, on_screen=False)


def forms_part(found: Sequence[Fulfilled]) -> Part:
    """Show what a filter is worth as a fraction of two polynomials (question A3)."""
    rows: list[tuple[Value, ...]] = []
    for number, form in enumerate(found[0].forms):
        errors = np.array([one.forms[number].error for one in found])
        largest = f"{errors.max():.2g}" if np.isfinite(errors).all() else "beyond all numbers"
        rows.append((form.order, form.cutoff, f"{form.radius:.6f}", f"{form.gain:.6g}", largest))
    columns = (
        "order of a pass",
        "cutoff [Hz]",
        "largest pole [1]",
        "gain of a constant [1]",
        "largest error on a ball [m]",
    )
    title = "A3: filters as one fraction of two polynomials, beside second-order sections; recorded balls"
    worst = {order: max(form.radius for form in found[0].forms if form.order == order) for order in (5, 10)}
    verdict = Verdict(
        "as a fraction, passes of order 5 are stable, and those of order 10 are not",
        worst[5] < 1 < worst[10],
        f"largest poles {worst[5]:.6f} and {worst[10]:.6f}",
    )
    return Part("forms", title, columns, rows, [verdict])
