"""Effects of haptic feedback and of a partner: within-dyad contrasts with confidence intervals and exact tests.

Every compared measure of `netboard.analysis.topics.measures` has the same contrasts: each haptic condition minus
haptics off, within each configuration; two people minus one, within each haptic condition; the interaction of both; and
each level of a further factor minus its first level, within all other factors. All are exploratory: their p values are
not corrected, and none of them decides anything. What a study decides it declares
(`netboard.analysis.topics.declared`).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np
import pandas as pd
from scipy import stats

from netboard.analysis.extraction.study import StudyData
from netboard.analysis.statistics.contrasts import Contrast, condition_contrast
from netboard.analysis.statistics.effect_sizes import paired_effect
from netboard.analysis.statistics.estimates import Estimate, mean_interval
from netboard.analysis.statistics.exact_tests import SYMMETRIC
from netboard.analysis.topics.figure import (
    BAND,
    NO_EFFECT,
    Drawn,
    Look,
    beside,
    draw_mean,
    handles,
    look_of,
    new_mosaic,
    pictured,
    span,
    titled,
)
from netboard.analysis.topics.groups import (
    Condition,
    by_factor,
    conditions,
    estimated,
    interval_text,
    paired_levels,
    performed_by,
    with_base,
)
from netboard.analysis.topics.measures import Measure, exponential, levels_of_performers, measures_of
from netboard.analysis.topics.result import Result, TopicResults, cached, plain
from netboard.base.looks import BLACK, PRINT_FINE, PRINT_SMALL
from netboard.base.plural import plural

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Kind = Literal["forces", "configuration", "interaction", "factor"]

T = TypeVar("T")

MIN_FOR_SKEWNESS = 4
"""Minimum number of differences for a skewness [1]."""

EXPLORATORY = "exploratory, not corrected"
"""Note beside the p value of each contrast."""

SEED = 20_220_302
"""Seed of bootstraps, and of permutation tests with many dyads."""


@dataclass(frozen=True, slots=True)
class Question:
    """A contrast between conditions: the level of one, or the difference of two, first minus second."""

    kind: Kind
    name: str
    first: tuple[str, ...]
    second: tuple[str, ...]


def questions_of(study: StudyData) -> tuple[Question, ...]:
    """Return the declared contrasts for a study: between human performers, no robot and no still hand."""
    people = tuple(one for one in conditions(study) if not one.partner)
    forces = {(one.configuration, one.force, one.other_levels): one for one in people}
    effects = {(felt.configuration, felt.force, felt.other_levels): (felt, off) for felt, off in with_base(people)}
    return (
        *(Question("forces", f"{felt.label} vs off", (felt.name,), (off.name,)) for felt, off in effects.values()),
        *(
            Question(
                "configuration",
                ", ".join(("dyadic vs bimanual", together.haptics, *together.other_levels)),
                (together.name,),
                (alone.name,),
            )
            for together, alone in _both(forces)
        ),
        *(
            Question(
                "interaction",
                ", ".join((f"{felt.haptics} vs off, dyadic vs bimanual", *felt.other_levels)),
                (felt.name, off.name),
                (felt_alone.name, off_alone.name),
            )
            for (felt, off), (felt_alone, off_alone) in _both(effects)
        ),
        *(Question("factor", name, (one.name,), (base.name,)) for name, one, base in by_factor(people)),
    )


def _both(of: Mapping[tuple[str, str, tuple[str, ...]], T]) -> Iterator[tuple[T, T]]:
    """Yield the entries that exist for both two people and one, with equal force and other levels."""
    for (configuration, force, among), found in of.items():
        alone = ("bimanual", force, among)
        if configuration == "dyadic" and alone in of:
            yield found, of[alone]


@dataclass(frozen=True, slots=True)
class ContrastResult:
    """A measure in the conditions of a contrast; for a ratio measure logarithms, and the ratio as mean difference.

    `difference` has the t interval, `bootstrap` the bootstrap interval.
    """

    measure: Measure
    question: Question
    contrast: Contrast
    difference: Estimate
    bootstrap: Estimate
    hedges: Estimate

    @property
    def unit(self) -> str:
        """SI unit of the difference; 1 for a ratio."""
        return "1" if self.measure.ratio else self.measure.unit

    @property
    def what(self) -> str:
        """Kind of the difference."""
        return f"{self.measure.name}: {'ratio' if self.measure.ratio else 'difference'}"


def _results(one: ContrastResult) -> Iterator[Result]:
    """Yield a difference with both confidence intervals, effect sizes and tests."""
    contrast = one.contrast
    note = "; ".join(filter(None, (one.measure.note, *contrast.notes, _left_out(contrast))))
    group = one.question.name
    yield estimated("contrasts", one.what, group, one.difference, one.unit, note)
    yield estimated("contrasts", f"{one.what}, bootstrap", group, one.bootstrap, one.unit, note)
    yield estimated("contrasts", f"{one.measure.name}: d_z", group, contrast.effect, "1", note)
    yield estimated("contrasts", f"{one.measure.name}: g_z", group, one.hedges, "1", note)
    for kind, test in (("sign test", contrast.signs), ("permutation test", contrast.permutation)):
        number = f"{test.n} dyads" if test.exact else "this number of random sign flips"
        least = "too few to test"
        if np.isfinite(test.least_p):
            least = f"{EXPLORATORY}; smallest possible p {test.least_p:.3g} with {number}"
        shape = f"; {_symmetry(contrast)}" if test is contrast.permutation else ""
        name = f"{one.measure.name}: p, {kind}"
        yield plain("contrasts", name, group, test.p, "1", test.n, "dyad", f"{least}{shape}")


def _left_out(contrast: Contrast) -> str:
    """Return a note on the dyads that cannot be compared; empty if all can."""
    dyads = ", ".join(map(str, contrast.left_out))
    return f"left out, because a value is missing in a condition: {dyads}" if dyads else ""


def _symmetry(contrast: Contrast) -> str:
    """Return a note on the permutation test's symmetry assumption and the skewness of the differences."""
    if contrast.n < MIN_FOR_SKEWNESS or not np.isfinite(contrast.effect.value):
        return SYMMETRIC
    return f"{SYMMETRIC}; the skewness of these differences is {stats.skew(contrast.differences):z.1f}"


