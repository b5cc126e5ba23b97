"""The paper's figure 6: delay between the sides in cooperative movements, by condition and threshold.

A panel with delays at each side's own peak shows the result without the bias of a common threshold. The numbers come
from `netboard.analysis.results.delay`.
"""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes

from netboard.analysis.extraction.study import Study
from netboard.analysis.figures.figure import Picture
from netboard.analysis.figures.marks import (
    Look,
    beside,
    draw_dyads,
    draw_mean,
    how_many,
    in_lines,
    listed,
    look_of,
    new_mosaic,
    styled,
    titled,
)
from netboard.analysis.results.delay import PERCENT, ConditionDelay, Delays, delay

TITLE = "Delay between the sides"

_MS = 1000.0
_WIDTH = 0.6
_BESIDE = 0.09
_FEW = 4
"""Largest number of conditions with panels side by side."""

_GREYS = ("#A0A0A0", "#757575", "#4A4A4A", "#000000")


@styled
def picture(study: Study) -> Picture:
    """Draw the delays of all conditions."""
    found = delay(study)
    shown = [one for one in found.conditions if any(np.isfinite(mean.value) for mean in one.as_set.means)]
    if not shown:
        return Picture("delay", TITLE, "No trial that counts has a cooperative movement, so there are no delays.", None)
    few = len(shown) <= _FEW
    layout = [["set", "set"], ["own", "signed"]] if few else [["set"], ["own"], ["signed"]]
    figure, axes = new_mosaic(5.0 if few else 7.2, layout, height_ratios=[1.25, 1] if few else None)
    panels: tuple[tuple[str, str, Callable[[ConditionDelay], Delays]], ...] = (
        ("set", f"{found.kind} delay, {_threshold(study)}", lambda one: one.as_set),
        ("own", f"{found.kind} delay, each side's own peak", lambda one: one.own_peak),
        ("signed", "signed delay, left less right", lambda one: one.signed),
    )
    for (name, title, delays), letter in zip(panels, "ABC", strict=True):
        titled(axes[name], letter, title)
        _panel(axes[name], shown, delays)
    _deviations(axes["signed"], shown)
    if few:
        _portions(axes["set"], len(shown))
    for name in () if few else ("set", "own"):
        axes[name].tick_params(axis="x", labelbottom=False)
    return Picture("delay", TITLE, _caption(study, shown), figure)


def _threshold(study: Study) -> str:
    of = "the slower side's peak" if study.readings.delays.threshold == "slower_side" else "each side's own peak"
    return f"threshold at a portion of {of}"


def _panel(axes: Axes, shown: list[ConditionDelay], delays: Callable[[ConditionDelay], Delays]) -> None:
    """Draw one kind of delay in each condition and at each fraction, darker for higher fractions."""
    for place, one in enumerate(shown):
        look, found = look_of(one.condition), delays(one)
        few = len(found.units) <= 40
        for offset, q, grey, mean in zip(beside(len(PERCENT), _WIDTH), PERCENT, _GREYS, found.means, strict=True):
            label = f"{one.condition.name}, {q} %"
            units = (found.units if few else found.dyads)[q]
            draw_dyads(axes, np.full(len(units), place + offset + _BESIDE), _MS * units, look.colour, f"{label}, units")
            face = "white" if look.face == "white" else grey
            draw_mean(axes, place + offset, mean, Look(grey, look.marker, face, look.line), label, scale=_MS)
    if len(shown) <= _FEW:
        axes.set_xticks(range(len(shown)), [in_lines(one.condition) for one in shown], fontsize=7.5)
    else:
        axes.set_xticks(range(len(shown)), [one.condition.label for one in shown], fontsize=7.5, rotation=90)
    axes.set_xlim(-0.5, len(shown) - 0.5)
    axes.set_ylabel("delay [ms]")
    if axes.get_ylim()[0] < 0.0:
        axes.axhline(0.0, color="#888888", linewidth=0.8, zorder=0)
    else:
        axes.set_ylim(bottom=0.0)


def _deviations(axes: Axes, shown: list[ConditionDelay]) -> None:
    """Draw the standard deviation of the signed delays as pale bars."""
    axes.use_sticky_edges = False
    for place, one in enumerate(shown):
        for offset, q, mean, spread in zip(
            beside(len(PERCENT), _WIDTH), PERCENT, one.signed.means, one.deviations.means, strict=True
        ):
            if np.isfinite([mean.value, spread.value]).all():
                axes.bar(
                    place + offset,
                    2 * _MS * spread.value,
                    0.13,
                    _MS * (mean.value - spread.value),
                    color="#E4E4E4",
                    zorder=0,
                    label=f"_{one.condition.name}, {q} %, SD",
                )


def _portions(axes: Axes, count: int) -> None:
    """Label the axis with the fractions."""
    ticks = [place + offset for place in range(count) for offset in beside(len(PERCENT), _WIDTH)]
    names = [f"{q}" if k else f"{q} %" for _ in range(count) for k, q in enumerate(PERCENT)]
    axes.set_xticks(ticks, names, minor=True, fontsize=6.5)
    axes.tick_params(axis="x", which="minor", length=2, pad=1)
    axes.tick_params(axis="x", which="major", length=0, pad=11)


def _caption(study: Study, shown: list[ConditionDelay]) -> str:
    of = {"dyads": "dyads", "people": "participants alone and dyads together", "movements": "single movements"}
    unit = study.readings.summaries.intervals
    known = [(one.condition.label, one.as_set.means[0].n, one.as_set.means[0].unit) for one in shown]
    each = how_many(known, [one.movements for one in shown], "movement")
    warning = (
        " Movements of one person are not independent, so that these intervals are too short."
        if unit == "movements"
        else ""
    )
    few = of["dyads" if unit == "movements" else unit]
    return (
        "Time between the sides' reaching a portion of a peak velocity in cooperative movements: "
        f"{listed([str(q) for q in PERCENT])} %, the darker the higher. Large points: means with 95 % t intervals over "
        f"{of[unit]}; small points: {few}. B: without the bias that one threshold for both sides has; C: pale bars are "
        f"mean ± SD within performers.{warning} {each}"
    )
