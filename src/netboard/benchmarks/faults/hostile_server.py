"""A fake server that sends malformed messages to real agents, displays and loggers between its valid ones.

The valid messages are simple, so that any effect of the malformed ones is visible: a constant force, ticks that contain
only their number, a slowly moving board, and from time to time the start of an identical block.
"""

import socket as net
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from math import sin

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Config, resolve
from netboard.base.tables.rig import Network
from netboard.base.tick import TICK
from netboard.benchmarks.faults import zmtp
from netboard.benchmarks.faults.malformed_frames import decode_or_none
from netboard.network.protocol.codec import encode
from netboard.network.protocol.joining import Goodbye, Hello, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.motion import Force, Heartbeat, Point, Safeguard, Stylus
from netboard.network.protocol.records import LogAck, LogBatch, LogEnd, LogRequest, TickRecord
from netboard.network.protocol.views import Frames
from netboard.network.transport import channels, sockets
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
        """Return the welcome that announces a block to the peers."""
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
        """Announce a block to every peer."""
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
            self.malformed[channel] += self._views["left"].send(frame)
        elif channel == "moves" and self._moves is not None:
            self.malformed[channel] += sockets.send(self._moves, frame)
        else:
            self.malformed[channel] += sum(self._routers[channel].send(name, frame) for name in self._peers[channel])


def _view(side: str, step: int) -> View:
    """Return a view of a slowly moving board."""
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
