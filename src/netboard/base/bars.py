"""Progress bars on a terminal, all with the same columns; no other module makes any."""

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn


def progress_bars(console: Console, *more: str | ProgressColumn, shown: bool = True) -> Progress:
    """Return progress bars with the elapsed and the remaining time, which disappear at the end.

    Parameters
    ----------
    console : Console
        Where they are shown, if it is a terminal.
    *more : str or ProgressColumn
        Further columns beside the bar, for example ``"{task.completed} ticks"``.
    shown : bool
        False: show none.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), *more, TimeElapsedColumn(), TimeRemainingColumn())
    return Progress(*columns, console=console, transient=True, disable=not (shown and console.is_terminal))
