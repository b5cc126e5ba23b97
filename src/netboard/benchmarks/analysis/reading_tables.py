"""Effects of settings on the reported numbers, as tables: one by one, in pairs, and on paths through all questions."""

import math
from collections.abc import Sequence

import numpy as np

from netboard.analysis.extraction.study import Study
from netboard.benchmarks.analysis import multiverse
from netboard.benchmarks.analysis.multiverse import HEADLINES
from netboard.benchmarks.analysis.numbers import STATEMENTS, Numbers
from netboard.benchmarks.analysis.readings import AMBIGUITIES, Alternative, Ambiguity
from netboard.benchmarks.harness.results import Part, Value, Verdict

Singles = Sequence[tuple[Ambiguity, Alternative, Numbers]]
"""Numbers with one alternative each."""

LEAST = 1e-6
"""Relative changes below this count as none [1]."""

SMALL = 0.01
"""A number that changes by more has moved, as a share [1]."""

SHOWN = 0.001
"""A headline number that changes by more is shown, as a share [1]."""

RARE = 0.02
"""Shares of the time below this are negligible [1]."""


def values_of(found: Numbers) -> dict[str, float]:
    """Return the values alone."""
    return {name: one.value for name, one in found.items()}


def change(before: float, after: float) -> float:
    """Return how far a number moved, as a share of what it was; NaN if that is not known, infinite from 0 [1]."""
    if math.isnan(before) and math.isnan(after):
        return 0.0
    if before == after:
        return 0.0
    return (after - before) / abs(before) if before else math.copysign(math.inf, after)


def signed(share: float) -> str:
    """Write a change in percent."""
    if math.isnan(share):
        return "none left"
    if abs(share) < LEAST:
        return "0"
    if not math.isfinite(share):
        return "from 0"
    return f"{100 * share:+.0f} %" if abs(share) >= 0.1 else f"{100 * share:+.2g} %"


def numbers_part(default: Numbers, singles: Singles) -> Part:
    """List every number with its range over all alternatives, one at a time."""
    rows: list[tuple[Value, ...]] = []
    for name, one in default.items():
        values = np.array([found[name].value for _, other, found in singles if other.likely])
        known = values[np.isfinite(values)]
        low, high = (float(known.min()), float(known.max())) if known.size else (math.nan, math.nan)
        rows.append((name, one.unit, one.value, low, high))
    columns = ("number", "unit", "default", "least", "most")
    title = "Every number, and its range over the likely alternatives, one at a time"
    return Part("numbers", title, columns, rows, on_screen=False)


def readings_part(default: Numbers, singles: Singles) -> Part:
    """Say of every question what its other answers move most."""
    rows: list[tuple[Value, ...]] = []
    for one in AMBIGUITIES:
        mine = [(other, found) for asked, other, found in singles if asked is one]
        if not mine:
            rows.append((one.name, one.question, one.default, "none", one.reason, ""))
        for other, found in mine:
            rows.append((one.name, one.question, one.default, other.name, *_most(one, default, found)))
    columns = ("", "question", "default", "alternative", "moves most", "moved by 1 %")
    beyond = [f"{one.name} {other.name}" for one, other, found in singles if _beyond(one, default, found)]
    verdict = Verdict(
        "no answer moves a number that has nothing to do with the question",
        not beyond,
        ", ".join(beyond) or f"{len(singles)} answers, {len(default)} numbers each",
    )
    return Part("readings", "Every open question, and what its other answers move", columns, rows, [verdict])


def _beyond(one: Ambiguity, default: Numbers, found: Numbers) -> bool:
    """Whether a setting changes a number that it cannot affect."""
    others = [name for name, number in default.items() if number.family not in one.touches]
    return any(not abs(change(default[name].value, found[name].value)) <= LEAST for name in others)


def _most(one: Ambiguity, default: Numbers, found: Numbers) -> tuple[str, str]:
    """Find the number that an answer moves most (a mean, else a spread, else a count); count those it moves."""
    mine = {
        name: change(number.value, found[name].value)
        for name, number in default.items()
        if number.family in one.touches
    }
    moved = f"{sum(not abs(share) <= SMALL for share in mine.values())} of {len(mine)}"
    for kind in ("mean", "spread", "count"):
        shares = {name: mine[name] for name in mine if default[name].kind == kind and _tells(name, default, found)}
        largest = max(shares, key=lambda name: abs(shares[name]), default="")
        if largest and abs(shares[largest]) > LEAST:
            before, after = default[largest], found[largest].value
            unit = "" if before.unit == "1" else f" {before.unit}"
            return f"{largest}: {before.value:.3g} to {after:.3g}{unit}, {signed(shares[largest])}", moved
    return "none left" if any(map(math.isnan, mine.values())) else "nothing", moved


def _tells(name: str, default: Numbers, found: Numbers) -> bool:
    """Whether a change in percent is meaningful: of known numbers in one unit that are not negligible."""
    before, after = default[name], found[name]
    rare = before.family == "shares" and before.value < RARE
    return math.isfinite(before.value) and math.isfinite(after.value) and before.unit == after.unit and not rare


