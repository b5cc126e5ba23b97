"""Finds recordings of the same ticks: a copy in the folder, or a block that two loggers recorded."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from netboard.base.errors import RecordingError
from netboard.recording.files.reader import Recording


def find_copies(recordings: Iterable[tuple[Path, Mapping[str, str]]]) -> Iterator[str]:
    """Yield a sentence on each file that has the same ticks as an earlier one, from their paths and metadata.

    Recordings that were simulated from the same table of hands with two configurations are no copies.
    """
    seen: dict[tuple[str, ...], Path] = {}
    for path, metadata in recordings:
        key = tuple(metadata.get(name, "") for name in ("session", "block", "part", "config_sha256"))
        if key in seen and all(key[:3]):  # a recovered recording may have lost some
            yield f"{seen[key]} and {path}: are the same part of the same block; leave one out"
        seen[key] = path


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
