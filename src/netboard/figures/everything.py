"""All pictures of a study, one after the other."""

from collections.abc import Callable, Iterator

from netboard.figures import (
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
from netboard.figures.picture import Picture
from netboard.measuring.study import Study

PAPER: tuple[Callable[[Study], Picture], ...] = (
    learning.picture,
    dyads.picture,
    classes.picture,
    strategy.picture,
    delay.picture,
)
"""Those of the paper, its figures 2 to 6."""

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
"""What a reader of today asks besides."""

PICTURES: tuple[Callable[[Study], Picture], ...] = PAPER + MODERN
"""All of them."""


def pictures(study: Study) -> Iterator[Picture]:
    """Draw everything, one picture at a time.

    Parameters
    ----------
    study : Study
        The study.

    Yields
    ------
    Picture
        The next one; without a figure where the study has nothing to show.
    """
    for draw in PICTURES:
        yield draw(study)
