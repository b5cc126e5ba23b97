"""Tasks in worker processes: a task whose process dies is retried once; if it dies again, that is an error."""

import os
import signal
from functools import partial
from pathlib import Path

import pytest

from netboard.analysis.cohort.workers import run_all
from netboard.base.errors import NetboardError

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="POSIX signals")]


def square_or_die(folder: Path, times: int, number: int) -> int:
    """Return the square; task 2 kills its process on the first `times` attempts."""
    if number == 2:
        tries = len(list(folder.iterdir()))
        if tries < times:
            (folder / f"{tries}").touch()
            os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def test_task_is_retried_after_its_process_is_killed(tmp_path: Path) -> None:
    assert dict(run_all(partial(square_or_die, tmp_path, 1), range(1, 5), 2)) == {1: 1, 2: 4, 3: 9, 4: 16}


def test_task_whose_process_dies_twice_is_an_error(tmp_path: Path) -> None:
    done = []
    with pytest.raises(NetboardError, match=r"virtual study 2: its process ended 2 times .* --resume"):
        done.extend(run_all(partial(square_or_die, tmp_path, 9), range(1, 3), 2))
    assert len(list(tmp_path.iterdir())) == 2


def test_empty_task_list_yields_no_results() -> None:
    assert list(run_all(square_or_die, (), 2)) == []  # type: ignore[arg-type]
