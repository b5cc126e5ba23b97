"""The example of deploy/ unchanged: two stations and a server, each with its own address, and keys on.

The machines are network namespaces, connected by a bridge in the server's namespace and removed after the test.
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
QUICK_TRIALS = (
    "block.trials=1",
    "task.hold_time=0.3",
    "task.level_time=0.05",
    "task.level_angle_deg=5.0",
    "task.level_rate_deg_s=30.0",
)
TIMEOUT = 180.0


def ip(*words: str) -> None:
    """Run ``ip``, and raise `OSError` with its output if it fails."""
    done = subprocess.run(["ip", *words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise OSError(f"ip {' '.join(words)}: {done.stderr.strip()}")


class Machines:
    """Three machines on one network, and their processes."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._names = {machine: f"netboard-{os.getpid()}-{machine}" for machine in ADDRESSES}
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def connect(self) -> None:
        """Create the machines and their network."""
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

    def install_keys(self) -> None:
        """Create the keys on the server, and copy each station's keys to it."""
        home = self.folder / "server" / "keys"
        keys.init(home)
        keys.add(home, "logger", "", home)
        for side in SIDES:
            for role in ("agent", "display"):
                keys.add(home, role, side, self.folder / side / "keys")  # type: ignore[arg-type]

    def up(self, machine: str, *options: str) -> None:
        """Run ``netboard up`` on a machine."""
        self.run(machine, "up", *options)

    def run(self, machine: str, *words: str, settings: Sequence[str] = ()) -> None:
        """Run a command on a machine."""
        changed = [word for setting in (*QUICK_TRIALS, *settings) for word in ("--set", setting)]
        command = [sys.executable, "-m", "netboard.services.cli", *words, "-c", str(EXAMPLE), *changed]
        with (self.folder / f"{machine}.log").open("wb") as log:
            self._running[machine] = subprocess.Popen(
                ["ip", "netns", "exec", self._names[machine], *command],
                cwd=self.folder / machine,
                stdout=log,
                stderr=log,
                env=os.environ | {"QT_QPA_PLATFORM": "offscreen"},
            )

    def output_of(self, *machines: str) -> str:
        """The output of the processes on these machines."""
        return "".join((self.folder / f"{machine}.log").read_text(errors="replace") for machine in machines)

    def until(self, pattern: str) -> None:
        """Wait until a pattern appears in the server's output."""
        end = time.monotonic() + TIMEOUT
        while not re.search(pattern, self.output_of("server")):
            assert time.monotonic() < end, f"no {pattern} within {TIMEOUT:.0f} s\n{self.output_of(*self._running)}"
            assert all(process.poll() is None for process in self._running.values()), self.output_of(*self._running)
            time.sleep(0.1)

    def down(self, machine: str) -> int:
        """Stop the process on a machine, and return its exit code."""
        process = self._running.pop(machine)
        process.send_signal(signal.SIGTERM)
        return process.wait(TIMEOUT)

    def destroy(self) -> None:
        """Kill all processes and remove the machines."""
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
    created = Machines(tmp_path)
    try:
        created.connect()
    except OSError as error:
        created.destroy()
        pytest.skip(f"network namespaces are not permitted here: {error}")
    yield created
    created.destroy()


def names_of(events: Sequence[object]) -> set[str]:
    return {getattr(event, "name", "") for event in events}


@pytest.mark.sampled(2, of="sessions in real time")
def test_two_station_example_completes_a_block_on_three_machines(machines: Machines) -> None:
    machines.install_keys()
    for side in SIDES:
        machines.up(side, "--station", side)
    machines.up("server", "--server")
    machines.until(r"to=finished")
    assert machines.down("server") == 0, machines.output_of("server")
    for side in SIDES:
        assert machines.down(side) == 0, machines.output_of(side)

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
    peers = {clock.peer for clock in clocks}
    assert {f"{role}.{side}" for role in ("agent", "display") for side in SIDES} <= peers
    # All machines share one clock, so the true offset is 0.
    assert [clock for clock in clocks if clock.bound_ns > 0 and abs(clock.offset_ns) > clock.bound_ns] == []
    for side in SIDES:
        best = min(clock.bound_ns for clock in clocks if clock.peer == f"agent.{side}")
        assert 0 < best <= network.clock_bound_ms * 1e6


@pytest.mark.sampled(2, of="sessions in real time")
def test_one_command_at_the_server_runs_both_stations_by_their_services(machines: Machines) -> None:
    stations = [f"stations.{side}={ADDRESSES[side]}" for side in SIDES]
    machines.install_keys()
    home = machines.folder / "server" / "keys"
    for side in SIDES:
        keys.add(home, "station", side, machines.folder / side / "keys")
        machines.run(side, "station", "--side", side, settings=stations)
    machines.run("server", "up", "--no-console", settings=stations)
    machines.until("the trial is finished")
    assert machines.down("server") == 0, machines.output_of("server")
    for side in SIDES:
        output = machines.output_of(side)
        assert f"start {side} agent" in output
        assert f"stop {side} display" in output
        assert machines.down(side) == 0, machines.output_of(side)
    (path,) = (machines.folder / "server" / "recordings").glob("*.mcap")
    with Recording(path) as recording:
        assert verify_recording(recording).identical
        assert recording.end["ended"] == "complete"
