"""Families of tests: how many tests a study has, what the smallest possible p is, and how p values are corrected.

Every p value in the results belongs to one family. The primary contrast is one test, and has the whole level. The
secondary tests are corrected, and depend on the primary one
(`netboard.analysis.statistics.contrasts.gatekept`). All other tests are exploratory or sensitivity analyses, and their
p values are uncorrected.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import isfinite, nan

from netboard.analysis.extraction.study import StudyData
from netboard.analysis.statistics.exact_tests import Test
from netboard.analysis.statistics.factors import INTERCEPT
from netboard.analysis.topics.contrasts import comparisons
from netboard.analysis.topics.declared import ByMethod, NoAnalysis
from netboard.analysis.topics.dyads import dyads
from netboard.analysis.topics.influence import influences
from netboard.analysis.topics.models import fits
from netboard.analysis.topics.primary import primary
from netboard.analysis.topics.result import Result, TopicResults, plain

LEVEL = 0.05
"""Level below which p values are counted [1]."""

GATEKEPT, UNCORRECTED = "gatekeeping by the primary contrast, and Holm", "none: exploratory"
PRIMARY, SENSITIVITY = "none: the only primary test", "none: sensitivity analysis"
"""Corrections of a family."""


@dataclass(frozen=True, slots=True)
class FamilyOfTests:
    """Tests that are corrected together, or counted together: their p values, corrected or as they are [1].

    `least_p` is the smallest possible p of one of them, `corrected_least_p` that after the correction; both NaN for a
    test without such a limit. `dyads` is the smallest and the largest number of dyads in a test [1].
    """

    name: str
    p: tuple[float, ...]
    least_p: float
    corrected_least_p: float
    dyads: tuple[int, int]
    correction: str

    @property
    def below(self) -> int:
        """Number of p values below `LEVEL` [1]."""
        return sum(p < LEVEL for p in self.p)


def families(study: StudyData) -> TopicResults[FamilyOfTests]:
    """Return all families of tests of a study with at least one test."""
    every = (*_of_declared(study), *_of_contrasts(study), *_of_dyads(study), *_of_influence(study), *_of_models(study))
    return TopicResults.of([one for one in every if one.p], _results)


TOPIC, TESTS, LEAST, LEAST_CORRECTED, BELOW = (
    "testing",
    "number of tests",
    "smallest possible p of one test",
    "smallest possible p after the correction",
    f"number of p values below {LEVEL:g}, corrected as stated",
)
"""Topic and quantities of the results."""


def _results(one: FamilyOfTests) -> Iterator[Result]:
    """Yield the number of tests, the smallest possible p before and after the correction, and the small p values."""
    numbers = {
        TESTS: float(len(one.p)),
        LEAST: one.least_p,
        LEAST_CORRECTED: one.corrected_least_p,
        BELOW: float(one.below),
    }
    for quantity, value in numbers.items():
        if isfinite(value):
            yield plain(TOPIC, quantity, one.name, value, "1", one.dyads[0], "dyad", f"correction: {one.correction}")


def _of_declared(study: StudyData) -> Iterator[FamilyOfTests]:
    found = primary(study).analysis
    if isinstance(found, NoAnalysis):
        return
    yield _declared("primary contrast", [found.contrast.counts], PRIMARY)
    further = found.secondary_effects
    raw = _declared("secondary tests", [one.counts for one in further], GATEKEPT)
    adjusted = tuple(one.adjusted for one in further if isfinite(one.adjusted))
    yield replace(raw, p=adjusted, corrected_least_p=found.least_adjusted or nan)
    others = [other for one in (found.contrast, *further) for other in one.others]
    yield _declared("declared effects, by other methods", others, SENSITIVITY)


def _declared(name: str, found: Sequence[ByMethod], correction: str) -> FamilyOfTests:
    tested = [one.tested for one in found if isfinite(one.tested.p)]
    least = min((one.least_p for one in tested), default=nan) or nan  # 0: no limit
    return _known(name, [one.tested.p for one in found], least, [one.estimate.n for one in found], correction)


def _of_contrasts(study: StudyData) -> Iterator[FamilyOfTests]:
    parts = comparisons(study).parts
    for measures in dict.fromkeys(one.measure.family for one in parts):
        own = [one for one in parts if one.measure.family == measures]
        yield _family(
            f"contrasts, measures of {measures}: permutation tests", [one.contrast.permutation for one in own]
        )
    yield _family("contrasts, all measures: sign tests", [one.contrast.signs for one in parts])


def _of_dyads(study: StudyData) -> Iterator[FamilyOfTests]:
    yield _family("gains of dyads: sign tests", [one.test for one in dyads(study).parts])


def _of_influence(study: StudyData) -> Iterator[FamilyOfTests]:
    found = [one for one in influences(study).parts if one.chance is not None]
    chances = [one.chance for one in found if one.chance is not None]
    sizes = [len(one.dyads) for one in found]
    least = min((one.least_p for one in chances), default=nan)
    yield _known("influence between partners: exchanges of partners", [one.p for one in chances], least, sizes)


def _of_models(study: StudyData) -> Iterator[FamilyOfTests]:
    for fit in fits(study).fits:
        terms = [one for one in fit.model.effects if one.name != INTERCEPT]
        sizes = [fit.model.dyads] * len(terms)
        yield _known(f"model of {fit.measure}: terms", [one.p for one in terms], nan, sizes)


def _family(name: str, tests: Iterable[Test]) -> FamilyOfTests:
    every = [test for test in tests if isfinite(test.p)]
    least = min((test.least_p for test in every), default=nan)
    return _known(name, [test.p for test in every], least, [test.n for test in every])


def _known(
    name: str, p: Iterable[float], least: float, sizes: Iterable[int], correction: str = UNCORRECTED
) -> FamilyOfTests:
    every = [(value, n) for value, n in zip(p, sizes, strict=True) if isfinite(value)]
    counts = [n for _, n in every] or [0]
    known = tuple(value for value, _ in every)
    return FamilyOfTests(name, known, least, least, (min(counts), max(counts)), correction)
