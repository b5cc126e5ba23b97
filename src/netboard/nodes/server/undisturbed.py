"""The undisturbed tick of a felt trial: from both samples to both sent forces in one compiled call.

A force waits for whatever its tick does first, and in a loop that sleeps most of the time a few lines of Python take 10
us. While a trial runs and nothing is the matter, a tick needs no Python until its forces have left. Anything else (a
missing sample, a device that is not armed, an operator's wish, a robot partner) is handled by
`netboard.nodes.server.session`, which does the same steps one by one.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from netboard.base.compiled import composed, machine_code
from netboard.base.tick import TICK
from netboard.network.protocol import fixed
from netboard.network.transport import fastpath
from netboard.nodes.ports import samples
from netboard.nodes.ports.samples import fill, send_forces
from netboard.stage.stage import Stage

ALL_FINE = 3 * (samples.LIVE | samples.ARMED)
"""What `netboard.nodes.ports.samples.fill` finds while nothing is the matter."""

_HEAD, _MARKERS, _ = fixed.FORCE


def _ticks(state: Any, rows: Any, first: int, count: int, book: Any, tables: Any) -> None:
    """Stand for the ticks of a stage."""


def _answer(
    fast: Any,
    agents: Any,
    gains: Any,
    frame: Any,
    force: Any,
    state: Any,
    rows: Any,
    words: Any,
    book: Any,
    tables: Any,
    number: int,
    delay: int,
    due_ns: int,
    late_ns: int,
    timeout_ns: int,
) -> int:
    """Begin a tick with the newest samples and, where these are `ALL_FINE`, run it and send both forces.

    Returns what `netboard.nodes.ports.samples.fill` has found, or `netboard.network.transport.fastpath.FAILED`.
    """
    row = words[number % len(words)]
    found = fill(row, agents, number, due_ns, late_ns, timeout_ns)
    if found != ALL_FINE:
        return found
    _ticks(state, rows, number, 1, book, tables)
    commanded = words[(number - delay) % len(words)]
    sent = send_forces(fast, frame, row, commanded, agents, gains, _HEAD, _MARKERS, force)
    return sent if sent == fastpath.FAILED else found


@cache
def _composed(ticks: Callable[..., None]) -> Callable[..., int]:
    return composed(_answer, _ticks=ticks)


def answer_of(stage: Stage) -> Callable[..., int]:
    """Compile the undisturbed tick of a stage, or load it from the cache."""
    row = np.zeros(1, TICK)
    arguments = (
        fastpath.FastPath(None).record,
        np.zeros((2, samples.WORDS), np.int64),
        np.ones(2),
        np.zeros(fixed.FORCE.size, np.uint8),
        np.zeros(len(fixed.FORCE.markers), np.int64),
        stage.initial(),
        row,
        row.view(np.int64).reshape(1, -1),
        stage.book,
        stage.tables,
        *(0,) * 5,
    )
    return machine_code(_composed(stage.ticks), *arguments)
