"""Disk space for recordings: early warning, a stop before the disk is full, and reserved space for the index.

The remaining time is estimated from the recording's growth over the last minute. A short burst, as when a logger
catches up, must not raise a warning: other systems have stopped recordings for no reason that way.
"""

from collections import deque
from pathlib import Path
from typing import NamedTuple

from netboard.base.errors import ConfigError, RecordingError
from netboard.base.files.new import try_writing

BYTES_PER_SECOND = 250_000
"""Growth of a recording, with a margin: demos took 120 to 190 kB/s."""

LOW_BYTES = 5_000_000_000
"""Warn below this free space, as Open Ephys and Pupil Capture do [1]."""

LOW_S = 1800.0
"""Warn below this remaining time [s]."""

MIN_BYTES = 200_000_000
"""Below this free space no recording starts, and a running one is finished [1]."""

MIN_S = 120.0
"""Below this remaining time a running recording is finished [s]."""

SLOW_SYNC_S, STALLED_SYNC_S = 0.6, 3.0
"""Time until records are on disk from which the disk counts as slow, and as stalled [s].

The logger syncs every `Recording.flush_ms`, 400 ms by default. On a disk that takes its time, a power cut loses more.
"""

MEMORY_NS = 60_000_000_000
"""Window of the growth-rate estimate [ns]."""

STEP_NS = 5_000_000_000
"""Interval between two size measurements [ns]."""


class Space(NamedTuple):
    """Free space and how long it lasts."""

    free: int
    seconds: float  # time until the space is used up [s]

    @property
    def low(self) -> bool:
        """Whether to warn the operator."""
        return self.free < LOW_BYTES or self.seconds < LOW_S

    @property
    def out(self) -> bool:
        """Whether to finish the recording."""
        return self.free < MIN_BYTES or self.seconds < MIN_S

    def __str__(self) -> str:
        size = f"{self.free / 1e9:.1f} GB" if self.free >= MIN_BYTES else f"{self.free / 1e6:.0f} MB"
        return f"{size} free" if self.seconds >= LOW_S else f"{size} free, for {self.seconds / 60:.0f} min"


class DiskUse:
    """Growth rate of a recording, and how long the free space lasts."""

    def __init__(self) -> None:
        self._sizes: deque[tuple[int, int]] = deque(maxlen=MEMORY_NS // STEP_NS)

    def judge(self, now_ns: int, written: int, free: int) -> Space:
        """Return the current free space and remaining time."""
        sizes = self._sizes
        if not sizes or now_ns - sizes[-1][0] >= STEP_NS:
            sizes.append((now_ns, written))
        then_ns, size = sizes[0]
        # Wait until the window is full: a logger that joins late first writes a backlog.
        if len(sizes) < (sizes.maxlen or 0) or written <= size:
            return Space(free, float("inf"))
        return Space(free, free * (now_ns - then_ns) * 1e-9 / (written - size))


def require_space(folder: Path, free: int) -> None:
    """Refuse to start a recording on a disk that is nearly full."""
    space = Space(free, float("inf"))
    if space.out:
        raise RecordingError(f"{folder}: only {space}, and a recording stops at {MIN_BYTES / 1e6:.0f} MB")


def require_writable(folder: Path, key: str) -> None:
    """Raise an error if a folder cannot be created or written to; leave nothing in it."""
    place = next(parent for parent in (folder, *folder.absolute().parents) if parent.exists())
    try:
        try_writing(place)
    except OSError as error:
        raise ConfigError(
            f'{key}: found "{folder}", expected a folder that can be written: {place}: {error.strerror or error}'
        ) from error
