"""Head of a report: the question of the study, what it declares, and its design as done; then its answer.

The answer is that of the declared analysis (`netboard.analysis.report.answer`). Without one the head says that the
report is exploratory, and what that means.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import pandas as pd

from netboard.analysis.extraction.study import StudyData
from netboard.analysis.extraction.tables import ATTEMPT_KEY
from netboard.analysis.report.answer import (
    answer_sentences,
    effect_lines,
    effects_grid,
    means_grid,
    secondary_grid,
    sensitivity_grid,
)
from netboard.analysis.report.grids import Cell, Grid, GridColumn, grid_of, name, number
from netboard.analysis.report.wording import amount, capital, percent, plural
from netboard.analysis.topics import testing
from netboard.analysis.topics.crossing import DeclaredFactor
from netboard.analysis.topics.declared import DeclaredAnalysis, NoAnalysis
from netboard.analysis.topics.groups import block_labels
from netboard.analysis.topics.primary import method_name, primary
from netboard.analysis.topics.result import UNCOMPUTABLE
from netboard.task.studies.factors import KIND


@dataclass(frozen=True, slots=True)
class DeclaredAnswer:
    """Answer of the declared analysis, in sentences and tables."""

    sentences: tuple[str, ...]
    effects: Grid
    means: Grid
    others: Grid | None
    secondary: Grid | None


@dataclass(frozen=True, slots=True)
class ReportHead:
    """Head of a report: question, declaration and design as done, in sentences; the answer, if one was declared."""

    text: str
    declared: tuple[str, ...]
    done: tuple[str, ...]
    conditions: Grid
    answer: DeclaredAnswer | None


def question(study: StudyData, results: pd.DataFrame | None) -> ReportHead:
    """Return the head of the report of a study; its results, if known, are counted where nothing is declared."""
    found = _analysis(study)
    text = " / ".join(dict.fromkeys(one.question for one in study.declarations if one.question))
    done, conditions = tuple(_done(study, found)), _conditions(study)
    if isinstance(found, NoAnalysis):
        return ReportHead(text, tuple(_undeclared(study, found, results)), done, conditions, None)
    answer = DeclaredAnswer(
        tuple(answer_sentences(found)),
        effects_grid(found.primary),
        means_grid(found),
        sensitivity_grid(found.primary),
        secondary_grid(found),
    )
    return ReportHead(text, tuple(_declared(study, found)), done, conditions, answer)


def answer_lines(study: StudyData) -> Iterator[str]:
    """Yield the answer of the declared analysis for the terminal, a line for each effect; or that there is none."""
    found = _analysis(study)
    if isinstance(found, NoAnalysis):
        yield f"no declared analysis ({found.why}): the report is exploratory"
        return
    own = found.declaration
    yield f"primary outcome: {own.primary}, {method_name(own.primary, own.method)}"
    yield from (f"  {line}" for line in effect_lines(found.primary))


def _analysis(study: StudyData) -> DeclaredAnalysis | NoAnalysis:
    """Return the declared analysis; an error in it is the reason why there is none."""
    try:
        return primary(study).analysis
    except UNCOMPUTABLE as error:
        return NoAnalysis(f"it could not be computed: {type(error).__name__}: {error}")


# --- declaration -----------------------------------------------------------------------------------------------------


def _declared(study: StudyData, found: DeclaredAnalysis) -> Iterator[str]:
    """Yield sentences on what was declared, and where."""
    own, outcome = found.declaration, found.primary
    assert outcome is not None  # for the type checker; the caller has asked
    have, every = study.declarations[own], sum(study.declarations.values())
    method = method_name(own.primary, own.method)
    both = " (their interaction)" if len(found.crossing.factors) > 1 else ""
    yield (
        f"Declared in the study file, and in {_of(have, every)} before the first trial: primary outcome {own.primary}; "
        f"contrast {own.contrast}{both}; method {method}; {percent(own.level)} confidence intervals."
    )
    if have < every:
        yield f"{plural(every - have, 'recording')} declare nothing: for their data the declaration came later."
    secondary = ["the main effects"] if len(found.crossing.factors) > 1 else []
    if own.secondary:
        secondary.append(f"the same contrasts of the secondary outcomes ({', '.join(own.secondary)})")
    if secondary:
        yield f"Secondary: {', and '.join(secondary)}."
    yield "Everything else in this report is exploratory."


def _of(have: int, every: int) -> str:
    return f"all {plural(every, 'recording')}" if have == every else f"{amount(have)} of {plural(every, 'recording')}"


def _undeclared(study: StudyData, found: NoAnalysis, results: pd.DataFrame | None) -> Iterator[str]:
    """Yield sentences on a report without a declared analysis."""
    if any(one.primary for one in study.declarations):
        yield f"The declared analysis is not in this report: {found.why}."
        for one, count in study.declarations.items():
            what = f"{one.primary}, {one.contrast}, method {one.method}" if one.primary else "nothing"
            yield f"{plural(count, 'recording')}: {what}."
    else:
        yield "This study declares no primary outcome and no contrast."
    tests = "tests"
    if results is not None:
        counts = results.loc[(results["topic"] == testing.TOPIC) & (results["quantity"] == testing.TESTS), "value"]
        tests = plural(int(counts.sum()), "test")
    yield (
        "So this report is exploratory: no test was chosen before the data were seen, and none of its "
        f"{tests} counts more than another. Some p values are small by chance. Take what "
        "it shows as a question for a study that declares it ([analysis] in the study file)."
    )


# --- design as done --------------------------------------------------------------------------------------------------


def _done(study: StudyData, found: DeclaredAnalysis | NoAnalysis) -> Iterator[str]:
    """Yield sentences on the dyads, the trials, and the counterbalancing of the declared factors, as done."""
    blocks = study.analysed
    planned = int(blocks.groupby(["dyad", "block"])["trials"].max().sum())
    trials = study.trials[study.trials["recording"].isin(blocks["recording"])]
    done = trials.loc[trials["outcome"] == "success", ["dyad", "block", "trial"]].drop_duplicates()
    yield (
        f"{plural(len(study.dyads), 'dyad')} in {plural(blocks['condition'].nunique(), 'condition')}: "
        f"{plural(planned, 'trial')} planned, {amount(len(done))} done, {amount(len(study.counted))} counted; "
        f"{plural(int(_excluded(study, blocks).sum()), 'attempt')} excluded."
    )
    if isinstance(found, DeclaredAnalysis):
        yield from (f"{capital(note)}." for note in found.primary.notes)
        yield from (_counterbalancing(blocks, factor) for factor in found.crossing.factors)


def _counterbalancing(blocks: pd.DataFrame, factor: DeclaredFactor) -> str:
    """Return how a declared factor was counterbalanced."""
    rows = blocks[blocks[factor.of.column].isin(factor.levels)].drop_duplicates(["dyad", "block"])
    if factor.of.scope == "trial":
        return f"{capital(factor.name)}: the level was drawn for each trial within the blocks."
    if factor.between:
        found = rows.drop_duplicates("dyad")[factor.of.column].value_counts()
        each = " and ".join(f"{level} in {plural(int(found.get(level, 0)), 'dyad')}" for level in factor.levels)
        return f"{capital(factor.name)} varied between dyads: {each}."
    return _beginnings(rows, factor)


def _beginnings(rows: pd.DataFrame, factor: DeclaredFactor) -> str:
    """Return how often each level came first, in the blocks of a dyad or of a performer, and its mean place."""
    unit = ["dyad"] if factor.of.name == KIND else ["dyad", "kind", "sequence"]
    rows = rows.sort_values("block", kind="stable").assign(sequence=_sequences(rows))
    found = rows.drop_duplicates(unit)[factor.of.column].value_counts()
    first = [int(found.get(level, 0)) for level in factor.levels]
    places = [float(rows.loc[rows[factor.of.column] == level, "block"].mean()) for level in factor.levels]
    own = sum(first) == rows["dyad"].nunique()
    of = plural(sum(first), "dyad") if own else f"{plural(sum(first), 'sequence')} of blocks (one kind, one performer)"
    each = " and ".join(f"{amount(n)} began with {level}" for level, n in zip(factor.levels, first, strict=True))
    mean = " and ".join(f"{amount(place, 1)} ({level})" for level, place in zip(factor.levels, places, strict=True))
    uneven = ". The mean positions differ, so practice contributes to the comparison"
    even = "" if abs(places[0] - places[1]) < 0.05 else uneven
    head = f"{capital(factor.name)}: of {of}, {each}"
    return f"{head}. Mean position of these blocks in the order: {mean}{even}."


def _sequences(rows: pd.DataFrame) -> pd.Series:
    """Return who performs a kind of block: the dyad, even if a partner stands in for one of both, or a participant."""
    together = (rows["performer"] == rows["dyad"]).groupby([rows["dyad"], rows["kind"]]).transform("any")
    return rows["performer"].where(~together, rows["dyad"])


def _excluded(study: StudyData, blocks: pd.DataFrame) -> pd.Series:
    """Return the number of excluded attempts of each of these recordings."""
    every = study.exclusions.drop_duplicates(ATTEMPT_KEY)["recording"].value_counts()
    return every.reindex(blocks["recording"]).fillna(0)


def _conditions(study: StudyData) -> Grid:
    """Return the conditions as done: dyads, blocks, and trials planned, done, counted and excluded."""
    blocks, labels = study.analysed, block_labels(study)
    out = _excluded(study, blocks)
    rows: list[dict[GridColumn, Cell | float]] = []
    for condition, own in blocks.groupby("condition", sort=True):
        trials = study.trials[study.trials["recording"].isin(own["recording"])]
        done = trials.loc[trials["outcome"] == "success", ["dyad", "block", "trial"]].drop_duplicates()
        rows.append(
            {
                name("Condition"): labels[str(condition)],
                number("Dyads"): own["dyad"].nunique(),
                number("Blocks"): len(own.drop_duplicates(["dyad", "block"])),
                number("Trials planned"): int(own.groupby(["dyad", "block"])["trials"].max().sum()),
                number("Done"): len(done),
                number("Counted"): int(trials["counts"].sum()),
                number("Attempts excluded"): int(out[own["recording"]].sum()),
            }
        )
    return grid_of("Conditions as done", rows)
