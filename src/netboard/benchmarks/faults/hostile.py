"""A server that is none: it does what a server does, and between its messages says whatever comes to its mind.

Real agents, displays and loggers connect to it. What it says in earnest is as plain as can be, so that any effect of
the rest is seen: one force that never changes, ticks that are numbered and else empty, a board that moves a little; and
now and then another block, which is like the one before.
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
from netboard.benchmarks.faults.mutants import parse
from netboard.network.protocol.codec import encode
from netboard.network.protocol.joining import Goodbye, Hello, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.motion import Force, Heartbeat, Point, Safeguard, Stylus
from netboard.network.protocol.records import LogAck, LogBatch, LogEnd, LogRequest, TickRecord
from netboard.network.protocol.views import Frames
from netboard.network.transport import channels, sockets
from netboard.stage.view import View

FORCE = 0.1
"""Force on every hand, small enough to arm the device with it [N]."""

SESSION = "f" * 32
_GROWN = Safeguard.ARMED | Safeguard.RAMPING

ROWS = 10
"""Ticks per batch for the logger, and turns between batches [1]."""

VIEW_TURNS = 16
"""Turns between views [1]."""

BLOCK_TURNS = 5000
"""Turns between the beginnings of two blocks [1]."""

BLOCKS = 1000
"""Number of blocks, after which the count restarts [1]."""

KEPT_OPEN = 4
"""Connections left open in which no ZeroMQ is spoken [1]."""

MEANT: tuple[type[Message], ...] = (Welcome, Goodbye, Refusal, Force, Point, Heartbeat, LogBatch, LogEnd)
"""Message types that a peer must believe from its server; malformed frames that decode to one are skipped."""


class HostileServer:
    """Everything a server binds, and the channel between the hands of a bimanual participant.

    - `grown`: those of them whose force has grown to what is wanted.
    - `durable`: number of the first record that the logger does not have on disk [1].
    """

    def __init__(self, config: Config, context: sockets.Context, mutants: Iterator[bytes]) -> None:
        where = channels.addresses(config.network)
        self.armed: set[bytes] = set()
        self.grown: set[bytes] = set()
        self.samples = self.shown = self.ticks = self.durable = 0
        self._mutants = mutants
        self._config = config
        self._welcome = self._begin(1)
        self._routers = {
            "motion": sockets.motion_server(context, where.listen(channels.MOTION)),
            "log": sockets.log_server(context, where.listen(channels.LOG)),
            "control": sockets.control_server(context, where.listen(channels.CONTROL)),
        }
        self._views = {side: sockets.view_publisher(context, where.listen(channels.VIEW[side])) for side in SIDES}
        bimanual = config.block.configuration == "bimanual"
        self._moves = sockets.moves_sender(context, where.listen(channels.MOVES)) if bimanual else None
        self._peers: dict[str, set[bytes]] = {channel: set() for channel in self._routers}
        self._wanted: dict[bytes, int] = {}
        self._turns = 0
        self._log_ended = False
        self.nonsense = dict.fromkeys([*self._routers, "view", *(["moves"] if bimanual else [])], 0)

    def turn(self, *channels: str) -> None:
        """Do what is due in this millisecond, and send a malformed message on some channels."""
        self._turns += 1
        for channel in self._routers:
            self._hear(channel)
        self._speak()
        for channel in channels:
            self._babble(channel)

    def end_log(self) -> None:
        """Tell the loggers that the log is complete."""
        self._log_ended = True

    # --- in earnest --------------------------------------------------------------------------------------------------

    def _begin(self, number: int) -> bytes:
        """Return the message that announces a block to the peers."""
        block = replace(self._config.block, number=number, blocks=BLOCKS)
        return encode(Welcome(SESSION, PROTOCOL_VERSION, now_ns(), resolve(replace(self._config, block=block))))

    def _hear(self, channel: str) -> None:
        router = self._routers[channel]
        while (received := router.receive()) is not None:
            name, frame = received
            match parse(frame):
                case Hello():
                    self._peers[channel].add(name)
                    router.send(name, self._welcome)
                case Stylus(safeguards=bits):
                    self.samples += 1
                    (self.armed.add if bits & Safeguard.ARMED else self.armed.discard)(name)
                    (self.grown.add if bits & _GROWN == Safeguard.ARMED else self.grown.discard)(name)
                case Frames(shown=shown):
                    self.shown += len(shown)
                case LogRequest(first=first):
                    self._wanted[name] = max(first, 0)
                case LogAck(durable=durable):
                    self.durable = durable

    def _speak(self) -> None:
        turn, now = self._turns, now_ns()
        for name in self._peers["motion"]:
            force = Force(turn, now, -1, FORCE, 0) if name in self.armed else Heartbeat(turn, now, -1, 0, arm=True)
            self._routers["motion"].send(name, encode(force))
        if turn % BLOCK_TURNS == 0:
            self._welcome = self._begin(turn // BLOCK_TURNS % BLOCKS + 1)
            for channel, router in self._routers.items():
                for name in self._peers[channel]:
                    router.send(name, self._welcome)
        if turn % ROWS == 0:
            for name in self._wanted:
                self._send_ticks(name)
        if turn % VIEW_TURNS == 0:
            for side, publisher in self._views.items():
                publisher.send(encode(_view(side, turn)))

    def _send_ticks(self, name: bytes) -> None:
        """Send a logger its next records; after nonsense it asks again and gets them again."""
        first = self._wanted[name]
        if self._log_ended and first >= self.ticks:
            self._routers["log"].send(name, encode(LogEnd(self.ticks - 1)))
            return
        records = []
        for number in range(first, first + ROWS):
            row = np.zeros(1, TICK)
            row["tick"] = number
            records.append(encode(TickRecord(row.tobytes())))
        if self._routers["log"].send(name, encode(LogBatch(first, 0, tuple(records)))):
            self._wanted[name] = first + ROWS
            self.ticks = max(self.ticks, first + ROWS)

    # --- and not -----------------------------------------------------------------------------------------------------

    def _babble(self, channel: str) -> None:
        frame = next(self._mutants)
        if isinstance(parse(frame), MEANT):
            return
        if channel == "view":
            self.nonsense[channel] += self._views["left"].send(frame)
        elif channel == "moves" and self._moves is not None:
            self.nonsense[channel] += sockets.send(self._moves, frame)
        else:
            self.nonsense[channel] += sum(self._routers[channel].send(name, frame) for name in self._peers[channel])


def _view(side: str, turn: int) -> View:
    """Return a view of a swaying board."""
    z = 0.01 * sin(turn * 1e-3)
    return View(
        side, turn, now_ns(), "running", z, 0.1 * z, 0.0, 0.15, z, z, 1, 6, 0, None, None, "", turn, 0.0, 1, 1, None
    )


class Babbler:
    """Listens on a server's ports and answers connections with bytes that are not ZeroMQ."""

    def __init__(self, network: Network, seed: int) -> None:
        self.heard = 0
        self._talk = zmtp.Talk(KEPT_OPEN, seed)
        places = [(network.host, network.port + channel) for channel in range(channels.MOVES)]
        self._listeners = [net.create_server(place) for place in places]
        for listener in self._listeners:
            listener.setblocking(False)

    def turn(self) -> None:
        """Answer new connections."""
        for listener in self._listeners:
            with suppress(BlockingIOError):
                connection, _ = listener.accept()
                self.heard += 1
                self._talk.take(connection)
        self._talk.turn()

    def close(self) -> None:
        """Close all connections."""
        for listener in self._listeners:
            listener.close()
        self._talk.close()
