"""A set of netboard processes on this machine: started together, watched, and none left behind.

Each runs ``netboard ...`` in a session of its own, so that a Ctrl-C in the terminal reaches only whoever started them,
who then ends them in order. What a process says goes to a file.
"""

import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from netboard.process import WITH_PARENT

STOP_SECONDS = 15.0
"""Processes get this long to end cleanly before they are killed [s]."""


@dataclass(frozen=True)
class Ended:
    """A process that has ended.

    Attributes
    ----------
    name : str
        Its name.
    code : int
        Its exit code, negative for a signal.
    last_words : str
        The last line it said.
    """

    name: str
    code: int
    last_words: str

    def __str__(self) -> str:
        how = f"was killed by signal {-self.code}" if self.code < 0 else f"ended with exit code {self.code}"
        return f"the {self.name} {how}" + (f": {self.last_words}" if self.last_words else "")


class Launcher:
    """Runs and watches processes; on leaving, ends all that still run.

    Parameters
    ----------
    folder : Path
        Where what they say is kept, one file each.
    environment : dict of str
        Environment variables on top of this process's own.
    """

    def __init__(self, folder: Path, environment: dict[str, str]) -> None:
        self._folder = folder
        self._environment = os.environ | environment | {WITH_PARENT: "1"}
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop(*self._running)

    def start(self, name: str, *arguments: str) -> None:
        """Start ``netboard ARGUMENTS`` under a name."""
        command = [sys.executable, "-m", "netboard.services.cli", *arguments]
        apart = (
            {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}  # type: ignore[attr-defined,unused-ignore]
            if sys.platform == "win32"
            else {"start_new_session": True}
        )
        with self.log_of(name).open("ab") as said:
            self._running[name] = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=said, stderr=said, env=self._environment, **apart
            )

    def log_of(self, name: str) -> Path:
        """File with what a process has said."""
        return self._folder / f"{name.replace(' ', '-')}.log"

    def process_id(self, name: str) -> int:
        """Process id of a running process."""
        return self._running[name].pid

    def ended(self) -> Ended | None:
        """Tell of a process that has ended although nobody asked it to, if there is one."""
        for name, process in self._running.items():
            code = process.poll()
            if code is not None:
                return Ended(name, code, self._last_words(name))
        return None

    def wait(self, name: str, seconds: float) -> str:
        """Wait for a process to end cleanly by itself, at most so long [s]; what went wrong, or nothing."""
        try:
            code = self._running[name].wait(seconds)
        except subprocess.TimeoutExpired:
            return f"the {name} did not end by itself within {seconds:.0f} s"
        del self._running[name]
        return str(Ended(name, code, self._last_words(name))) if code else ""

    def stop(self, *names: str) -> None:
        """Ask processes to stop, all at once, and kill what does not."""
        processes = [self._running.pop(name) for name in names]
        for process in processes:
            process.terminate()
        until = time.monotonic() + STOP_SECONDS
        for process in processes:
            try:
                process.wait(max(0.0, until - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def _last_words(self, name: str) -> str:
        lines = self.log_of(name).read_text(errors="replace").strip().splitlines()
        return lines[-1].strip() if lines else ""
