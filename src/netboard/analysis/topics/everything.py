"""All results of a study in one tidy table, and all figures.

Each topic is a function of the study whose result object lists its rows. An error in one topic becomes a row of its
own, an error in a figure becomes its caption; neither stops the others.

`everything_of` distributes topics and figures over processes. Their number and order change no number and no figure.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from math import nan
from typing import Any, Protocol

import pandas as pd

from netboard.analysis.extraction.study import Shared, StudyData, study_in
from netboard.analysis.extraction.workers import begun
from netboard.analysis.topics import (
    classes,
    contrasts,
    controls,
    delay,
    differences,
    dyads,
    influence,
    leadership,
    learning,
    measures,
    models,
    paths,
    primary,
    pushes,
    quality,
    recognition,
    strategy,
    testing,
)
from netboard.analysis.topics.figure import TopicFigure, WrittenFigure, as_bytes
from netboard.analysis.topics.result import UNCOMPUTABLE, Result, cached, plain, table_of
from netboard.base.process.resources import peak_memory
from netboard.recording.export.formats import Progress

NOT_COMPUTED = "not computed"
"""Quantity of the result that replaces a topic after an error, which its note gives."""


class Computed(Protocol):
    """What a topic computes, with the numbers to report."""

    @property
    def results(self) -> tuple[Result, ...]:
        """Return the numbers to report."""


Topic = Callable[[StudyData], Computed]

Draw = Callable[[StudyData], TopicFigure]

PAPER: tuple[Topic, ...] = (learning.learning, dyads.dyads, classes.classes, strategy.strategy, delay.delay)
"""Topics of the paper, in the order of its figures 2 to 6."""

MODERN: tuple[Topic, ...] = (
    quality.quality,
    measures.overview,
    contrasts.comparisons,
    controls.controls,
    models.fits,
    leadership.leaders,
    influence.influences,
    paths.mean_paths,
    recognition.opinions,
    pushes.pushes,
    testing.families,
)
"""Topics beyond the paper."""

TOPICS: tuple[Topic, ...] = (primary.primary, *PAPER, *MODERN)
"""All topics; the declared analysis comes first."""


def results_of(study: StudyData, topics: Sequence[Topic] = TOPICS) -> pd.DataFrame:
    """Compute the results of all topics."""
    return table_of(result for topic in topics for result in results_in(study, topic))


def results_in(study: StudyData, topic: Topic) -> tuple[Result, ...]:
    """Compute one topic; an error becomes a result in its place, so that other topics are unaffected."""
    try:
        return topic(study).results
    except UNCOMPUTABLE as error:
        why = f"{type(error).__name__}: {error}"
        return (plain(_name_of(topic), NOT_COMPUTED, "", nan, "", 0, "", why),)


def _name_of(function: Callable[[StudyData], object]) -> str:
    """Return the name of a topic and of its figure: the module that computes and draws them."""
    return function.__module__.rpartition(".")[2]


PAPER_FIGURES = tuple(topic.picture for topic in (learning, dyads, classes, strategy, delay))
"""Figures of the paper, 2 to 6."""

MODERN_FIGURES = tuple(
    topic.picture
    for topic in (
        quality,
        measures,
        contrasts,
        differences,
        controls,
        models,
        leadership,
        influence,
        paths,
        recognition,
        pushes,
    )
)
"""Figures beyond the paper."""

PICTURES = (primary.picture, *PAPER_FIGURES, *MODERN_FIGURES)
"""All figures; that of the primary outcome comes first."""


def drawn(study: StudyData, draw: Draw) -> TopicFigure:
    """Draw a figure; an error is reported in its place, so that all others are unaffected."""
    try:
        picture = draw(study)
        if picture.figure is not None:
            as_bytes(picture.figure, "svg")
    except UNCOMPUTABLE as error:
        name = _name_of(draw)
        why = f"This figure could not be drawn ({type(error).__name__}: {error}). The tables do not depend on it."
        return TopicFigure(name, name.capitalize(), why, None, failed=True)
    return picture


def primary_figure(study: StudyData) -> TopicFigure | None:
    """Draw the figure of the primary outcome, if it is among the figures."""
    return next((drawn(study, draw) for draw in PICTURES if draw is primary.picture), None)


# --- in several processes --------------------------------------------------------------------------------------------

SAME_NUMBERS = {"differences": "contrasts"}
"""Figures that show the numbers of another topic."""

USED: tuple[cached[Any], ...] = (contrasts.comparisons, controls.controls, models.fits, influence.influences)
"""Topics whose findings the report or the families of tests use, too."""

SLOWEST_FIRST = ("influence", "models", "contrasts", "measures", "paths")
"""Tasks that begin first, so that all processes end at about the same time."""


@dataclass(frozen=True, slots=True)
class StudyTask:
    """Topics and figures with costly numbers in common."""

    name: str
    topics: tuple[Topic, ...]
    draws: tuple[Draw, ...]


@dataclass(frozen=True, slots=True)
class TaskOutcome:
    """Results and figures of a task by name, what its topics of `USED` have found, and the peak memory [B]."""

    results: Mapping[str, tuple[Result, ...]]
    found: Mapping[str, object]
    figures: Mapping[str, WrittenFigure]
    peak: float


def everything_of(
    study: StudyData, shared: Shared, executor: Executor | None, main: TopicFigure | None, progress: Progress
) -> tuple[pd.DataFrame, list[WrittenFigure], float]:
    """Return all results and figures, and the peak memory of a process; `main` is the figure of the primary outcome."""
    tasks = list(study_tasks())
    outcomes = begun(executor, partial(run_task, shared), tasks)
    results: dict[str, tuple[Result, ...]] = {}
    figures = {} if main is None else {main.name: main.written()}
    peak = 0.0
    progress("results and figures", 0, len(tasks) + 1)
    for done, (_, outcome) in enumerate(outcomes, start=1):
        progress("results and figures", done, len(tasks) + 1)
        for used in USED if executor is not None else ():
            if (found := outcome.found.get(_name_of(used))) is not None:
                used.adopt(study, found)
        results |= outcome.results
        figures |= outcome.figures
        peak = max(peak, outcome.peak)
    for topic in TOPICS:
        if _name_of(topic) not in results:
            results[_name_of(topic)] = results_in(study, topic)
    rows = (row for topic in TOPICS for row in results[_name_of(topic)])
    return table_of(rows), [figures[_name_of(draw)] for draw in PICTURES], peak


def run_task(shared: Shared, task: StudyTask) -> TaskOutcome:
    """Compute the topics of a task and draw its figures."""
    study = study_in(shared)
    results = {_name_of(topic): results_in(study, topic) for topic in task.topics}
    found = {_name_of(topic): topic.kept(study) for topic in USED if topic in task.topics}
    figures = {_name_of(draw): drawn(study, draw).written() for draw in task.draws}
    return TaskOutcome(results, found, figures, peak_memory())


def study_tasks() -> Iterator[StudyTask]:
    """Yield the tasks, without what depends on the numbers of others, and without the primary outcome."""
    own = (primary.primary, primary.picture, testing.families)
    groups: dict[str, tuple[list[Topic], list[Draw]]] = {}
    for place, functions in enumerate((TOPICS, PICTURES)):
        for function in functions:
            if function not in own:
                name = _name_of(function)
                groups.setdefault(SAME_NUMBERS.get(name, name), ([], []))[place].append(function)
    for name in sorted(groups, key=lambda name: SLOWEST_FIRST.index(name) if name in SLOWEST_FIRST else len(groups)):
        topics, draws = groups[name]
        yield StudyTask(name, tuple(topics), tuple(draws))
