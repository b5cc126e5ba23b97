"""Ctrl-C in threads and workers: POSIX can block it in a thread, and send it to a process; Windows can do neither."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager


def can_interrupt() -> bool:
    """Return whether one process can interrupt another as Ctrl-C does."""
    return hasattr(signal, "pthread_sigmask")


@contextmanager
def ctrl_c(*, blocked: bool) -> Iterator[None]:
    """Block Ctrl-C until the end, in this thread and the processes that it starts, or unblock it; POSIX only."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK if blocked else signal.SIG_UNBLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
