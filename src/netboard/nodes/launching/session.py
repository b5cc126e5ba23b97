"""The processes of a session over its machines: started in order, watched, and stopped in order.

Rules: a process that fails is named with the end of its log. One that rejoins a session (agent, display, logger) is
started again, as by the systemd units, also if it vanished with a station that was restarted. The end of the server is
the end of the session. All else goes on: what the session lacks, server and console say. Nothing here waits;
`LaunchedSession.poll` is called ten times a second.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from netboard.network.protocol.station import ProcessStatus
from netboard.nodes.launching.machines import SessionMachine, last_lines
from netboard.nodes.operator.launcher import EndedProcess, stop_group

REJOINING = ("agent", "display", "logger", "trigger")
"""Programs that rejoin a session after a failure."""

WRONG_USAGE = 2
"""Exit code of a wrong configuration, with which a program would fail again [1]."""

RESTART_SECONDS = 2.0
"""Time after a failure before a process is started again [s]."""

MAX_FAILURES = 3
"""Failures after which a process is not started again [1]."""

SHOWN_LINES = 12
"""Lines of its log that are shown when a process fails [1]."""


@dataclass(frozen=True, slots=True)
class UnaskedEnd:
    """A process that has ended without being asked to, and what follows."""

    name: str
    status: ProcessStatus  # its code is None if its machine knows it no more
    log: tuple[str, ...]  # its last lines
    consequence: str

    def __str__(self) -> str:
        if self.status.code is None:
            return f"the {self.name} is gone, as if its station was restarted; {self.consequence}"
        return f"{EndedProcess(self.name, self.status.code, '')}; {self.consequence}"

    @property
    def failed(self) -> bool:
        """Whether it is a fault."""
        return self.status.code != 0


@dataclass(slots=True)
class LaunchedSession:
    """The processes of a session.

    ``machines``: by name; ``places``: the machine of each process, in the order of their start; ``report``: is called
    for each process that ends by itself; ``clock``: time [s].
    """

    machines: Mapping[str, SessionMachine]
    places: Mapping[str, str]
    report: Callable[[UnaskedEnd], object]
    clock: Callable[[], float] = time.monotonic
    failures: dict[str, int] = field(default_factory=dict)
    broken: set[str] = field(default_factory=set)  # processes that have failed, and do not run again
    stopping: bool = False
    _again_at: dict[str, float] = field(default_factory=dict)
    _running: dict[str, ProcessStatus] = field(default_factory=dict)  # as of the last poll
    _handled: dict[str, int] = field(default_factory=dict)  # process id of each end that was reported

    def start(self) -> None:
        """Start all processes."""
        for name, machine in self.places.items():
            self.machines[machine].start(name)

    def restart(self, name: str) -> None:
        """Start a process again that has ended."""
        self.failures.pop(name, None)
        self.broken.discard(name)
        self.machines[self.places[name]].start(name)

    def stop(self) -> None:
        """Ask all processes to stop, in order; `poll` then asks the next ones when the first have ended."""
        self.stopping = True
        self.broken |= set(self._again_at)
        self._again_at.clear()

    def hurry(self) -> None:
        """Shorten the time for processes that are stopping."""
        for machine in self.machines.values():
            machine.hurry()

    def poll(self) -> None:
        """Find out how the processes are, and do what follows."""
        for machine in self.machines.values():
            machine.poll()
        for name in self.places:
            status = self._last_status(name)
            if status is not None and status.phase == "ended" and self._handled.get(name) != status.process_id:
                self._handled[name] = status.process_id
                if not self.stopping:
                    self._end(name, status)
        now = self.clock()
        for name in [name for name, at in self._again_at.items() if now >= at]:
            del self._again_at[name]
            self.machines[self.places[name]].start(name)
        if self.stopping:
            self._stop_next()

    def status(self, name: str) -> ProcessStatus | None:
        """Return how a process is; None if it was never started."""
        return self.machines[self.places[name]].processes.get(name)

    @property
    def running(self) -> list[str]:
        """Names of the processes that run or are stopping."""
        found = ((name, self.status(name)) for name in self.places)
        return [name for name, status in found if status is not None and status.phase in ("running", "stopping")]

    @property
    def over(self) -> bool:
        """Whether it was stopped and no process is left."""
        return self.stopping and not self.running

    def _last_status(self, name: str) -> ProcessStatus | None:
        """Return how a process is; one that ran and that its machine, which answers, knows no more has ended."""
        status, before = self.status(name), self._running.pop(name, None)
        if status is not None and status.phase in ("running", "stopping"):
            self._running[name] = status
            self.broken.discard(name)
        if status is not None or before is None:
            return status
        if self.machines[self.places[name]].trouble:
            self._running[name] = before  # its machine is silent: nothing is known
            return None
        return before._replace(phase="ended", code=None)

    def _end(self, name: str, status: ProcessStatus) -> None:
        """Decide what follows from the end of a process, and report it."""
        kind = name.rpartition(" ")[2]
        failed = status.code != 0
        self.failures[name] = self.failures.get(name, 0) + failed
        may_rejoin = kind in REJOINING and failed and status.code != WRONG_USAGE
        if kind == "server":
            consequence = "stopping all others"
            self.stop()
        elif may_rejoin and self.failures[name] <= MAX_FAILURES:
            consequence = "it is started again"
            self._again_at[name] = self.clock() + RESTART_SECONDS
        elif failed:
            consequence = "it is not started again; all others go on"
        else:
            consequence = "all others go on"
        if failed and name not in self._again_at:
            self.broken.add(name)
        lines = last_lines(self.machines[self.places[name]].tail(name), SHOWN_LINES) if failed else []
        self.report(UnaskedEnd(name, status, tuple(lines), consequence))

    def _stop_next(self) -> None:
        """Ask the first group of processes that still run to stop."""
        running = self.running
        group = min(map(stop_group, running), default=0)
        for name in running:
            if stop_group(name) == group:
                self.machines[self.places[name]].stop(name)
