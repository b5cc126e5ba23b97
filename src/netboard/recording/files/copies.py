"""Finds recordings of the same ticks: a copy in the folder, or a block that two loggers recorded."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np

from netboard.base.errors import RecordingError
from netboard.recording.files.reader import Recording

_TOLD_BY = ("tick", "theta")
"""Columns by which ticks are the same: their number, and the tilt that the server computed."""


def find_copies(recordings: Iterable[tuple[Path, Mapping[str, str]]]) -> Iterator[str]:
    """Yield a sentence on each file whose ticks are all in another one too, from their paths and metadata.

    Recordings that were simulated from the same table of hands with two configurations are no copies.
    """
    seen: dict[tuple[str, ...], list[tuple[Path, str]]] = {}
    for path, metadata in recordings:
        key = tuple(metadata.get(name, "") for name in ("session", "block", "config_sha256"))
        part = metadata.get("part", "")
        if all((*key[:2], part)):  # a recovered recording may have lost some
            for other, other_part in seen.setdefault(key, []):
                if part == other_part:
                    yield f"{other} and {path}: are the same part of the same block; leave one out"
                elif inner := _contained(other, path):
                    yield f"{other} and {path}: two loggers recorded the same ticks of a block; leave out {inner}"
            seen[key].append((path, part))


def _contained(one: Path, other: Path) -> Path | None:
    """Return the recording whose ticks are all in the other; None if neither's are, or cannot be read."""
    try:
        with Recording(one) as first, Recording(other) as second:
            if _has_all(first, second):
                return other
            return one if _has_all(second, first) else None
    except RecordingError:  # a check of its ticks reports the damage
        return None


def _has_all(outer: Recording, inner: Recording) -> bool:
    """Return whether a recording has all ticks of another, which has some; read them only if their ranges say so."""
    wanted, offered = inner.tick_range, outer.tick_range
    if not wanted or wanted.start not in offered or wanted[-1] not in offered:
        return False
    ours, theirs = outer.columns(*_TOLD_BY, first=wanted.start, stop=wanted.stop), inner.columns(*_TOLD_BY)
    _, at, found = np.intersect1d(ours["tick"], theirs["tick"], return_indices=True)
    return len(found) == len(theirs["tick"]) and all(
        ours[name][at].tobytes() == theirs[name][found].tobytes() for name in _TOLD_BY
    )


def copies_among(paths: Iterable[Path]) -> Iterator[str]:
    """Yield these sentences for files, of which some may be unreadable."""
    readable: list[tuple[Path, Mapping[str, str]]] = []
    for path in paths:
        try:
            with Recording(path) as recording:
                readable.append((path, recording.metadata))
        except RecordingError:
            continue
    yield from find_copies(readable)
