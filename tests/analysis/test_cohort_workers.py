"""Tasks in worker processes: a task whose process dies is retried once; if it dies again, that is an error."""

import os
import signal
import subprocess
import sys
from functools import partial
from multiprocessing import active_children
from multiprocessing.connection import wait
from pathlib import Path
from threading import Event

import pytest

from netboard.analysis.cohort.workers import Runner
from netboard.base.errors import NetboardError

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="POSIX signals")]

TWO_PROCESSES = Runner(lambda what, done, total: None, 2)


def square_or_die(folder: Path, times: int, number: int) -> int:
    """Return the square; task 2 kills its process on the first `times` attempts."""
    if number == 2:
        tries = len(list(folder.iterdir()))
        if tries < times:
            (folder / f"{tries}").touch()
            os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def test_task_is_retried_after_its_process_is_killed(tmp_path: Path) -> None:
    assert dict(TWO_PROCESSES.run_all(partial(square_or_die, tmp_path, 1), range(1, 5))) == {1: 1, 2: 4, 3: 9, 4: 16}


def test_task_whose_process_dies_twice_is_an_error(tmp_path: Path) -> None:
    done = []
    with pytest.raises(NetboardError, match=r"virtual study 2: its process ended 2 times .* --resume"):
        done.extend(TWO_PROCESSES.run_all(partial(square_or_die, tmp_path, 9), range(1, 3)))
    assert len(list(tmp_path.iterdir())) == 2


def test_empty_task_list_yields_no_results() -> None:
    assert list(TWO_PROCESSES.run_all(square_or_die, ())) == []  # type: ignore[arg-type]


def one_or_wait(number: int) -> int:
    """Return 1, or never end."""
    if number > 1:
        Event().wait()
    return number


def test_interruption_ends_the_processes_at_once() -> None:
    before = set(active_children())
    results = TWO_PROCESSES.run_all(one_or_wait, range(1, 3))
    assert next(results) == (1, 1)
    workers = set(active_children()) - before
    with pytest.raises(KeyboardInterrupt):
        results.throw(KeyboardInterrupt())  # type: ignore[attr-defined]
    try:
        assert workers
        # Not `is_alive`: while a thread of the pool reaps a process, that returns True.
        assert all(wait([worker.sentinel], 30) for worker in workers)
    finally:
        for worker in workers:
            worker.kill()


def wait_for_ever(number: int) -> None:
    """Write the number of this process, and never end."""
    os.write(1, f"{os.getpid()}\n".encode())
    Event().wait()


def test_workers_end_when_their_parent_is_killed() -> None:
    """The killed process cannot stop them: each must notice. Its output ends once the last of them has ended."""
    script = "from test_cohort_workers import TWO_PROCESSES, wait_for_ever\n"
    script += "if __name__ == '__main__':\n    list(TWO_PROCESSES.run_all(wait_for_ever, (1, 2)))\n"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    command = [sys.executable, "-c", script]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True) as killed:
        assert killed.stdout is not None
        workers = [int(killed.stdout.readline()) for _ in range(2)]
        killed.kill()
        try:
            killed.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            for worker in workers:
                os.kill(worker, signal.SIGKILL)
            raise