@cached
def comparisons(study: StudyData) -> TopicResults[ContrastResult]:
    """Compute, for every compared measure, all contrasts that some dyad has."""
    rng = np.random.default_rng(SEED)
    questions, who = questions_of(study), performed_by(conditions(study))
    found: list[ContrastResult] = []
    for measure in measures_of(study):
        if measure.compared:
            own = levels_of_performers(study, measure)
            performers = own.pivot(index=["dyad", "performer"], columns="condition", values="level")
            for question in questions:
                names = [*question.first, *question.second]
                if set(names) <= set(performers.columns):
                    table = paired_levels(performers, who, names)
                    if table.notna().all(axis=1).any():
                        found.append(_compare(measure, question, table, rng))
    return TopicResults.of(found, _results)


def _compare(measure: Measure, question: Question, table: pd.DataFrame, rng: np.random.Generator) -> ContrastResult:
    first, second = (_level(table, conditions) for conditions in (question.first, question.second))
    both = pd.concat([first, second])
    is_first = np.arange(len(both)) < len(first)
    contrast = condition_contrast(both.to_numpy(), both.index.to_numpy(), is_first, rng, name=question.name)
    difference, drawn = contrast.difference, contrast.bootstrap
    if measure.ratio:
        difference, drawn = exponential(difference), exponential(drawn)
    elif question.kind != "interaction":
        difference = mean_interval(contrast.differences, measure.of_difference)
    hedges = paired_effect(contrast.differences, correction="hedges")
    return ContrastResult(measure, question, contrast, difference, drawn, hedges)


def _level(table: pd.DataFrame, conditions: tuple[str, ...]) -> pd.Series:
    """Return the level of each dyad in a condition, or the difference of two."""
    first = table[conditions[0]]
    return first if len(conditions) == 1 else first - table[conditions[1]]


KINDS = {
    "forces": "haptics on vs off",
    "configuration": "dyadic vs bimanual",
    "interaction": "haptics on vs off, dyadic vs bimanual",
    "factor": "levels of other factors",
}
"""Titles of the panels."""

TICKS = (-100, -30, -10, -3, -1, 0, 1, 3, 10, 30, 100)
"""Ticks of an axis that is linear up to 1 and logarithmic beyond [1]."""


