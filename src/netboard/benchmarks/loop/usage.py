"""Resource usage of processes: CPU time, run-queue time, context switches and memory by thread, from Linux's /proc.

A thread is of one of three kinds: the loop (a process's first thread), ZeroMQ's I/O, or any other. Times are those of
the scheduler, to the nanosecond if available (``schedstat``), else to its clock tick.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import reduce
from pathlib import Path
from typing import NamedTuple

from netboard.base.clock import now_ns
from netboard.base.errors import NetboardError
from netboard.base.process.resources import resident_memory
from netboard.base.system.c_library import clock_ticks_hz

LOOP, TRANSPORT, OTHER = "loop", "I/O", "other"
KINDS = (LOOP, TRANSPORT, OTHER)
"""Kinds of threads."""

_TRANSPORT_NAME = "ZMQbg/IO"


class ThreadUsage(NamedTuple):
    """Usage of threads.

    - `seconds`: time on a core [s].
    - `waited`: time in the run queue; 0 if the system does not report it [s].
    """

    seconds: float = 0.0
    waited: float = 0.0
    sleeps: int = 0
    preemptions: int = 0

    def plus(self, other: "ThreadUsage", sign: int = 1) -> "ThreadUsage":
        """Return the sum with another, or with sign -1 the difference."""
        return ThreadUsage._make(mine + sign * theirs for mine, theirs in zip(self, other, strict=True))


@dataclass(frozen=True, slots=True)
class Usage:
    """Usage of a process at one time.

    - `at_ns`: time, monotonic clock [ns].
    """

    at_ns: int
    threads: dict[tuple[int, str], ThreadUsage]
    resident: float

    def since(self, before: "Usage") -> dict[str, ThreadUsage]:
        """Return the usage since an earlier time by kind of thread, without threads that have ended."""
        found = dict.fromkeys(KINDS, ThreadUsage())
        for thread, spent in self.threads.items():
            change = spent.plus(before.threads.get(thread, ThreadUsage()), -1)
            found[thread[1]] = found[thread[1]].plus(change)
        return found


def total(parts: Iterable[ThreadUsage]) -> ThreadUsage:
    """Return the sum."""
    return reduce(ThreadUsage.plus, parts, ThreadUsage())


@dataclass
class Cost:
    """Usage of a process during a measurement.

    - `seconds`: duration of the measurement [s].
    """

    spent: dict[str, ThreadUsage] = field(default_factory=dict)
    seconds: float = 0.0

    def add(self, before: Usage, after: Usage) -> None:
        """Add a measurement."""
        for kind, spent in after.since(before).items():
            self.spent[kind] = self.spent.get(kind, ThreadUsage()).plus(spent)
        self.seconds += (after.at_ns - before.at_ns) * 1e-9

    @property
    def core_share(self) -> float:
        """Return the share of a core that the process used [1]."""
        return total(self.spent.values()).seconds / self.seconds

    def share_of(self, *kinds: str) -> float:
        """Return the share of a core that threads of some kinds used [1]."""
        return sum(self.spent[kind].seconds for kind in kinds) / self.seconds


Costs = dict[str, Cost]


def add_costs(costs: Costs, before: Mapping[str, Usage], after: Mapping[str, Usage]) -> None:
    """Add a measurement of some processes."""
    for name, usage in after.items():
        costs.setdefault(name, Cost()).add(before[name], usage)


def kind_of(process: int, thread: int, name: str) -> str:
    """Return the kind of a thread."""
    if name.startswith(_TRANSPORT_NAME):
        return TRANSPORT
    return LOOP if thread == process else OTHER


def parse_thread(stat: str, schedstat: str, status: str, clock_hz: int) -> tuple[str, ThreadUsage]:
    """Parse the usage of a thread from /proc.

    - `stat`, `schedstat`, `status`: the three files; `schedstat` may be empty.
    """
    head, _, tail = stat.rpartition(")")
    fields = tail.split()
    switches = dict(line.split(":", 1) for line in status.splitlines() if "ctxt_switches" in line)
    if schedstat:
        ran, waited, _ = map(int, schedstat.split())
        times = ran * 1e-9, waited * 1e-9
    else:
        times = (int(fields[11]) + int(fields[12])) / clock_hz, 0.0
    sleeps, preemptions = (int(switches[f"{kind}_ctxt_switches"]) for kind in ("voluntary", "nonvoluntary"))
    return head.partition("(")[2], ThreadUsage(*times, sleeps, preemptions)


def read_usage(process: int) -> Usage:
    """Return the present usage of a process."""
    here = Path("/proc") / str(process)
    clock_hz = clock_ticks_hz()
    try:
        found = (_read_thread(process, int(folder.name), folder, clock_hz) for folder in (here / "task").iterdir())
        threads = dict(one for one in found if one is not None)
        return Usage(now_ns(), threads, resident_memory(process))
    except OSError as error:
        raise NetboardError(f"cannot tell what process {process} uses: {error}") from error


def _read_thread(process: int, thread: int, folder: Path, clock_hz: int) -> tuple[tuple[int, str], ThreadUsage] | None:
    """Return the usage of a thread; None if it has ended meanwhile, as the servo of a device that is lost."""
    schedstat = folder / "schedstat"
    try:
        name, spent = parse_thread(
            (folder / "stat").read_text(),
            schedstat.read_text() if schedstat.exists() else "",
            (folder / "status").read_text(),
            clock_hz,
        )
    except (FileNotFoundError, ProcessLookupError):
        return None
    return (thread, kind_of(process, thread, name)), spent
