"""Time and memory of a call, measured in a fresh process so that its memory is its own.

What is measured has a module of its own, for such a process imports no more than that.
"""

import os
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Took:
    """Time and memory of a call.

    - `seconds`: by the clock [s].
    - `cores`: of cores, in this process and those that it started and saw end [s].
    """

    seconds: float
    cores: float


class Watch:
    """Measures time and memory since its creation."""

    def __init__(self) -> None:
        self._began = time.perf_counter(), _of_cores()

    def read(self) -> Took:
        """Return the time and memory used so far."""
        return Took(time.perf_counter() - self._began[0], _of_cores() - self._began[1])


def _of_cores() -> float:
    """Return the CPU time of this process and of its ended children [s]."""
    ended = os.times()
    return time.process_time() + ended.children_user + ended.children_system


def apart(function: Callable[P, T], *arguments: P.args, **more: P.kwargs) -> T:
    """Call a function in a fresh process."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(function, *arguments, **more).result()
