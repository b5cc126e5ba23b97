"""The files of a session, looked up in a thread: a large folder or a slow disk delays no emergency stop.

They are its recordings, for their size, the study, which somebody may edit meanwhile, and the logs of its processes.
"""

import time
from collections.abc import Callable, Hashable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, final

T = TypeVar("T")

LOOK_S = 5.0
"""Time between two looks at the recordings and the study [s]."""

FILE_LOOK_S = 1.0
"""Time between two looks at a log [s]."""


@final
class FileLooks:
    """Reads files in a thread of its own, each from time to time. ``clock``: time [s]."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._reader = ThreadPoolExecutor(1, "files of a session")
        self._found: dict[Hashable, Any] = {}
        self._coming: dict[Hashable, Future[Any]] = {}
        self._due: dict[Hashable, float] = {}

    def newest(self, key: Hashable, read: Callable[[], T], first: T) -> T:
        """Return what the last look has found, ``first`` before it; the next one is done when it is due.

        After a disk error what was found before stays.
        """
        coming = self._coming.get(key)
        if coming is not None and coming.done():
            del self._coming[key]
            with suppress(OSError):
                self._found[key] = coming.result()
        if key not in self._coming and self._clock() >= self._due.get(key, 0.0):
            self._due[key] = self._clock() + FILE_LOOK_S
            self._coming[key] = self._reader.submit(read)
        found: T = self._found.get(key, first)
        return found

    def close(self) -> None:
        """Look no more."""
        self._reader.shutdown(wait=False, cancel_futures=True)


@dataclass(frozen=True, slots=True)
class _Look:
    """What a look has found; None for what could not be read."""

    size: int | None  # of the recordings [bytes]
    study: str | None


class SessionFiles:
    """The recordings since a session has begun, and its study. ``clock``: time [s]."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.size = 0  # as of the last look [bytes]
        self.studies = "", ""  # text of the study at the first look and at the last one; empty for a built-in study
        self._clock = clock
        self._due = 0.0
        self._folder: Path | None = None
        self._before: Future[frozenset[str]] = Future()
        self._reader = ThreadPoolExecutor(1, "recordings")
        self._coming: Future[_Look] | None = None
        self._study = Path()
        self._first: Future[str | None] = Future()

    def begin(self, folder: Path, study: Path) -> None:
        """Begin a session, whose recordings go to a folder; ``study``: its file, or the name of a built-in study."""
        self.size, self.studies, self._coming, self._folder, self._study = 0, ("", ""), None, folder, study
        self._before = self._reader.submit(_names, folder)
        self._first = self._reader.submit(_text, study)

    def poll(self) -> None:
        """Take the result of a look, and have the next one done when it is due; after a disk error all stays."""
        if self._coming is not None and self._coming.done():
            look, self._coming = self._coming.result(), None
            self.size = self.size if look.size is None else look.size
            first = self._first.result()  # read before, by the same thread
            if first is not None and look.study is not None:
                self.studies = first, look.study
        if self._folder is not None and self._coming is None and self._clock() >= self._due:
            self._due = self._clock() + LOOK_S
            self._coming = self._reader.submit(_look, self._folder, self._before, self._study)

    def close(self) -> None:
        """Look no more."""
        self._reader.shutdown(wait=False, cancel_futures=True)


def _recordings(folder: Path) -> list[Path]:
    return list(folder.glob("*.mcap*"))


def _names(folder: Path) -> frozenset[str]:
    return frozenset(path.name for path in _recordings(folder))


def _look(folder: Path, before: Future[frozenset[str]], study: Path) -> _Look:
    size = None
    with suppress(OSError):
        size = _size(folder, before)
    return _Look(size, _text(study))


def _text(study: Path) -> str | None:
    """Return the text of a study; None if it cannot be read, empty if there is no such file."""
    try:
        return study.read_text(errors="replace") if study.is_file() else ""
    except OSError:
        return None


def _size(folder: Path, before: Future[frozenset[str]]) -> int:
    """Return the size of the recordings in a folder, without those that were there before [bytes]."""
    size, earlier = 0, before.result()  # the same thread has listed them
    for path in _recordings(folder):
        with suppress(FileNotFoundError):  # it was finished just now, and has another name
            size += 0 if path.name in earlier else path.stat().st_size
    return size
