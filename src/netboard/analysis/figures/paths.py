"""Mean paths of ball and hands in each condition, with the spread of the trials.

Trials with the target on the left are mirrored. The numbers come from `netboard.analysis.results.paths`.
"""

from typing import Literal

from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from netboard.analysis.extraction.study import Study
from netboard.analysis.figures.figure import BLACK, Picture
from netboard.analysis.figures.marks import how_many, look_of, new_mosaic, styled, titled
from netboard.analysis.results.groups import Condition
from netboard.analysis.results.paths import BAND, QUANTITIES, Course, courses
from netboard.analysis.results.units import read_in

TITLE = "The course of a trial"

COLUMNS = 4
"""Conditions in a row [1]."""

_STYLES: dict[str, Literal["-", "--"]] = {"near": "-", "far": "--"}
_HANDS = {"near": BLACK, "far": "#555555"}
_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


@styled
def picture(study: Study) -> Picture:
    """Draw mean paths."""
    found = courses(study).courses
    if not found:
        return Picture("paths", TITLE, "No trial that counts has a path.", None)
    shown = list(dict.fromkeys(one.condition for one in found))
    lines = [shown[k : k + COLUMNS] for k in range(0, len(shown), COLUMNS)]
    figure, axes = new_mosaic(0.4 + 3.9 * len(lines), _layout(lines))
    for place, condition in enumerate(shown):
        ball, hands = (axes[f"{what} {condition.name}"] for what in ("ball", "hands"))
        for one in (one for one in found if one.condition == condition):
            _course(ball if one.quantity == "ball" else hands, one)
        titled(ball, _LETTERS[place], condition.label.replace(", ", ",\n"))
        hands.set_xlabel("time from the release [s]")
        ball.tick_params(labelbottom=False)
    for what, label in (("ball", "ball towards the target [mm]"), ("hands", "height of the hands [mm]")):
        _alike(axes, [[f"{what} {one.name}" for one in line] for line in lines], label)
    handles = [Line2D([], [], color=colour, linestyle=_STYLES[name]) for name, colour in _HANDS.items()]
    figure.legend(handles, [QUANTITIES[name] for name in _HANDS], loc="outside lower center", ncols=2)
    return Picture("paths", TITLE, _caption(found), figure)


def _layout(lines: list[list[Condition]]) -> list[list[str]]:
    """Return a layout with the hands of each condition below its ball."""
    width = len(lines[0])
    rows = [[f"{what} {one.name}" for one in line] for line in lines for what in ("ball", "hands")]
    return [row + ["."] * (width - len(row)) for row in rows]


def _alike(axes: dict[str, Axes], lines: list[list[str]], label: str) -> None:
    """Give panels of one quantity the same scale, and label the first panel of each row."""
    names = [name for line in lines for name in line]
    lows, highs = zip(*(axes[name].get_ylim() for name in names), strict=True)
    for name in names:
        axes[name].set_ylim(min(lows), max(highs))
        axes[name].tick_params(labelleft=any(name == line[0] for line in lines))
    for line in lines:
        axes[line[0]].set_ylabel(label)


def _course(axes: Axes, one: Course) -> None:
    """Draw a quantity: each dyad, their mean, and the band of the trials."""
    look, scale = look_of(one.condition), read_in("m").scale
    name = f"{one.condition.name}, {one.quantity}"
    colour = "#555555" if one.quantity == "far" else look.colour
    axes.axhline(0.0, color="#BBBBBB", linewidth=0.6, zorder=0)
    axes.fill_between(
        one.time, scale * one.low, scale * one.high, color=colour, alpha=0.16, linewidth=0.0, label=f"_{name}, trials"
    )
    for dyad, own in zip(one.dyads, one.each, strict=True):
        axes.plot(one.time, scale * own, color=colour, linewidth=0.5, alpha=0.5, label=f"_{name}, {dyad}")
    axes.plot(
        one.time,
        scale * one.mean,
        color=colour,
        linewidth=1.5,
        linestyle=_STYLES.get(one.quantity, "-"),
        label=f"_{name}",
    )


def _caption(found: tuple[Course, ...]) -> str:
    low, high = (round(100 * share) for share in BAND)
    own = [one for one in found if one.quantity == "ball"]
    known = how_many(
        [(one.condition.label, len(one.dyads), "dyad") for one in own], [one.trials for one in own], "trial"
    )
    return (
        "Ball and hands from the release on, as long as nine of ten trials go on; trials with the target at the left "
        f"are mirrored. Thick: means over dyads; thin: dyads; bands: from {low} % to {high} % of the trials. {known}"
    )
