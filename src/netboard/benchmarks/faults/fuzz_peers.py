"""Malformed messages for real agents, a display and a logger, from two hostile servers.

One agent runs the simulated participant of a dyad; the other one is bimanual and receives commands over the channel
moves, so that every socket of every process is tested. The devices must render exactly the forces that the servers
command.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Side
from netboard.base.errors import NetboardError
from netboard.benchmarks.faults.devices import read_traces
from netboard.benchmarks.faults.evidence import between
from netboard.benchmarks.faults.hostile_server import FORCE, HostileServer, NonZmqServer
from netboard.benchmarks.faults.malformed_frames import MalformedFrames, valid_frames
from netboard.benchmarks.faults.process_health import memory, memory_part, require_running
from netboard.benchmarks.faults.rigs import TIMEOUT, Rig, tampered
from netboard.benchmarks.harness.results import Part, Value, Verdict
from netboard.benchmarks.harness.running import Tell
from netboard.network.transport import sockets
from netboard.recording.files.reader import Recording

RELAXED_LIMITS = ("safety.stale_after_ms=1000", "safety.disarm_after_ms=2000", "safety.arm_time=0.1")
"""Long timeouts: one loop sends both the malformed messages and the forces, so a force may arrive late."""

STEP_SECONDS = 0.001
MALFORMED_PER_STEP = 3
"""Malformed messages per step and channel [1]."""

CHECK_STEPS = 1000
"""Steps between two checks of the processes [1]."""

NON_ZMQ_SECONDS = 5.0
"""Duration of the first phase, in which the servers do not speak ZeroMQ [s]."""

STUCK_SECONDS = 60.0
"""Time without progress after which a socket counts as stuck [s]."""


class PeerGroup:
    """A hostile server and the processes that connect to it.

    - `side`: side of the agent; the left one has a display and a logger beside it.
    - `server`: the server, once `serve` was called.
    """

    server: HostileServer

    def __init__(self, folder: Path, side: Side) -> None:
        folder.mkdir(parents=True)
        settings, environment = tampered(folder.resolve())
        self.side = side
        self.complete = side == "left"
        self.channels = ("motion", "view", "control", "log") if self.complete else ("motion", "moves")
        configuration = f"block.configuration={'dyadic' if self.complete else 'bimanual'}"
        self.rig = Rig(folder, (*RELAXED_LIMITS, *settings, configuration), environment)

    def start(self) -> None:
        """Start the processes."""
        self.rig.start_agent(self.side)
        if self.complete:
            self.rig.start("left display", "display", "--station", "left", "--offscreen")
            self.rig.start("logger", "logger", "--once")

    def serve(self, context: sockets.Context) -> None:
        """Open the server."""
        self.server = HostileServer(self.rig.config, context, MalformedFrames(valid_frames(3), 3 + self.complete))

    def is_ready(self) -> bool:
        """Return whether every process works: force at its full size, frames shown, records on disk."""
        server = self.server
        return bool(server.at_full_force) and (not self.complete or (server.frames_shown > 0 and server.durable > 0))

    def malformed(self, count: int) -> int:
        """Return the number of malformed messages sent, at most `count` per channel [1]."""
        return sum(min(self.server.malformed[channel], count) for channel in self.channels)


def peer_parts(folder: Path, count: int, tell: Tell) -> Iterator[Part]:
    """Connect real peers to hostile servers."""
    tell("peers: starting", 0.0)
    groups = [PeerGroup(folder / side, side) for side in SIDES]
    with ExitStack() as stack:
        for group in groups:
            stack.enter_context(group.rig)
            group.start()
        connections = _serve_without_zmq(groups)
        context = stack.enter_context(sockets.open_context())
        for group in groups:
            group.serve(context)
        _step_until(groups, lambda: all(group.is_ready() for group in groups))
        before, shown_before, start_ns = _memory(groups), groups[0].server.frames_shown, now_ns()
        _send_malformed(groups, count, tell)
        stop_ns, after = now_ns(), _memory(groups)
        frames_shown = groups[0].server.frames_shown - shown_before
        tell("peers: checking the results", 1.0)
        codes = _stop(groups)
    verdicts = [
        Verdict("every process keeps running, and ends with exit code 0", not any(codes.values()), f"{codes}"),
        *(_same_force(group, start_ns, stop_ns) for group in groups),
        Verdict("the display continues to show frames", frames_shown > 0, f"{frames_shown} frames"),
        _recorded(groups[0]),
    ]
    yield _peers_part(groups, connections, verdicts)
    yield memory_part("peers-memory", "Memory of the processes connected to the hostile servers", before, after)


def _serve_without_zmq(groups: Sequence[PeerGroup]) -> int:
    """Answer the peers with invalid bytes for a while; return the number of connections [1]."""
    servers = [NonZmqServer(group.rig.config.network, seed) for seed, group in enumerate(groups)]
    deadline = time.monotonic() + TIMEOUT
    all_connected = False
    while time.monotonic() < deadline:
        for server in servers:
            server.step()
        if not all_connected and all(server.connections for server in servers):
            all_connected = True
            deadline = min(deadline, time.monotonic() + NON_ZMQ_SECONDS)
        time.sleep(STEP_SECONDS)
    for group, server in zip(groups, servers, strict=True):
        require_running(group.rig)
        server.close()
    return sum(server.connections for server in servers)


def _step_until(groups: Sequence[PeerGroup], condition: Callable[[], bool]) -> None:
    """Serve without malformed messages until a condition holds."""
    deadline = time.monotonic() + TIMEOUT
    while not condition():
        _step(groups, 0)
        if time.monotonic() > deadline:
            raise NetboardError(f"the agents, the display or the logger do not work after {TIMEOUT:g} s")


def _step(groups: Sequence[PeerGroup], count: int) -> None:
    """Advance each server by one step, with malformed messages on each channel that has sent fewer than `count`."""
    for group in groups:
        channels = [channel for channel in group.channels if group.server.malformed[channel] < count]
        group.server.step(*MALFORMED_PER_STEP * channels)
    time.sleep(STEP_SECONDS)


def _send_malformed(groups: Sequence[PeerGroup], count: int, tell: Tell) -> None:
    """Send `count` malformed messages on every channel."""
    total = count * sum(len(group.channels) for group in groups)
    sent, sent_at = 0, time.monotonic()
    steps = 0
    while sent < total:
        _step(groups, count)
        steps += 1
        now_sent = sum(group.malformed(count) for group in groups)
        if now_sent > sent:
            sent, sent_at = now_sent, time.monotonic()
        elif time.monotonic() - sent_at > STUCK_SECONDS:
            counts = [group.server.malformed for group in groups]
            raise NetboardError(f"a peer has read no message for {STUCK_SECONDS:g} s; sent so far: {counts}")
        if steps % CHECK_STEPS == 0:
            tell("peers: malformed messages", sent / total)
            for group in groups:
                require_running(group.rig)


def _stop(groups: Sequence[PeerGroup]) -> dict[str, int]:
    """End the log, then stop every process; return the exit codes by process name."""
    left = groups[0]
    left.server.end_log()
    deadline = time.monotonic() + TIMEOUT
    while left.rig.running["logger"].poll() is None and time.monotonic() < deadline:
        _step(groups, 0)
    codes = {"logger": left.rig.wait("logger")}
    for group in groups:
        codes |= {name: group.rig.stop(name) for name in list(group.rig.running)}
    return codes


def _memory(groups: Sequence[PeerGroup]) -> dict[str, float]:
    return {name: size for group in groups for name, size in memory(group.rig).items()}


def _peers_part(groups: Sequence[PeerGroup], connections: int, verdicts: list[Verdict]) -> Part:
    """Tabulate the malformed messages that each socket received."""
    left, right = (group.server.malformed for group in groups)
    rows: list[tuple[Value, ...]] = [
        ("left agent: motion", left["motion"]),
        ("left agent, left display: view", left["view"]),
        ("left display: control", left["control"]),
        ("logger: log", left["log"]),
        ("right agent: motion", right["motion"]),
        ("right agent: moves", right["moves"]),
        ("all: connections without ZeroMQ", connections),
    ]
    title = "Malformed messages for agents, displays and loggers"
    return Part("peers", title, ("socket", "messages [1]"), rows, verdicts)


def _same_force(group: PeerGroup, start_ns: int, stop_ns: int) -> Verdict:
    """Check that the device was sent the constant force of the server only."""
    traces = read_traces(group.rig.folder, group.side)
    forces = np.concatenate([np.empty(0), *(between(trace, start_ns, stop_ns)["fz"] for trace in traces)])
    others = int(np.sum(forces != FORCE))
    claim = f"the {group.side} device is sent no other force than the commanded one"
    return Verdict(claim, forces.size > 0 and others == 0, f"{others} of {forces.size} forces differ from {FORCE:g} N")


def _recorded(group: PeerGroup) -> Verdict:
    """Check that the recording has every tick of the server."""
    claim = "every tick of the server is recorded"
    paths = group.rig.recordings()
    if len(paths) != 1:
        return Verdict(claim, False, f"{len(paths)} recordings")
    with Recording(paths[0]) as recording:
        ticks = recording.ticks()["tick"]
    complete = np.array_equal(ticks, np.arange(group.server.ticks))
    return Verdict(claim, complete, f"{ticks.size} of {group.server.ticks} ticks")
