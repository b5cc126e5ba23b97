"""Checks whether the recordings' disk is fast enough and large enough for a session.

The logger writes a chunk, waits until it is on disk, and repeats; these checks do the same in the same folder.
"""

import os
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from netboard.base.finding import Colour, Finding, graded
from netboard.base.tables.rig import RecordingSettings
from netboard.recording.format.disk import BYTES_PER_SECOND

GOOD_HOURS, FEWEST_HOURS = 24.0, 4.0
"""Recording time for which the free space should suffice, and must suffice [h]."""

GOOD_MS, BEARABLE_MS = 200.0, 2000.0
"""Good and bearable time to sync a chunk: the interval of flushes, and much less than the server's ring holds [ms]."""


def nearest(folder: Path) -> Path:
    """Return the folder, or its nearest parent that exists."""
    folder = folder.absolute()
    while not folder.is_dir() and folder != folder.parent:
        folder = folder.parent
    return folder


def space(settings: RecordingSettings) -> Finding:
    """Check the recording time that the disk has space for."""
    free = shutil.disk_usage(nearest(Path(settings.directory))).free
    hours = free / BYTES_PER_SECOND / 3600
    found = f"{free / 1e9:.1f} GB free for {settings.directory}: {hours:.0f} h of recording"
    figures = {"free_gb": free / 1e9, "hours": hours}
    advice = "make room, or choose another [recording] directory"
    poor: Colour = "yellow" if hours >= FEWEST_HOURS else "red"
    return graded("disk space", hours >= GOOD_HOURS, found, advice, figures, else_=poor)


def speed(settings: RecordingSettings, chunks: int, progress: Callable[[float], None]) -> Finding:
    """Measure how long a chunk takes to reach the disk."""
    name = "disk speed"
    folder = nearest(Path(settings.directory))
    try:
        took = sync_times(folder, settings.chunk_bytes, chunks, progress)
    except OSError as error:
        return Finding(name, "red", f"{folder}: {error.strerror}", "choose a [recording] directory you may write to")
    p50, most = float(np.median(took)), max(took)
    found = f"{settings.chunk_bytes // 1024} KiB are on disk after {p50:.1f} ms (median), {most:.1f} ms (longest)"
    figures = {"p50_ms": p50, "max_ms": most}
    advice = "record to a local disk that no other program uses"
    poor: Colour = "yellow" if most <= BEARABLE_MS else "red"
    return graded(name, most <= GOOD_MS, found, advice, figures, else_=poor)


def sync_times(folder: Path, chunk_bytes: int, chunks: int, progress: Callable[[float], None]) -> list[float]:
    """Write and sync this many chunks of noise, and return how long each took [ms]."""
    took = []
    with tempfile.NamedTemporaryFile(dir=folder, prefix=".netboard-doctor-", buffering=0) as file:
        for number in range(chunks):
            chunk = os.urandom(chunk_bytes)
            began = time.monotonic()
            file.write(chunk)
            os.fsync(file.fileno())
            took.append((time.monotonic() - began) * 1000)
            progress((number + 1) / chunks)
    return took
