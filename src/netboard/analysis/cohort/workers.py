"""Run one task for each number: in this process, in processes of this machine, or on a Dask cluster.

A process has one task at a time. If it ends too early, for want of memory or by a signal, only its task is lost:
another process tries it once more. If that fails too, the running tasks are finished, and then there is an error.
"""

import multiprocessing
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from functools import partial
from pathlib import Path
from typing import TypeVar

from netboard.analysis.extraction.workers import dask, leave_stopping
from netboard.base.errors import NetboardError

T = TypeVar("T")

Task = Callable[[int], T]

TRIES = 2
"""How often a task is tried whose process ends too early [1]."""

AHEAD = 64
"""Tasks that a cluster has at a time [1]."""


def run_all(
    task: Task[T], numbers: Sequence[int], workers: int, address: str | None = None, files: Sequence[Path] = ()
) -> Iterator[tuple[int, T]]:
    """Yield each number and its result as it is finished.

    Parameters
    ----------
    task : callable
        Function that can be pickled.
    workers : int
        Processes of this machine; 1: this one [1].
    address : str or None
        Address of a Dask scheduler, used instead of processes.
    files : sequence of Path
        Files that all workers of a cluster must see.
    """
    if not numbers:
        return
    if address is not None:
        with dask(address)(files) as executor:
            yield from _run(task, numbers, AHEAD, lambda: executor)
    elif workers == 1:
        for number in numbers:
            yield number, task(number)
    else:
        spawn = partial(ProcessPoolExecutor, 1, multiprocessing.get_context("spawn"), leave_stopping)
        yield from _run(task, numbers, min(workers, len(numbers)), spawn)


def _run(
    task: Task[T], numbers: Sequence[int], ahead: int, executor_for: Callable[[], Executor]
) -> Iterator[tuple[int, T]]:
    """Keep so many tasks running, each in an executor that is replaced if it breaks."""
    waiting, lost = deque(numbers), Counter[int]()
    running: dict[Future[T], tuple[int, Executor]] = {}
    executors: list[Executor] = []

    def start(executor: Executor) -> None:
        number = waiting.popleft()
        running[executor.submit(task, number)] = number, executor

    try:
        for _ in range(min(ahead, len(waiting))):
            executors.append(executor_for())
            start(executors[-1])
        while running:
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                number, executor = running.pop(future)
                if isinstance(future.exception(), BrokenExecutor):
                    lost[number] += 1
                    executor.shutdown(wait=False)
                    executors.append(executor := executor_for())
                    if lost[number] < TRIES:
                        waiting.appendleft(number)
                    else:
                        waiting.clear()
                else:
                    yield number, future.result()
                if waiting:
                    start(executor)
    finally:
        for executor in executors:
            executor.shutdown(wait=False, cancel_futures=True)
    for number, times in lost.items():
        if times == TRIES:
            raise NetboardError(
                f"virtual study {number}: its process ended {TRIES} times before it was done, perhaps for want of "
                "memory; finished studies are kept: try fewer --workers, with --resume"
            )
