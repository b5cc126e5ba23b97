"""What ran on the server's core while the server was late, from the kernel's scheduler trace.

Reads the text of ``/sys/kernel/tracing/trace`` with the event ``sched_switch`` and the clock ``mono``, which is the
clock of a recording made on the same machine. The server's loop is recognised by its real-time priority.
"""

import re
from collections import Counter
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from netboard.base.errors import RecordingError, unreadable
from netboard.base.process.realtime import Priority
from netboard.base.terminal.output import FittedTable, numbers
from netboard.recording.timing.trace import MS, TimingTrace

SERVER_PRIORITY = 99 - Priority.SERVER
"""Priority of the server's loop as the kernel writes it: smaller is higher [1]."""

_SWITCH = re.compile(
    r"\[(?P<cpu>\d+)\]\s+\S+\s+(?P<seconds>\d+)\.(?P<micros>\d{6}): sched_switch: "
    r"prev_comm=(?P<name>.*) prev_pid=(?P<pid>\d+) prev_prio=-?\d+ prev_state=\S+ ==> "
    r"next_comm=.* next_pid=\d+ next_prio=(?P<priority>-?\d+)"
)


@dataclass(frozen=True, slots=True)
class ContextSwitch:
    """A core ends to run one thread and begins to run another."""

    time_ns: int
    cpu: int
    thread: str  # the one that ran until now
    priority: int  # that of the one that runs from now on


def read(path: Path) -> list[ContextSwitch]:
    """Read the switches in a file, in order of time."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise unreadable(path, error) from error
    switches = [
        ContextSwitch(
            int(one["seconds"]) * 10**9 + int(one["micros"]) * 1000,
            int(one["cpu"]),
            f"{one['name']} ({one['pid']})",
            int(one["priority"]),
        )
        for one in _SWITCH.finditer(text)
    ]
    if not switches:
        raise RecordingError(f"{path}: found no sched_switch event, expected the text of /sys/kernel/tracing/trace")
    return sorted(switches, key=lambda one: one.time_ns)


def ran_instead(switches: list[ContextSwitch], due_ns: int, began_ns: int) -> Counter[str] | None:
    """Return for how long each thread ran on the server's core from a deadline to the start of its tick [ns].

    None if the trace does not show the server start in that time.
    """
    arrivals = [one for one in switches if one.priority == SERVER_PRIORITY and due_ns <= one.time_ns <= began_ns]
    if not arrivals:
        return None
    server = arrivals[0]
    on_core = [one for one in switches if one.cpu == server.cpu and one.time_ns <= server.time_ns]
    if on_core[0].time_ns > due_ns:
        return None
    took: Counter[str] = Counter()
    for one, after in pairwise(on_core):
        if after.time_ns > due_ns:
            took[after.thread] += after.time_ns - max(one.time_ns, due_ns)
    return took


def table(found: TimingTrace, switches: list[ContextSwitch], most: int) -> FittedTable:
    """Return what ran on the server's core during the worst episodes of a late server."""
    title = "On the server's core from the deadline to the tick"
    shown = FittedTable(*numbers("tick", "late [ms]"), "threads, with their time [ms]", title=title)
    stamps = found.stamps
    for one in [one for one in found.worst if one.evidence.is_late][:most]:
        rows = range(one.evidence.first, one.evidence.last + 1)
        row = next(row for row in rows if stamps.late_ns[row] > found.limit_ns)
        began_ns = int(stamps.began_ns[row])
        took = ran_instead(switches, began_ns - int(stamps.late_ns[row]), began_ns)
        ran = "not in the trace" if took is None else ", ".join(_duration_text(*pair) for pair in took.most_common(5))
        shown.add_row(str(stamps.tick[row]), f"{stamps.late_ns[row] * MS:.3f}", ran or "none: the core was idle")
    return shown


def _duration_text(thread: str, took_ns: int) -> str:
    name = "idle" if thread.startswith("swapper/") else thread
    return f"{name} {took_ns * MS:.3f}"
