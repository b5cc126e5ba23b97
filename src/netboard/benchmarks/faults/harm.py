"""Actions that inject faults: each function returns the action, which is called with a site while a trial runs.

An action is undone if possible, and a process that cannot recover by itself is restarted, as by an operator. An action
returns facts that are not in the recordings.
"""

import os
import shutil
import signal
import socket as net
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from netboard.base.clock import now_ns
from netboard.benchmarks.faults.devices import Trick, play_trick, read_trace, trace_file
from netboard.benchmarks.faults.links import Spaces
from netboard.benchmarks.faults.relay import FAIR, Relay, Weather
from netboard.benchmarks.faults.rigs import TIMEOUT
from netboard.benchmarks.faults.sites import START_S, Site, side_of
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Hello, Refusal
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.protocol.motion import Stylus
from netboard.network.transport import channels, poller, sockets
from netboard.network.transport.channels import CHANNELS
from netboard.nodes.ports import emergency

Facts: TypeAlias = Mapping[str, str]
Act: TypeAlias = Callable[[Site], Facts]

ANSWER_SECONDS = 5.0
FLOOD_SECONDS, QUICK_FLOOD_SECONDS = 3.0, 1.5
AWAY = 1.0
"""Time from killing a process to its restart [s]."""

STRANGER = Hello("agent", "left", PROTOCOL_VERSION, "stranger:1", "0", {})
SAMPLE = Stylus(0, 0, 0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 0, 0, 0.0, -1, 0, 0, 0, 0)


def _for_a_while(
    begin: Callable[[Site], object], end: Callable[[Site], object], seconds: float, quick: float | None = None
) -> Act:
    """Return an action with a start and an end after a duration, `quick` in the short form [s]."""

    def act(site: Site) -> Facts:
        begin(site)
        site.sleep(seconds, quick)
        end(site)
        return {}

    return act


# --- processes ---------------------------------------------------------------------------------------------------


def stand_still(process: str, seconds: float) -> Act:
    """Return an action that suspends a process for a duration [s]."""
    return _for_a_while(
        lambda site: site.rig.send_signal(process, signal.SIGSTOP),
        lambda site: site.rig.send_signal(process, signal.SIGCONT),
        seconds,
    )


def kill(process: str, seconds: float = AWAY, quick: float | None = None) -> Act:
    """Return an action that kills a process and restarts it later [s]."""

    def act(site: Site) -> Facts:
        site.rig.kill(process)
        site.sleep(seconds, quick)
        site.start_again(process)
        if process == "server":
            site.rig.until_felt(START_S)
        else:
            name = f":{site.rig.running[process].pid}"
            site.rig.until(lambda status: any(link[1].endswith(name) for link in status.links))
        return {}

    return act


def kill_logger_until_it_matters(site: Site) -> Facts:
    """Kill the logger, and restart it only after the server has paused the trial for it."""
    site.rig.kill("logger")
    status = site.rig.until(lambda status: status.phase == "paused")
    site.sleep(10.0, 2.0)
    site.start_again("logger")
    return {"notice": status.notice}


def kill_with_peer_frozen(site: Site) -> Facts:
    """Kill the server and start another while an agent is suspended; the agent wakes with the old session."""
    site.rig.send_signal("left agent", signal.SIGSTOP)
    site.rig.kill("server")
    site.start_again("server")
    site.rig.until(lambda status: "agent.right" in status.peers, START_S)
    site.rig.send_signal("left agent", signal.SIGCONT)
    return {}


def together(*acts: Act) -> Act:
    """Return an action that performs several acts at the same time."""

    def act(site: Site) -> Facts:
        with ThreadPoolExecutor(len(acts)) as workers:
            facts = workers.map(lambda one: one(site), acts)
        return {name: fact for found in facts for name, fact in found.items()}

    return act


# --- links -------------------------------------------------------------------------------------------------------


def hold(process: str, seconds: float, quick: float | None = None) -> Act:
    """Return an action that holds all bytes on a process's line for a duration [s]."""
    return _for_a_while(
        lambda site: site.relays[process].hold(),
        lambda site: site.relays[process].mend(),
        *(seconds, quick),
    )


def cut(process: str, seconds: float) -> Act:
    """Return an action that resets a process's connections and refuses new ones for a duration [s]."""
    return _for_a_while(lambda site: site.relays[process].cut(), lambda site: site.relays[process].mend(), seconds)


