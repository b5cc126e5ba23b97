"""Progress bars on a terminal, all with the same columns, and lines elsewhere; no other module makes any."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from netboard.base.terminal.output import plain_console

_shown: list[Progress] = []
"""Bars that are on the terminal, the newest last."""


def shown_bars() -> Progress | None:
    """Return the bars that are on the terminal now; others would overwrite them."""
    return _shown[-1] if _shown else None


class _Bars(Progress):
    """Bars that `shown_bars` finds."""

    def start(self) -> None:
        """Show them."""
        if not self.disable:
            _shown.append(self)
        super().start()

    def stop(self) -> None:
        """Hide them."""
        if self in _shown:
            _shown.remove(self)
        super().stop()


def progress_bars(console: Console, *more: str | ProgressColumn, shown: bool = True) -> Progress:
    """Return progress bars with elapsed and remaining time, which disappear at the end; shown on a terminal only.

    ``more``: further columns beside the bar, for example ``"{task.completed} ticks"``.
    """
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        *more,
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    return _Bars(*columns, console=console, transient=True, disable=not (shown and console.is_terminal))


LINE_INTERVAL = 60.0
"""Time between two lines of progress where there is no terminal [s]."""


@contextmanager
def telling() -> Iterator[Callable[[str, float, float], None]]:
    """Show one progress bar on stderr, or a line a minute in a log; yield its callback (current step, done, total)."""
    console = plain_console(stderr=True, soft_wrap=True)
    if not console.is_terminal:
        yield _lines(console)
        return
    with progress_bars(console, TaskProgressColumn()) as progress:
        task = progress.add_task("")

        def tell(what: str, done: float, total: float) -> None:
            progress.update(task, description=what, completed=done, total=total)

        yield tell


def _lines(console: Console) -> Callable[[str, float, float], None]:
    """Return a callback that prints a line from time to time."""
    began = last = time.monotonic()

    def tell(what: str, done: float, total: float) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= LINE_INTERVAL and total > 0:
            last = now
            console.print(f"{what}: {done / total:.0%} after {(now - began) / 60:.0f} min")

    return tell
