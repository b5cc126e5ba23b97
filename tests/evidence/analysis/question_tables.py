"""Tables of the effects of settings on the reported numbers: one at a time, in pairs, and on random paths."""

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd

from evidence.analysis import multiverse
from evidence.analysis.multiverse import HEADLINES
from evidence.analysis.open_questions import QUESTIONS, Alternative, Question
from evidence.analysis.reported_numbers import STATEMENTS, Numbers
from netboard.analysis.extraction.study import StudyData
from netboard.benchmarks.harness.results import ResultPart, Value

Singles = Sequence[tuple[Question, Alternative, Numbers]]
"""The reported numbers with one alternative at a time."""

NO_CHANGE = 1e-6
"""Relative changes up to this are rounding errors [1]."""

CHANGED = 0.01
"""Relative change from which a number counts as changed [1]."""

SHOWN = 0.001
"""Relative change from which the table of headline numbers shows a number [1]."""

RARE = 0.02
"""Shares of the time below this are negligible: their relative change is not reported [1]."""


def values_of(found: Numbers) -> dict[str, float]:
    """Return the values without family, unit and kind."""
    return {name: one.value for name, one in found.items()}


def change(before: float, after: float) -> float:
    """Return the relative change of a number: 0 between two NaN, NaN if one is NaN, infinite from 0 [1]."""
    if before == after or (math.isnan(before) and math.isnan(after)):
        return 0.0
    return (after - before) / abs(before) if before else math.copysign(math.inf, after)


def signed(share: float) -> str:
    """Format a relative change in percent."""
    if math.isnan(share):
        return "no value"
    if abs(share) < NO_CHANGE:
        return "0"
    if not math.isfinite(share):
        return "from 0"
    return f"{100 * share:+.0f} %" if abs(share) >= 0.1 else f"{100 * share:+.2g} %"


def numbers_part(default: Numbers, singles: Singles) -> ResultPart:
    """Tabulate every number with its range over the likely alternatives, one at a time."""
    part = ResultPart(
        "numbers",
        "Reported numbers, and their ranges over the likely alternatives, one at a time",
        "number | unit | default | minimum | maximum",
        on_screen=False,
    )
    for name, one in default.items():
        values = np.array([found[name].value for _, other, found in singles if other.likely])
        known = values[np.isfinite(values)]
        low, high = (float(known.min()), float(known.max())) if known.size else (math.nan, math.nan)
        part.add(name, one.unit, one.value, low, high)
    return part


def alternatives_part(default: Numbers, singles: Singles) -> ResultPart:
    """Tabulate, for each alternative to a question, the number that it changes most."""
    part = ResultPart(
        "readings",
        "Effect of each alternative on the reported numbers",
        "id | question | default | alternative | largest change | changed by 1 %",
    )
    for one in QUESTIONS:
        mine = [(other, found) for asked, other, found in singles if asked is one]
        if not mine:
            part.add(one.name, one.text, one.default, "none", one.reason, "")
        for other, found in mine:
            part.add(one.name, one.text, one.default, other.name, *_largest_change(one, default, found))
    unrelated = [f"{one.name} {other.name}" for one, other, found in singles if _changes_unrelated(one, default, found)]
    part.claim(
        "no alternative changes a number that is independent of its question",
        not unrelated,
        ", ".join(unrelated) or f"{len(singles)} alternatives, {len(default)} numbers each",
    )
    return part


def _changes_unrelated(one: Question, default: Numbers, found: Numbers) -> bool:
    """Return whether a setting changes a number outside the families that its question touches."""
    others = [name for name, number in default.items() if number.family not in one.families]
    return any(not abs(change(default[name].value, found[name].value)) <= NO_CHANGE for name in others)


def _largest_change(one: Question, default: Numbers, found: Numbers) -> tuple[str, str]:
    """Describe the largest change of a mean, else of a spread, else of a count; and count the changed numbers."""
    mine = {
        name: change(number.value, found[name].value)
        for name, number in default.items()
        if number.family in one.families
    }
    moved = f"{sum(not abs(share) <= CHANGED for share in mine.values())} of {len(mine)}"
    for kind in ("mean", "spread", "count"):
        shares = {name: mine[name] for name in mine if default[name].kind == kind and _comparable(name, default, found)}
        largest = max(shares, key=lambda name: abs(shares[name]), default="")
        if largest and abs(shares[largest]) > NO_CHANGE:
            before, after = default[largest], found[largest].value
            unit = "" if before.unit == "1" else f" {before.unit}"
            return f"{largest}: {before.value:.3g} to {after:.3g}{unit}, {signed(shares[largest])}", moved
    return "no value" if any(map(math.isnan, mine.values())) else "no change", moved


