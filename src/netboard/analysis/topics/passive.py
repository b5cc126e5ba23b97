"""Passive-partner control: the mechanical part of the haptic effect on cooperative movement.

The effect is the dyad's share of cooperative movement with haptic feedback minus the share without. The passive effect
is the share that each side's recorded movement would have with a passive partner instead of the other participant; a
still partner has none (`netboard.analysis.measures.passive`). The rest of the effect, which mechanics alone do not
predict, is its communicative part: both parts have a confidence interval over dyads. Device friction suppresses most of
this movement, so each passive effect is reported twice: for a hand without friction, an upper bound, and for a hand
that holds the recorded device.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.extraction.attempts import STIFFNESSES
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.statistics.estimates import Estimate, bootstrap, mean_interval, ratio_of_sums
from netboard.analysis.topics.figure import (
    NO_EFFECT,
    Drawn,
    beside,
    draw_dyads,
    draw_mean,
    look_of,
    new_mosaic,
    pictured,
)
from netboard.analysis.topics.groups import Condition, conditions, estimated, interval_text, with_base
from netboard.analysis.topics.measures import levels, measures_of, rows_of
from netboard.analysis.topics.result import Result, TopicResults
from netboard.analysis.topics.units import PERCENT, POINTS
from netboard.base.plural import plural

REST = (
    "the effect minus the passive effect: what mechanics alone do not predict; an arm that stiffens is active, too, so "
    "it is no proof of communication"
)
"""Note on the communicative part of an effect."""

SEED = 20_170_605
"""Seed of the bootstrap."""


@dataclass(frozen=True, slots=True, eq=False)
class Control:
    """Effect of a haptic condition, and its passive effect for an arm's `stiffness` [N/m] and device `friction` [N].

    Friction is NaN for a hand alone, without a device. The communicative part is the effect minus the passive effect.
    `share` is the sum of the passive effects over that of the effects, with a bootstrap over dyads: 1 = all is
    mechanics [1].
    """

    condition: Condition
    stiffness: int
    friction: float
    dyads: tuple[str, ...]
    effect: NDArray[np.float64]
    passive: NDArray[np.float64]
    mean_effect: Estimate
    mean_passive: Estimate
    mean_communicative: Estimate
    share: Estimate

    @property
    def with_device(self) -> bool:
        """Whether the passive hand holds the recorded device."""
        return not np.isnan(self.friction)

    @property
    def arm(self) -> str:
        """Description of the passive hand."""
        return f"{self.stiffness} N/m, {'with the device' if self.with_device else 'no friction'}"

    @property
    def has_effect(self) -> bool:
        """Whether the share is meaningful: the effect's confidence interval excludes 0."""
        return self.mean_effect.low > 0.0 or self.mean_effect.high < 0.0


def _results(found: Sequence[Control]) -> Iterator[Result]:
    """Yield the effect of each haptic condition, and for each stiffness the passive effect and its share."""
    felt = None
    for one in found:
        group = f"{one.condition.label} vs off"
        if one.condition != felt:
            felt = one.condition
            yield _row("haptic effect on cooperative share", group, one.mean_effect, "")
        yield _row(f"passive effect on cooperative share, {one.arm}", group, one.mean_passive, _held(one))
        rest = f"communicative part of the effect on cooperative share, {one.arm}"
        yield _row(rest, group, one.mean_communicative, f"{REST}; {_held(one)}")
        share, note = one.share, f"1 = entirely mechanical; intervals of few dyads are too short; {_held(one)}"
        if not one.has_effect:
            share = replace(share, value=np.nan, low=np.nan, high=np.nan)
            note = "no share, because the effect may be 0: its confidence interval includes 0, or there is none"
        yield _row(f"passive share of the effect, {one.arm}", group, share, note)


def _held(one: Control) -> str:
    """Return a description of the passive partner."""
    if one.with_device:
        return f"a passive partner who holds the recorded device, friction {one.friction:.2f} N"
    return "a passive partner without the device's friction: an upper bound"


def _row(quantity: str, group: str, found: Estimate, note: str) -> Result:
    return estimated("passive", quantity, group, found, "1", note)


def controls(study: StudyData) -> TopicResults[Control]:
    """Compare the effect of haptic feedback with that of a passive partner.

    Controls come by haptic condition, then by stiffness; without friction and then with the device, if known. There are
    none if no dyad has dyadic trials both with and without haptic feedback.
    """
    cooperative = next(measure for measure in measures_of(study) if measure.name == "cooperative share")
    live = levels(study, cooperative)
    found = []
    for stiffness in STIFFNESSES:
        for name, held in ((f"passive_{stiffness}", False), (f"passive_{stiffness}_device", True)):
            passive = levels(study, replace(cooperative, values=itemgetter(name)))
            for felt, off in with_base(conditions(study)):
                columns = [_of(live, felt), _of(live, off), _of(passive, felt)]
                table = pd.concat(columns, axis=1, join="inner").sort_index()
                friction = _friction(study, felt) if held else np.nan
                if felt.configuration == "dyadic" and not felt.partner and len(table):
                    found.append(_control(felt, stiffness, friction, table))
    found.sort(key=lambda one: one.condition.name)
    return TopicResults(tuple(found), tuple(_results(found)))


