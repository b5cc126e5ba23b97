"""All results of a study in one tidy table, and all figures.

Each topic is a function of the study whose result object lists its rows. An error in one topic becomes a row of its
own, an error in a figure becomes its caption; neither stops the others.
"""

from collections.abc import Callable, Iterator, Sequence
from math import nan
from typing import Protocol

import pandas as pd

from netboard.analysis.extraction.study import StudyData
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
from netboard.analysis.topics.figure import TopicFigure, as_bytes
from netboard.analysis.topics.result import UNCOMPUTABLE, Result, plain, table_of

NOT_COMPUTED = "not computed"
"""Quantity of the result that replaces a topic after an error, which its note gives."""


class Computed(Protocol):
    """What a topic computes, with the numbers to report."""

    @property
    def results(self) -> tuple[Result, ...]:
        """Return the numbers to report."""


Topic = Callable[[StudyData], Computed]

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


def pictures(study: StudyData) -> Iterator[TopicFigure]:
    """Draw all figures, one at a time; only title and caption if the study has no data for one."""
    for draw in PICTURES:
        yield drawn(study, draw)


def drawn(study: StudyData, draw: Callable[[StudyData], TopicFigure]) -> TopicFigure:
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
