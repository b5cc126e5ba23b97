"""All figures of a study, one after the other.

A figure that cannot be drawn is replaced by its reason and does not stop the others.
"""

from collections.abc import Callable, Iterator

from netboard.analysis.extraction.study import Study
from netboard.analysis.figures import (
    classes,
    contrasts,
    delay,
    differences,
    dyads,
    influence,
    leadership,
    learning,
    measures,
    models,
    passive,
    paths,
    quality,
    strategy,
)
from netboard.analysis.figures.figure import Picture, as_bytes
from netboard.analysis.results.result import UNCOMPUTABLE

PAPER: tuple[Callable[[Study], Picture], ...] = (
    learning.picture,
    dyads.picture,
    classes.picture,
    strategy.picture,
    delay.picture,
)
"""Figures of the paper, 2 to 6."""

MODERN: tuple[Callable[[Study], Picture], ...] = (
    quality.picture,
    measures.picture,
    contrasts.picture,
    differences.picture,
    models.picture,
    leadership.picture,
    influence.picture,
    passive.picture,
    paths.picture,
)
"""Figures beyond the paper."""

PICTURES: tuple[Callable[[Study], Picture], ...] = PAPER + MODERN
"""All figures."""


def pictures(study: Study) -> Iterator[Picture]:
    """Draw all figures, one at a time.

    Yields
    ------
    Picture
        The next figure; only title and caption if the study has no data for it.
    """
    for draw in PICTURES:
        yield drawn(study, draw)


def drawn(study: Study, draw: Callable[[Study], Picture]) -> Picture:
    """Draw a figure; an error is reported in its place, so that all others are unaffected."""
    try:
        picture = draw(study)
        if picture.figure is not None:
            as_bytes(picture.figure, "svg")
    except UNCOMPUTABLE as error:
        name = draw.__module__.rpartition(".")[2]
        why = f"This figure could not be drawn ({type(error).__name__}: {error}). The tables do not depend on it."
        return Picture(name, name.capitalize(), why, None, failed=True)
    return picture
