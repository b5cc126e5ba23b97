"""Functions called in new processes.

This module imports little, because a cost that is measured in such a process includes its imports.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import ParamSpec, TypeVar

from netboard.base.process.workers import terminate_workers

P = ParamSpec("P")
T = TypeVar("T")


@contextmanager
def fresh_processes(count: int) -> Iterator[ProcessPoolExecutor]:
    """Yield an executor with new processes, which inherit no state of this one; an interruption ends them at once."""
    with ProcessPoolExecutor(count, get_context("spawn")) as pool:
        try:
            yield pool
        except KeyboardInterrupt:
            terminate_workers(pool)
            raise


def in_fresh_process(function: Callable[P, T], *arguments: P.args, **keywords: P.kwargs) -> T:
    """Call a function in a new process, so that its memory and its threads are its own."""
    with fresh_processes(1) as pool:
        return pool.submit(function, *arguments, **keywords).result()
