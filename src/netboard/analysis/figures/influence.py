"""Directed influence of each partner on the other, compared with surrogate dyads.

The numbers come from `netboard.analysis.results.influence`. Transmission through the board counts as influence too.
"""

import numpy as np
from matplotlib.axes import Axes

from netboard.analysis.extraction.study import Study
from netboard.analysis.figures.figure import Picture
from netboard.analysis.figures.marks import look_of, many, new_mosaic, styled
from netboard.analysis.results.influence import Influence, influences

TITLE = "Influence between partners"

FEW = 6
"""Largest number of columns with horizontal names [1]."""


@styled
def picture(study: Study) -> Picture:
    """Draw the influence between partners."""
    found = [one for one in influences(study).influences if len(one.values)]
    if not found:
        why = "No condition has two people and paths of their trials, so there is no influence to look for."
        return Picture("influence", TITLE, why, None)
    figure, axes = new_mosaic(3.2, [["all"]])
    for place, one in enumerate(found):
        _column(axes["all"], place, one)
    names = [f"{one.condition.felt}\n{one.direction}" for one in found]
    axes["all"].set_xticks(range(len(found)), names, fontsize=7)
    if len(found) > FEW:
        for label in axes["all"].get_xticklabels():
            label.set(rotation=35, ha="right", rotation_mode="anchor")
    axes["all"].set_xlim(-0.6, len(found) - 0.4)
    axes["all"].set_ylim(bottom=min(0.0, axes["all"].get_ylim()[0]))
    axes["all"].set_ylabel("Granger strength [nat]")
    figure.legend(*axes["all"].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return Picture("influence", TITLE, _caption(found), figure)


def _column(axes: Axes, place: int, one: Influence) -> None:
    """Draw true dyads on the left, surrogates on the right."""
    look = look_of(one.condition)
    name = f"{one.condition.name}, {one.direction}"
    named = place == 0
    axes.plot(
        np.full(len(one.values), place - 0.15),
        one.values,
        linestyle="none",
        marker="o",
        markersize=3.5,
        color=look.colour,
        alpha=0.5,
        markeredgewidth=0.0,
        label="a dyad" if named else f"_{name}, dyads",
    )
    mean = float(np.mean(one.values))
    axes.plot(
        [place - 0.27, place - 0.03],
        [mean, mean],
        color=look.colour,
        linewidth=2.0,
        label="mean of the dyads" if named else f"_{name}, mean",
    )
    if one.chance is not None:
        at = np.full(len(one.chance.surrogates), place + 0.15)
        axes.plot(
            at,
            one.chance.surrogates,
            linestyle="none",
            marker="_",
            markersize=12,
            color="#777777",
            alpha=0.7,
            label="the same of dyads who never met" if named else f"_{name}, surrogates",
        )
        axes.text(place, 1.0, f"p = {one.chance.p:.2g}", transform=axes.get_xaxis_transform(), ha="center", fontsize=7)


def _caption(found: list[Influence]) -> str:
    n = sorted({len(one.dyads) for one in found})
    tests = [one.chance for one in found if one.chance is not None]
    chance = "With a single dyad there are no surrogates."
    if tests:
        most = max(tests, key=lambda one: one.n)
        chance = (
            f"Grey: means of dyads made of partners who never met, {many(len(most.surrogates), 'pairing')}. p: share "
            f"of all exchanges of partners whose mean is as large, at least {most.least_p:.2g}."
        )
    return (
        "How much better the velocity of one side is foretold with 60 ms of the other's past than with its own and "
        f"the ball's alone. Points: dyads, n = {' or '.join(map(str, n))}, {found[0].trials} of {found[0].of} trials "
        f"of each; bars: their mean. {chance} What passes through the board is influence too."
    )
