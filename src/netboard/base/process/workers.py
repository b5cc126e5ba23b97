"""Processes that work for this one, and the cores for them."""

import os
import signal
import threading
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import parent_process
from multiprocessing.connection import wait
from multiprocessing.context import SpawnContext, SpawnProcess
from threading import Event

from netboard.base.system.interrupts import can_interrupt, ctrl_c
from netboard.base.system.scheduling import scheduling

interrupted = Event()
"""Whether Ctrl-C has interrupted this worker: the exception alone can be lost, in a callback of the compiler."""


def usable_cpus() -> list[int]:
    """Return the CPUs that this process may use."""
    return sorted(scheduling.cpus()) or list(range(os.cpu_count() or 1))


def cores() -> int:
    """Return the number of cores that this process may use [1]."""
    return len(usable_cpus())


def worker_processes(count: int, *, interruptible: bool = False) -> ProcessPoolExecutor:
    """Return a pool of new processes; Ctrl-C stops only the waiting process, which stops them.

    They end with this process, also if it is killed and cannot stop them.

    ``interruptible``: it also interrupts what they run with `ctrl_c` unblocked, and `interrupted` tells them.
    """
    return ProcessPoolExecutor(count, _Context(), _stop_once if interruptible else _leave_stopping)


class _Worker(SpawnProcess):
    """A process that Ctrl-C does not interrupt while it starts or waits, which would print a traceback."""

    def start(self) -> None:
        with ctrl_c(blocked=True):
            super().start()


class _Context(SpawnContext):
    """Starts these processes; a forked copy would inherit locks of other threads (ZeroMQ's, Numba's), held for ever."""

    Process = _Worker


def interrupt_workers(pool: ProcessPoolExecutor) -> None:
    """Interrupt what the processes of an interruptible pool run, as Ctrl-C does; POSIX only."""
    if can_interrupt():
        for number in pool._processes or {}:
            os.kill(number, signal.SIGINT)


def terminate_workers(pool: ProcessPoolExecutor) -> None:
    """End the processes of a pool at once; after a mere shutdown, this process could end only after their tasks."""
    processes = list((pool._processes or {}).values())  # Python 3.14 has ProcessPoolExecutor.terminate_workers
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.terminate()


def _leave_stopping() -> None:
    """Ignore Ctrl-C in a worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _end_with_parent()


def _stop_once() -> None:
    """Let Ctrl-C interrupt a worker once: it can reach it from the terminal and from the waiting process."""

    def stop(number: int, frame: object) -> None:
        if not interrupted.is_set():
            interrupted.set()
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, stop)
    _end_with_parent()


def _end_with_parent() -> None:
    """End this worker at once when its parent process ends: nobody takes its results, or ends it, any more.

    The pool alone does not see to it: a worker that waits for its next task holds both ends of the queue.
    """
    parent = parent_process()
    if parent is None:
        return

    def watch() -> None:
        wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, name="end with parent", daemon=True).start()
