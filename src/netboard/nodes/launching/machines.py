"""The processes of a session on one machine: started, asked to stop, and reported with their logs; nothing waits.

`SessionMachine` is what a session needs of a machine, and `LocalMachine` is this one.
"""

import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol, Self

from netboard.base.errors import NetboardError, writing
from netboard.network.protocol.station import ProcessStatus
from netboard.nodes.operator.launcher import HURRIED_SECONDS, STOP_SECONDS, Launcher

TAIL_BYTES = 16_384
"""Size of the end of a log that is shown [bytes]."""


class SessionMachine(Protocol):
    """A machine that runs processes of a session."""

    @property
    def trouble(self) -> str:
        """Why the machine does not answer, or should not be used; empty if all is well."""

    @property
    def processes(self) -> Mapping[str, ProcessStatus]:
        """The processes that were started, by name, as of the last poll."""

    def start(self, name: str) -> None:
        """Start a process, unless it runs; `processes` then has no earlier end of it."""

    def stop(self, name: str) -> None:
        """Ask a process to stop."""

    def hurry(self) -> None:
        """Shorten the time for processes that are stopping."""

    def poll(self) -> None:
        """Find out how the processes are."""

    def tail(self, name: str) -> str:
        """Return the end of a process's log."""


class LocalMachine:
    """Processes on this machine. On leaving, ends what still runs, in the order of `netboard.nodes.operator.launcher`.

    ``commands``: the command of each process that may be started, by name. ``launcher``: has a folder for their logs.
    ``size_of``: returns the size of a running process's log, which may be that of a moment ago; default: the size now.
    """

    trouble = ""

    def __init__(
        self,
        commands: Mapping[str, Sequence[str]],
        launcher: Launcher,
        size_of: Callable[[Path], int] | None = None,
    ) -> None:
        self.commands: Mapping[str, Sequence[str]] = commands
        self._launcher, self._size_of = launcher, size_of or log_size
        self._statuses: dict[str, ProcessStatus] = {}
        self._began: dict[str, float] = {}
        self._kill_at: dict[str, float] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._launcher.stop_all()

    @property
    def processes(self) -> Mapping[str, ProcessStatus]:
        """The processes that were started, by name, as of the last poll."""
        return self._statuses

    def start(self, name: str) -> None:
        """Start a process, unless it runs."""
        if name in self._launcher.running():
            return
        self._launcher.start(name, *self.commands[name])
        self._began[name] = time.monotonic()
        self._statuses[name] = ProcessStatus(name, "running", None, self._launcher.process_id(name), 0.0, 0)
        self.poll()

    def stop(self, name: str) -> None:
        """Ask a process to stop; it is killed if it does not within `STOP_SECONDS`."""
        if name in self._launcher.running() and name not in self._kill_at:
            self._launcher.ask_to_stop(name)
            self._kill_at[name] = time.monotonic() + STOP_SECONDS
            self.poll()

    def hurry(self) -> None:
        """Shorten the time for processes that are stopping."""
        soon = time.monotonic() + HURRIED_SECONDS
        self._kill_at = {name: min(at, soon) for name, at in self._kill_at.items()}

    def poll(self) -> None:
        """Find out how the processes are."""
        now = time.monotonic()
        for name in self._launcher.running():
            if now > self._kill_at.get(name, now):
                self._launcher.kill(name)
            code = self._launcher.code(name)
            asked = name in self._kill_at
            phase = ("stopping" if asked else "running") if code is None else ("stopped" if asked else "ended")
            size = (self._size_of if code is None else log_size)(self.log_of(name))
            self._statuses[name] = self._statuses[name]._replace(
                phase=phase, code=code, seconds=now - self._began[name], log_bytes=size
            )
            if code is not None:
                self._launcher.forget(name)
                self._kill_at.pop(name, None)

    def tail(self, name: str) -> str:
        """Return the end of a process's log."""
        return log_tail(self.log_of(name))

    def log_of(self, name: str) -> Path:
        """Return the file of a process's log."""
        path = self._launcher.log_of(name)
        assert path is not None
        return path


def log_size(path: Path) -> int:
    """Return the size of a log; 0 if there is none yet [bytes]."""
    return path.stat().st_size if path.exists() else 0


def log_tail(path: Path) -> str:
    """Return the end of a log."""
    if not path.exists():
        return ""
    with path.open("rb") as log:
        log.seek(max(0, path.stat().st_size - TAIL_BYTES))
        return log.read().decode(errors="replace")


def device_conflict(name: str, processes: Mapping[str, ProcessStatus]) -> str:
    """Return why a process may not start now: the agent and the test of one device exclude each other."""
    side, _, program = name.partition(" ")
    other = {"agent": f"{side} device test", "device test": f"{side} agent"}.get(program, "")
    status = processes.get(other)
    if status is None or status.phase not in ("running", "stopping"):
        return ""
    return f"the {other} has the device; stop it first"


def log_folder(parent: Path, name: str) -> Path:
    """Create a folder for the logs of a session, named after its start."""
    with writing(parent, NetboardError):
        parent.mkdir(parents=True, exist_ok=True)
        return Path(tempfile.mkdtemp(prefix=f"{name}_{datetime.now(UTC):%Y%m%dT%H%M%SZ}_", dir=parent))


def last_lines(log: str, count: int) -> list[str]:
    """Return the last lines of a log, without empty ones."""
    return [line.rstrip() for line in log.splitlines() if line.strip()][-count:]
