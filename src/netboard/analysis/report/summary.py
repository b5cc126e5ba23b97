"""Summary of a report: the main results of each topic in sentences, then a small table.

Sentences contain only numbers: a value, its confidence interval, the number of dyads, and whether no effect lies in the
interval. No sentence names a cause, calls a result significant, or takes an interval for evidence of no effect.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import pandas as pd

from netboard.analysis.extraction.conditions import STAND_INS
from netboard.analysis.report.grids import Grid, GridColumn, grid, name, number
from netboard.analysis.report.numbers import after, between, records, unit_of, written
from netboard.analysis.report.wording import amount, capital, plural
from netboard.analysis.statistics.exact_tests import MAX_EXACT
from netboard.analysis.topics.delay import OVER_ALL, RISE

_STAGES = r"(?P<team>.+), last (?P<count>\d+) vs first \d+"
_GROUPS = r"(?P<team>.+), last group vs first"
_FELT = r"(?P<team>.+), (?P<force>[^,]+) vs off"
_TEAMS = r"(?P<one>bimanual|dyadic) vs (?P<other>bimanual|dyadic)"
_LEVEL = r"(?!.* vs )(?P<group>.+)"


@dataclass(frozen=True, slots=True)
class SentencePattern:
    """Pattern of the sentence for a quantity.

    Attributes
    ----------
    group : str
        Regular expression of the groups; the words may use its named parts; a ``team`` becomes trials of that team.
    lead : str
        Start of the sentence.
    none : str
        Words for no effect, such as ``no change``; empty for a level, which is reported only if the study has no
        contrast of the quantity.
    without : float
        Value of no effect [its unit].
    """

    quantity: str
    group: str
    lead: str
    clause: str
    none: str = ""
    without: float = 0.0


@dataclass(frozen=True, slots=True)
class Heading:
    """A column of a topic's table, for quantities of the table of results no two of which have the same group."""

    title: str
    quantities: tuple[str, ...]
    is_count: bool = False


@dataclass(frozen=True, slots=True)
class Theme:
    """Content of the summary for a topic."""

    topic: str
    picture: str
    patterns: tuple[SentencePattern, ...]
    headings: tuple[Heading, ...]

    @property
    def quantities(self) -> tuple[str, ...]:
        """All quantities that it uses from the table of results."""
        of_patterns = [one.quantity for one in self.patterns]
        return tuple(dict.fromkeys([*of_patterns, *(quantity for one in self.headings for quantity in one.quantities)]))


def _compared(quantity: str, what: str) -> tuple[SentencePattern, ...]:
    """Return patterns for a quantity's contrasts between haptic conditions and teams, and for its level."""
    return (
        SentencePattern(
            quantity,
            _FELT,
            f"{capital(what)}, {{force}} minus haptics off, was",
            "{value} in {team}",
            "no difference",
        ),
        SentencePattern(
            quantity,
            _TEAMS,
            f"{capital(what)}, {{one}} minus {{other}} trials, was",
            "{value}",
            "no difference",
        ),
        SentencePattern(quantity, _LEVEL, f"In the condition “{{group}}”, {what} was", "{value}"),
    )


def _spread(what: str) -> SentencePattern:
    start = f"From the first to the last group of trials, the {what} at the first braking changed"
    return SentencePattern(f"change of {what}", _GROUPS, start, "by {value} in {team}", "no change")