def _comparable(name: str, default: Numbers, found: Numbers) -> bool:
    """Return whether a relative change is meaningful: both values are known, in one unit and not negligible."""
    before, after = default[name], found[name]
    rare = before.family == "shares" and before.value < RARE
    return math.isfinite(before.value) and math.isfinite(after.value) and before.unit == after.unit and not rare


def headlines_part(default: Numbers, singles: Singles) -> ResultPart:
    """Tabulate the headline numbers with each alternative that changes one of them."""
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
    return ResultPart(
        "headlines",
        "Headline numbers with each alternative that changes one of them by 0.1 %; empty: as by default",
        ("id", "alternative", *(label.replace("\n", " ") for _, label, _ in HEADLINES)),
        rows,
    )


def moved_part(default: Numbers, singles: Singles) -> ResultPart:
    """List all numbers that an alternative changes."""
    part = ResultPart(
        "moved",
        "All numbers that an alternative changes by 1 %",
        "id | alternative | number | unit | default | with the alternative | change",
        on_screen=False,
    )
    for one, other, found in singles:
        for name, number in default.items():
            share = change(number.value, found[name].value)
            if not abs(share) <= CHANGED:
                part.add(one.name, other.name, name, number.unit, number.value, found[name].value, signed(share))
    return part


def pairs_part(default: Numbers, singles: Singles, pairs: Sequence[tuple[Question, Question, Numbers]]) -> ResultPart:
    """Tabulate the joint effect of two alternatives and their interaction.

    - `pairs`: two questions, and the numbers with the first alternative of both.
    """
    part = ResultPart(
        "pairs",
        "Two alternatives at once; interaction: the joint change minus both single changes",
        "two alternatives | number | default | first alone | second alone | both | interaction",
    )
    for one, other, both in pairs:
        (first, by_one), (second, by_other) = (
            next((answer.name, found) for asked, answer, found in singles if asked is question)
            for question in (one, other)
        )
        families = set(one.families) & set(other.families)
        for name, label, factor in [row for row in HEADLINES if default[row[0]].family in families][:2]:
            base, *after = (factor * found[name].value for found in (default, by_one, by_other, both))
            joint = after[2] - after[0] - after[1] + base
            answers = f"{one.name} {first}; {other.name} {second}"
            part.add(answers, label.replace("\n", " "), base, *after, joint)
    return part


def paths_part(default: Numbers, paths: Sequence[dict[str, float]], count: int) -> ResultPart:
    """Tabulate percentiles of the headline numbers over the paths."""
    part = ResultPart(
        "paths",
        f"Headline numbers on random paths, drawn from {count:.3g}",
        "number | default | minimum | 5 % | median | 95 % | maximum | paths below the default | paths",
    )
    for name, label, factor in HEADLINES:
        values = factor * np.array([one[name] for one in paths])
        known = values[np.isfinite(values)]
        before = factor * default[name].value
        marks = [float(mark) for mark in np.percentile(known, (0, 5, 50, 95, 100))] if known.size else [math.nan] * 5
        below = f"{100 * float(np.mean(known < before)):.0f} %" if known.size else "none"
        part.add(label.replace("\n", " "), before, *marks, below, known.size)
    return part


def statements_part(default: Numbers, singles: Singles, paths: Sequence[dict[str, float]]) -> ResultPart:
    """Tabulate how often each statement of the paper holds for the participants of the study."""
    plain = values_of(default)
    one = multiverse.count_holding([values_of(found) for _, _, found in singles])
    every = multiverse.count_holding(paths)
    part = ResultPart(
        "statements",
        "Which statements of the paper hold for these participants",
        "statement | default | one alternative at a time | paths | of",
    )
    for statement, (alone, of), (held, among) in zip(STATEMENTS, one, every, strict=True):
        share = f"{100 * held / among:.0f} %" if among else "undefined"
        part.add(statement.text, statement.gap(plain) > 0, f"{alone} of {of}", share, among)
    return part


def affected_part(base: StudyData, whole_ball: StudyData) -> ResultPart:
    """Tabulate the shares of trials that questions A24 and B5 affect."""
    part = ResultPart(
        "concerned",
        "Trials that questions A24 and B5 affect",
        "condition | trials | A24: first movement the wrong way | no braking movement | "
        "B5: whole ball never in the target for 1.5 s",
    )
    keys = ["recording", "trial", "attempt"]
    completion = whole_ball.trials.set_index(keys)["completion"]  # without a completion time, no trial counts there
    for condition, trials in base.counted.groupby("condition"):
        lost = completion[pd.MultiIndex.from_frame(trials[keys])].isna()
        affected = (trials["wrong_way"] > 0, trials["braking_distance"].isna(), lost)
        part.add(str(condition), len(trials), *(f"{100 * float(one.mean()):.1f} %" for one in affected))
    return part
