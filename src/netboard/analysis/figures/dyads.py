"""The paper's figure 3: participants relative to partners and dyads, in completion time and velocity peaks.

A plane has one point for each participant; beside it are the gains of the dyads. The numbers come from
`netboard.analysis.results.dyads`.
"""

import numpy as np
from matplotlib.axes import Axes

from netboard.analysis.extraction.study import Study
from netboard.analysis.figures.figure import BLACK, GREEN, ORANGE, PINK, SKY, YELLOW, Picture
from netboard.analysis.figures.marks import (
    Look,
    draw_dyads,
    draw_mean,
    how_many,
    look_of,
    new_mosaic,
    styled,
    titled,
)
from netboard.analysis.results.dyads import Comparison, dyads
from netboard.analysis.results.groups import QUANTITIES
from netboard.base.tables.forces import FORCES

TITLE = "Dyads and their partners alone"

_FORCES = dict(zip(FORCES[2:], (SKY, GREEN, PINK, ORANGE, YELLOW), strict=False))
"""Colours of the force conditions that are neither off nor on."""


@styled
def picture(study: Study) -> Picture:
    """Draw the performance of dyads relative to their participants alone."""
    found = [one for one in dyads(study).comparisons if one.known]
    if not found:
        why = "No dyad has performed together with a force with which both of its participants have performed alone."
        return Picture("dyads", TITLE, why, None)
    columns = [quantity.column for quantity in QUANTITIES]
    rows = [columns, [f"gain {column}" for column in columns]]
    forces = len({one.condition.force for one in found})
    figure, axes = new_mosaic(3.65 + 0.36 * forces, rows, height_ratios=[3.05, 0.3 + 0.36 * forces])
    for quantity, letter, below in zip(QUANTITIES, "AB", "CD", strict=True):
        own = [one for one in found if one.quantity == quantity]
        _plane(axes[quantity.column], own)
        titled(axes[quantity.column], letter, quantity.name)
        _gains(axes[f"gain {quantity.column}"], own)
        titled(axes[f"gain {quantity.column}"], below, "gain of the dyad")
    return Picture("dyads", TITLE, _caption(found), figure)


def _look(one: Comparison) -> Look:
    """Return the style: black with and without haptics; colours for parts of the force."""
    return look_of(one.condition, _FORCES.get(one.condition.force, BLACK))


def _plane(axes: Axes, found: list[Comparison]) -> None:
    """Draw all participants, joined within a dyad, and the diagonal."""
    unit = found[0].quantity.unit if found else "1"
    every = [
        value
        for one in found
        for point in one.points
        for value in (point.relative.against_partner, point.relative.of_dyad)
    ]
    reach = 1.15 * max([1e-3, *map(abs, every)])
    axes.fill_between([-reach, reach], [-reach, reach], -reach, color="#EEEEEE", zorder=0, linewidth=0.0)
    axes.plot([-reach, reach], [-reach, reach], color="#888888", linewidth=0.8, zorder=1, label="_diagonal")
    axes.text(0.97 * reach, -0.97 * reach, "dyad better\nthan the mean of both", ha="right", va="bottom", fontsize=7)
    for one in found:
        look = _look(one)
        for first, second in zip(one.points[::2], one.points[1::2], strict=True):
            pair = (first.relative, second.relative)
            x, y = [point.against_partner for point in pair], [point.of_dyad for point in pair]
            axes.plot(
                x,
                y,
                color=look.colour,
                linewidth=0.7,
                linestyle=look.line,
                zorder=2,
                label=f"_{first.dyad} {one.condition.force}",
            )
        axes.plot(
            [point.relative.against_partner for point in one.points],
            [point.relative.of_dyad for point in one.points],
            linestyle="none",
            marker=look.marker,
            markersize=5,
            color=look.colour,
            markerfacecolor=look.face,
            zorder=3,
            label=f"_{one.condition.force}",
        )
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    axes.set_aspect("equal")
    axes.set_xlabel(f"(partner - self) / 2 [{unit}]")
    axes.set_ylabel(f"dyad - self [{unit}]")


def _gains(axes: Axes, found: list[Comparison]) -> None:
    """Draw the gain of each dyad and their mean, a row for each haptic condition."""
    axes.axvline(0.0, color="#888888", linewidth=0.8, zorder=1)
    for row, one in enumerate(found):
        look, gains = _look(one), one.gains
        draw_dyads(axes, gains, np.full(len(gains), row + 0.27), look.colour, one.condition.force)
        draw_mean(axes, row, one.gain, look, one.condition.force, across=True)
    names = [f"{one.condition.felt}:\n{one.better} of {one.known} dyads better" for one in found]
    axes.set_yticks(range(len(found)), names)
    axes.set_ylim(max(len(found), 1) - 0.5, -0.5)
    axes.set_xlabel(f"mean of the two alone less dyad [{found[0].quantity.unit if found else '1'}]")


def _caption(found: list[Comparison]) -> str:
    known = [(f"{one.condition.felt}, {one.quantity.name}", one.known, "dyad") for one in found]
    least = [one.test.least_p for one in found if np.isfinite(one.test.least_p)]
    power = f" A sign test of so many dyads can give no p below {min(least):.3g}." if least else ""
    return (
        "A, B: a point for each participant, the two of a dyad joined. To the right: better than the partner, both "
        "alone with the same force; upwards: the dyad needs more than the participant alone. C, D: gains of the dyads "
        "(small points), and their means with 95 % t intervals (large). "
        f"{how_many(known)}{power}"
    )
