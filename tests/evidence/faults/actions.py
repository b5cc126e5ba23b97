"""Actions that inject faults into a site while a trial runs.

An action is undone if possible, and a process that cannot recover by itself is restarted, as by an operator. An action
returns facts that are not in the recordings.
"""

import os
import shutil
import socket as net
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from evidence.faults.attackers import SAMPLE
from evidence.faults.deferred import deferred
from evidence.faults.devices import DeviceFault, read_trace, set_device_fault, trace_file
from evidence.faults.relay import UNIMPAIRED, Impairment, Relay
from evidence.faults.rigs import until_forces
from evidence.faults.sites import START_S, Site, side_of
from netboard.base.clock import now_ns
from netboard.benchmarks.harness.rig import TIMEOUT
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Hello, Refusal
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.transport import channels, poller, sockets
from netboard.network.transport.channels import CHANNELS
from netboard.nodes.ports import emergency

Facts: TypeAlias = Mapping[str, str]
Action: TypeAlias = Callable[[Site], Facts | None]

ANSWER_SECONDS = 5.0
FLOOD_SECONDS, QUICK_FLOOD_SECONDS = 3.0, 1.5
RESTART_DELAY = 1.0
"""Time from killing a process to its restart [s]."""

STRANGER = Hello("agent", "left", PROTOCOL_VERSION, "stranger:1", "0", {})


# --- processes ---------------------------------------------------------------------------------------------------


@deferred
def suspend(site: Site, process: str, seconds: float) -> None:
    """Suspend a process for a duration [s]."""
    site.rig.suspend(process)
    site.sleep(seconds)
    site.rig.resume(process)


@deferred
def kill(site: Site, process: str, seconds: float = RESTART_DELAY, quick: float | None = None) -> None:
    """Kill a process, and restart it after `seconds`, or `quick` in the short form [s]."""
    site.rig.kill(process)
    site.sleep(seconds, quick)
    site.restart(process)
    if process == "server":
        until_forces(site.rig, START_S)
    else:
        name = f":{site.rig.running[process].pid}"
        site.rig.until(lambda status: any(link.name.endswith(name) for link in status.links))


def kill_logger_until_paused(site: Site) -> Facts:
    """Kill the logger, and restart it only after the server has paused the trial for it."""
    site.rig.kill("logger")
    status = site.rig.until(lambda status: status.phase == "paused")
    site.sleep(10.0, 2.0)
    site.restart("logger")
    return {"notice": status.notice}


def kill_with_peer_frozen(site: Site) -> None:
    """Kill the server and start another while an agent is suspended; the agent wakes with the old session."""
    site.rig.suspend("left agent")
    site.rig.kill("server")
    site.restart("server")
    site.rig.until(lambda status: "agent.right" in status.peers, START_S)
    site.rig.resume("left agent")


@deferred
def together(site: Site, *actions: Action) -> Facts:
    """Perform several actions at the same time."""
    with ThreadPoolExecutor(len(actions)) as workers:
        facts = workers.map(lambda one: one(site), actions)
    return {name: fact for found in facts for name, fact in (found or {}).items()}


# --- links -------------------------------------------------------------------------------------------------------


@deferred
def hold(site: Site, process: str, seconds: float, quick: float | None = None) -> None:
    """Hold all bytes on a process's line for a duration, `quick` in the short form [s]."""
    site.relays[process].hold()
    site.sleep(seconds, quick)
    site.relays[process].restore()


@deferred
def cut(site: Site, process: str, seconds: float) -> None:
    """Reset a process's connections, and refuse new ones for a duration [s]."""
    site.relays[process].cut()
    site.sleep(seconds)
    site.relays[process].restore()


@deferred
def black_hole(site: Site, process: str, seconds: float) -> None:
    """Reset a process's connections, and accept new, blocked ones for a duration [s]."""
    _reset(site.relays[process])
    site.relays[process].hold()
    site.sleep(seconds)
    site.relays[process].restore()