THEMES = (
    Theme(
        "learning",
        "learning",
        (
            SentencePattern(
                "change of completion time",
                _STAGES,
                "From the first to the last {count}, completion time changed",
                "by {value} in {team}",
                "no change",
            ),
        ),
        (
            Heading("completion time", ("completion time, mean of dyads", "change of completion time")),
            Heading(
                "velocity peaks", ("number of velocity peaks, mean of dyads", "change of number of velocity peaks")
            ),
        ),
    ),
    Theme(
        "dyads",
        "dyads",
        (
            SentencePattern(
                "completion time: mean of the two minus dyad",
                "(?P<group>.+)",
                "The gain of dyads in completion time (mean of the two partners alone minus the dyad) was",
                "{value} with {group}",
                "no gain",
            ),
        ),
        (
            Heading("gain in completion time", ("completion time: mean of the two minus dyad",)),
            Heading("faster dyads", ("completion time: dyads better than the mean of the two",), is_count=True),
            Heading("gain in velocity peaks", ("number of velocity peaks: mean of the two minus dyad",)),
            Heading(
                "dyads with fewer", ("number of velocity peaks: dyads better than the mean of the two",), is_count=True
            ),
        ),
    ),
    Theme(
        "classes",
        "classes",
        (
            *_compared("share of cooperative movement", "the share of cooperative movement"),
            *_compared("share of competitive movement", "the share of competitive movement"),
        ),
        (
            Heading("cooperative", ("share of cooperative movement",)),
            Heading("competitive", ("share of competitive movement",)),
            Heading("single", ("share of single movement",)),
            Heading("still", ("share of stillness",)),
        ),
    ),
    Theme(
        "strategy",
        "strategy",
        (_spread("variance of distance"), _spread("generalised variance")),
        (
            Heading("area of the ellipse", ("area of the ellipse", "change of the area of the ellipse")),
            Heading("variance of distance", ("variance of distance", "change of variance of distance")),
            Heading("variance of velocity", ("variance of velocity", "change of variance of velocity")),
            Heading("generalised variance", ("generalised variance", "change of generalised variance")),
        ),
    ),
    Theme(
        "delay",
        "delay",
        _compared(f"delay, {OVER_ALL}", "the delay between the sides"),
        (Heading(OVER_ALL, (f"delay, {OVER_ALL}",)), Heading(RISE, (RISE,))),
    ),
    Theme(
        "contrasts",
        "differences",
        (
            SentencePattern(
                "completion time: ratio",
                _FELT,
                "With {force},",
                "{team} took {value} times as long as with haptics off",
                "no difference",
                1.0,
            ),
            SentencePattern(
                "completion time: ratio",
                r"(?P<one>dyadic) vs (?P<other>bimanual), (?P<force>.+)",
                "Trials took",
                "{value} times as long in {one} as in {other} conditions with {force}",
                "no difference",
                1.0,
            ),
        ),
        (
            Heading("completion time, ratio", ("completion time: ratio",)),
            Heading("velocity peaks, difference", ("velocity peaks: difference",)),
        ),
    ),
)
"""Themes of the summary, in order."""


@dataclass(frozen=True, slots=True)
class Main:
    """Main results of a topic: a table with a row for each group, a column for each quantity."""

    picture: str
    title: str
    sentences: tuple[str, ...]
    table: Grid


def summary(results: pd.DataFrame, titles: Mapping[str, str]) -> tuple[Main, ...]:
    """Return the main results by topic; topics without results are left out."""
    found = []
    for theme in THEMES:
        mine = results[(results["topic"] == theme.topic) & results["value"].notna()]
        rows = records(mine[mine["quantity"].isin(theme.quantities)])
        if rows:
            sentences = tuple(_sentences(theme.patterns, rows))
            table = _table(theme, titles.get(theme.picture, theme.topic), rows)
            found.append(Main(theme.picture, titles.get(theme.picture, theme.topic), sentences, table))
    return tuple(found)


