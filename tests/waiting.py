"""Waiting for a thread, a process or a socket beside a test: what has no event to wait for is looked at again."""

from collections.abc import Callable
from time import monotonic, sleep
from typing import TypeVar

T = TypeVar("T")

PATIENCE = 60.0
"""Time in which all of them answer even on a busy machine [s]."""


def until(
    condition: Callable[[], T],
    step: Callable[[], object] = lambda: None,
    state: Callable[[], object] = lambda: "timeout",
) -> T:
    """Repeat a step until a condition holds, and return its value; fail with the state after `PATIENCE`."""
    end = monotonic() + PATIENCE
    while not (found := condition()):
        assert monotonic() < end, state()
        step()
        sleep(0.001)
    return found