@deferred
def impair_line(site: Site, process: str, up: Impairment = UNIMPAIRED, down: Impairment = UNIMPAIRED) -> None:
    """Degrade a process's line for 3 s, or 1 s in the short form."""
    site.relays[process].impair(up, down)
    site.sleep(3.0, 1.0)
    site.relays[process].impair()


@deferred
def duplicate(site: Site, process: str) -> None:
    """Reset a process's connections, and duplicate the new ones for 2 s."""
    line = site.relays[process]
    line.duplicate(True)
    _reset(line)
    site.sleep(2.0)
    line.duplicate(False)
    _reset(line)


def _reset(line: Relay) -> None:
    """Reset the connections of a line, and let new ones be made."""
    line.cut()
    time.sleep(0.01)
    line.restore()


@deferred
def restart_with_unknown_clock(site: Site, process: str, impairment: Impairment) -> Facts:
    """Restart an agent over a line too slow for the clock bound that arming needs."""
    site.relays[process].impair(impairment, impairment)
    site.rig.kill(process)
    site.restart(process)
    status = site.rig.until(lambda status: any("clock" in lack for lack in status.waiting_for))
    site.relays[process].impair()
    return {"waiting for": ", ".join(status.waiting_for)}


@deferred
def pull_cable(site: Site, process: str, seconds: float) -> None:
    """Set a station's real link down for a duration [s]."""
    if site.namespaces is None:
        raise ValueError("this site has no network namespaces")
    site.namespaces.pull(side_of(process))
    site.sleep(seconds)
    site.namespaces.plug(side_of(process))


# --- unauthorised peers --------------------------------------------------------------------------------------------


def second_agent(site: Site) -> Facts:
    """Start a second agent for a side."""
    second = site.rig.start("second left agent", "agent", "--side", "left")
    wanted = "already has an agent"
    until = time.monotonic() + TIMEOUT
    while wanted not in site.rig.output_of("second left agent") and time.monotonic() < until:
        time.sleep(0.1)
    time.sleep(1.0)
    output = site.rig.output_of("second left agent")
    site.rig.kill("second left agent")
    forces = read_trace(trace_file(site.rig.folder, "left", second.pid))["fz"]
    largest = float(np.max(np.abs(forces), initial=0.0))
    answer = next((line for line in output.splitlines() if wanted in line), output[-200:])
    return {"answer": answer, "largest force of the second": f"{largest:g} N in {forces.size}"}


@deferred
def send_as_stranger(site: Site, *frames: bytes) -> Facts:
    """Send frames to the motion channel as a stranger, and note the answer to each."""
    answers: dict[str, None] = {}
    with sockets.open_context() as context:
        stranger = sockets.motion_agent(context, _addresses(site).reach(channels.MOTION), "stranger")
        until = time.monotonic() + ANSWER_SECONDS
        while len(answers) < len(frames) and time.monotonic() < until:
            for frame in frames:
                sockets.send(stranger, frame)
            if poller.wait_readable(stranger, 0.2):
                answers[_answer(sockets.receive(stranger))] = None
    return {"answer": "; ".join(answers)}


def _answer(frame: bytes | None) -> str:
    message = decode(frame) if frame is not None else None
    return message.reason if isinstance(message, Refusal) else str(message)


def flood(site: Site) -> Facts:
    """Send invalid frames and `Hello` on every channel at full rate, and keep opening connections."""
    sent = connections = 0
    frames = (b"nonsense", b"\xc1" * 2000, encode(STRANGER), encode(SAMPLE), encode(replace(STRANGER, side="")))
    seconds = QUICK_FLOOD_SECONDS if site.quick else FLOOD_SECONDS
    until = time.monotonic() + seconds
    with sockets.open_context() as context:
        where = _addresses(site)
        floods = [
            sockets.motion_agent(context, where.reach(channels.MOTION), "flood"),
            sockets.control_client(context, where.reach(channels.CONTROL), "flood"),
            sockets.log_client(context, where.reach(channels.LOG), "flood"),
        ]
        while time.monotonic() < until:
            for _ in range(200):
                sent += sum(sockets.send(socket, frames[sent % len(frames)]) for socket in floods)
            connections += _connect_without_zmq(site)
    return {"flood": f"{sent} frames, {connections} connections in {seconds:g} s"}