def _sentences(patterns: Sequence[SentencePattern], rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the results of each group in a sentence or two, in the order of the patterns."""
    known: set[str] = set()
    for pattern in patterns:
        if not pattern.none and pattern.quantity in known:
            continue
        for row in rows:
            match = re.fullmatch(pattern.group, row["group"]) if row["quantity"] == pattern.quantity else None
            if match:
                words = {part: _worded(part, text) for part, text in match.groupdict().items()}
                yield f"{pattern.lead.format(**words)} {_clause(pattern, row, words)}."
                known.add(pattern.quantity)


def _worded(part: str, text: str) -> str:
    """Return a part of a group's name as words of a sentence."""
    if part == "count":
        return "trial" if text == "1" else f"{text} trials"
    return _trials(text) if part == "team" else text


def _trials(team: str) -> str:
    """Return a phrase for the trials of a team."""
    configuration, *others = team.split(", ")
    partners = [f"{kind} partner" for kind in STAND_INS]
    details = [f"the {one}" if one in partners else one for one in others]
    return f"{configuration} trials" + (f" with {', '.join(details)}" if details else "")


def _clause(pattern: SentencePattern, row: Mapping[str, Any], words: Mapping[str, str]) -> str:
    """Return a clause with the result of one group and its confidence interval."""
    value = f"{written(row)[0]}{after(unit_of(row))}"
    interval = f"{row['interval']}: {between(row)}" if between(row) else ""
    aside = ", ".join(part for part in (interval, plural(int(row["n"]), row["of"])) if part)
    clause = f"{pattern.clause.format(value=value, **words)} ({aside})"
    return f"{clause}. {capital(_interval_position(pattern, row))}" if pattern.none else clause


def _interval_position(pattern: SentencePattern, row: Mapping[str, Any]) -> str:
    """Return a phrase on the position of the confidence interval."""
    if not (isfinite(row["low"]) and isfinite(row["high"])):
        return "there is no confidence interval, so its uncertainty is unknown"
    if row["low"] <= pattern.without <= row["high"]:
        none = f"{pattern.none} ({amount(pattern.without)})"
        return f"the data are compatible with {none} and with every other value in the interval"
    return f"the whole interval is {'above' if row['low'] > pattern.without else 'below'} {amount(pattern.without)}"


def _table(theme: Theme, title: str, rows: Sequence[Mapping[str, Any]]) -> Grid:
    """Return the results of a topic as a table: groups, values with intervals, and numbers of units."""
    cells: dict[str, dict[str, Mapping[str, Any]]] = {}
    for row in rows:
        for heading in theme.headings:
            if row["quantity"] in heading.quantities:
                cells.setdefault(row["group"], {}).setdefault(heading.title, row)
    shown = [one for one in theme.headings if any(one.title in found for found in cells.values())]
    lines = []
    for group in _ends_of_series(list(cells)):
        found = cells[group]
        values = [_cell(one, found[one.title]) if one.title in found else "" for one in shown]
        made_of = dict.fromkeys(plural(int(row["n"]), row["of"]) for row in found.values())
        lines.append([group, *values, "; ".join(made_of)])
    columns = [name("Group"), *(number(_heading(one, rows)) for one in shown), GridColumn("n")]
    return grid(_caption(title, rows), columns, lines)


def _ends_of_series(groups: Sequence[str]) -> list[str]:
    """Return each team's first and last of consecutive groups of trials."""
    series: dict[str, list[str]] = {}
    for group in groups:
        match = re.fullmatch(r"(.+), trials \d+ to \d+", group)
        series.setdefault(match[1] if match else group, []).append(group)
    return [group for group in groups if any(group in (own[0], own[-1]) for own in series.values())]


def _cell(heading: Heading, row: Mapping[str, Any]) -> str:
    value, interval = written(row)[0], between(row)
    if heading.is_count:
        return f"{value} of {amount(int(row['n']))}"
    return f"{value} ({interval})" if interval else value


def _heading(heading: Heading, rows: Sequence[Mapping[str, Any]]) -> str:
    unit = next(unit_of(row) for row in rows if row["quantity"] in heading.quantities)
    symbol = unit.symbol.removesuffix(" points")
    return f"{heading.title} [{symbol}]" if symbol else heading.title


def _caption(title: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a caption that explains the brackets and the unit of differences of shares."""
    kinds = dict.fromkeys(row["interval"] for row in rows if row["interval"] and isfinite(row["low"]))
    sentences = [title, *([f"In brackets: confidence intervals ({' or '.join(kinds)})"] if kinds else [])]
    if any(unit_of(row).symbol == "% points" for row in rows):
        sentences.append("Differences of shares are in percentage points")
    return ". ".join(sentences) + "."


def few(dyads: int) -> str:
    """Return a caution for the number of dyads."""
    least = min(1.0, 2.0 / 2**dyads)
    caution = f"The dyad is the unit of replication, so n is {plural(dyads, 'dyad')}, however many trials there are."
    if 2**dyads > MAX_EXACT:  # random sign flips, and no p of a sign test that is worth a sentence
        return caution
    caution += f" Here the smallest possible p of an exact two-sided test within dyads is {amount(least)}"
    if least > 0.05:
        return f"{caution}, so no such test can be significant at 5 %; that takes six dyads or more."
    return f"{caution}."