def swallow(process: str, seconds: float) -> Act:
    """Return an action that resets a process's connections and accepts new, blocked ones for a duration [s]."""

    def begin(site: Site) -> None:
        _reset(site.relays[process])
        site.relays[process].hold()

    return _for_a_while(begin, lambda site: site.relays[process].mend(), seconds)


def blow(process: str, up: Weather = FAIR, down: Weather = FAIR) -> Act:
    """Return an action that degrades a process's line for 3 s, or 1 s in the short form."""
    return _for_a_while(
        lambda site: site.relays[process].weather(up, down), lambda site: site.relays[process].weather(), 3.0, 1.0
    )


def double(process: str) -> Act:
    """Return an action that resets a process's connections and duplicates the new ones for 2 s."""

    def duplicate(site: Site, on: bool) -> None:
        site.relays[process].double(on)
        _reset(site.relays[process])

    return _for_a_while(lambda site: duplicate(site, True), lambda site: duplicate(site, False), 2.0)


def _reset(line: Relay) -> None:
    """Reset the connections of a line, and let new ones be made."""
    line.cut()
    time.sleep(0.01)
    line.mend()


def distrust(process: str, weather: Weather) -> Act:
    """Return an action that restarts an agent over a line too slow for the clock bound that arming needs."""

    def act(site: Site) -> Facts:
        site.relays[process].weather(weather, weather)
        site.rig.kill(process)
        site.start_again(process)
        status = site.rig.until(lambda status: any("clock" in lack for lack in status.waiting_for))
        site.relays[process].weather()
        return {"waiting for": ", ".join(status.waiting_for)}

    return act


def pull_cable(process: str, seconds: float) -> Act:
    """Return an action that sets a station's real link down for a duration [s]."""
    side = side_of(process)
    return _for_a_while(lambda site: _cables(site).pull(side), lambda site: _cables(site).plug(side), seconds)


def _cables(site: Site) -> Spaces:
    if site.spaces is None:
        raise ValueError("there are no cables at this site")
    return site.spaces


# --- peers that do not belong --------------------------------------------------------------------------------------


def second_agent(site: Site) -> Facts:
    """Start a second agent for a side."""
    second = site.rig.start("second left agent", "agent", "--side", "left")
    wanted = "already has an agent"
    until = time.monotonic() + TIMEOUT
    while wanted not in site.rig.said("second left agent") and time.monotonic() < until:
        time.sleep(0.1)
    time.sleep(1.0)
    said = site.rig.said("second left agent")
    site.rig.kill("second left agent")
    forces = read_trace(trace_file(site.rig.folder, "left", second.pid))["fz"]
    largest = float(np.max(np.abs(forces), initial=0.0))
    answer = next((line for line in said.splitlines() if wanted in line), said[-200:])
    return {"answer": answer, "largest force of the second": f"{largest:g} N in {forces.size}"}


def say(*frames: bytes) -> Act:
    """Return an action that sends frames to the motion channel as a stranger and notes the answer to each."""

    def act(site: Site) -> Facts:
        answers: dict[str, None] = {}
        with sockets.open_context() as context:
            stranger = sockets.motion_agent(context, _reach(site).reach(channels.MOTION), "stranger")
            until = time.monotonic() + ANSWER_SECONDS
            while len(answers) < len(frames) and time.monotonic() < until:
                for frame in frames:
                    sockets.send(stranger, frame)
                if poller.wait_readable(stranger, 0.2):
                    answers[_words(sockets.receive(stranger))] = None
        return {"answer": "; ".join(answers)}

    return act


def _words(frame: bytes | None) -> str:
    message = decode(frame) if frame is not None else None
    return message.reason if isinstance(message, Refusal) else str(message)


def flood(site: Site) -> Facts:
    """Send invalid frames and `Hello` on every channel at full rate, and keep opening connections."""
    sent = connections = 0
    frames = (b"nonsense", b"\xc1" * 2000, encode(STRANGER), encode(SAMPLE), encode(replace(STRANGER, side="")))
    seconds = QUICK_FLOOD_SECONDS if site.quick else FLOOD_SECONDS
    until = time.monotonic() + seconds
    with sockets.open_context() as context:
        where = _reach(site)
        floods = [
            sockets.motion_agent(context, where.reach(channels.MOTION), "flood"),
            sockets.control_client(context, where.reach(channels.CONTROL), "flood"),
            sockets.log_client(context, where.reach(channels.LOG), "flood"),
        ]
        while time.monotonic() < until:
            for _ in range(200):
                sent += sum(sockets.send(socket, frames[sent % len(frames)]) for socket in floods)
            connections += _knock(site)
    return {"flood": f"{sent} frames, {connections} connections in {seconds:g} s"}


