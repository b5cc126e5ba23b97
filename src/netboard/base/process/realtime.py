"""Real-time set-up of a loop: scheduling, CPUs, locked memory, timers.

`prepare` is the only place that requests real-time features, with priorities from the table `Priority`. Nothing here is
fatal: a feature that the system does not offer or allow is logged in one line, and the process continues without it.
docs/how-to/real-time.md explains each feature and how to permit it.
"""

import errno
import gc
import logging
import sys
from collections.abc import Callable
from enum import IntEnum
from functools import partial

from netboard.base.system.scheduling import scheduling
from netboard.base.tables.rig import Realtime

log = logging.getLogger(__name__)

OK, OFF = "ok", "off"
"""Result of a request: granted, or not requested; any other text is the reason of a refusal."""


class Priority(IntEnum):
    """SCHED_FIFO priorities of netboard's loops; no others are in use.

    The server precedes the agents, because both wait for it. ZeroMQ's threads precede their loop by `IO_PRIORITY_STEP`,
    so that messages leave at once and not after the rest of the tick, even on a shared core; so does the watch of a
    robot partner. A trigger box's process has little work and follows the agents. Logger, displays and all others have
    normal scheduling. Interrupt threads of a PREEMPT_RT kernel have 50.
    """

    TRIGGER = 45
    AGENT = 50
    SERVER = 60


IO_PRIORITY_STEP = 5
"""Priority of ZeroMQ's threads above that of their loop [1]."""


PLACES = ("server", "left", "right")
"""Loops of a rig, in the order in which they get CPUs of their own, from the highest CPU number down."""

AUTO = "auto"

PRIORITY = "priority"
_granted: dict[str, int] = {}
"""Priority that `prepare` was granted for the loop of this process."""


def steady_loop() -> None:
    """Start a real-time loop: with the priority that `prepare` was granted, and without garbage collection.

    The thread switch interval is shortened, so that a thread of a library cannot delay the loop by 5 ms.
    """
    # A full collection of 800 000 objects takes 130 to 140 ms.
    gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(5e-4)
    if PRIORITY in _granted:
        scheduling.set_priority(_granted[PRIORITY])


def beside_loop() -> None:
    """Set up a thread that works for a loop, at the priority below it.

    With normal scheduling, the thread could be kept from its core while it holds Python's lock, and the loop with it.
    """
    if PRIORITY in _granted:
        scheduling.set_priority(_granted[PRIORITY], beside=True)


def above_loop() -> None:
    """Set up a thread that must run although the loop of the process hangs, at a priority above it."""
    if PRIORITY in _granted:
        scheduling.set_priority(_granted[PRIORITY] + IO_PRIORITY_STEP)


def prepare(wanted: Realtime, priority: int, cpus: str) -> dict[str, str]:
    """Request the real-time features of a loop, before anything else is created; log refusals.

    Scheduling is tested here and starts with `steady_loop`, because compiling may take a minute and must not block the
    rest of the machine.

    ``cpus``: CPUs it may run on, as in ``0,2-3``; empty for any. Returns the result of each request: `OK`, `OFF`, or
    the reason of a refusal.
    """
    requests: dict[str, Callable[[], None] | None] = {
        "scheduling": partial(_schedule, priority) if wanted.scheduling else None,
        "cpus": partial(_stay_on, cpus) if cpus else None,
        "memory": scheduling.lock_memory if wanted.lock_memory else None,
        "timer_slack": scheduling.wake_in_time if wanted.scheduling else None,
        "core_sleep": scheduling.keep_awake if wanted.scheduling else None,
    }
    results = {what: OFF if request is None else _tried(what, request) for what, request in requests.items()}
    log.info("real time: %s", ", ".join(f"{what} {result}" for what, result in results.items() if result in {OK, OFF}))
    return results


def cpus_for(loop: str, wanted: Realtime) -> str:
    """Return the CPUs for one of the `PLACES`, for `prepare`.

    By default a loop shares one CPU with ZeroMQ's thread, because waking another CPU for each message takes longer.
    Agents leave the choice to the system if there is not one CPU for each loop.
    """
    cpus = wanted.server_cpus if loop == PLACES[0] else wanted.agent_cpus
    if cpus != AUTO:
        return cpus
    have = sorted(scheduling.cpus())
    enough = 2 if loop == PLACES[0] else len(PLACES)
    return str(have[-1 - PLACES.index(loop)]) if len(have) >= enough else ""


def io_priority(results: dict[str, str], priority: int) -> int | None:
    """Return the SCHED_FIFO priority of ZeroMQ's threads, by the results of `prepare`; None for normal scheduling."""
    return priority + IO_PRIORITY_STEP if results["scheduling"] == OK else None


def leave_reserved_cpus(wanted: Realtime) -> None:
    """Leave the CPUs reserved for server and agents, if there are others; for processes without deadlines."""
    if taken := ",".join(cpus for cpus in (wanted.server_cpus, wanted.agent_cpus) if cpus not in {"", AUTO}):
        _tried("cpus", partial(_stay_off, taken))


def cpu_set(cpus: str) -> set[int]:
    """Read a list of CPUs, such as ``0,2-3``."""
    numbers: set[int] = set()
    for part in filter(None, cpus.split(",")):
        first, dash, last = part.partition("-")
        try:
            numbers |= set(range(int(first), int(last if dash else first) + 1))
        except ValueError:
            raise OSError(errno.EINVAL, f"found {cpus}, expected CPUs such as 0,2-3") from None
    return numbers


def _tried(what: str, request: Callable[[], None]) -> str:
    """Make a request; log a refusal, which is not fatal."""
    try:
        request()
    except OSError as error:
        log.info("real time: %s refused (%s); continuing without it", what, error.strerror)
        return str(error.strerror)
    return OK


def _schedule(priority: int) -> None:
    """Request the priority for this thread, from the start of its loop on."""
    scheduling.permit(priority)
    _granted[PRIORITY] = priority


def _stay_on(cpus: str) -> None:
    """Restrict this thread, and those it starts from now on, to these CPUs."""
    scheduling.stay_on(cpu_set(cpus))


def _stay_off(cpus: str) -> None:
    """Exclude these CPUs for this thread and those it starts from now on, if others are left."""
    if others := scheduling.cpus() - cpu_set(cpus):
        scheduling.stay_on(others)
