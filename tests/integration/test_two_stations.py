"""The example of deploy/ as it stands: two stations and a server, each with an address of its own, keys on.

The machines are network namespaces, joined by a bridge in the server's; all that is made is gone with them.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from netboard.base.config import SIDES, parse
from netboard.network import keys
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording
from netboard.task.trials.state_machine import Phase

pytestmark = [pytest.mark.integration, pytest.mark.quiet, pytest.mark.slow, pytest.mark.timeout(300)]

EXAMPLE = Path(__file__).parents[2] / "deploy" / "two-stations" / "netboard.toml"
ADDRESSES = {"server": "10.77.0.1", "left": "10.77.0.2", "right": "10.77.0.3"}
QUICKLY = (
    "block.trials=1",
    "task.hold_time=0.3",
    "task.level_time=0.05",
    "task.level_angle_deg=5.0",
    "task.level_rate_deg_s=30.0",
)
TIMEOUT = 180.0


def ip(*words: str) -> None:
    """Run ``ip``; raises with what it said if it fails."""
    done = subprocess.run(["ip", *words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise OSError(f"ip {' '.join(words)}: {done.stderr.strip()}")


class Machines:
    """Three machines on one network, and what runs on them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._names = {machine: f"netboard-{os.getpid()}-{machine}" for machine in ADDRESSES}
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def connect(self) -> None:
        """Make them and their network."""
        for machine, name in self._names.items():
            ip("netns", "add", name)
            ip("-n", name, "link", "set", "lo", "up")
            (self.folder / machine).mkdir()
        server = self._names["server"]
        ip("-n", server, "link", "add", "bridge", "type", "bridge")
        ip("-n", server, "addr", "add", f"{ADDRESSES['server']}/24", "dev", "bridge")
        ip("-n", server, "link", "set", "bridge", "up")
        for side in SIDES:
            station = self._names[side]
            ip("-n", server, "link", "add", f"to-{side}", "type", "veth", "peer", "name", "eth0", "netns", station)
            ip("-n", server, "link", "set", f"to-{side}", "master", "bridge", "up")
            ip("-n", station, "addr", "add", f"{ADDRESSES[side]}/24", "dev", "eth0")
            ip("-n", station, "link", "set", "eth0", "up")

    def bring_keys(self) -> None:
        """Make the keys at the server, and bring each station its own."""
        home = self.folder / "server" / "keys"
        keys.init(home)
        keys.add(home, "logger", "", home)
        for side in SIDES:
            for role in ("agent", "display"):
                keys.add(home, role, side, self.folder / side / "keys")  # type: ignore[arg-type]

    def up(self, machine: str, *options: str) -> None:
        """Run ``netboard up`` on a machine."""
        settings = [word for setting in QUICKLY for word in ("--set", setting)]
        command = [sys.executable, "-m", "netboard.services.cli", "up", *options, str(EXAMPLE), *settings]
        with (self.folder / f"{machine}.log").open("wb") as said:
            self._running[machine] = subprocess.Popen(
                ["ip", "netns", "exec", self._names[machine], *command],
                cwd=self.folder / machine,
                stdout=said,
                stderr=said,
                env=os.environ | {"QT_QPA_PLATFORM": "offscreen"},
            )

    def said(self, *machines: str) -> str:
        """What has been said on machines."""
        return "".join((self.folder / f"{machine}.log").read_text(errors="replace") for machine in machines)

    def until(self, pattern: str) -> None:
        """Wait for the server to say something."""
        end = time.monotonic() + TIMEOUT
        while not re.search(pattern, self.said("server")):
            assert time.monotonic() < end, f"no {pattern} within {TIMEOUT:.0f} s\n{self.said(*self._running)}"
            assert all(process.poll() is None for process in self._running.values()), self.said(*self._running)
            time.sleep(0.1)

    def down(self, machine: str) -> int:
        """Stop what runs on a machine; its exit code."""
        process = self._running.pop(machine)
        process.send_signal(signal.SIGTERM)
        return process.wait(TIMEOUT)

    def destroy(self) -> None:
        """End everything, whatever has happened."""
        for process in self._running.values():
            process.kill()
            process.wait()
        for name in self._names.values():
            listed = subprocess.run(["ip", "netns", "pids", name], capture_output=True, text=True, check=False)
            for number in listed.stdout.split():
                os.kill(int(number), signal.SIGKILL)
            subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)


@pytest.fixture
def machines(tmp_path: Path) -> Iterator[Machines]:
    if shutil.which("ip") is None:
        pytest.skip("network namespaces need the command ip (package iproute2)")
    made = Machines(tmp_path)
    try:
        made.connect()
    except OSError as error:
        made.destroy()
        pytest.skip(f"network namespaces are not permitted here: {error}")
    yield made
    made.destroy()


def names_of(events: Sequence[object]) -> set[str]:
    return {getattr(event, "name", "") for event in events}


@pytest.mark.daily(3, of="sessions in real time")
def test_the_example_plays_a_block_between_three_machines(machines: Machines) -> None:
    machines.bring_keys()
    for side in SIDES:
        machines.up(side, "--station", side)
    machines.up("server", "--server")
    machines.until(r"to=finished")
    assert machines.down("server") == 0, machines.said("server")
    for side in SIDES:
        assert machines.down(side) == 0, machines.said(side)

    (path,) = (machines.folder / "server" / "recordings").glob("*.mcap")
    with Recording(path) as recording:
        ticks, clocks, events = recording.ticks(), recording.clocks(), recording.events()
        network = parse(recording.config_text).network
        assert verify_recording(recording).identical
        assert recording.end["ended"] == "complete"
    assert ticks["tick"].tolist() == list(range(len(ticks)))
    assert np.any(ticks["phase"] == Phase.RUNNING)
    assert {"held", "session_ended"} <= names_of(events)
    assert (network.curve, network.host) == ("on", ADDRESSES["server"])
    seen = {clock.peer for clock in clocks}
    assert {f"{role}.{side}" for role in ("agent", "display") for side in SIDES} <= seen
    # They are one machine after all, so the true offset is 0.
    assert [clock for clock in clocks if clock.bound_ns > 0 and abs(clock.offset_ns) > clock.bound_ns] == []
    for side in SIDES:
        best = min(clock.bound_ns for clock in clocks if clock.peer == f"agent.{side}")
        assert 0 < best <= network.clock_bound_ms * 1e6
