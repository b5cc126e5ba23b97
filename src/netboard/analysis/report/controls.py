"""Section of a report on controls: each effect of haptic feedback beside what mechanics alone predict of it.

The numbers are those of `netboard.analysis.topics.controls`. All of them are exploratory.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

from netboard.analysis.extraction.controls import CONTROLS, Arm, arms_of
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.report.grids import Cell, Grid, GridColumn, grid_of, name, number
from netboard.analysis.report.numbers import between, unit_of, written
from netboard.analysis.report.wording import NONE, capital, plural
from netboard.analysis.statistics.estimates import Estimate
from netboard.analysis.topics.controls import PASSIVE, TOPIC, ControlledEffect, ControlPrediction, Part, controls
from netboard.analysis.topics.figure import listed
from netboard.analysis.topics.groups import estimated
from netboard.analysis.topics.result import UNCOMPUTABLE

Row = dict[GridColumn, Cell | float]


@dataclass(frozen=True, slots=True)
class ComparedControls:
    """Controls of one comparison: a sentence, the parts of its effects, and other tables; None for none.

    `measured` has the conditions of the study that are controls. `details` are tables by their titles: the parts with
    each arm of the usual stiffness, and the other computed controls.
    """

    title: str
    sentence: str
    parts: Grid
    measured: Grid | None
    details: dict[str, Grid]


@dataclass(frozen=True, slots=True)
class ControlsSection:
    """Section on controls: every comparison, and notes on measures without a computed control, numbered from 1."""

    comparisons: tuple[ComparedControls, ...]
    notes: tuple[str, ...]
    about: tuple[str, ...]


def controls_section(study: StudyData) -> ControlsSection:
    """Return the section of a study; without comparisons if there are none, or they could not be computed."""
    try:
        found = controls(study).parts
    except UNCOMPUTABLE:  # the results say so
        found = ()
    notes = tuple(dict.fromkeys(one.why for one in found if one.why))
    groups = dict.fromkeys(one.group for one in found)
    compared = (_compared([one for one in found if one.group == group], notes) for group in groups)
    return ControlsSection(tuple(compared), notes, tuple(_about(study)))


def _about(study: StudyData) -> Iterator[str]:
    """Yield the sentences above the tables."""
    settings = study.readings.controls
    yield (
        "A haptic force also moves an arm that does nothing. The passive part of an effect is what the force would "
        "change in trials with haptics off if both hands moved as they did, and their arms, springs of "
        f"{settings.stiffnesses[0]:g} N/m, yielded to it. The rest is called communicative in dyads, and active in one "
        "person. It includes whatever people do about the forces, so it is no proof of communication."
    )
    yield (
        "An arm yields more if its owner compensates the friction of the device, so arms with the recorded device and "
        "without friction are two extremes. The tables give the range over all "
        f"{len(arms_of(settings))} arms: {listed([f'{k:g}' for k in settings.stiffnesses])} N/m, each with the device "
        "and without friction."
    )
    yield " ".join(f"{capital(one.name)}: {one.about}." for one in CONTROLS[1:])


def _compared(found: Sequence[ControlledEffect], notes: Sequence[str]) -> ComparedControls:
    title, known = capital(found[0].group), [one for one in found if one.passive]
    measured, computed = (_others(title, found, measured=kind) for kind in (True, False))
    details = {"Other computed controls": computed} if computed else {}
    if known:
        arms = grid_of(f"{title}, an arm of the usual stiffness", [*map(_by_arm, known)])
        details = {"Parts with the usual arm": arms, **details}
    parts = grid_of(f"{title}: each effect and its parts. {PARTS}", [_parts(one, notes) for one in found])
    return ComparedControls(title, _sentence(found), parts, measured, details)


PARTS = (
    "Effect: with its 95 % confidence interval. Parts: smallest to largest estimate of all arms, and in brackets the "
    "interval that contains the 95 % confidence intervals with all of them"
)
"""Explanation of the table of parts."""


def _sentence(found: Sequence[ControlledEffect]) -> str:
    """Return for which measures mechanics do not predict the whole effect, whatever the arm."""
    known = [one for one in found if one.passive]
    if not known:
        return "No effect of this comparison has a computed control."
    remain, rest = [one.measure.name for one in known if one.remains], known[0].rest
    every = f"{plural(len(known), 'measure')} with a passive part"
    if not remain:
        return f"In none of {every} does the interval of the {rest} with all arms exclude no effect."
    return (
        f"In {len(remain)} of {every}, the interval of the {rest} with all arms excludes no effect: {listed(remain)}. "
        "These intervals are not corrected for their number."
    )


def _cell(one: ControlledEffect, found: Estimate | None) -> str:
    """Return an estimate with its interval, in the display unit of its measure."""
    if found is None:
        return NONE
    row = _row(one, found)
    value, interval = written(row)[0], between(row)
    return f"{value} ({interval})" if interval else value


def _row(one: ControlledEffect, found: Estimate) -> dict[str, object]:
    scale = "ratio" if one.measure.ratio else "difference"
    return asdict(estimated(TOPIC, f"{one.measure.name}: {scale}", one.group, found, one.unit))


def _named(one: ControlledEffect) -> dict[GridColumn, Cell | float]:
    """Return the first cell of a row: the measure, with its unit."""
    unit = "ratio" if one.measure.ratio else unit_of(_row(one, one.effect)).symbol
    return {name("Measure"): f"{one.measure.name} [{unit or '1'}]"}


def _parts(one: ControlledEffect, notes: Sequence[str]) -> Row:
    """Return the row of an effect with its parts; columns are the same for all measures of a comparison."""
    return {
        **_named(one),
        number("Effect"): _cell(one, one.effect),
        number("Passive part"): f"note {notes.index(one.why) + 1}" if one.why else _range(one, "passive"),
        number(capital(one.rest)): _range(one, "rest"),
        number("Dyads"): one.effect.n,
    }


def _range(one: ControlledEffect, part: Part) -> str:
    """Return the range of the estimates with all arms, and the interval that contains theirs."""
    whole = one.over_arms(part)
    if whole is None:
        return NONE
    rows = [_row(one, replace(whole, value=value)) for value in one.range_of(part)]
    low, high = (written(row)[0] for row in rows)
    return f"{low} to {high} ({between(rows[0])})" if between(rows[0]) else f"{low} to {high}"


def _by_arm(one: ControlledEffect) -> Row:
    """Return the row of the parts of an effect with the arms of the usual stiffness."""
    by_arm = {each.arm: each for each in one.passive}
    row: Row = _named(one)
    for title, part in (("Passive part", "predicted"), (capital(one.rest), "rest")):
        for arm in one.usual_arms:
            each = by_arm.get(arm)
            row[number(f"{title}, {arm.holding}")] = _cell(one, getattr(each, part) if each else None)
    return row


def _others(title: str, found: Sequence[ControlledEffect], *, measured: bool) -> Grid | None:
    """Return the other controls of all effects, those that are conditions of the study or the computed ones."""
    chosen = {
        one.measure.name: {(each.name, each.arm): each for each in one.predictions if _is_other(each, measured)}
        for one in found
    }
    keys = dict.fromkeys(key for own in chosen.values() for key in own)
    rows = [_controls(one, chosen[one.measure.name], keys) for one in found if chosen[one.measure.name]]
    what = "conditions of this study that are controls" if measured else "other computed controls"
    return grid_of(f"{title}: {what}", rows) if rows else None


def _is_other(each: ControlPrediction, measured: bool) -> bool:
    return each.control != PASSIVE and each.measured == measured


def _controls(
    one: ControlledEffect,
    known: Mapping[tuple[str, Arm | None], ControlPrediction],
    keys: Iterable[tuple[str, Arm | None]],
) -> Row:
    """Return the row of an effect with its other controls, and for conditions of the study the rest."""
    row: Row = _named(one)
    for title, arm in keys:
        each = known.get((title, arm))
        arms = "" if arm is None else f", {arm.holding}"
        row[number(f"{capital(title)}{arms}")] = _cell(one, each.predicted if each else None)
        if arm is None:
            row[number(f"Effect minus {title.removesuffix(', measured')}")] = _cell(one, each.rest if each else None)
    row[number("Dyads")] = min(each.effect.n for each in known.values())
    return row
