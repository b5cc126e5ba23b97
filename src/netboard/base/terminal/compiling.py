"""How a first start shows that it compiles: a bar with the time left on a terminal, one line elsewhere.

Nothing is shown when all kernels are in the cache, or the few that are not take a moment.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread

from rich.progress import Progress, TaskID

from netboard.base import kernel_cache
from netboard.base.compilation import UNKNOWN, Forecast, compilation
from netboard.base.plural import plural
from netboard.base.terminal.bars import progress_bars, shown_bars
from netboard.base.terminal.output import plain_console

WORDS = "compiling kernels for this machine, once after an installation or an update"

SHOWN_AFTER_S = 2.0
"""Time after which a compilation is shown: by then some of its kernels have been measured [s]."""

FIRST_SHARE = 0.1
"""Share of the expected kernels after which the line is written that says how long the others take [1]."""

LOOK_S = 0.5
"""Interval between two looks for kernels that worker processes have compiled [s]."""


class CompilationBar:
    """Shows a compilation on stderr, and the time left at the rate of the kernels so far.

    Not ``drawn``: in one line, also on a terminal.
    """

    def __init__(self, forecast: Forecast = UNKNOWN, *, drawn: bool = True) -> None:
        self._forecast, self._expected, self._drawn = forecast, forecast.kernels, drawn
        self._console = plain_console(stderr=True, soft_wrap=True)
        self._bars: Progress | None = None
        self._task = TaskID(0)
        self._spent = 0.0  # before the last rest [s]
        self._since: float | None = None  # when the compilation that goes on began
        self._said = False

    def compiled(self, count: int) -> None:
        """Show the number of kernels compiled so far [1]."""
        now = time.monotonic()
        if self._since is None:
            self._since = now
        seconds, others = self._spent + now - self._since, shown_bars()
        if seconds < SHOWN_AFTER_S or not count:
            return
        if self._drawn and self._console.is_terminal and others in (None, self._bars):
            self._advance(count)
        elif not self._said and count >= FIRST_SHARE * self._expected:
            self._said = True
            console = self._console if others is None else others.console  # which prints above its bars
            console.print(self._line(count, seconds), soft_wrap=True)

    def rests(self) -> None:
        """Hide the bar; other output may follow."""
        if self._since is not None:
            self._spent += time.monotonic() - self._since
            self._since = None
        if self._bars is not None:
            self._bars.stop()

    def _line(self, count: int, seconds: float) -> str:
        """Return in words what is done, what is left, and about how long that takes."""
        done, total = f"{WORDS}: {plural(count, 'kernel')}", self._expected
        if total <= count:
            return f"{done} so far, in {seconds:.0f} s"
        left = max(round(seconds * (1.0 / self._forecast.share(count) - 1.0), -1), 10.0)
        return f"{done} took {seconds:.0f} s; about {total - count} are left, for about {left:.0f} s"

    def _advance(self, count: int) -> None:
        """Draw the bar; its end moves if there are more kernels than expected."""
        total, forecast = max(self._expected, count + 1), self._forecast
        share = forecast.share(count) if total == self._expected else count / total
        if self._bars is None:
            self._console.print(WORDS)
            self._bars = progress_bars(self._console)
            self._task = self._bars.add_task("", total=1.0 if self._expected else None)
        if self._bars is not shown_bars():
            self._bars.start()
        words = f"{count} of about {plural(total, 'kernel')}" if self._expected else plural(count, "kernel")
        self._bars.update(self._task, description=words, completed=share)


@contextmanager
def workers_compilation() -> Iterator[None]:
    """Say in one line that the worker processes of this one compile meanwhile."""

    def count() -> int:
        return kernel_cache.count() - compilation.count

    over = Event()
    watch = Thread(target=watch_cache, args=(count, over.wait, CompilationBar(drawn=False)), daemon=True)
    watch.start()
    try:
        yield
    finally:
        over.set()
        watch.join()


def watch_cache(count: Callable[[], int], over: Callable[[float], bool], bar: CompilationBar) -> None:
    """Report new kernels in the cache, until it is over. ``over``: waits for a time [s], and returns whether it is."""
    before = seen = count()
    while not over(LOOK_S):
        if (now := count()) > seen:
            seen = now
            bar.compiled(seen - before)
