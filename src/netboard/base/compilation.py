"""The compilation of kernels in this process, for a bar that shows it; a process whose kernels are cached has none.

`netboard.base.compiled` and its cache report here what they do, and know nothing of terminals.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol


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
