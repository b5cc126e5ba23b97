"""Malformed messages for real agents, a display and a logger, from two hostile servers.

One agent runs the simulated participant of a dyad; the other one is bimanual and receives commands over the channel
moves, so that every socket of every process is tested. The devices must render exactly the forces that the servers
command. The valid messages between the malformed ones are simple, so that any effect is visible: a constant force,
ticks that contain only their number, a slowly moving board, and from time to time the start of an identical block.
"""

import socket as net
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from math import sin
from pathlib import Path

import numpy as np

from evidence.faults import zmtp
from evidence.faults.devices import read_traces
from evidence.faults.evidence import between
from evidence.faults.fuzz_server import STUCK_SECONDS, memory_part
from evidence.faults.malformed_frames import MalformedFrames, decode_or_none, valid_frames
from evidence.faults.rigs import tampered
from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Config, Side, resolve
from netboard.base.errors import NetboardError
from netboard.base.safeguards import Safeguard
from netboard.base.tables.rig import Network
from netboard.base.tick import TICK
from netboard.benchmarks.harness.results import BenchVerdict, ResultPart
from netboard.benchmarks.harness.rig import TIMEOUT, Rig
from netboard.benchmarks.harness.running import Tell
from netboard.network.protocol.codec import encode
from netboard.network.protocol.joining import Goodbye, Hello, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.motion import Force, Heartbeat, Point, Stylus
from netboard.network.protocol.records import LogAck, LogBatch, LogEnd, LogRequest, TickRecord
from netboard.network.protocol.views import Frames
from netboard.network.transport import channels, sockets
from netboard.recording.files.reader import Recording
from netboard.stage.view import View

FORCE = 0.1
"""Commanded force of every device, small enough to arm the device with it [N]."""

BATCH_TICKS = 10
"""Ticks per batch for the logger, and steps between batches [1]."""

VIEW_STEPS = 16
"""Steps between views [1]."""

BLOCK_STEPS = 5000
"""Steps between the starts of two blocks [1]."""

BLOCK_COUNT = 1000
"""Number of blocks, after which the block number restarts at 1 [1]."""

MAX_OPEN = 4
"""Connections without ZeroMQ that are open at a time [1]."""

EFFECTIVE: tuple[type[Message], ...] = (Welcome, Goodbye, Refusal, Force, Point, Heartbeat, LogBatch, LogEnd)
"""Message types that have an effect when a server sends them; malformed frames that decode to one are skipped."""


