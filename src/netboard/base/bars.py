"""Progress bars on a terminal, all with the same columns; no other module makes any."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)


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


@contextmanager
def telling() -> Iterator[Callable[[str, float, float], None]]:
    """Show one progress bar on stderr; yield its callback (current step, done, total)."""
    with progress_bars(Console(stderr=True), TaskProgressColumn()) as progress:
        task = progress.add_task("")

        def tell(what: str, done: float, total: float) -> None:
            progress.update(task, description=escape(what), completed=done, total=total)

        yield tell
