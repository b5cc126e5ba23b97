"""`netboard up` alone: a whole session of a study in real processes, from a configuration to its recording."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from netboard.network.transport.ports import free_port
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording

pytestmark = [
    *(pytest.mark.integration, pytest.mark.slow, pytest.mark.timeout(600)),
    pytest.mark.sampled(1, of="whole sessions"),
]

RIG = """
[session]
pilot = true
[network]
curve = "on"
"""
"""A rig with keys, which are missing at first."""

TIMEOUT = 240.0


class Up:
    """A running ``netboard up``."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.folder, self.log = folder, folder / "up.txt"
        (folder / "rig.toml").write_text(RIG + f"port = {free_port()}\n")
        command = [sys.executable, "-m", "netboard.services.cli", "up", "rig.toml", "--offscreen", *options]
        with self.log.open("wb") as out:
            self.process = subprocess.Popen(
                command, cwd=folder, stdout=out, stderr=out, env=os.environ | {"COLUMNS": "200"}
            )

    @property
    def text(self) -> str:
        return self.log.read_text(errors="replace")

    def until(self, pattern: str) -> "re.Match[str]":
        """Wait for a pattern in the output."""
        end = time.monotonic() + TIMEOUT
        while (found := re.search(pattern, self.text, re.MULTILINE)) is None:
            assert self.process.poll() is None, self.text
            assert time.monotonic() < end, self.text
            time.sleep(0.1)
        return found

    def interrupt(self) -> int:
        """Press Ctrl-C once, and return the exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(TIMEOUT)


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Up]:
    up = Up(tmp_path, "--study", "paper", "--dyad", "3", "--blocks", "1", "--trials", "1", "--autostart")
    yield up
    up.process.kill()
    up.process.wait()


def test_one_command_runs_a_session_and_one_ctrl_c_ends_it(running: Up) -> None:
    running.until("^session +a trial is running")
    logs = running.folder / running.until("^logs +(.+)$")[1]
    assert running.interrupt() == 0, running.text
    for missing in ("keys/server.key", "keys/console.key", "keys/agent.left.key", "recordings"):
        assert f"{missing}: is missing; created: " in running.text
    assert {path.stem for path in logs.iterdir()} == {
        *("logger", "server", "left-agent", "right-agent", "left-display", "right-display", "console")
    }
    (path,) = (running.folder / "recordings").glob("*.mcap")
    with Recording(path) as recording:
        assert verify_recording(recording).identical
        assert {event.name for event in recording.events()} >= {"block_began", "session_ended"}
