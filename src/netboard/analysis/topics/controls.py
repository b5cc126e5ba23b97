"""Controls: each effect of haptic feedback beside what mechanics alone predict of it.

The passive part of an effect is what the haptic force would change in trials with haptics off, if both partners moved
as they did, and only their arms yielded to it (`netboard.analysis.extraction.controls`). The rest of the effect is its
communicative part; that of one person with both hands is called active. Both have confidence intervals over dyads, of
the same method as the effect. Neither the stiffness of the arms nor the friction that people compensate is known, so
all assumed arms are reported, and an interval that contains those of all arms.

Conditions that a study has are controls, too, and the only ones of measures of the ball: a force without the partner's
part, and a partner who is not a person.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import nan
from operator import itemgetter
from typing import TYPE_CHECKING, Literal

import numpy as np
import pandas as pd

from netboard.analysis.extraction.controls import CONTROLS, Arm, Control, arms_of
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.statistics.estimates import Estimate, mean_interval, t_interval
from netboard.analysis.topics.figure import BAND, NO_EFFECT, Drawn, beside, draw_mean, look_of, pictured, span
from netboard.analysis.topics.groups import (
    Condition,
    conditions,
    estimated,
    interval_text,
    paired_levels,
    performed_by,
    with_base,
)
from netboard.analysis.topics.measures import (
    COLUMNS,
    Measure,
    exponential,
    grid,
    legend,
    levels_of_performers,
    measures_of,
)
from netboard.analysis.topics.result import Result, TopicResults, cached, plain
from netboard.analysis.topics.units import read_in
from netboard.base.looks import PRINT_FINE, PRINT_SMALL
from netboard.base.plural import noun
from netboard.base.tables.forces import CONDITIONS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Part = Literal["passive", "rest"]
"""Part of an effect: what mechanics alone predict, or the rest."""

TOPIC = "controls"

WHOLE_FORCE = "full"
"""Force condition of which controls are computed."""

PASSIVE = CONTROLS[0]
"""Control that is the passive part of an effect."""

ALL_ARMS = "all arms"
"""Name of the interval that contains those of all arms."""

NO_ROWS = "no dyad has successful trials of two people with haptics off, in a scene with a free board"
"""Reason why nothing could be computed of any measure."""


@dataclass(frozen=True, slots=True, eq=False)
class ControlPrediction:
    """What a control predicts of an effect, with the rest of the effect, over the dyads that have both.

    `control` and `arm` are None for a control that is a condition of the study. For a ratio measure the estimates are
    ratios: the effect is the product of both.
    """

    name: str
    control: Control | None
    arm: Arm | None
    effect: Estimate
    predicted: Estimate
    rest: Estimate

    @property
    def measured(self) -> bool:
        """Whether it is a condition of the study."""
        return self.control is None


@dataclass(frozen=True, slots=True, eq=False)
class ControlledEffect:
    """Effect of a haptic condition on a measure, with its controls; `why` no control is computed, empty if one is."""

    measure: Measure
    condition: Condition
    effect: Estimate
    predictions: tuple[ControlPrediction, ...]
    usual_arms: tuple[Arm, ...]
    why: str = ""

    @property
    def group(self) -> str:
        """Name of the comparison."""
        return f"{self.condition.label} vs off"

    @property
    def rest(self) -> str:
        """Name of the part that mechanics do not predict: with one person, there is nobody to communicate with."""
        return "communicative part" if self.condition.configuration == "dyadic" else "active part"

    @property
    def unit(self) -> str:
        """SI unit; 1 for a ratio."""
        return "1" if self.measure.ratio else self.measure.unit

    @property
    def none(self) -> float:
        """Value of no effect [its unit]."""
        return 1.0 if self.measure.ratio else 0.0

    @property
    def passive(self) -> tuple[ControlPrediction, ...]:
        """Passive part with each arm."""
        return tuple(one for one in self.predictions if one.control == PASSIVE)

    @property
    def usual(self) -> tuple[ControlPrediction, ...]:
        """Passive part with the arms of usual stiffness, with the device first."""
        return tuple(one for one in self.passive if one.arm in self.usual_arms)

    def over_arms(self, part: Part) -> Estimate | None:
        """Return a part with an interval that contains those of all arms; None without a computed control."""
        found = self._with_arms(part)
        if not found:
            return None
        low, high = min(one.low for one in found), max(one.high for one in found)
        return replace(found[0], low=low, high=high, method=f"{found[0].method}, all of {len(found)} arms")

    def range_of(self, part: Part) -> tuple[float, float]:
        """Return the smallest and the largest estimate of a part, of all arms [its unit]."""
        values = [one.value for one in self._with_arms(part)]
        return min(values), max(values)

    def _with_arms(self, part: Part) -> list[Estimate]:
        """Return a part with each arm, that of the usual stiffness with the device first."""
        return [one.predicted if part == "passive" else one.rest for one in self.passive]

    @property
    def remains(self) -> bool:
        """Whether no effect lies outside the interval of the rest that contains those of all arms."""
        rest = self.over_arms("rest")
        return rest is not None and not rest.low <= self.none <= rest.high and np.isfinite(rest.low)


def _results(one: ControlledEffect) -> Iterator[Result]:
    """Yield an effect, each control of it, and the rest; or why there is none."""
    what = f"{one.measure.name}: {'ratio' if one.measure.ratio else 'difference'}"

    def row(part: str, found: Estimate, note: str = "") -> Result:
        return estimated(TOPIC, f"{what}, {part}", one.group, found, one.unit, note)

    yield row("effect", one.effect)
    if one.why:
        yield plain(TOPIC, f"{what}, passive part", one.group, nan, one.unit, 0, "dyad", one.why)
    for each in one.predictions:
        passive = each.control == PASSIVE
        arm = "" if each.arm is None else f", {each.arm.name}"
        about = "a condition of the study" if each.control is None else each.control.about
        yield row(f"passive part{arm}" if passive else f"{each.name}{arm}", each.predicted, about)
        yield row(f"{one.rest}{arm}" if passive else f"effect minus {each.name}{arm}", each.rest, REST)
    parts: dict[Part, str] = {"passive": "passive part", "rest": one.rest}
    for part, name in parts.items():
        if (found := one.over_arms(part)) is not None:
            yield row(f"{name}, {ALL_ARMS}", found, ARMS_NOTE)


REST = "what the control does not predict; people also stiffen and react to what they see: no proof of communication"
"""Note on the rest of an effect."""

ARMS_NOTE = "from the lowest to the highest limit of the intervals with all arms; the value is that of the first arm"
"""Note on the interval that contains those of all arms."""


@cached
def controls(study: StudyData) -> TopicResults[ControlledEffect]:
    """Compute the controls of every effect of haptic feedback on a compared measure, between human performers."""
    compared = _comparisons(study)
    known, arms, who = _rows(study), arms_of(study.readings.controls), performed_by(conditions(study))
    found = []
    for measure in measures_of(study) if compared else ():
        if measure.compared:
            levels = _Levels(measure, _table(study, measure, known), who)
            found += [effect for one in compared for effect in _controlled(levels, one, arms)]
    return TopicResults.of(sorted(found, key=lambda one: one.condition.configuration != "dyadic"), _results)


@dataclass(frozen=True, slots=True)
class _Comparison:
    """A haptic condition and the one without, conditions that are controls, and why none can be computed.

    Each of the controls is a name, and two conditions whose difference it is.
    """

    felt: Condition
    off: Condition
    measured: tuple[tuple[str, Condition, Condition], ...]
    unlike: str


def _comparisons(study: StudyData) -> tuple[_Comparison, ...]:
    """Return the comparisons of a study, without those of forces that serve as a control of the whole force."""
    every = conditions(study)
    pairs = [(felt, off) for felt, off in with_base(every) if not felt.partner]
    whole = {felt.team for felt, _ in pairs if felt.force == WHOLE_FORCE}
    return tuple(
        _Comparison(felt, off, tuple(_measured(felt, off, every)), _unlike(study, felt, off))
        for felt, off in pairs
        if felt.force not in _CONTROL_FORCES or felt.team not in whole
    )


_BETWEEN = " | "
"""Separates a condition, a control and an arm in the name of a column."""

_CONTROL_FORCES = {name for name, one in CONDITIONS.items() if one.control}


def _rows(study: StudyData) -> pd.DataFrame:
    """Return the attempts in controls that count, under names of conditions, controls and arms."""
    rows = study.controls[study.controls["counts"] == 1]
    names = zip(rows["condition"], rows["control"], rows["arm"], strict=True)
    return rows.assign(condition=[_BETWEEN.join(each) for each in names])


def _table(study: StudyData, measure: Measure, known: pd.DataFrame) -> pd.DataFrame:
    """Return the level of each performer (rows) in each condition, and in each control with each arm (columns)."""
    tables = [levels_of_performers(study, measure)]
    if not measure.uncontrolled and len(known):
        weights = itemgetter("movements") if measure.of == "movement" else measure.weights
        tables.append(levels_of_performers(study, replace(measure, weights=weights), known))
    return pd.concat(tables).pivot(index=["dyad", "performer"], columns="condition", values="level")


class _Levels:
    """Levels of a measure in conditions and controls, of which effects are differences."""

    def __init__(self, measure: Measure, table: pd.DataFrame, who: Mapping[str, object]) -> None:
        self.measure, self._table = measure, table
        self._who = {**who, **{name: who[name.partition(_BETWEEN)[0]] for name in table.columns}}

    def of(self, names: Sequence[str]) -> pd.DataFrame:
        """Return the levels of the dyads that have all of some columns; empty if one is unknown."""
        if not set(names) <= set(self._table.columns):
            return pd.DataFrame()
        return paired_levels(self._table, self._who, list(dict.fromkeys(names))).dropna()

    def effect(self, values: pd.Series) -> Estimate:
        """Return the mean of differences with its confidence interval, as in the contrasts of the report."""
        if self.measure.ratio:
            return exponential(t_interval(values.to_numpy()))
        return mean_interval(values.to_numpy(), self.measure.of_difference)

    def split(self, effect: Sequence[str], control: Sequence[str]) -> tuple[Estimate, Estimate, Estimate] | None:
        """Return effect, prediction and rest over the dyads that have all of them; None if there are none."""
        levels = self.of([*effect, *control])
        if not len(levels):
            return None
        whole, predicted = (levels[one] - levels[other] for one, other in (effect, control))
        rest = t_interval((whole - predicted).to_numpy())
        return self.effect(whole), self.effect(predicted), exponential(rest) if self.measure.ratio else rest


def _controlled(levels: _Levels, one: _Comparison, arms: Sequence[Arm]) -> Iterator[ControlledEffect]:
    """Yield an effect with its controls; none if no dyad has both conditions."""
    names = one.felt.name, one.off.name
    whole = levels.of(names)
    if not len(whole):
        return
    why, found = levels.measure.uncontrolled or one.unlike, []
    for control, arm in () if why else product(CONTROLS, arms):
        columns = [_BETWEEN.join((one.off.name, control.name, name)) for name in (arm.name, "")]
        if parts := levels.split(names, columns):
            found.append(ControlPrediction(control.name, control, arm, *parts))
    why = why or ("" if found else NO_ROWS)
    for name, first, second in one.measured:
        if parts := levels.split(names, (first.name, second.name)):
            found.append(ControlPrediction(name, None, None, *parts))
    effect = levels.effect(whole[names[0]] - whole[names[1]])
    yield ControlledEffect(levels.measure, one.felt, effect, tuple(found), tuple(arms[:2]), why)


def _unlike(study: StudyData, felt: Condition, off: Condition) -> str:
    """Return why controls of the whole force are none of a haptic condition; empty if they are."""
    if felt.force != WHOLE_FORCE:
        return f"computed for {CONDITIONS[WHOLE_FORCE].label} only, not for {felt.haptics}"
    settings = [study.blocks.loc[study.blocks["condition"] == one.name, _FORCE] for one in (felt, off)]
    known = pd.concat(settings).drop_duplicates()
    alike = all(map(len, settings)) and len(known) == 1 and known.notna().all(axis=None)
    if felt.other_levels != off.other_levels or not alike or settings[0]["force_delay"].any():
        return UNLIKE
    return ""


UNLIKE = "not computed, because the two conditions differ in more than the force, or the force has a delay"
"""Reason why trials with haptics off cannot tell what the force would have been."""

_FORCE = ["force_scale", "force_delay"]
"""Settings of the force in the table of blocks, which the computed force needs as in the trials with haptics on."""


def _measured(
    felt: Condition, off: Condition, every: Sequence[Condition]
) -> Iterator[tuple[str, Condition, Condition]]:
    """Yield the conditions that are controls: their name, and the two whose difference is the prediction."""
    for one, base in with_base(tuple(every)):
        alike = (one.configuration, one.other_levels) == (felt.configuration, felt.other_levels)
        if base == off and one.force in _CONTROL_FORCES and one != felt:
            yield f"{one.haptics}, measured", one, base
        elif alike and one.partner and not felt.partner and one.force == felt.force:
            yield f"{one.partner}, measured", one, base


# --- figure ----------------------------------------------------------------------------------------------------------


ROWS = ("effect", "passive part", "rest", "environment only", "recorded partner")
"""Rows of a panel, from the top."""


@pictured("Effects of forces beside what mechanics alone predict")
def picture(study: StudyData) -> Drawn:
    """Draw each effect of haptic feedback with a computed control, its parts, and the other controls."""
    found = [one for one in controls(study).parts if one.passive]
    if not found:
        return f"No controls: {NO_ROWS}, and the same with {CONDITIONS[WHOLE_FORCE].label}."
    names = list(dict.fromkeys(one.measure.name for one in found))
    felt = list(dict.fromkeys(one.condition for one in found))
    figure, axes = grid(names, 1.2 + 0.35 * len(felt), COLUMNS)
    for place, name in enumerate(names):
        _panel(axes[name], [one for one in found if one.measure.name == name], felt, labelled=place % COLUMNS == 0)
    legend(figure, felt)
    return figure, _caption(found)


def _panel(axes: "Axes", found: Sequence[ControlledEffect], felt: Sequence[Condition], *, labelled: bool) -> None:
    """Draw the controls of a measure: one colour for each condition; hollow: without the friction of the device."""
    measure = found[0].measure
    unit = read_in(found[0].unit, f"{measure.name}: difference")
    axes.axvline(found[0].none, **NO_EFFECT)
    for row in range(0, len(ROWS), 2):
        axes.axhspan(row - 0.5, row + 0.5, color=BAND, zorder=0, linewidth=0.0)
    for one, shift in ((one, beside(len(felt), 0.45)[felt.index(one.condition)]) for one in found):
        look = look_of(one.condition)
        hollow = replace(look, face="white")
        draw_mean(axes, shift, one.effect, look, f"{one.group}, effect", scale=unit.scale, across=True)
        if (whole := one.over_arms("rest")) is not None:
            ends = [unit.scale * whole.low, unit.scale * whole.high]
            axes.plot(ends, [2 + shift] * 2, color=look.colour, linewidth=5.0, alpha=0.25, solid_capstyle="butt")
        for each in one.predictions:
            if each.arm in one.usual_arms:
                at = shift + (0.07 if each.arm.device else -0.07)
                mark = look if each.arm.device else hollow
                rows = [(1, each.predicted), (2, each.rest)] if each.control == PASSIVE else []
                for row, mean in rows or [(ROWS.index(each.name), each.predicted)]:
                    label = f"{one.group}, {ROWS[row]}, {each.arm.name}"
                    draw_mean(axes, row + at, mean, mark, label, scale=unit.scale, across=True)
    axes.set_title(measure.name, loc="left", fontsize=PRINT_SMALL)
    axes.set_xlabel(f"difference {unit.in_brackets}", fontsize=PRINT_SMALL)
    axes.set_yticks(range(len(ROWS)), ROWS if labelled else [""] * len(ROWS), fontsize=PRINT_FINE)
    axes.set_ylim(len(ROWS) - 0.5, -0.5)
    axes.tick_params(axis="x", labelsize=6.5)
    axes.tick_params(axis="y", length=0)


def _caption(found: Sequence[ControlledEffect]) -> str:
    usual = [one.arm.stiffness for one in found[0].usual if one.arm]
    device = "filled: with the mass and friction of the recorded device, hollow: no friction"
    arms = f"{usual[0]:g} N/m, {device if len(usual) > 1 else 'without a device, which is unknown'}"
    stiffnesses = ", ".join(dict.fromkeys(f"{one.arm.stiffness:g}" for one in found[0].passive if one.arm))
    others = "; ".join(f"{one.name}: {one.about}" for one in CONTROLS[1:])
    intervals = interval_text(mean for one in found for mean in (one.effect, one.usual[0].rest))
    n = [one.effect.n for one in found]
    return (
        "Change with haptic feedback of each measure that the hands alone determine; measures of the ball have no "
        "computed control. Effect: as recorded. Passive part: what the force changes in trials with haptics off if "
        f"both arms yield to it. Rest: effect minus passive part. Arms of {arms}. Pale bar: the intervals of the rest "
        f"with all arms ({stiffnesses} N/m). {others[0].upper()}{others[1:]}. Points: means over dyads with "
        f"{intervals}; n = {span(n)} {noun(max(n), 'dyad')}."
    )
