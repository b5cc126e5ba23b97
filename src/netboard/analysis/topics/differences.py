"""Effects of haptic feedback and of a partner on every measure, in the measure's unit.

Differences are within dyads; completion times have ratios. The numbers come from `netboard.analysis.topics.contrasts`.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from netboard.analysis.extraction.study import StudyData
from netboard.analysis.topics.contrasts import ContrastResult, Question, comparisons, looks_of
from netboard.analysis.topics.figure import NO_EFFECT, Drawn, Look, draw_dyads, draw_mean, handles, pictured, span
from netboard.analysis.topics.groups import interval_text
from netboard.analysis.topics.measures import COLUMNS, grid
from netboard.analysis.topics.units import read_in
from netboard.base.looks import PRINT_SMALL
from netboard.base.plural import noun

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FEW = 8
"""Largest number of differences in a narrow panel [1]."""


@pictured("Effects of forces and of a partner")
def picture(study: StudyData) -> Drawn:
    """Draw all differences between conditions."""
    found = comparisons(study).parts
    if not found:
        return "No dyad has two conditions that are compared."
    names = list(dict.fromkeys(one.measure.name for one in found))
    questions = sorted({one.question for one in found}, key=[one.question for one in found].index)
    looks = looks_of(study, questions)
    figure, axes = grid(names, 1.35, COLUMNS if len(questions) <= FEW else COLUMNS // 2)
    for name in names:
        _panel(axes[name], [one for one in found if one.measure.name == name], questions, looks)
    labels = [f"{letter}: {one.name}" for letter, one in zip(_LETTERS, questions, strict=False)]
    figure.legend(
        handles([looks[one.name] for one in questions]),
        labels,
        loc="outside upper center",
        ncols=2,
        handletextpad=0.2,
        fontsize=PRINT_SMALL,
    )
    return figure, _caption(found)


_LETTERS = "abcdefghijklmnopqrstuvwxyz"


def _panel(
    axes: "Axes", found: Sequence[ContrastResult], questions: Sequence[Question], looks: dict[str, Look]
) -> None:
    """Draw the differences in a measure: each dyad, and the mean."""
    measure = found[0].measure
    unit = read_in(found[0].unit, found[0].what)
    axes.axhline(1.0 if measure.ratio else 0.0, **NO_EFFECT)
    for one in found:
        at, look = questions.index(one.question), looks[one.question.name]
        each = np.asarray(one.contrast.differences)
        each = np.exp(each) if measure.ratio else unit.scale * each
        draw_dyads(axes, np.full(len(each), at + 0.22), each, look.colour, f"{one.question.name}, dyads")
        draw_mean(axes, at, one.difference, look, one.question.name, scale=unit.scale)
    axes.set_title(measure.name, loc="left", fontsize=PRINT_SMALL)
    axes.set_ylabel(f"{'ratio' if measure.ratio else 'difference'} {unit.in_brackets}", fontsize=PRINT_SMALL)
    axes.tick_params(axis="y", labelsize=6.5)
    axes.set_xticks(range(len(questions)), list(_LETTERS[: len(questions)]), fontsize=PRINT_SMALL)
    axes.set_xlim(-0.6, len(questions) - 0.4)


def _caption(found: Sequence[ContrastResult]) -> str:
    n = [one.contrast.n for one in found]
    intervals = interval_text(one.difference for one in found)
    return (
        "Differences between conditions (ratios for completion times): small points: within each dyad; large points: "
        f"means over dyads with {intervals}; n = {span(n)} {noun(max(n), 'dyad')}."
    )
