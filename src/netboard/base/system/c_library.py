"""Calls of the C library that POSIX has and Windows lacks, or that do nothing there."""

import ctypes
import errno
import os
import select
import socket
import sys
from collections.abc import Callable

if sys.platform != "win32":
    import resource

HAS_POSIX = sys.platform != "win32"
"""Whether C code finds POSIX's clock, which is Python's monotonic one, and POSIX's threads; Windows has others."""

_KEEP_SIZE = 1  # FALLOC_FL_KEEP_SIZE of Linux: the file does not grow, so a reader finds no zeros at its end


def libc(call: Callable[[ctypes.CDLL], int]) -> None:
    """Call the C library; raise `OSError` if the call fails."""
    if call(ctypes.CDLL(None, use_errno=True)):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def allow_files() -> None:
    """Allow this process as many open files as the system lets it have: each connection of a server is one.

    Windows has no such limit for sockets.
    """
    if sys.platform != "win32":
        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def allocate(descriptor: int, start: int, count: int) -> bool:
    """Reserve disk space after the end of a file; return False where the system does not support it."""
    # On a 32-bit system the C library's offsets have another size than the arguments declared here.
    if sys.platform != "linux" or sys.maxsize < 2**32:
        return False
    fallocate = ctypes.CDLL(None, use_errno=True).fallocate
    fallocate.argtypes = (ctypes.c_int, ctypes.c_int, ctypes.c_int64, ctypes.c_int64)
    while fallocate(descriptor, _KEEP_SIZE, start, count):
        number = ctypes.get_errno()
        if number in (errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL):
            return False
        if number != errno.EINTR:
            raise OSError(number, os.strerror(number))
    return True


def load_average() -> float:
    """Return how many processes wanted to run during the last minute, on average; NaN where nobody counts them [1]."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")


def clock_ticks_hz() -> int:
    """Return the rate at which /proc counts the time of processes [1/s]."""
    return int(getattr(os, "sysconf")("SC_CLK_TCK"))  # noqa: B009


def has_reader() -> bool:
    """Tell whether the program that reads this one's output is still there; Windows tells it of no pipe."""
    if not hasattr(select, "poll"):
        return False
    poll = select.poll()
    for descriptor in (1, 2):
        poll.register(descriptor, 0)
    return not any(event & (select.POLLERR | select.POLLHUP) for _, event in poll.poll(0))


def notify(address: str, message: str) -> None:
    """Send a service manager a message without waiting, by its Unix domain socket, as systemd has one."""
    with socket.socket(getattr(socket, "AF_UNIX"), socket.SOCK_DGRAM) as to:  # noqa: B009
        to.setblocking(False)
        to.sendto(message.encode(), address)
