"""A dyad of real processes on this machine that can be killed, stopped, or connected through a relay.

A rig is a context manager: leaving it ends all its processes, suspended ones too. The output of each process goes to a
file of its name in the rig's folder. Two rigs may share a server, which then belongs to the first.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

from netboard.base.config import SIDES, Config, Side, parse, resolve
from netboard.base.errors import NetboardError
from netboard.base.process.resources import resident_memory
from netboard.base.process.stopping import STOP_WITH_PARENT
from netboard.base.system.supervision import supervision
from netboard.network import keys
from netboard.network.protocol.control import Status
from netboard.network.transport import sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.operator.operator import Operator

TIMEOUT = 120.0
"""Timeout of every wait; only a broken process takes this long [s]."""

ANSWER_SECONDS = 0.2
POLL_INTERVAL_S = 0.02

ACTIVE = ("levelling", "running", "holding")
"""Lasting phases in which forces are rendered."""


@dataclass(frozen=True)
class Route:
    """Address at which a process reaches the server, and a command that its own command line is prefixed with."""

    host: str
    port: int
    prefix: tuple[str, ...] = ()


class Rig:
    """The processes of one dyad.

    - `settings`: changes of the default configuration; or the whole configuration, whose paths are absolute.
    - `routes`: connections that differ from the configuration, by name of the process.
    - `running`: the processes that have been started and not ended, by name.
    """

    def __init__(
        self,
        folder: Path,
        settings: tuple[str, ...] | Config = (),
        environment: Mapping[str, str] | None = None,
        routes: Mapping[str, Route] | None = None,
    ) -> None:
        self.folder = folder.resolve()
        defaults = (f"network.port={free_port()}", f"recording.directory={self.folder / 'recordings'}")
        self.config = settings if isinstance(settings, Config) else parse("", "rig", (*defaults, *settings))
        self.file = self._write("rig", self.config)
        self.running: dict[str, subprocess.Popen[bytes]] = {}
        self._environment = (
            os.environ | {"QT_QPA_PLATFORM": "offscreen", STOP_WITH_PARENT: str(os.getpid())} | dict(environment or {})
        )
        self._routes = dict(routes or {})
        self._stack = ExitStack()
        self.context = self._stack.enter_context(sockets.open_context())
        self._operator_stack = ExitStack()
        self._operator: Operator | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.end()
        self.disconnect()
        self._stack.close()

    def end(self) -> None:
        """Kill every process that still runs."""
        for process in self.running.values():
            process.kill()
            process.wait()
        self.running.clear()

    @property
    def operator(self) -> Operator:
        """Return the operator of this rig, a new one after the server has ended."""
        if self._operator is None:
            self._operator = Operator(self.config.network, self._operator_stack.enter_context(sockets.open_context()))
        return self._operator

    def start(self, name: str, *arguments: str) -> subprocess.Popen[bytes]:
        """Start ``netboard ARGUMENTS -c FILE`` under a name."""
        file, prefix = self.file, tuple[str, ...]()
        if route := self._routes.get(name):
            network = replace(self.config.network, host=route.host, port=route.port)
            file, prefix = self._write(name, replace(self.config, network=network)), route.prefix
        command = [*prefix, sys.executable, "-m", "netboard.services.cli", *arguments, "-c", str(file)]
        with self._log_file(name).open("ab") as log:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env=self._environment,
                cwd=self.folder,
                **supervision.new_group(),
            )
        self.running[name] = process
        return process

    def start_all(self, displays: bool = False) -> None:
        """Start the processes of a session."""
        self.start("logger", "logger", "--once")
        self.start("server", "server")
        self.start_stations(displays)

    def start_stations(self, displays: bool = False) -> None:
        """Start the processes of both stations."""
        for side in SIDES:
            self.start_agent(side)
            if displays:
                self.start(f"{side} display", "display", "--station", side)

    def start_agent(self, side: Side) -> subprocess.Popen[bytes]:
        """Start an agent."""
        return self.start(f"{side} agent", "agent", "--side", side)

    def until(self, condition: Callable[[Status], bool], seconds: float = TIMEOUT) -> Status:
        """Wait for a status that meets a condition."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and not self._lost_server():
            status = self.operator.ask(ANSWER_SECONDS)
            if status is not None and condition(status):
                return status
            time.sleep(POLL_INTERVAL_S)
        raise NetboardError(
            f"waited {seconds:g} s, or the server ended: {self.operator.status}; {self._last_line('server')}"
        )

    def _lost_server(self) -> bool:
        """Return whether this rig's server has ended unexpectedly."""
        return "server" in self.running and self.running["server"].poll() is not None

    def do(self, command: str) -> None:
        """Send the server a command."""
        self.until(lambda status: True)
        reply = self.operator.do(command)
        if not reply.accepted:
            raise NetboardError(f"{command}: refused: {reply.reason}")

    def ask_to_end(self) -> None:
        """Command the end of the session; the answer may be lost on the link."""
        self.until(lambda status: True)
        self.operator.command("end")

    def require_running(self) -> None:
        """Raise an error if a process has ended."""
        for name, process in self.running.items():
            if (code := process.poll()) is not None:
                raise NetboardError(f"the {name} ended with exit code {code}:\n{self.output_of(name)[-2000:]}")

    def memory(self) -> dict[str, float]:
        """Return the resident memory of each process [bytes]."""
        return {name: resident_memory(process.pid) for name, process in self.running.items()}

    def output_of(self, name: str) -> str:
        """Return the output of a process so far."""
        log = self._log_file(name)
        return log.read_text(errors="replace") if log.exists() else ""

    def _last_line(self, name: str) -> str:
        return self.output_of(name).strip().rpartition("\n")[2]

    def suspend(self, name: str) -> None:
        """Suspend a process (SIGSTOP)."""
        self._send(name, supervision.suspend)

    def resume(self, name: str) -> None:
        """Resume a suspended process (SIGCONT)."""
        self._send(name, supervision.resume)

    def _send(self, name: str, number: signal.Signals | None) -> None:
        if number is None:
            raise NetboardError("this system cannot suspend a process")
        self.running[name].send_signal(number)

    def kill(self, name: str) -> None:
        """Kill a process."""
        process = self.running.pop(name)
        process.kill()
        process.wait()
        if name == "server":
            self.disconnect()

    def stop(self, name: str, number: signal.Signals = signal.SIGTERM) -> int:
        """Ask a process to stop; return its exit code."""
        self.running[name].send_signal(number)
        return self.wait(name)

    def wait(self, name: str) -> int:
        """Wait until a process has ended by itself; return its exit code."""
        try:
            code = self.running[name].wait(TIMEOUT)
        except subprocess.TimeoutExpired as error:
            raise NetboardError(f"the {name} did not end within {TIMEOUT:g} s: {self._last_line(name)}") from error
        del self.running[name]
        if name == "server":
            self.disconnect()
        return code

    def disconnect(self) -> None:
        """Close the operator's connection."""
        self._operator_stack.close()
        self._operator = None

    def finish(self) -> list[Path]:
        """Shut the session down in order; return the recordings."""
        self.ask_to_end()
        return self.finished()

    def finished(self) -> list[Path]:
        """Wait until the server, if it is this rig's, and the logger have ended; return the recordings."""
        for name in ("server", "logger"):
            if name in self.running and self.wait(name) != 0:
                raise NetboardError(f"the {name} did not end cleanly: {self._last_line(name)}")
        return self.recordings()

    def recordings(self) -> list[Path]:
        """Return the finished recordings, oldest first."""
        return sorted(Path(self.config.recording.directory).glob("*.mcap"))

    def _log_file(self, name: str) -> Path:
        return self.folder / f"{name}.log"

    def _write(self, name: str, config: Config) -> Path:
        file = self.folder / f"{name}.toml"
        file.write_text(resolve(config), encoding="utf-8")
        return file


def add_dyad_keys(folder: Path, destination: Path) -> None:
    """Add a key for every peer that a dyad may have to a server's folder of keys, and write it to `destination`."""
    for side in SIDES:
        keys.add(folder, "agent", side, destination)
        keys.add(folder, "display", side, destination)
    keys.add(folder, "logger", "", destination)
    keys.add(folder, "console", "", destination)
