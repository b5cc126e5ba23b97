"""Answer of a report: the primary contrast, then the secondary tests, in sentences and tables.

An interval that includes no effect is worded as what it excludes and what it does not: it is no evidence that there is
no effect, unless it lies within the declared smallest effect of interest. Only the declared method counts; other
methods are sensitivity analyses. Only the primary contrast has the whole level: each secondary test shows the p that is
adjusted for the primary one and for the others.
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from math import isfinite
from typing import Any

from netboard.analysis.report.grids import Cell, Grid, GridColumn, grid_of, name, number
from netboard.analysis.report.numbers import after, between, unit_of, written
from netboard.analysis.report.wording import amount, capital, percent, plural
from netboard.analysis.statistics.estimates import Estimate
from netboard.analysis.topics.declared import (
    DeclaredAnalysis,
    DeclaredEffect,
    Outcome,
    assumption,
    equivalence_interval,
)
from netboard.analysis.topics.primary import effect_result, mean_result, method_name, size_result
from netboard.analysis.topics.result import cautioned


def answer_sentences(found: DeclaredAnalysis) -> Iterator[str]:
    """Yield a paragraph for the primary contrast and each other effect on its outcome, then what holds for them."""
    for effect in reversed(found.primary.effects):
        yield " ".join(_paragraph(found, effect))
    tests = len(found.secondary_effects)
    if tests:
        yield (
            f"The primary contrast is tested at the full level of {percent(1.0 - found.declaration.level)}. The other "
            f"{plural(tests, 'declared test')} are secondary. Each has an adjusted p: the larger of two "
            "values, the primary p and its own p after Holm's correction over all secondary tests (gatekeeping). So an "
            "adjusted p can be below the level only if the primary p is."
        )
    if len(found.primary.effects) > 1:
        yield "A main effect is averaged over the levels of the other factor: read it together with the interaction."
    if assumed := assumption(found.primary.measure.name, found.declaration.method):
        yield f"The test {assumed}."
    if not found.declaration.smallest_effect:
        yield (
            "No smallest effect of interest is declared, so no result of this study can be read as evidence that there "
            "is no effect."
        )


def effect_lines(outcome: Outcome) -> Iterator[str]:
    """Yield each effect on an outcome in a line: estimate, confidence interval and p value."""
    for effect in reversed(outcome.effects):
        row = asdict(effect_result(outcome, effect, effect.counts))
        interval = f"{percent(effect.counts.estimate.level)} CI {between(row)}" if between(row) else "no CI"
        value = f"{written(row)[0]}{after(unit_of(row))}"
        role = "primary contrast" if effect is outcome.effects[-1] else "secondary"
        yield f"{effect.name} ({role}): {effect.counts.scale} {value} ({interval}), {_test(effect)}"


def _paragraph(found: DeclaredAnalysis, effect: DeclaredEffect) -> Iterator[str]:
    """Yield the sentences on one effect: estimate and test, what the data exclude, and equivalence."""
    outcome = found.primary
    row = asdict(effect_result(outcome, effect, effect.counts))
    role = "Primary contrast" if effect is found.contrast else "Secondary"
    yield f"{role}. {_estimate_clause(found, effect, row)} ({'; '.join(_aside(outcome, effect, row))})."
    yield OVERRULED if _overruled(found, effect) else compatible(row, _null(effect))
    if found.declaration.smallest_effect:
        yield _equivalence(found.declaration.smallest_effect, effect, row)


OVERRULED = (
    "This confidence interval is not adjusted for the other tests. It does not contain the value of no effect. But the "
    "adjusted p is above the level, so no effect remains possible."
)
"""Sentence on a secondary effect whose interval excludes no effect, and whose adjusted p does not."""


def _overruled(found: DeclaredAnalysis, effect: DeclaredEffect) -> bool:
    """Return whether the p of a secondary test is below the level, and its adjusted p is not."""
    level = 1.0 - found.declaration.level
    return effect is not found.contrast and effect.counts.tested.p <= level < effect.adjusted


def _estimate_clause(found: DeclaredAnalysis, effect: DeclaredEffect, row: Mapping[str, Any]) -> str:
    """Return a clause with the estimate of an effect in words."""
    value = f"{written(row)[0]}{after(unit_of(row))}"
    one, scale = effect.factors[0], effect.counts.scale
    (first, second), ratio = one.levels, scale != "difference"
    of = f"the {scale} of {found.primary.measure.name} ({one.name}: {first} {'over' if ratio else 'minus'} {second})"
    if len(effect.factors) == 1:
        rest = [factor.name for factor in found.crossing.factors if factor is not one]
        return f"{capital(of)} was {value}" + (f", averaged over {rest[0]}" if rest else "")
    other = effect.factors[1]
    than = "divided by" if ratio else "minus"
    levels = f"with {other.name} {other.levels[0]}, {than} that with {other.name} {other.levels[1]}"
    return f"Interaction: {of} {levels}, was {value}"


def _aside(outcome: Outcome, effect: DeclaredEffect, row: Mapping[str, Any]) -> Iterator[str]:
    """Yield interval, test and effect size of an effect."""
    by, level = effect.counts, percent(effect.counts.estimate.level)
    yield (
        f"{level} confidence interval {between(row)}{after(unit_of(row))}" if between(row) else "no confidence interval"
    )
    yield f"{method_name(outcome.measure.name, by.method)}, {_test(effect)}, {plural(by.estimate.n, 'dyad')}"
    size = asdict(size_result(outcome, effect))
    if isfinite(effect.size.value):
        yield f"effect size {_size_name(size)} = {written(size)[0]}, {level} CI {between(size)}"


def _size_name(row: Mapping[str, Any]) -> str:
    return str(row["quantity"].rpartition(": ")[2])


def _test(effect: DeclaredEffect) -> str:
    """Return the statistic and the p value of the test that counts."""
    tested = effect.counts.tested
    if not isfinite(tested.p):
        return f"no p value: {tested.note}"
    p = cautioned(f"p = {amount(tested.p)}", tested.caution)
    if effect.adjusted != tested.p:
        p = f"{p}, adjusted p = {amount(effect.adjusted)}"
    return f"t({amount(round(tested.free, 1))}) = {amount(tested.statistic, 2)}, {p}" if isfinite(tested.free) else p


def _null(effect: DeclaredEffect) -> float:
    return 0.0 if effect.counts.scale == "difference" else 1.0


def compatible(row: Mapping[str, Any], none: float) -> str:
    """Return what a confidence interval excludes, and what remains compatible with the data.

    `none` is the value of no effect.
    """
    if not (isfinite(row["low"]) and isfinite(row["high"])):
        return "There is no confidence interval: the data exclude nothing."
    low, high = _sized(row, "low", none), _sized(row, "high", none)
    if row["low"] <= none <= row["high"]:
        return (
            f"The data exclude effects below {low} and above {high}. All effects between them, including no effect, "
            "remain compatible with the data. So the data do not show that there is no effect."
        )
    return (
        f"The confidence interval does not contain the value of no effect. Effects from {low} to {high} remain "
        "compatible with the data."
    )


def _sized(row: Mapping[str, Any], end: str, none: float) -> str:
    """Return a limit as an effect: a ratio as a percentage, a difference in its unit."""
    if none == 1.0:
        value = 100.0 * (row[end] - 1.0)
        return f"{_signed(amount(value, 0 if abs(value) >= 10 else 1))}\N{NO-BREAK SPACE}%"
    text = written(row)[1 if end == "low" else 2]
    return f"{_signed(text)}{after(unit_of(row))}"


def _signed(text: str) -> str:
    return text if text.startswith("−") or not text.strip("0.") else f"+{text}"


def _equivalence(smallest: float, effect: DeclaredEffect, row: Mapping[str, Any]) -> str:
    """Return whether effects as large as the declared smallest one of interest are excluded."""
    narrow = equivalence_interval(effect)
    ratio = effect.counts.scale != "difference"
    low, high = (1.0 / (1.0 + smallest), 1.0 + smallest) if ratio else (-smallest, smallest)
    range_row = dict(row) | {"value": narrow.value, "low": low, "high": high}
    tests = f"two one-sided tests at {percent(1.0 - effect.counts.estimate.level)}"
    if not isfinite(narrow.low):
        return "Whether effects of interest are excluded is unknown."
    found = f"{percent(narrow.level)} confidence interval {between(dict(row) | _ends(narrow))}"
    limits = f"{between(range_row)}{after(unit_of(row))}"
    if low < narrow.low and narrow.high < high:
        return f"Effects as large as the smallest effect of interest ({limits}) are excluded ({tests}: {found})."
    return f"Effects as large as the smallest effect of interest ({limits}) are not excluded ({tests}: {found})."


def _ends(found: Estimate) -> dict[str, float]:
    return {"value": found.value, "low": found.low, "high": found.high}


# --- tables ----------------------------------------------------------------------------------------------------------


def effects_grid(outcome: Outcome) -> Grid:
    """Return the primary contrast and the other effects on its outcome, by the method that counts."""
    return grid_of(f"Primary outcome, {outcome.measure.name}: the declared effects", [*_effects(outcome)])


def _effects(outcome: Outcome) -> Iterator[dict[GridColumn, Cell | float]]:
    for effect in reversed(outcome.effects):
        row, size = asdict(effect_result(outcome, effect, effect.counts)), asdict(size_result(outcome, effect))
        yield {
            name("Effect"): effect.name,
            GridColumn("Test"): "primary" if effect is outcome.effects[-1] else "secondary",
            number(_scale(row, effect.counts.scale)): written(row)[0],
            number(f"{percent(effect.counts.estimate.level)} CI"): between(row),
            GridColumn("Method"): method_name(outcome.measure.name, effect.counts.method),
            number("t"): amount(effect.counts.tested.statistic, 2),
            number("df"): amount(round(effect.counts.tested.free, 1)),
            number("p"): cautioned(amount(effect.counts.tested.p), effect.counts.tested.caution),
            number("p, adjusted"): amount(effect.adjusted),
            number("Effect size"): f"{_size_name(size)} = {written(size)[0]} ({between(size)})",
            number("Dyads"): effect.counts.estimate.n,
        }


def _scale(row: Mapping[str, Any], scale: str) -> str:
    """Return a heading with scale and unit."""
    symbol = unit_of(row).symbol
    return f"{capital(scale)} [{symbol or '1'}]"


def means_grid(found: DeclaredAnalysis) -> Grid:
    """Return the means of the primary outcome in the compared conditions."""
    measure, level = found.primary.measure, percent(found.declaration.level)
    rows: list[dict[GridColumn, Cell | float]] = []
    for levels in found.primary.means:
        row = asdict(mean_result(found.primary, found.crossing, levels))
        heading = f"{'Geometric mean' if measure.ratio else 'Mean'} [{unit_of(row).symbol or '1'}]"
        rows.append(
            {
                name("Condition"): row["group"],
                number(heading): written(row)[0],
                number(f"{level} CI"): between(row),
                GridColumn("Interval"): row["interval"],
                number("Dyads"): int(row["n"]),
            }
        )
    return grid_of(f"{capital(measure.name)} in the compared conditions", rows)


def sensitivity_grid(outcome: Outcome) -> Grid | None:
    """Return the effects by the methods that do not count; None if there is no other."""
    rows: list[dict[GridColumn, Cell | float]] = []
    for effect in outcome.effects:
        for by in effect.others:
            row = asdict(effect_result(outcome, effect, by))
            rows.append(
                {
                    name("Effect"): effect.name,
                    GridColumn("Method"): method_name(outcome.measure.name, by.method),
                    GridColumn("Scale"): by.scale,
                    number("Estimate"): f"{written(row)[0]}{after(unit_of(row))}",
                    number(f"{percent(by.estimate.level)} CI"): between(row),
                    number("p"): cautioned(amount(by.tested.p), by.tested.caution),
                }
            )
    return grid_of(f"Sensitivity analyses of {outcome.measure.name}: none of these counts", rows) if rows else None


def secondary_grid(found: DeclaredAnalysis) -> Grid | None:
    """Return the effects on the secondary outcomes by the declared method; None if there are none."""
    rows: list[dict[GridColumn, Cell | float]] = []
    for outcome in found.secondary:
        for effect in outcome.effects:
            row = asdict(effect_result(outcome, effect, effect.counts))
            rows.append(
                {
                    name("Outcome"): outcome.measure.name,
                    name("Effect"): effect.name,
                    GridColumn("Scale"): effect.counts.scale,
                    number("Estimate"): f"{written(row)[0]}{after(unit_of(row))}",
                    number(f"{percent(found.declaration.level)} CI"): between(row),
                    number("p, adjusted"): cautioned(amount(effect.adjusted), effect.counts.tested.caution),
                    number("Dyads"): effect.counts.estimate.n,
                }
            )
    if not rows:
        return None
    tests = plural(len(found.secondary_effects), "secondary test")
    caption = f"Secondary outcomes, by the declared method; p adjusted for the primary contrast and over {tests}"
    return grid_of(caption, rows)
