"""Locks of open files among processes, which end with the process.

POSIX: ``flock``. Windows: ``LockFileEx`` on one byte far beyond the end, because a lock there keeps others from reading
what it covers.
"""

import os
import sys
from collections.abc import Callable
from ctypes import byref

from netboard.base.system.windows import Kernel32, Overlapped, kernel32

if sys.platform != "win32":
    import fcntl

FAIL_AT_ONCE, EXCLUSIVE = 1, 2
"""Flags of LockFileEx."""

PLACE = 2**62
"""Position of the byte that Windows locks."""


def posix_lock(descriptor: int, *, shared: bool) -> None:
    """Lock a file by flock."""
    if sys.platform != "win32":
        fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)


def windows_lock(descriptor: int, *, shared: bool, api: Kernel32, handle_of: Callable[[int], int]) -> None:
    """Lock a byte of a file by LockFileEx. ``handle_of``: Windows' handle of a file number."""
    place = Overlapped(low=PLACE & 0xFFFFFFFF, above=PLACE >> 32)
    flags = FAIL_AT_ONCE | (0 if shared else EXCLUSIVE)
    api.succeed("LockFileEx", handle_of(descriptor), flags, 0, 1, 0, byref(place))


def lock(descriptor: int, *, shared: bool = False) -> None:
    """Lock an open file until it is closed or its process ends.

    A writer's lock excludes all others; shared ones exclude only writers. Raises `BlockingIOError` if the file is
    locked, and another `OSError` on a file system without locks.
    """
    if sys.platform == "win32":
        import msvcrt  # noqa: PLC0415  (only there)

        windows_lock(descriptor, shared=shared, api=kernel32(), handle_of=msvcrt.get_osfhandle)
    else:
        posix_lock(descriptor, shared=shared)


def sync_directory(directory: os.PathLike[str]) -> None:
    """Make a new directory entry survive a power cut; Windows writes it with the file, and opens no directory."""
    if sys.platform != "win32":
        handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
