"""Run one task for each number: in this process, in processes of this machine, or on a Dask cluster.

A process has one task at a time. If it ends too early, because memory ran out or a signal killed it, only its
task is lost: another process tries it once more. If that fails too, the running tasks are finished, and then there is
an error. An interruption ends the processes at once, because nobody takes the results of their tasks any more.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from netboard.analysis.extraction.workers import dask
from netboard.base.errors import NetboardError
from netboard.base.process.workers import terminate_workers, worker_processes
from netboard.base.terminal.compiling import workers_compilation
from netboard.recording.export.formats import Progress

T = TypeVar("T")

Task = Callable[[int], T]

TRIES = 2
"""How often a task is tried whose process ends too early [1]."""

CODE = "netboard.analysis.cohort.virtual"
"""Module whose code, with all that it imports, determines the tables of a virtual study."""

AHEAD = 64
"""Tasks that a cluster has at a time [1]."""


@dataclass(frozen=True, slots=True)
class Runner:
    """Where the tasks of a cohort run, and the callback that reports their progress.

    - `workers`: processes of this machine; 1: this one [1].
    - `address`: address of a Dask scheduler, used instead of processes.
    """

    progress: Progress
    workers: int = 1
    address: str | None = None

    def run_all(self, task: Task[T], numbers: Sequence[int], files: Sequence[Path] = ()) -> Iterator[tuple[int, T]]:
        """Yield each number and its result as it is finished.

        - `task`: function that can be pickled.
        - `files`: files that all workers of a cluster must see.
        """
        if not numbers:
            return
        with ExitStack() as stack:

            def process() -> Executor:
                pool = worker_processes(1)
                stack.callback(terminate_workers, pool)
                return pool

            if self.address is not None:
                cluster = stack.enter_context(dask(self.address, root=CODE)(files))
                yield from _run(task, numbers, AHEAD, lambda: cluster)
            elif self.workers > 1:
                stack.enter_context(workers_compilation())
                yield from _run(task, numbers, self.workers, process)
            else:
                for number in numbers:
                    yield number, task(number)


def _run(
    task: Task[T], numbers: Sequence[int], ahead: int, executor_for: Callable[[], Executor]
) -> Iterator[tuple[int, T]]:
    """Keep some tasks running, each in an executor that is replaced if it breaks."""
    waiting, lost = deque(numbers), Counter[int]()
    running: dict[Future[T], tuple[int, Executor]] = {}

    def start(executor: Executor) -> None:
        number = waiting.popleft()
        running[executor.submit(task, number)] = number, executor

    for _ in range(min(ahead, len(waiting))):
        start(executor_for())
    while running:
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            number, executor = running.pop(future)
            if not isinstance(future.exception(), BrokenExecutor):
                yield number, future.result()
            else:
                lost[number] += 1
                if lost[number] == TRIES:
                    waiting.clear()
                    continue
                executor = executor_for()
                waiting.appendleft(number)
            if waiting:
                start(executor)
    for number, times in lost.items():
        if times == TRIES:
            raise NetboardError(
                f"virtual study {number}: its process ended {TRIES} times before it was done, perhaps for want of "
                "memory; finished studies are kept: try fewer --workers, with --resume"
            )
