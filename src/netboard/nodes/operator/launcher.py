"""A set of netboard processes on this machine: started together, supervised, and stopped in order.

Each runs ``netboard ...`` in a session or process group of its own (`netboard.base.system.supervision`). A Ctrl-C in
the terminal thus reaches only this process, which then ends the others in order. Their output goes to files, or to
this process's output.
"""

import logging
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from netboard.base.process.stopping import STOP_WITH_PARENT, SUPERVISOR
from netboard.base.system.supervision import description, supervision

log = logging.getLogger(__name__)

LAST = ("server", "trigger", "logger")
"""Agents, displays and consoles stop before the server that they depend on, and together: no agent renders forces while
a display hangs. The trigger box makes the pulses of the server's last events. The logger stops last, to write its last
records. The kind is a word of the name: "left agent 2"."""

UNBUFFERED = {"PYTHONUNBUFFERED": "1"}
"""Environment of processes whose logs are complete at any moment."""

CHECK_INTERVAL_S = 0.1

STOP_SECONDS = 15.0
"""Time for processes to end cleanly before they are killed [s]."""

HURRIED_SECONDS = 2.0
"""Time that is left to them after a second Ctrl-C: enough for zero forces and the last records [s]."""


@dataclass(frozen=True)
class EndedProcess:
    """A process that has ended."""

    name: str
    code: int
    last_line: str  # of its output

    def __str__(self) -> str:
        return f"the {self.name} {description(self.code)}" + (f": {self.last_line}" if self.last_line else "")


class Launcher:
    """Runs and supervises processes; on leaving, ends all that still run, in the order of `stop_group`.

    ``folder``: folder for their output, one file each; None passes it on to this process's output.
    """

    def __init__(self, folder: Path | None, environment: dict[str, str]) -> None:
        self._folder = folder
        supervision.keep_none()
        self._environment = os.environ | environment | {STOP_WITH_PARENT: str(os.getpid())}
        self._environment.pop(SUPERVISOR, None)  # this process's supervisor does not supervise the ones started here
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.stop_all()

    def start(self, name: str, *arguments: str) -> None:
        """Start ``netboard ARGUMENTS`` under a name."""
        command = [sys.executable, "-m", "netboard.services.cli", *arguments]
        path = self.log_of(name)
        with nullcontext() if path is None else path.open("ab") as output:
            self._running[name] = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                env=self._environment,
                **supervision.new_group(),
            )

    def log_of(self, name: str) -> Path | None:
        """Return the file with a process's output."""
        return None if self._folder is None else self._folder / f"{name.replace(' ', '-')}.log"

    def running(self) -> list[str]:
        """Return the names of all processes that were not stopped, in the order of their start."""
        return list(self._running)

    def process_id(self, name: str) -> int:
        """Return the process id of a running process."""
        return self._running[name].pid

    def ended(self) -> EndedProcess | None:
        """Return a process that has ended without being asked to, if there is one."""
        for name, process in self._running.items():
            code = process.poll()
            if code is not None:
                return EndedProcess(name, code, self._last_line(name))
        return None

    def code(self, name: str) -> int | None:
        """Return the exit code of a process; None while it runs."""
        return self._running[name].poll()

    def ask_to_stop(self, name: str) -> None:
        """Ask a process to stop, without waiting."""
        supervision.ask_to_stop(self._running[name])

    def kill(self, name: str) -> None:
        """Kill a process, and wait for its end."""
        self._running[name].kill()
        self._running[name].wait()

    def forget(self, name: str) -> None:
        """Forget a process that has ended, so that its name can be used again."""
        del self._running[name]

    def wait(self, name: str, seconds: float) -> str:
        """Wait until a process ends by itself, or until the timeout [s]; return what went wrong, or nothing."""
        try:
            code = self._running[name].wait(seconds)
        except subprocess.TimeoutExpired:
            return f"the {name} did not end by itself within {seconds:.0f} s"
        del self._running[name]
        return str(EndedProcess(name, code, self._last_line(name))) if code else ""

    def stop_all(self) -> list[EndedProcess]:
        """Stop all that still run, in the order of `stop_group`; return those that failed."""
        failed: list[EndedProcess] = []
        for group in range(len(LAST) + 1):
            failed += self.stop(*(name for name in self._running if stop_group(name) == group))
        return failed

    def stop(self, *names: str) -> list[EndedProcess]:
        """Ask processes to stop, all at once, and kill those that do not; return those that failed.

        A second Ctrl-C shortens the wait for them, a third ends it. A process that was still starting, and was ended by
        the signal, has not failed.
        """
        processes = {name: self._running[name] for name in names}
        for process in processes.values():
            supervision.ask_to_stop(process)
        try:
            _await(processes.values(), STOP_SECONDS)
        except KeyboardInterrupt:
            with suppress(KeyboardInterrupt):
                _await(processes.values(), HURRIED_SECONDS)
        finally:
            for name, process in processes.items():
                process.kill()
                process.wait()
                del self._running[name]
        return [
            EndedProcess(name, process.returncode, self._last_line(name))
            for name, process in processes.items()
            if process.returncode not in (0, supervision.terminated)
        ]

    def _last_line(self, name: str) -> str:
        path = self.log_of(name)
        lines = [] if path is None else path.read_text(errors="replace").strip().splitlines()
        return lines[-1].strip() if lines else ""


def stop_group(name: str) -> int:
    """Return which group of processes stops with this one: the first one, or one of the `LAST` [1]."""
    return max((1 + number for number, kind in enumerate(LAST) if kind in name.split()), default=0)


def _await(processes: Iterable["subprocess.Popen[bytes]"], seconds: float) -> None:
    """Wait until all processes have ended, or until the timeout [s]."""
    until = time.monotonic() + seconds
    for process in processes:
        with suppress(subprocess.TimeoutExpired):
            process.wait(max(0.0, until - time.monotonic()))


def supervise(wanted: dict[str, list[str]], stopping: Callable[[], bool]) -> int:
    """Run processes until stopped or one of them ends; then stop the others."""
    with Launcher(None, {}) as launcher:
        for name, command in wanted.items():
            launcher.start(name, *command)
        log.info("started: %s", ", ".join(wanted))
        ended: EndedProcess | None = None
        while not stopping() and ended is None:
            time.sleep(CHECK_INTERVAL_S)
            ended = launcher.ended()
        if ended is not None:
            log.info("%s; stopping the others", ended)
        failed = launcher.stop_all()
    for process in failed:
        log.error("%s", process)
    return 1 if failed else 0