@pictured("Effects of forces and of a partner, standardised (exploratory)")
def picture(study: StudyData) -> Drawn:
    """Draw all effect sizes.

    Intervals are those of the noncentral t distribution, p values those of permutation tests.
    """
    found = [one for one in comparisons(study).parts if np.isfinite(one.hedges.value)]
    if not found:
        return "An effect size needs at least three dyads with both conditions, whose differences are not all equal."
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
    return figure, f"{_caption(found)} {_tests(comparisons(study).parts)}"


def looks_of(study: StudyData, questions: Sequence[Question]) -> dict[str, Look]:
    """Return each contrast's style: that of the condition with haptics or a partner; black for interactions."""
    by_name: dict[str, Condition] = {one.name: one for one in conditions(study)}
    return {one.name: look_of(by_name[one.first[0]], BLACK if one.kind == "interaction" else "") for one in questions}


def _reach(found: Sequence[ContrastResult]) -> float:
    """Return the limit of the axes."""
    ends = [abs(end) for one in found for end in (one.hedges.value, one.hedges.low, one.hedges.high)]
    return 1.2 * max(1.0, float(np.nanmax(ends)))


def _panel(
    axes: "Axes",
    found: Sequence[ContrastResult],
    names: Sequence[str],
    looks: dict[str, Look],
    reach: float,
    height: float,
) -> None:
    """Draw one kind of effect, a row for each measure, with uncorrected p values on the right."""
    questions = list(dict.fromkeys(one.question for one in found))
    offsets = dict(zip(questions, beside(len(questions), 0.5 if len(questions) <= 2 else 0.75), strict=True))
    for row in range(0, len(names), 2):
        axes.axhspan(row - 0.5, row + 0.5, color=BAND, zorder=0, linewidth=0.0)
    axes.axvline(0.0, **NO_EFFECT)
    for one in found:
        at = names.index(one.measure.name) + offsets[one.question]
        draw_mean(
            axes, at, one.hedges, looks[one.question.name], f"{one.measure.name}: {one.question.name}", across=True
        )
        p = f"{one.contrast.permutation.p:.3g}"
        axes.text(1.02, at, p, transform=axes.get_yaxis_transform(), va="center", fontsize=PRINT_FINE)
    axes.text(1.02, -0.75, "p", transform=axes.get_yaxis_transform(), va="center", fontsize=PRINT_FINE, style="italic")
    axes.set_yticks(range(len(names)), names, fontsize=PRINT_SMALL)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xscale("asinh", linear_width=1.0)
    axes.set_xlim(-reach, reach)
    ticks = [tick for tick in TICKS if abs(tick) <= reach]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks], fontsize=PRINT_FINE)
    axes.set_xticks([], minor=True)
    axes.set_xlabel("effect size g_z [1]")
    if len(questions) > 1:
        _legend(axes, questions, looks, height)


def _legend(axes: "Axes", questions: Sequence[Question], looks: dict[str, Look], height: float) -> None:
    marks, names = handles([looks[one.name] for one in questions]), [_short(one) for one in questions]
    axes.legend(
        marks, names, loc="upper center", bbox_to_anchor=(0.5, -0.6 / height), fontsize=PRINT_FINE, handletextpad=0.2
    )


def _short(question: Question) -> str:
    """Return the part of a contrast's name that distinguishes it from others of its kind."""
    if question.kind == "configuration":
        return question.name.removeprefix("dyadic vs bimanual, ")
    return question.name.partition(" vs off")[0]


def _caption(found: Sequence[ContrastResult]) -> str:
    n = span([one.contrast.n for one in found])
    return (
        f"Mean difference within dyads (n = {n}) over the standard deviation of these differences, bias-corrected "
        f"(g_z), with {interval_text(one.hedges for one in found)}; completion times as logarithms. Beyond 1 the axis "
        "is logarithmic."
    )


def _tests(every: Sequence[ContrastResult]) -> str:
    """Return sentences on the tests, their number, and the smallest possible p."""
    tests = [one.contrast.permutation for one in every if np.isfinite(one.contrast.permutation.p)]
    kind = "exact permutation tests"
    if not all(test.exact for test in tests):
        kind = "permutation tests by random sign flips"
    least = min(test.least_p for test in tests)
    low = sum(test.p < 0.05 for test in tests)
    return (
        f"p: {kind}, exploratory and not corrected: {low} of {plural(len(tests), 'p value')} are below 0.05; without "
        f"any effect, up to about {0.05 * len(tests):.2g} of them are expected to be. The smallest possible p of one "
        f"test is {least:.3g} with this number of dyads. The test {SYMMETRIC}."
    )