def _knock(site: Site) -> int:
    """Connect to every channel, send bytes that are not ZeroMQ, and close."""
    network = site.rig.config.network
    for channel in range(len(CHANNELS) - 1):
        with net.create_connection((network.host, network.port + channel), ANSWER_SECONDS) as connection:
            connection.sendall(b"GET / HTTP/1.1\r\n\r\n")
    return len(CHANNELS) - 1


def _reach(site: Site) -> channels.Addresses:
    return channels.addresses(site.rig.config.network)


# --- devices -----------------------------------------------------------------------------------------------------


def trick(process: str, what: Trick, seconds: float = 1.0) -> Act:
    """Return an action that makes an agent's device fail for a duration [s]."""
    side = side_of(process)
    return _for_a_while(
        lambda site: play_trick(site.rig.folder, side, what),
        lambda site: play_trick(site.rig.folder, side, "none"),
        seconds,
    )


def trick_and_restart(process: str, what: Trick) -> Act:
    """Return an action that makes an agent's device fail and restarts the agent with a working one."""

    def act(site: Site) -> Facts:
        play_trick(site.rig.folder, side_of(process), what)
        site.rig.until(lambda status: status.phase == "paused")
        time.sleep(AWAY)
        ended = site.rig.running[process].poll()
        play_trick(site.rig.folder, side_of(process), "none")
        code = site.rig.wait(process) if ended is not None else site.rig.stop(process)
        site.start_again(process)
        return {"exit code of the agent": str(code), "its last words": site.rig.said(process).splitlines()[-1]}

    return act


def stop_in_an_emergency(site: Site) -> Facts:
    """Trigger an emergency stop, release it a while later, and resume."""
    site.rig.do(emergency.STOP)
    site.rig.until(lambda status: emergency.LACKING in status.waiting_for)
    time.sleep(AWAY)
    site.rig.do(emergency.RELEASE)
    site.rig.until(lambda status: status.phase == "paused" and not status.waiting_for)
    site.rig.do("resume")
    return {}


# --- clocks and disks --------------------------------------------------------------------------------------------


def set_wall_clock(*seconds: int) -> Act:
    """Return an action that sets the wall clock of all processes to several times in turn [s]."""

    def act(site: Site) -> Facts:
        if site.clock is None:
            raise ValueError("the wall clock cannot be set at this site")
        for shift in (*seconds, 0):
            site.clock.set(shift)
            time.sleep(1.0)
        return {}

    return act


def fill_disk(left: int) -> Act:
    """Return an action that fills the recordings' disk up to a remainder [bytes] and starts a logger elsewhere."""

    def act(site: Site) -> Facts:
        place = Path(site.rig.config.recording.directory)
        spare = shutil.disk_usage(place).free - left
        with (place / "filler").open("wb") as filler:  # in one step, before a process can react to a partial fill
            os.posix_fallocate(filler.fileno(), 0, spare)
        return _next_logger(site)

    return act


def remove_directory(site: Site) -> Facts:
    """Delete the recordings' folder with the recording in it, and start another logger elsewhere."""
    shutil.rmtree(site.rig.config.recording.directory)
    return _next_logger(site)


def _next_logger(site: Site) -> Facts:
    """Wait until the logger has ended, note why, and start the next one with another folder."""
    began = now_ns()
    code = site.rig.wait("logger")
    seconds = (now_ns() - began) * 1e-9
    said = site.rig.said("logger").splitlines()
    status = site.rig.until(lambda status: status.phase == "paused")
    site.rig.start("logger", "logger", "--once", "--set", f"recording.directory={site.rig.folder / 'elsewhere'}")
    warned = next((line for line in said if "only" in line), "no warning")
    return {
        "logger": f"exit code {code} after {seconds:.1f} s: {said[-1]}",
        "warning": warned,
        "notice": status.notice,
    }
