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


class Supervised:
    """A process, and what it tells whoever started it."""

    def __init__(self, name: str, folder: Path, settings: list[str]) -> None:
        self._hears = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._hears.bind(str(folder / name))
        self._hears.settimeout(TIMEOUT)
        self._said = (folder / f"{name}.log").open("wb")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "netboard.services.cli", *COMMANDS[name], *settings],
            cwd=folder,
            env=os.environ | {"NOTIFY_SOCKET": str(folder / name), "QT_QPA_PLATFORM": "offscreen"},
            stdout=self._said,
            stderr=self._said,
        )

    def hear(self) -> str:
        return self._hears.recv(100).decode()

    def ask_to_stop(self) -> None:
        """Make room for its last word, as many wait to be heard while others start, and ask."""
        while select([self._hears], [], [], 0.0)[0]:
            assert self.hear() == "WATCHDOG=1"
        self.process.send_signal(signal.SIGTERM)

    def end(self) -> None:
        self.process.kill()
        self.process.wait()
        self._hears.close()
        self._said.close()


@pytest.fixture
def all_of_them(tmp_path: Path) -> Iterator[dict[str, Supervised]]:
    settings = ["--set", f"network.port={free_port()}", "--set", "network.require_logger=false"]
    started = {name: Supervised(name, tmp_path, settings) for name in COMMANDS}
    yield started
    for one in started.values():
        one.end()


@pytest.mark.slow
def test_every_service_reports_to_systemd(all_of_them: dict[str, Supervised]) -> None:
    for one in all_of_them.values():
        assert [one.hear(), one.hear()] == ["READY=1", "WATCHDOG=1"]
    for one in all_of_them.values():
        one.ask_to_stop()
    for name, one in all_of_them.items():
        while (said := one.hear()) == "WATCHDOG=1":
            pass
        assert said == "STOPPING=1"
        assert one.process.wait(TIMEOUT) == 0, name
