"""What a recording asks of its disk: a word in time before there is no space, and room kept free for the end.

How long the space will do is judged by what the recording itself has needed of late. A burst, as when a logger catches
up, must not look like the rate of an hour: that has stopped other systems for nothing.
"""

import ctypes
import errno
import os
import sys
from collections import deque
from pathlib import Path
from tempfile import TemporaryFile
from typing import NamedTuple

from netboard.base.errors import ConfigError, RecordingError

LOW_BYTES = 5_000_000_000
"""Less free space than this is said [1]."""

LOW_S = 1800.0
"""As is space for less than this [s]."""

LEAST_BYTES = 200_000_000
"""With less free space than this nothing is begun, and what is being written is finished [1]."""

LEAST_S = 120.0
"""As with space for less than this [s]."""

MEMORY_NS = 60_000_000_000
"""The rate is that of the last minute [ns]."""

STEP_NS = 5_000_000_000
"""It is measured so often [ns]."""

_KEEP_SIZE = 1


class Space(NamedTuple):
    """How much space there is.

    Attributes
    ----------
    seconds : float
        How long it will do [s].
    """

    free: int
    seconds: float

    @property
    def low(self) -> bool:
        """Whether somebody should know."""
        return self.free < LOW_BYTES or self.seconds < LOW_S

    @property
    def out(self) -> bool:
        """Whether it is time to stop."""
        return self.free < LEAST_BYTES or self.seconds < LEAST_S

    def __str__(self) -> str:
        size = f"{self.free / 1e9:.1f} GB" if self.free >= LEAST_BYTES else f"{self.free / 1e6:.0f} MB"
        return f"{size} free" if self.seconds >= LOW_S else f"{size} free, for {self.seconds / 60:.0f} min"


class Consumption:
    """How fast a recording grows, and how long the space will do."""

    def __init__(self) -> None:
        self._sizes: deque[tuple[int, int]] = deque(maxlen=MEMORY_NS // STEP_NS)

    def judge(self, now_ns: int, written: int, free: int) -> Space:
        """Say how much space there is."""
        sizes = self._sizes
        if not sizes or now_ns - sizes[-1][0] >= STEP_NS:
            sizes.append((now_ns, written))
        then_ns, size = sizes[0]
        # Not before the memory is full: a logger that joins late has a backlog to write first.
        if len(sizes) < (sizes.maxlen or 0) or written <= size:
            return Space(free, float("inf"))
        return Space(free, free * (now_ns - then_ns) * 1e-9 / (written - size))


def require_space(folder: Path, free: int) -> None:
    """Refuse to begin a recording that could not go on for long."""
    space = Space(free, float("inf"))
    if space.out:
        raise RecordingError(f"{folder}: only {space}, and a recording stops at {LEAST_BYTES / 1e6:.0f} MB")


def sync_directory(directory: Path) -> None:
    """Make a new name in a directory survive a power cut, where the system offers it."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def allocate(handle: int, start: int, count: int) -> bool:
    """Keep space for a file behind its end, so that nobody else can take it; False where systems do not offer that."""
    if sys.platform != "linux" or sys.maxsize < 2**32:
        return False
    fallocate = ctypes.CDLL(None, use_errno=True).fallocate
    fallocate.argtypes = (ctypes.c_int, ctypes.c_int, ctypes.c_int64, ctypes.c_int64)
    while fallocate(handle, _KEEP_SIZE, start, count):
        number = ctypes.get_errno()
        if number in (errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL):
            return False
        if number != errno.EINTR:
            raise OSError(number, os.strerror(number))
    return True


def require_writable(folder: Path, key: str) -> None:
    """Raise an error if a folder cannot be made or written to; nothing is left there."""
    place = next(parent for parent in (folder, *folder.absolute().parents) if parent.exists())
    try:
        with TemporaryFile(dir=place):
            pass
    except OSError as error:
        raise ConfigError(
            f'{key}: found "{folder}", expected a folder that can be written: {place}: {error.strerror or error}'
        ) from error
