"""The compilation of kernels in this process, for a bar that shows it; a process whose kernels are cached has none.

`netboard.base.compiled` and its cache report here what they do, and know nothing of terminals.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple, Protocol

TENTHS = tuple(tenth / 10 for tenth in range(1, 11))


class Forecast(NamedTuple):
    """What a compilation with an empty cache takes: how many kernels, and which shares of its time.

    ``shares``: share of the whole time after each tenth of the kernels, as measured; a kernel that others are compiled
    into takes many times as long as a small one [1].
    """

    kernels: int  # 0 if the number is not known [1]
    shares: tuple[float, ...] = TENTHS

    def share(self, count: int) -> float:
        """Return the share of the time after which this many kernels are compiled [1]."""
        place = min(10.0 * count / self.kernels, 10.0)
        whole = int(min(place, 9.0))
        before, after = (0.0, *self.shares)[whole : whole + 2]
        return before + (place - whole) * (after - before)

    def with_cached(self, cached: int) -> "Forecast":
        """Return the forecast where some kernels are in the cache already; no one knows which."""
        return Forecast(max(self.kernels - cached, 0)) if cached else self


UNKNOWN = Forecast(0)
"""The forecast of a compilation that nobody has measured."""


class CompilationWatcher(Protocol):
    """Shows a compilation."""

    def compiled(self, count: int) -> None:
        """Take the number of kernels compiled so far, 0 when the first begins [1]."""

    def rests(self) -> None:
        """Nothing is being compiled any more, for now."""


class Compilation:
    """Counts the kernels that this process compiles, and tells a watcher, which is made when the first begins."""

    def __init__(self) -> None:
        self._make: Callable[[], CompilationWatcher] | None = None
        self._watcher: CompilationWatcher | None = None
        self._depth = self._count = 0

    @property
    def count(self) -> int:
        """Kernels that this process has compiled while it was watched [1]."""
        return self._count

    @contextmanager
    def watched(self, make: Callable[[], CompilationWatcher]) -> Iterator[None]:
        """Show what is compiled meanwhile."""
        self._make, self._watcher, self._count = make, None, 0
        try:
            yield
        finally:
            self._make = self._watcher = None

    @contextmanager
    def kernel(self) -> Iterator[None]:
        """Load or compile a kernel, and the kernels that it calls."""
        self._depth += 1
        try:
            yield
        finally:
            self._depth -= 1
            if not self._depth and self._watcher is not None:
                self._watcher.rests()

    def begins(self) -> None:
        """Note that a kernel is not in the cache and is compiled now."""
        if self._watcher is None and self._make is not None:
            self._watcher = self._make()
        self._tell()

    def ends(self) -> None:
        """Note that a kernel has been compiled."""
        self._count += 1
        self._tell()

    def _tell(self) -> None:
        if self._watcher is not None:
            self._watcher.compiled(self._count)


compilation = Compilation()
"""The compilation of this process."""
