"""systemd notifications of real processes: ready, watchdog, stopping."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from select import select

import pytest

from netboard.network.transport.ports import free_port

pytestmark = [
    pytest.mark.integration,
    pytest.mark.slow,
    pytest.mark.timeout(240),
    pytest.mark.skipif(sys.platform != "linux", reason="systemd is Linux's"),
]

TIMEOUT = 120.0
COMMANDS = {
    "server": ["server"],
    "logger": ["logger"],
    "agent": ["agent", "--side", "left"],
    "display": ["display", "--station", "left"],
}


class SupervisedService:
    """A process and its notifications to systemd."""

    def __init__(self, name: str, folder: Path, settings: list[str]) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(folder / name))
        self._socket.settimeout(TIMEOUT)
        self._log = (folder / f"{name}.log").open("wb")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "netboard.services.cli", *COMMANDS[name], *settings],
            cwd=folder,
            env=os.environ | {"NOTIFY_SOCKET": str(folder / name), "QT_QPA_PLATFORM": "offscreen"},
            stdout=self._log,
            stderr=self._log,
        )

    def receive(self) -> str:
        return self._socket.recv(100).decode()

    def ask_to_stop(self) -> None:
        """Discard pending watchdog messages, which may fill the queue of the socket, and send SIGTERM."""
        while select([self._socket], [], [], 0.0)[0]:
            assert self.receive() == "WATCHDOG=1"
        self.process.send_signal(signal.SIGTERM)

    def end(self) -> None:
        self.process.kill()
        self.process.wait()
        self._socket.close()
        self._log.close()


@pytest.fixture
def services(tmp_path: Path) -> Iterator[dict[str, SupervisedService]]:
    settings = ["--set", f"network.port={free_port()}", "--set", "network.require_logger=false"]
    started = {name: SupervisedService(name, tmp_path, settings) for name in COMMANDS}
    yield started
    for service in started.values():
        service.end()


@pytest.mark.slow
def test_every_service_reports_to_systemd(services: dict[str, SupervisedService]) -> None:
    for service in services.values():
        assert [service.receive(), service.receive()] == ["READY=1", "WATCHDOG=1"]
    for service in services.values():
        service.ask_to_stop()
    for name, service in services.items():
        while (message := service.receive()) == "WATCHDOG=1":
            pass
        assert message == "STOPPING=1"
        assert service.process.wait(TIMEOUT) == 0, name
