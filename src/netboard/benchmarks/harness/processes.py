"""Functions called in new processes.

This module imports little, because a cost that is measured in such a process includes its imports.
"""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


def fresh_processes(count: int) -> ProcessPoolExecutor:
    """Return an executor with new processes, which inherit no state of this one."""
    return ProcessPoolExecutor(count, get_context("spawn"))


def in_fresh_process(function: Callable[P, T], *arguments: P.args, **keywords: P.kwargs) -> T:
    """Call a function in a new process, so that its memory and its threads are its own."""
    with fresh_processes(1) as pool:
        return pool.submit(function, *arguments, **keywords).result()
