"""Processes that work for this one."""

import signal
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context


def worker_processes(count: int) -> ProcessPoolExecutor:
    """Return a pool of new processes; Ctrl-C stops only the waiting process, which stops them."""
    return ProcessPoolExecutor(count, get_context("spawn"), _leave_stopping)


def terminate_workers(pool: ProcessPoolExecutor) -> None:
    """End the processes of a pool at once; after a mere shutdown, this process could end only after their tasks."""
    processes = list((pool._processes or {}).values())  # Python 3.14 has ProcessPoolExecutor.terminate_workers
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.terminate()


def _leave_stopping() -> None:
    """Ignore Ctrl-C in a worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
