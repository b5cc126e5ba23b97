"""Every picture of a study."""

from collections.abc import Iterator

from netboard.figures.picture import COLOURS, Picture, new_figure
from netboard.measuring.study import Study


def pictures(study: Study) -> Iterator[Picture]:
    """Draw all pictures.

    Parameters
    ----------
    study : Study
        The study.

    Yields
    ------
    Picture
        The next one.
    """
    counted = study.counted
    if counted.empty:
        yield Picture("completion", "Completion times", "No trial counts.", None)
        return
    figure, (axes,) = new_figure(3.0)
    for configuration, trials in counted.groupby("configuration"):
        axes.plot(trials["order"], trials["completion"], ".", ms=2, color=COLOURS[configuration], label=configuration)
    axes.set(xlabel="number of the trial in its condition", ylabel="completion time [s]")
    axes.legend()
    caption = f"Completion times in order; n = {len(counted)} trials."
    yield Picture("completion", "Completion times", caption, figure)
