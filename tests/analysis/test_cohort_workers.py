"""Tasks in processes: a task whose process dies is repeated; a second time it is an error that keeps finished work."""

import os
import signal
from functools import partial
from pathlib import Path

import pytest

from netboard.analysis.cohort.workers import run_all
from netboard.base.errors import NetboardError

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="POSIX signals")]


def dies(folder: Path, times: int, number: int) -> int:
    """Be killed the first times that the second task is tried."""
    if number == 2:
        tries = len(list(folder.iterdir()))
        if tries < times:
            (folder / f"{tries}").touch()
            os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def test_a_task_whose_process_is_killed_is_tried_again(tmp_path: Path) -> None:
    assert dict(run_all(partial(dies, tmp_path, 1), range(1, 5), 2)) == {1: 1, 2: 4, 3: 9, 4: 16}


def test_a_task_that_kills_its_process_twice_is_an_error(tmp_path: Path) -> None:
    done = []
    with pytest.raises(NetboardError, match=r"virtual study 2: its process ended 2 times .* --resume"):
        done.extend(run_all(partial(dies, tmp_path, 9), range(1, 3), 2))
    assert len(list(tmp_path.iterdir())) == 2


def test_no_tasks_take_no_process() -> None:
    assert list(run_all(dies, (), 2)) == []  # type: ignore[arg-type]
