"""What forces and a partner change: differences between conditions within dyads, with intervals and exact tests.

Every measure of `netboard.findings.measures` that is compared has the same contrasts: each force that is felt less
none, within each configuration; two people less one, within each force; and the interaction of the two. Those of all
measures of a family are one family of tests (Holm). They are declared here, before anybody looks at results.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pandas as pd

from netboard.analysis.contrasts import Contrast, condition_contrast, holm
from netboard.analysis.statistics import Estimate, paired_effect
from netboard.findings.measures import EXPLAINED, Measure, as_read, exponential, levels
from netboard.findings.results import Result
from netboard.measuring.study import Study

Kind = Literal["forces", "configuration", "interaction"]

SEED = 20_220_302
"""Of bootstraps, and of permutations of many dyads."""

BOOTSTRAP = "95 % bootstrap of dyads, BCa"


@dataclass(frozen=True, slots=True)
class Question:
    """Which conditions are compared.

    Attributes
    ----------
    kind : {"forces", "configuration", "interaction"}
        What makes the difference.
    name : str
        In words.
    first, second : tuple of str
        Conditions: of one, its level; of two, the first one's less the second one's.
    """

    kind: Kind
    name: str
    first: tuple[str, ...]
    second: tuple[str, ...]


def questions_of(study: Study) -> tuple[Question, ...]:
    """Declare the contrasts that a study can have.

    Parameters
    ----------
    study : Study
        The study. Only conditions of people are compared: no robot's, none with a hand that is still.

    Returns
    -------
    tuple of Question
        All of them; none for a study of one condition.
    """
    trials = study.counted
    people = trials[trials["condition"] == trials["configuration"] + ", " + trials["force"]]
    there = set(people["condition"])
    felt = sorted(people.loc[people["haptics"] == 1, "force"].unique())
    return tuple(
        question
        for question in _all_questions(felt, sorted(people["force"].unique()))
        if there.issuperset(question.first + question.second)
    )


def _all_questions(felt: list[str], forces: list[str]) -> Iterator[Question]:
    for configuration in ("bimanual", "dyadic"):
        for force in felt:
            name = f"{configuration}: {force} less none"
            yield Question("forces", name, (f"{configuration}, {force}",), (f"{configuration}, none",))
    for force in forces:
        yield Question(
            "configuration", f"{force}: dyadic less bimanual", (f"dyadic, {force}",), (f"bimanual, {force}",)
        )
    for force in felt:
        name = f"({force} less none), dyadic less bimanual"
        pairs = [(f"{who}, {force}", f"{who}, none") for who in ("dyadic", "bimanual")]
        yield Question("interaction", name, pairs[0], pairs[1])


@dataclass(frozen=True, slots=True)
class Comparison:
    """A measure in the conditions of a question.

    Attributes
    ----------
    measure : Measure
        What is measured.
    question : Question
        What is compared.
    contrast : Contrast
        In each dyad, intervals, tests and d_z; of a ratio measure, of natural logarithms.
    difference, bootstrap : Estimate
        Its mean difference with the t interval and that of the bootstrap; of a ratio measure, the ratio
        [the measure's, or 1].
    hedges : Estimate
        g_z: d_z without its bias in small samples [1].
    corrected : float
        p of the permutation test, corrected for all tests of the family [1].
    """

    measure: Measure
    question: Question
    contrast: Contrast
    difference: Estimate
    bootstrap: Estimate
    hedges: Estimate
    corrected: float

    @property
    def unit(self) -> str:
        """SI unit of the difference; 1 of a ratio."""
        return "1" if self.measure.ratio else self.measure.unit

    @property
    def what(self) -> str:
        """What the difference is."""
        return f"{self.measure.name}: {'ratio' if self.measure.ratio else 'difference'}"


@dataclass(frozen=True, slots=True)
class Comparisons:
    """All measures in all contrasts.

    Attributes
    ----------
    comparisons : tuple of Comparison
        By measure, then by question.
    """

    comparisons: tuple[Comparison, ...]

    @property
    def results(self) -> list[Result]:
        """Differences with both intervals, sizes of effects, and tests."""
        return [row for one in self.comparisons for row in _rows(one)]


def _rows(one: Comparison) -> Iterator[Result]:
    contrast = one.contrast
    note = "; ".join(filter(None, (EXPLAINED.get(one.measure.name, ""), *contrast.notes)))
    yield _estimate(one, one.what, one.difference, "95 % t", one.unit, note)
    yield _estimate(one, one.what, one.bootstrap, BOOTSTRAP, one.unit, note)
    yield _estimate(one, f"{one.measure.name}: d_z", contrast.effect, "95 % noncentral t", "1", note)
    yield _estimate(one, f"{one.measure.name}: g_z", one.hedges, "95 % noncentral t", "1", note)
    for name, test in (("sign test", contrast.signs), ("permutation test", contrast.permutation)):
        least = f"at least {test.least_p:.3g} with so many" if np.isfinite(test.least_p) else "too few to test"
        yield _number(one, f"{one.measure.name}: p, {name}", test.p, test.n, least)
    family = f"all contrasts of all measures of {one.measure.family}, permutation tests"
    yield _number(one, f"{one.measure.name}: p, Holm", one.corrected, contrast.n, family)


def _estimate(one: Comparison, quantity: str, found: Estimate, interval: str, unit: str, note: str) -> Result:
    name = interval if np.isfinite(found.low) else ""
    numbers = (found.value, found.low, found.high)
    return Result("contrasts", quantity, one.question.name, *numbers, unit, name, found.n, "dyad", note)


def _number(one: Comparison, quantity: str, value: float, n: int, note: str) -> Result:
    return Result("contrasts", quantity, one.question.name, value, np.nan, np.nan, "1", "", n, "dyad", note)


def comparisons(study: Study) -> Comparisons:
    """Compare conditions in all measures.

    Parameters
    ----------
    study : Study
        The study.

    Returns
    -------
    Comparisons
        Of every measure that is compared, all contrasts that some dyad has.
    """
    rng = np.random.default_rng(SEED)
    questions = questions_of(study)
    found: list[Comparison] = []
    for measure in as_read(study):
        if measure.compared:
            table = levels(study, measure).pivot(index="dyad", columns="condition", values="level")
            found += [_compare(measure, question, table, rng) for question in questions if _asked(question, table)]
    return Comparisons(_corrected(found))


def _asked(question: Question, table: pd.DataFrame) -> bool:
    """Whether a dyad has all conditions of a question."""
    conditions = [*question.first, *question.second]
    return set(conditions) <= set(table.columns) and bool(table[conditions].notna().all(axis=1).any())


def _compare(measure: Measure, question: Question, table: pd.DataFrame, rng: np.random.Generator) -> Comparison:
    first, second = (_level(table, conditions) for conditions in (question.first, question.second))
    both = pd.concat([first, second])
    is_first = np.arange(len(both)) < len(first)
    contrast = condition_contrast(both.to_numpy(), both.index.to_numpy(), is_first, rng, name=question.name)
    difference, drawn = contrast.difference, contrast.bootstrap
    if measure.ratio:
        difference, drawn = exponential(difference), exponential(drawn)
    hedges = paired_effect(contrast.differences, correction="hedges")
    return Comparison(measure, question, contrast, difference, drawn, hedges, np.nan)


def _level(table: pd.DataFrame, conditions: tuple[str, ...]) -> pd.Series:
    """Return the level of each dyad in a condition, or the difference of two."""
    first = table[conditions[0]]
    return first if len(conditions) == 1 else first - table[conditions[1]]


def _corrected(found: list[Comparison]) -> tuple[Comparison, ...]:
    """Correct p values within families."""
    values = np.full(len(found), np.nan)
    for family in {one.measure.family for one in found}:
        own = [k for k, one in enumerate(found) if one.measure.family == family]
        values[own] = holm([found[k].contrast.permutation.p for k in own])
    return tuple(replace(one, corrected=float(p)) for one, p in zip(found, values, strict=True))