class HostileServer:
    """Binds every socket of a server, and the channel between the hands of a bimanual simulated participant.

    - `armed`, `at_full_force`: names of the agents that are armed, and of those that have finished the force ramp.
    - `frames_shown`: number of frames that the displays have shown [1].
    - `ticks`: number of ticks sent to the logger [1].
    - `durable`: number of the first record that the logger does not have on disk [1].
    - `malformed`: number of malformed messages sent on each channel [1].
    """

    def __init__(self, config: Config, context: sockets.Context, frames: Iterator[bytes]) -> None:
        where = channels.addresses(config.network)
        self.armed: set[bytes] = set()
        self.at_full_force: set[bytes] = set()
        self.frames_shown = self.ticks = self.durable = 0
        self._frames = frames
        self._config = config
        self._welcome = self._welcome_to_block(1)
        self._routers = {
            "motion": sockets.motion_server(context, where.listen(channels.MOTION)),
            "log": sockets.log_server(context, where.listen(channels.LOG)),
            "control": sockets.control_server(context, where.listen(channels.CONTROL)),
        }
        self._views = {side: sockets.view_publisher(context, where.listen(channels.VIEW[side])) for side in SIDES}
        bimanual = config.block.configuration == "bimanual"
        self._moves = sockets.moves_sender(context, where.listen(channels.MOVES)) if bimanual else None
        self._peers: dict[str, set[bytes]] = {channel: set() for channel in self._routers}
        self._next_record: dict[bytes, int] = {}
        self._steps = 0
        self._log_ended = False
        self.malformed = dict.fromkeys([*self._routers, "view", *(["moves"] if bimanual else [])], 0)

    def step(self, *channels: str) -> None:
        """Handle and send the valid messages of 1 ms, and send a malformed message for each item of `channels`."""
        self._steps += 1
        for channel in self._routers:
            self._receive(channel)
        self._send_valid()
        for channel in channels:
            self._send_malformed(channel)

    def end_log(self) -> None:
        """Announce the end of the log to the loggers once they have every record."""
        self._log_ended = True

    # --- valid messages ----------------------------------------------------------------------------------------------

    def _welcome_to_block(self, number: int) -> bytes:
        block = replace(self._config.block, number=number, blocks=BLOCK_COUNT)
        return encode(Welcome("f" * 32, PROTOCOL_VERSION, now_ns(), resolve(replace(self._config, block=block))))

    def _receive(self, channel: str) -> None:
        router = self._routers[channel]
        while (received := router.receive()) is not None:
            name, frame = received
            match decode_or_none(frame):
                case Hello():
                    self._peers[channel].add(name)
                    router.send(name, self._welcome)
                case Stylus(safeguards=bits):
                    ramp_done = bits & (Safeguard.ARMED | Safeguard.RAMPING) == Safeguard.ARMED
                    (self.armed.add if bits & Safeguard.ARMED else self.armed.discard)(name)
                    (self.at_full_force.add if ramp_done else self.at_full_force.discard)(name)
                case Frames(shown=shown):
                    self.frames_shown += len(shown)
                case LogRequest(first=first):
                    self._next_record[name] = max(first, 0)
                case LogAck(durable=durable):
                    self.durable = durable

    def _send_valid(self) -> None:
        step, now = self._steps, now_ns()
        for name in self._peers["motion"]:
            force = Force(step, now, -1, FORCE, 0) if name in self.armed else Heartbeat(step, now, -1, 0, arm=True)
            self._routers["motion"].send(name, encode(force))
        if step % BLOCK_STEPS == 0:
            self._start_block(step // BLOCK_STEPS % BLOCK_COUNT + 1)
        if step % BATCH_TICKS == 0:
            for name in self._next_record:
                self._send_ticks(name)
        if step % VIEW_STEPS == 0:
            for side, publisher in self._views.items():
                publisher.send(encode(_view(side, step)))

    def _start_block(self, number: int) -> None:
        self._welcome = self._welcome_to_block(number)
        for channel, router in self._routers.items():
            for name in self._peers[channel]:
                router.send(name, self._welcome)

    def _send_ticks(self, name: bytes) -> None:
        """Send a logger its next records; after a malformed message it requests some of them a second time."""
        first = self._next_record[name]
        if self._log_ended and first >= self.ticks:
            self._routers["log"].send(name, encode(LogEnd(self.ticks - 1)))
            return
        records = []
        for number in range(first, first + BATCH_TICKS):
            row = np.zeros(1, TICK)
            row["tick"] = number
            records.append(encode(TickRecord(row.tobytes())))
        if self._routers["log"].send(name, encode(LogBatch(first, 0, tuple(records)))):
            self._next_record[name] = first + BATCH_TICKS
            self.ticks = max(self.ticks, first + BATCH_TICKS)

    # --- malformed messages ------------------------------------------------------------------------------------------

    def _send_malformed(self, channel: str) -> None:
        frame = next(self._frames)
        if isinstance(decode_or_none(frame), EFFECTIVE):
            return
        if channel == "view":
            if self._views["left"].wanted():
                self._views["left"].send(frame)
                self.malformed[channel] += 1
        elif channel == "moves" and self._moves is not None:
            self.malformed[channel] += sockets.send(self._moves, frame)
        else:
            self.malformed[channel] += sum(self._routers[channel].send(name, frame) for name in self._peers[channel])


def _view(side: str, step: int) -> View:
    z = 0.01 * sin(step * 1e-3)
    return View(
        side, step, now_ns(), "running", z, 0.1 * z, 0.0, 0.15, z, z, 1, 6, 0, None, None, "", step, 0.0, 1, 1, None
    )


class NonZmqServer:
    """Listens on a server's ports and answers connections with bytes that violate ZeroMQ's protocol.

    - `connections`: number of connections accepted [1].
    """

    def __init__(self, network: Network, seed: int) -> None:
        self.connections = 0
        self._streams = zmtp.StreamSender(MAX_OPEN, seed)
        addresses = [(network.host, network.port + channel) for channel in range(channels.MOVES)]
        self._listeners = [net.create_server(address) for address in addresses]
        for listener in self._listeners:
            listener.setblocking(False)

    def step(self) -> None:
        """Accept new connections, and send the next part over those that are open."""
        for listener in self._listeners:
            with suppress(BlockingIOError):
                connection, _ = listener.accept()
                self.connections += 1
                self._streams.add(connection)
        self._streams.send_next()

    def close(self) -> None:
        """Close all connections and stop listening."""
        for listener in self._listeners:
            listener.close()
        self._streams.close()


RELAXED_LIMITS = (
    "safety.stale_after_ms=1000",
    "safety.disarm_after_ms=2000",
    "safety.arm_time=0.1",
    "fixture.stiffness=0",
    "fixture.damping=0",
)
"""One loop sends both the malformed messages and the forces, so a force may arrive late. In a long run the hand comes
to the end of its workspace, where the lateral fixture alone would exceed the mean force that motors may render."""

STEP_SECONDS = 0.001
MALFORMED_PER_STEP = 3
"""Malformed messages per step and channel [1]."""

CHECK_STEPS = 1000
"""Steps between two checks of the processes [1]."""

NON_ZMQ_SECONDS = 5.0
"""Duration of the first phase, in which the servers do not speak ZeroMQ [s]."""


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


def peer_parts(folder: Path, count: int, tell: Tell) -> Iterator[ResultPart]:
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
        BenchVerdict("every process keeps running, and ends with exit code 0", not any(codes.values()), f"{codes}"),
        *(_same_force(group, start_ns, stop_ns) for group in groups),
        BenchVerdict("the display continues to show frames", frames_shown > 0, f"{frames_shown} frames"),
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
        group.rig.require_running()
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
                group.rig.require_running()


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
    return {name: size for group in groups for name, size in group.rig.memory().items()}


def _peers_part(groups: Sequence[PeerGroup], connections: int, verdicts: list[BenchVerdict]) -> ResultPart:
    """Tabulate the malformed messages that each socket received."""
    left, right = (group.server.malformed for group in groups)
    return ResultPart(
        "peers",
        "Malformed messages for agents, displays and loggers",
        "socket | messages [1]",
        [
            ("left agent: motion", left["motion"]),
            ("left agent, left display: view", left["view"]),
            ("left display: control", left["control"]),
            ("logger: log", left["log"]),
            ("right agent: motion", right["motion"]),
            ("right agent: moves", right["moves"]),
            ("all: connections without ZeroMQ", connections),
        ],
        verdicts,
    )


def _same_force(group: PeerGroup, start_ns: int, stop_ns: int) -> BenchVerdict:
    """Check that the device was sent the constant force of the server only."""
    traces = read_traces(group.rig.folder, group.side)
    forces = np.concatenate([np.empty(0), *(between(trace, start_ns, stop_ns)["fz"] for trace in traces)])
    others = int(np.sum(forces != FORCE))
    claim = f"the {group.side} device is sent no other force than the commanded one"
    return BenchVerdict(
        claim, forces.size > 0 and others == 0, f"{others} of {forces.size} forces differ from {FORCE:g} N"
    )


def _recorded(group: PeerGroup) -> BenchVerdict:
    """Check that the recording has every tick of the server."""
    claim = "every tick of the server is recorded"
    paths = group.rig.recordings()
    if len(paths) != 1:
        return BenchVerdict(claim, False, f"{len(paths)} recordings")
    with Recording(paths[0]) as recording:
        ticks = recording.ticks()["tick"]
    complete = np.array_equal(ticks, np.arange(group.server.ticks))
    return BenchVerdict(claim, complete, f"{ticks.size} of {group.server.ticks} ticks")
