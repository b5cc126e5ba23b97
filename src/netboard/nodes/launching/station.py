"""The service of a station: it starts and stops the station's processes on request of the server's machine.

Only the owner of the server's key is admitted. A request names one of the declared programs; the command line is made
here, from this machine's own configuration. If the server's machine falls silent, the processes go on: the agent
enforces its safety limits by itself, and the next request finds them as they are.
"""

import logging
import os
import platform
import shutil
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

from netboard.base.clock import now_ns
from netboard.base.config import Config, Side
from netboard.base.device_kind import WORDS
from netboard.base.errors import ConfigError, WireError
from netboard.base.finding import text_of
from netboard.base.process.display_server import asked_offscreen, no_screen
from netboard.base.system.c_library import load_average
from netboard.devices.contract import registry
from netboard.devices.setup import usb
from netboard.network import keys
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.station import StationReport, StationRequest
from netboard.network.station_keys import StationRing
from netboard.network.transport import channels, poller, sockets
from netboard.network.transport.authenticator import Authenticator
from netboard.nodes.launching.machines import LocalMachine, device_conflict
from netboard.nodes.launching.programs import AT_A_STATION, PROGRAMS, command_of

WAIT_S = 0.02
"""Longest time for which a handshake or a request waits [s]."""

LOG_CHARACTERS = 8000
"""Length of the end of a log in a report [1]."""

log = logging.getLogger(__name__)


def station_commands(side: Side, settings: Sequence[str], *, offscreen: bool) -> dict[str, list[str]]:
    """Return the commands that a station runs, by the names of their processes."""
    commands = {}
    for program in AT_A_STATION:
        options = ["--offscreen"] * (offscreen and PROGRAMS[program].window)
        commands[f"{side} {program}"] = command_of(program, side, settings, options)
    return commands


def ring_of(config: Config, side: Side) -> StationRing:
    """Return the key of a station; raise an error if its address or its key is missing."""
    if not config.stations.of(side):
        raise ConfigError(f'[stations] {side}: found "", expected the address of this machine')
    return StationRing(Path(config.network.keys), side)


class StationService:
    """Answers requests; ``state``: describes the machine in words."""

    def __init__(
        self,
        config: Config,
        side: Side,
        ring: StationRing,
        machine: LocalMachine,
        context: sockets.Context,
        state: Mapping[str, str],
    ) -> None:
        address = config.stations.of(side)
        self._side, self._config, self._machine, self._state = side, config, machine, state
        self._authenticator = Authenticator(ring, config.stations.port_of(side))
        endpoint = channels.station_endpoint(address, config.stations.port_of(side), self._authenticator)
        self._router = sockets.station_server(context, endpoint)
        self._waiter = poller.Waiter((self._router.socket,))
        log.info("station %s: waiting for the server's machine at %s", side, endpoint.address)

    def run(self, stopping: Callable[[], bool]) -> None:
        """Answer requests until the process is asked to stop."""
        while not stopping():
            self.step(WAIT_S)
        self._router.close_after_goodbye()

    def step(self, seconds: float) -> None:
        """Wait at most this time [s] for requests, and answer them."""
        self._authenticator.answer_handshakes()
        for report in self._authenticator.reports(now_ns()):
            log.warning("refused: %s", " ".join(f"{name}={word}" for name, word in report.items()))
        self._waiter.wait(seconds)
        self._machine.poll()
        while (received := self._router.receive()) is not None:
            peer, frame = received
            if not peer:
                continue
            try:
                request = decode(frame)
            except WireError as error:
                log.warning("not a request: %s", error)
                continue
            if isinstance(request, StationRequest):
                self._router.send(peer, encode(self.answer(request)))

    def answer(self, request: StationRequest) -> StationReport:
        """Carry out a request, and report."""
        refused = self._refusal(request) or self._carry_out(request)
        processes = tuple(self._machine.processes.values())
        shown = {status.name for status in processes if status.phase == "ended" and status.code}
        shown |= {request.process} & set(self._machine.commands)
        logs = {name: self._machine.tail(name)[-LOG_CHARACTERS:] for name in sorted(shown)}
        state = dict(self._state) | changing_state(self._config, self._side)
        return StationReport(self._side, version("netboard"), state, processes, logs, refused)

    def _carry_out(self, request: StationRequest) -> str:
        """Start or stop a process; return why that failed. A full disk must not end the processes that run."""
        actions = {"start": self._machine.start, "stop": self._machine.stop}
        if request.action in actions:
            log.info("%s %s", request.action, request.process)
            try:
                actions[request.action](request.process)
            except OSError as error:
                log.error("cannot %s %s: %s", request.action, request.process, error)
                return f"cannot {request.action} the {request.process}: {error}"
        return ""

    def _refusal(self, request: StationRequest) -> str:
        """Return why a request is not carried out; empty if it is."""
        known = self._machine.commands
        if request.process not in known and (request.process or request.action != "report"):
            return f"{request.process!r:.80} is no process of this station; it has {', '.join(known)}"
        return device_conflict(request.process, self._machine.processes) if request.action == "start" else ""


def fixed_state() -> dict[str, str]:
    """Describe what does not change while the service runs; opening the screen takes a second or two."""
    unseen = asked_offscreen() or (found.why if (found := no_screen()) else "")
    return {
        "computer": platform.node(),
        "system": platform.platform(),
        "cores": str(os.cpu_count()),
        "screen": unseen or "opens",
    }


def changing_state(config: Config, side: Side) -> dict[str, str]:
    """Describe load, memory, disk, device and keys of a station."""
    backend = config.agents.of(side).device
    memory = dict(line.split(":", 1) for line in text_of(Path("/proc/meminfo")).splitlines() if ":" in line)
    state = {
        "load": f"{load_average():.2f}",
        "free memory": f"{int(memory['MemAvailable'].split()[0]) / 2**20:.1f} GiB" if "MemAvailable" in memory else "?",
        "free disk": _free_disk(),
        "device": f"{backend}: {WORDS[registry.kind_of(backend)]}",
    }
    if usb.has_sysfs(usb.ROOT):
        plugged = [f"{each.model.name} {each.serial}".strip() for each in usb.by_sysfs(usb.ROOT)]
        state["USB devices"] = ", ".join(plugged) or "none"
    if keys.encrypted(config.network):
        folder = Path(config.network.keys)
        lacking = [role for role in ("agent", "display") if not keys.key_path(folder, f"{role}.{side}").exists()]
        state["keys"] = f"missing in {folder}: {', '.join(lacking)}" if lacking else "complete"
    return state


def _free_disk() -> str:
    """Return the free space of the working folder, or why it is unknown."""
    try:
        return f"{shutil.disk_usage(Path.cwd()).free / 2**30:.1f} GiB"
    except OSError as error:
        return f"unknown: the working folder cannot be read: {error.strerror}"
