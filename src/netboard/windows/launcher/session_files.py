"""How much of a session is on disk, looked up in a thread: a large folder or a slow disk delays no emergency stop."""

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

LOOK_S = 5.0
"""Time between two looks at the folder [s]."""


class SessionFiles:
    """The recordings that were written since a session has begun. ``clock``: time [s]."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.size = 0  # as of the last look [bytes]
        self._clock = clock
        self._due = 0.0
        self._folder: Path | None = None
        self._before: Future[frozenset[str]] = Future()
        self._reader = ThreadPoolExecutor(1, "recordings")
        self._coming: Future[int] | None = None

    def begin(self, folder: Path) -> None:
        """Begin a session, whose recordings go to a folder."""
        self.size, self._coming, self._folder = 0, None, folder
        self._before = self._reader.submit(_names, folder)

    def poll(self) -> None:
        """Take the result of a look, and have the next one done when it is due; after a disk error the size stays."""
        if self._coming is not None and self._coming.done():
            coming, self._coming = self._coming, None
            with suppress(OSError):
                self.size = coming.result()
        if self._folder is not None and self._coming is None and self._clock() >= self._due:
            self._due = self._clock() + LOOK_S
            self._coming = self._reader.submit(_size, self._folder, self._before)

    def close(self) -> None:
        """Look no more."""
        self._reader.shutdown(wait=False, cancel_futures=True)


def _recordings(folder: Path) -> list[Path]:
    return list(folder.glob("*.mcap*"))


def _names(folder: Path) -> frozenset[str]:
    return frozenset(path.name for path in _recordings(folder))


def _size(folder: Path, before: Future[frozenset[str]]) -> int:
    """Return the size of the recordings in a folder, without those that were there before [bytes]."""
    size, earlier = 0, before.result()  # the same thread has listed them
    for path in _recordings(folder):
        with suppress(FileNotFoundError):  # it was finished just now, and has another name
            size += 0 if path.name in earlier else path.stat().st_size
    return size