def _connect_without_zmq(site: Site) -> int:
    """Connect to every channel, send bytes that are not ZeroMQ, and close."""
    network = site.rig.config.network
    for channel in range(len(CHANNELS) - 1):
        with net.create_connection((network.host, network.port + channel), ANSWER_SECONDS) as connection:
            connection.sendall(b"GET / HTTP/1.1\r\n\r\n")
    return len(CHANNELS) - 1


def _addresses(site: Site) -> channels.Addresses:
    return channels.addresses(site.rig.config.network)


# --- devices -----------------------------------------------------------------------------------------------------


@deferred
def fail_device(site: Site, process: str, fault: DeviceFault, seconds: float = 1.0) -> None:
    """Make an agent's device fail for a duration [s]."""
    set_device_fault(site.rig.folder, side_of(process), fault)
    site.sleep(seconds)
    set_device_fault(site.rig.folder, side_of(process), "none")


@deferred
def fail_device_and_restart(site: Site, process: str, fault: DeviceFault) -> Facts:
    """Make an agent's device fail, and restart the agent with a working one."""
    set_device_fault(site.rig.folder, side_of(process), fault)
    site.rig.until(lambda status: status.phase == "paused")
    time.sleep(RESTART_DELAY)
    ended = site.rig.running[process].poll()
    set_device_fault(site.rig.folder, side_of(process), "none")
    code = site.rig.wait(process) if ended is not None else site.rig.stop(process)
    site.restart(process)
    return {"exit code of the agent": str(code), "its last words": site.rig.output_of(process).splitlines()[-1]}


def emergency_stop(site: Site) -> None:
    """Trigger an emergency stop, release it a while later, and resume."""
    site.rig.do(emergency.STOP)
    site.rig.until(lambda status: emergency.AWAITING_RELEASE in status.waiting_for)
    time.sleep(RESTART_DELAY)
    site.rig.do(emergency.RELEASE)
    site.rig.until(lambda status: status.phase == "paused" and not status.waiting_for)
    site.rig.do("resume")


# --- clocks and disks --------------------------------------------------------------------------------------------


@deferred
def set_wall_clock(site: Site, *seconds: int) -> None:
    """Set the wall clock of all processes to several times in turn [s]."""
    if site.clock is None:
        raise ValueError("the wall clock cannot be set at this site")
    for shift in (*seconds, 0):
        site.clock.set(shift)
        time.sleep(1.0)


@deferred
def fill_disk(site: Site, left: int) -> Facts:
    """Fill the recordings' disk up to a remainder [bytes], and start a logger elsewhere."""
    folder = Path(site.rig.config.recording.directory)
    spare = shutil.disk_usage(folder).free - left
    with (folder / "filler").open("wb") as filler:  # in one step, before a process can react to a partial fill
        os.posix_fallocate(filler.fileno(), 0, spare)
    return _start_logger_elsewhere(site)


def remove_directory(site: Site) -> Facts:
    """Delete the recordings' folder with the recording in it, and start another logger elsewhere."""
    shutil.rmtree(site.rig.config.recording.directory)
    return _start_logger_elsewhere(site)


def _start_logger_elsewhere(site: Site) -> Facts:
    """Wait until the logger has ended, note why, and start the next one with another folder."""
    began = now_ns()
    code = site.rig.wait("logger")
    seconds = (now_ns() - began) * 1e-9
    output = site.rig.output_of("logger").splitlines()
    status = site.rig.until(lambda status: status.phase == "paused")
    site.rig.start("logger", "logger", "--once", "--set", f"recording.directory={site.rig.folder / 'elsewhere'}")
    warned = next((line for line in output if "only" in line), "no warning")
    return {
        "logger": f"exit code {code} after {seconds:.1f} s: {output[-1]}",
        "warning": warned,
        "notice": status.notice,
    }
