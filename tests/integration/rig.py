"""A real rig on loopback for tests: processes, a free port, an operator."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import zmq

from netboard import sockets
from netboard.config import Config, parse, resolve
from netboard.nodes.operator import Operator
from netboard.services.demo import free_port
from netboard.wire.messages import Status

PATIENCE = 60.0
"""Nothing here takes this long unless it is broken [s]."""


@dataclass
class Rig:
    """Processes of one session, started by name and all ended on leaving."""

    folder: Path
    settings: tuple[str, ...] = ()
    running: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        own = (f"network.port={free_port()}", f"recording.directory={self.folder / 'recordings'}")
        self.config: Config = parse("", "test", (*own, *self.settings))
        self.file = self.folder / "rig.toml"
        self.file.write_text(resolve(self.config))
        self.context: sockets.Context = zmq.Context()
        self.operator = Operator(self.config.network, self.context)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self.running.values():
            process.kill()
            process.wait()
        self.context.destroy(linger=0)

    def start(self, name: str, *arguments: str) -> subprocess.Popen[bytes]:
        """Start ``netboard ARGUMENTS -c FILE``; what it says goes to ``NAME.log``."""
        command = [sys.executable, "-m", "netboard.services.cli", *arguments, "-c", str(self.file)]
        environment = os.environ | {"QT_QPA_PLATFORM": "offscreen"}
        with (self.folder / f"{name}.log").open("ab") as said:
            process = subprocess.Popen(command, stdout=said, stderr=said, env=environment)
        self.running[name] = process
        return process

    def start_all(self, displays: bool = False) -> None:
        """Start the processes of a session."""
        self.start("logger", "logger", "--once")
        self.start("server", "server")
        for side in ("left", "right"):
            self.start(f"{side} agent", "agent", "--side", side)
            if displays:
                self.start(f"{side} display", "display", "--station", side)

    def until(self, what: Callable[[Status], bool]) -> Status:
        """Wait for a status that answers a description."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            status = self.operator.ask(0.2)
            if status is not None and what(status):
                return status
            time.sleep(0.02)
        raise AssertionError(f"waited {PATIENCE} s in vain; last status: {self.operator.status}\n{self.said('server')}")

    def said(self, name: str) -> str:
        """What a process has said so far."""
        return (self.folder / f"{name}.log").read_text()

    def send_signal(self, name: str, number: signal.Signals) -> None:
        """Send a process a signal."""
        self.running[name].send_signal(number)

    def kill(self, name: str) -> None:
        """Kill a process the hard way."""
        process = self.running.pop(name)
        process.send_signal(signal.SIGKILL)
        process.wait()

    def stop(self, name: str, number: signal.Signals = signal.SIGTERM) -> int:
        """Ask a process to stop; its exit code."""
        process = self.running.pop(name)
        process.send_signal(number)
        return process.wait(PATIENCE)

    def finish(self) -> list[Path]:
        """Shut the session down in order; the recordings."""
        self.operator.command("shutdown")
        for name in ("server", "logger"):
            assert self.running.pop(name).wait(PATIENCE) == 0, self.said(name)
        return self.recordings()

    def recordings(self) -> list[Path]:
        """The finished recordings, oldest first."""
        return sorted((self.folder / "recordings").glob("*.mcap"))
