"""Undisturbed ticks, in one compiled call from waiting for samples to the sent forces.

A force waits for whatever the loop does first, and in a loop that sleeps most of the time a few lines of Python take 10
us. While a block runs undisturbed, several ticks in a row need no Python. Python takes over when other work is due:
records for the loggers, views, a message other than a sample. Disturbed ticks (in a trial: a missing
sample, a device that is not armed; an operator's command, a robot partner) are handled by
`netboard.nodes.server.session`, which does the same steps one by one.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.clock import CATCH_UP_TICKS
from netboard.base.compiled import Records, composed, kernel, machine_code, waiting
from netboard.base.tick import HEARTBEAT_TICKS, LATE_NS, TICK, TICK_NS, TICK_WORDS
from netboard.network.transport import fastpath
from netboard.nodes.ports import samples
from netboard.nodes.ports.samples import BOTH, MotionChannel, awaited, drain, fill, send_forces, send_heartbeats
from netboard.nodes.server.tick_clock import EARLIEST_NS
from netboard.stage.stage import Stage, commanded_tick

ALL_FINE = 3 * (samples.LIVE | samples.ARMED)
"""Result of `netboard.nodes.ports.samples.fill` for samples that are in order."""

IN_TRIAL = (3 * (samples.LIVE | samples.ARMED | samples.STOPPED | samples.TRIPPED), ALL_FINE)
WAITING = (3 * (samples.STOPPED | samples.TRIPPED), 0)
"""``relevant`` and ``fine`` of a run during a trial, and between trials."""

DONE, WAITS, STEPS, INTERRUPTED, MESSAGE, FAILED = range(6)
"""Why a call returns: all ticks have run; the next one is not due; the one that has begun needs single steps; the loop
is too late, or another peer has sent something; an agent has sent something other than a sample; the socket has failed.
"""

RUN = np.dtype(
    [
        ("number", "<i8"),  # of the next tick
        ("due_ns", "<i8"),  # its deadline [ns]
        ("until", "<i8"),  # number of the tick before which Python is due
        ("sleeps", "<i8"),  # 1: sleep until the next tick; 0: return
        ("forces", "<i8"),  # 1: send forces; 0: heartbeats, every `HEARTBEAT_TICKS`
        ("relevant", "<i8"),  # which bits that `samples.fill` returns matter
        ("fine", "<i8"),  # what these must be
        ("wake_ns", "<i8"),  # when it can begin, if no sample arrives first [ns]
        ("late_ns", "<i8"),  # how long after its deadline the newest tick began [ns]
        ("late_ticks", "<i8"),  # deadline misses
        ("found", "<i8"),  # result of `netboard.nodes.ports.samples.fill` for the newest tick
    ]
)
"""A run of undisturbed ticks."""

RUN_WORDS = {name: place for place, name in enumerate(RUN.names or ())}
"""Place of each field among the words of a run, which Python reads and writes faster than fields of a record."""

_BEHIND_NS = CATCH_UP_TICKS * TICK_NS
_EVENT, _TICK, _TRIAL = (TICK_WORDS[name] for name in ("event", "tick", "trial"))
_PERTURBATION, _PERTURBED_TICKS = (TICK_WORDS[name] for name in ("perturbation", "perturbed_ticks"))
_UNREAD = samples.OTHER | samples.FAILED


def _ticks(state: Records, rows: Records, first: int, count: int, book: Records, tables: NDArray[np.float64]) -> None:
    """Stand for the ticks of a stage."""


@kernel
def _wake(agents: NDArray[np.int64], due_ns: int) -> int:
    """Return when a tick can begin if no other sample arrives [ns]."""
    return due_ns if awaited(agents) else due_ns - EARLIEST_NS


@kernel
def _send(
    motion: MotionChannel, gains: NDArray[np.float64], forces: int, row: NDArray[np.int64], commanded: NDArray[np.int64]
) -> int:
    """Send the forces of a tick, or the heartbeats that are due; return a result of sending."""
    if forces:
        return send_forces(motion, row, commanded, gains)
    return send_heartbeats(motion, row[_TICK], BOTH) if row[_TICK] % HEARTBEAT_TICKS == 0 else fastpath.SENT


def _run(
    motion: MotionChannel,
    gains: NDArray[np.float64],
    stage: tuple[Any, ...],
    runs: Records,
    delay: int,
    timeout_ns: int,
) -> int:
    """Run ticks while their samples are in order, and send the forces or heartbeats of each.

    ``stage``, ``runs``: as in `run_of`. Returns why it returns.
    """
    fast, agents, unregistered = motion.fast, motion.agents, motion.unregistered
    state, rows, words, book, tables = stage
    run = runs[0]
    while run["number"] < run["until"]:
        due_ns = run["due_ns"]
        found = drain(motion, due_ns, True, samples.MAX_FRAMES)
        run["wake_ns"] = _wake(agents, due_ns)
        wait_ns = run["wake_ns"] - fastpath.now_ns(fast)
        begins = wait_ns <= 0 and not found & _UNREAD
        if begins:
            number = run["number"]
            row, late_ns = words[number % len(words)], fastpath.now_ns(fast) - due_ns
            if late_ns > _BEHIND_NS:
                return INTERRUPTED
            run["late_ns"], run["found"] = late_ns, fill(row, agents, number, due_ns, late_ns, timeout_ns)
            if run["found"] & run["relevant"] != run["fine"]:
                return STEPS
            _ticks(state, rows, number, 1, book, tables)
            sent = commanded_tick(number, delay, row[_TRIAL], book[0]["rendering"]["catch"])
            if _send(motion, gains, run["forces"], row, words[sent % len(words)]) == fastpath.FAILED:
                return FAILED
            run["late_ticks"] += late_ns > LATE_NS
            run["number"], run["due_ns"] = number + 1, due_ns + TICK_NS
            # Python records the decision, and a change of the phase may end what makes a tick undisturbed. Python also
            # records that a perturbation begins, whose trigger is to be sent at once.
            if row[_EVENT] or (row[_PERTURBATION] and not row[_PERTURBED_TICKS]):
                run["until"] = number + 1
        if begins or (run["wake_ns"] < due_ns and not found & _UNREAD):  # an unread message must not be overwritten
            found = drain(motion, run["due_ns"], False, samples.MAX_FRAMES)  # the socket signals again once it is empty
            run["wake_ns"] = _wake(agents, run["due_ns"])
        if found & _UNREAD:
            return FAILED if found & samples.FAILED else MESSAGE
        if unregistered[0]["kept"] or unregistered[0]["dropped"]:
            return INTERRUPTED
        if begins:
            continue
        if not run["sleeps"]:
            return WAITS
        if fastpath.sleep(fast, wait_ns):
            return INTERRUPTED
    return DONE


@cache
def _composed(ticks: Callable[..., None]) -> Callable[..., int]:
    return composed(_run, waiting, _ticks=ticks)


def run_of(stage: Stage) -> Callable[..., int]:
    """Compile the undisturbed ticks of a stage, or load them from the cache.

    The arguments are those that `netboard.nodes.ports.motion_port.MotionPort.undisturbed_ticks` passes, the stage's
    state, rows, words, book and tables, a run (`RUN`), the force delay in ticks, and the age from which a sample no
    longer counts [ns].
    """
    rows, motion = np.zeros(1, TICK), samples.motion_of(fastpath.FastPath(None).record)
    scene = stage.initial(), rows, rows.view(np.int64).reshape(1, -1), stage.book, stage.tables
    return machine_code(_composed(stage.ticks), motion, np.ones(2), scene, np.zeros(1, RUN), 0, 0)
