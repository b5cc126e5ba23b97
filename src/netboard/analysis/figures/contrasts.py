"""Effects of haptic feedback and of a partner on every measure, as effect sizes (g_z).

Intervals are those of the noncentral t distribution, and p values those of exact permutation tests. The numbers come
from `netboard.analysis.results.contrasts`; `netboard.analysis.figures.differences` shows them in the measures' units.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from netboard.analysis.extraction.study import Study
from netboard.analysis.figures.figure import BLACK, Picture
from netboard.analysis.figures.marks import Look, beside, draw_mean, look_of, new_mosaic, styled, titled
from netboard.analysis.results.contrasts import Comparison, Question, comparisons
from netboard.analysis.results.groups import Condition, conditions
from netboard.analysis.statistics.exact_tests import SYMMETRIC

TITLE = "Effects of forces and of a partner, standardised"

KINDS = {
    "forces": "haptics less off",
    "configuration": "dyadic less bimanual",
    "interaction": "haptics less off, dyadic less bimanual",
    "factor": "levels of other factors",
}
"""Titles of the panels."""

TICKS = (-100, -30, -10, -3, -1, 0, 1, 3, 10, 30, 100)
"""Ticks of an axis that is linear up to 1 and logarithmic beyond [1]."""

_BAND = "#F3F3F3"


@styled
def picture(study: Study) -> Picture:
    """Draw all effect sizes."""
    found = [one for one in comparisons(study).comparisons if np.isfinite(one.hedges.value)]
    if not found:
        why = "Sizes of effects take three dyads or more that have two conditions, and that differ."
        return Picture("contrasts", TITLE, why, None)
    kinds = [kind for kind in KINDS if any(one.question.kind == kind for one in found)]
    names = list(dict.fromkeys(one.measure.name for one in found))
    looks = looks_of(study, [one.question for one in found])
    most = max(len({one.question for one in found if one.question.kind == kind}) for kind in kinds)
    figure, axes = new_mosaic(1.3 + len(names) * (0.14 + 0.1 * most), [kinds])
    for kind, letter in zip(kinds, "ABCD", strict=False):
        _panel(
            axes[kind],
            [one for one in found if one.question.kind == kind],
            names,
            looks,
            _reach(found),
            figure.get_figheight(),
        )
        titled(axes[kind], letter, KINDS[kind].replace(", ", ",\n"))
        if kind != kinds[0]:
            axes[kind].set_yticklabels([])
    return Picture("contrasts", TITLE, _caption(found), figure)


def looks_of(study: Study, questions: Sequence[Question]) -> dict[str, Look]:
    """Return each contrast's style: that of the condition with haptics or a partner; black for interactions."""
    by_name: dict[str, Condition] = {one.name: one for one in conditions(study)}
    return {one.name: look_of(by_name[one.first[0]], BLACK if one.kind == "interaction" else "") for one in questions}


def _reach(found: Sequence[Comparison]) -> float:
    """Return the limit of the axes."""
    ends = [abs(end) for one in found for end in (one.hedges.value, one.hedges.low, one.hedges.high)]
    return 1.2 * max(1.0, float(np.nanmax(ends)))


def _panel(
    axes: Axes, found: Sequence[Comparison], names: Sequence[str], looks: dict[str, Look], reach: float, height: float
) -> None:
    """Draw one kind of effect, a row for each measure, with exact p values on the right."""
    questions = list(dict.fromkeys(one.question for one in found))
    offsets = dict(zip(questions, beside(len(questions), 0.5 if len(questions) <= 2 else 0.75), strict=True))
    for row in range(0, len(names), 2):
        axes.axhspan(row - 0.5, row + 0.5, color=_BAND, zorder=0, linewidth=0.0)
    axes.axvline(0.0, color="#888888", linewidth=0.8, zorder=1)
    for one in found:
        at = names.index(one.measure.name) + offsets[one.question]
        draw_mean(
            axes, at, one.hedges, looks[one.question.name], f"{one.measure.name}: {one.question.name}", across=True
        )
        p = one.contrast.permutation.p
        axes.text(1.02, at, f"{p:.3g}", transform=axes.get_yaxis_transform(), va="center", fontsize=5.5)
    axes.text(1.02, -0.75, "p", transform=axes.get_yaxis_transform(), va="center", fontsize=6.5, style="italic")
    axes.set_yticks(range(len(names)), names, fontsize=7)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xscale("asinh", linear_width=1.0)
    axes.set_xlim(-reach, reach)
    ticks = [tick for tick in TICKS if abs(tick) <= reach]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks], fontsize=6.5)
    axes.set_xticks([], minor=True)
    axes.set_xlabel("effect size g_z [1]")
    if len(questions) > 1:
        _legend(axes, questions, looks, height)


def _legend(axes: Axes, questions: Sequence[Question], looks: dict[str, Look], height: float) -> None:
    for one in questions:
        look = looks[one.name]
        axes.plot(
            [],
            [],
            linestyle="none",
            marker=look.marker,
            color=look.colour,
            markerfacecolor=look.face,
            label=_short(one),
        )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.6 / height), fontsize=6.5, handletextpad=0.2)


def _short(question: Question) -> str:
    """Return the part of a contrast's name that distinguishes it from others of its kind."""
    if question.kind == "configuration":
        return question.name.removeprefix("dyadic less bimanual, ")
    return question.name.partition(" less off")[0]


def _caption(found: Sequence[Comparison]) -> str:
    n = sorted({one.contrast.n for one in found})
    many = f"{n[0]}" if len(n) == 1 else f"{n[0]} to {n[-1]}"
    least = min(one.contrast.permutation.least_p for one in found)
    sure = sum(one.corrected < 0.05 for one in found)
    return (
        "Mean difference over the standard deviation of the dyads' differences, without bias (g_z), with 95 % "
        f"intervals of the noncentral t distribution; n = {many} dyads, each compared with itself; completion times by "
        "their logarithms. Beyond 1 the axis is logarithmic. p: exact permutation tests, which can give no p below "
        f"{least:.3g} with so many dyads. Such a test {SYMMETRIC}. Corrected within families (Holm), {sure} "
        f"of {len(found)} are below 0.05."
    )