def headlines_part(default: Numbers, singles: Singles) -> Part:
    """Put the headline numbers beside each other, by every alternative that moves one."""
    rows: list[tuple[Value, ...]] = [
        ("", "default", *(f"{factor * default[name].value:.3g}" for name, _, factor in HEADLINES))
    ]
    for one, other, found in singles:
        shares = [change(default[name].value, found[name].value) for name, _, _ in HEADLINES]
        if any(not abs(share) <= SHOWN for share in shares):
            cells = [
                "" if abs(share) <= SHOWN else f"{factor * found[name].value:.3g}"
                for (name, _, factor), share in zip(HEADLINES, shares, strict=True)
            ]
            rows.append((one.name, other.name, *cells))
    columns = ("", "reading", *(label.replace("\n", " ") for _, label, _ in HEADLINES))
    title = "Headline numbers by each alternative that moves one by 0.1 %; empty: as by default"
    return Part("headlines", title, columns, rows)


def moved_part(default: Numbers, singles: Singles) -> Part:
    """List all numbers that an alternative moves."""
    rows: list[tuple[Value, ...]] = []
    for one, other, found in singles:
        for name, number in default.items():
            share = change(number.value, found[name].value)
            if not abs(share) <= SMALL:
                rows.append((one.name, other.name, name, number.unit, number.value, found[name].value, signed(share)))
    columns = ("", "alternative", "number", "unit", "by default", "by the alternative", "change")
    return Part("moved", "All numbers that an alternative moves by 1 %", columns, rows, on_screen=False)


def pairs_part(default: Numbers, singles: Singles, pairs: Sequence[tuple[Ambiguity, Ambiguity, Numbers]]) -> Part:
    """Say what two answers do together, and how much of it neither does alone.

    - `pairs`: two questions, and the numbers by the first alternative of both.
    """
    rows: list[tuple[Value, ...]] = []
    for one, other, both in pairs:
        (first, by_one), (second, by_other) = (
            next((answer.name, found) for asked, answer, found in singles if asked is question)
            for question in (one, other)
        )
        families = set(one.touches) & set(other.touches)
        for name, label, factor in [row for row in HEADLINES if default[row[0]].family in families][:2]:
            base, *after = (factor * found[name].value for found in (default, by_one, by_other, both))
            joint = after[2] - after[0] - after[1] + base
            answers = f"{one.name} {first}, {other.name} {second}"
            rows.append((answers, label.replace("\n", " "), base, *after, joint))
    columns = ("two answers", "number", "default", "first alone", "second alone", "both", "interaction")
    title = "Two answers at once; interaction: what both move less what each moves alone"
    return Part("pairs", title, columns, rows)


def paths_part(default: Numbers, paths: Sequence[dict[str, float]], count: int) -> Part:
    """Say how the headline numbers are spread over the paths."""
    rows: list[tuple[Value, ...]] = []
    for name, label, factor in HEADLINES:
        values = factor * np.array([one[name] for one in paths])
        known = values[np.isfinite(values)]
        before = factor * default[name].value
        marks = [float(mark) for mark in np.percentile(known, (0, 5, 50, 95, 100))] if known.size else [math.nan] * 5
        below = f"{100 * float(np.mean(known < before)):.0f} %" if known.size else "none"
        rows.append((label.replace("\n", " "), before, *marks, below, known.size))
    columns = ("number", "default", "least", "5 %", "median", "95 %", "most", "paths below the default", "paths")
    return Part("paths", f"Headline numbers on paths drawn from {count:.3g}", columns, rows)


def statements_part(default: Numbers, singles: Singles, paths: Sequence[dict[str, float]]) -> Part:
    """Count where what the paper says of its people holds for these."""
    plain = values_of(default)
    one = multiverse.held([values_of(found) for _, _, found in singles])
    every = multiverse.held(paths)
    rows: list[tuple[Value, ...]] = []
    for statement, (alone, of), (held, among) in zip(STATEMENTS, one, every, strict=True):
        share = f"{100 * held / among:.0f} %" if among else "none tells"
        rows.append((statement.words, statement.gap(plain) > 0, f"{alone} of {of}", share, among))
    columns = ("statement", "default", "one alternative at a time", "paths", "of")
    return Part("statements", "Where what the paper says of its people holds for these", columns, rows)


def concerned_part(base: Study, whole_ball: Study) -> Part:
    """Count the trials that questions A24 and B5 concern."""
    rows: list[tuple[Value, ...]] = []
    for condition, own in base.counted.groupby("condition"):
        other = whole_ball.counted[whole_ball.counted["condition"] == condition]
        wrong, none = float((own["wrong_way"] > 0).mean()), float(own["braking_distance"].isna().mean())
        lost = float(other["completion"].isna().mean())
        rows.append((str(condition), len(own), *(f"{100 * share:.1f} %" for share in (wrong, none, lost))))
    columns = (
        "condition",
        "trials",
        "A24: first movement the wrong way",
        "no braking movement",
        "B5: no 1.5 s with all of the ball in the target",
    )
    return Part("concerned", "What some questions concern", columns, rows)