def _friction(study: StudyData, condition: Condition) -> float:
    rows = rows_of(study, "trial")
    return float(rows.loc[rows["condition"] == condition.name, "passive_friction"].mean())


def _of(table: pd.DataFrame, condition: Condition) -> pd.Series:
    """Return the levels of the dyads in a condition."""
    return table[table["condition"] == condition.name].set_index("dyad")["level"]


def _control(condition: Condition, stiffness: int, friction: float, table: pd.DataFrame) -> Control:
    """Compare the columns on, off and passive of a table of dyads."""
    on, off, passive = table.to_numpy().T
    effect = on - off
    share = bootstrap((passive, effect), ratio_of_sums, np.random.default_rng(SEED))
    return Control(
        condition=condition,
        stiffness=stiffness,
        friction=friction,
        dyads=tuple(table.index),
        effect=effect,
        passive=passive,
        mean_effect=mean_interval(effect, "balance"),
        mean_passive=mean_interval(passive, "share"),
        mean_communicative=mean_interval(effect - passive, "balance"),
        share=share,
    )


_NONE = "The mechanical part of the effect cannot be estimated, because the effect may be 0."


@pictured("The part that a passive partner would show")
def picture(study: StudyData) -> Drawn:
    """Draw the effect of haptic feedback and the passive effect.

    The passive effect is shown without friction, an upper bound, and with the device's friction if known.
    """
    found = controls(study).parts
    if not found:
        return "No dyad has trials of two people both with and without forces, in a scene with a free board."
    figure, panels = new_mosaic(3.0, [["all"]])
    axes = panels["all"]
    axes.axhline(0.0, **NO_EFFECT)
    felt = list(dict.fromkeys(one.condition for one in found))
    columns = list(range(1 + len({one.arm for one in found})))
    for condition, offset in zip(felt, beside(len(felt), 0.5), strict=True):
        own = [one for one in found if one.condition == condition]
        look = look_of(condition)
        for k, dyad in enumerate(own[0].dyads):
            values = [own[0].effect[k], *(one.passive[k] for one in own)]
            draw_dyads(
                axes,
                np.array(columns) + offset + 0.06,
                POINTS.scale * np.array(values),
                look.colour,
                f"{condition.name}, {dyad}",
                joined=True,
            )
        means = [own[0].mean_effect, *(one.mean_passive for one in own)]
        for place, mean in zip(columns, means, strict=True):
            draw_mean(axes, place + offset, mean, look, f"{condition.name}, {place}", scale=POINTS.scale)
        axes.plot([], [], linestyle="none", marker=look.marker, color=look.colour, label=condition.haptics_label)
    names = [
        "haptics on minus off,\nas recorded",
        *(f"passive,\n{one.arm.replace(', ', ',' + chr(10))}" for one in found if one.condition == felt[0]),
    ]
    axes.set_xticks(columns, names, fontsize=7)
    axes.set_xlim(-0.5, columns[-1] + 0.5)
    axes.set_ylabel(f"change of the cooperative share {POINTS.in_brackets}")
    if len(felt) > 1:
        axes.legend(loc="best")
    return figure, _caption(found)


def _caption(found: tuple[Control, ...]) -> str:
    shares = "; ".join(_share(one) for one in found if one.has_effect)
    mechanical = f"Mechanical part of the effect, with 95 % confidence intervals (bootstrap, BCa): {shares}."
    rests = "; ".join(map(_rest, found))
    rest = f" Communicative part (the effect minus the passive effect), with 95 % confidence intervals: {rests}."
    means = [mean for one in found for mean in (one.mean_effect, one.mean_passive)]
    return (
        "Share of cooperative movement in dyadic trials. Left: its change from haptics off to haptics on, as recorded. "
        "Right: the share with a simulated passive partner in place of either participant, while the other hand moves "
        "as recorded. The board moves the passive hand, which makes no movement of its own. "
        f"{_device(found)} Large points: means over dyads with {interval_text(means)}; small points: dyads, joined; "
        f"n = {plural(len(found[0].dyads), 'dyad')}. {mechanical if shares else _NONE}{rest}"
    )


def _device(found: tuple[Control, ...]) -> str:
    """Return sentences on the arms of the passive hand."""
    frictions = [one.friction for one in found if one.with_device]
    arms = ", ".join(f"{k} N/m" for k in STIFFNESSES)
    alone = f"Stiffness of its arm: {arms}. Without friction, the share is an upper bound."
    if not frictions:
        return f"{alone} The friction of the device is unknown."
    return f"{alone} With the device, it also has the device's friction of {np.mean(frictions):.2f} N."


def _rest(one: Control) -> str:
    """Return the communicative part of an effect in percentage points, with its confidence interval."""
    mean = one.mean_communicative
    value, low, high = (f"{POINTS.scale * end:.1f}" for end in (mean.value, mean.low, mean.high))
    ends = f" ({low} to {high})" if np.isfinite(mean.low) else ""
    return f"{one.condition.haptics_label}, {one.arm}: {value} points{ends}"


def _share(one: Control) -> str:
    value, low, high = (f"{PERCENT.scale * end:.0f}" for end in (one.share.value, one.share.low, one.share.high))
    ends = f" ({low} to {high})" if np.isfinite(one.share.low) else ""
    return f"{one.condition.haptics_label}, {one.stiffness} N/m: {value} %{ends}"
