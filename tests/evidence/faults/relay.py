"""A TCP relay between one peer and all channels of the server, in its own thread.

It delays, jitters, throttles and stalls bytes. It can hold all bytes (a pulled plug: connections stay, and the bytes
arrive later), cut (existing and new connections are reset until `restore`), and duplicate connections (the server
receives the same bytes twice). Bytes keep their order, as in TCP: late bytes delay all that follow. None are parsed.
"""

import logging
import os
import random
import select
import socket as net
import struct
import threading
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import inf
from typing import Self, TypeAlias

from netboard.base.clock import now_ns
from netboard.network.transport.channels import CHANNELS
from netboard.network.transport.ports import free_port

log = logging.getLogger(__name__)

Place: TypeAlias = tuple[str, int]
"""Address and port."""

STALL_NS = 200_000_000
"""Shortest TCP retransmission timeout [ns]."""

CHUNK_BYTES = 65_536
MAX_BYTES = 2**20
"""Bytes in transit above which the relay does not read from a sender [bytes]."""

CONNECT_SECONDS = 1.0
PRIORITY = 45
"""SCHED_FIFO priority of the thread, below the processes that it serves."""

_RESET = struct.pack("ii", 1, 0)
"""SO_LINGER value with which closing sends a reset."""


@dataclass(frozen=True)
class Impairment:
    """Impairment of one direction of a line.

    - `delay`: delay of every byte [s].
    - `jitter`: upper limit of an additional, uniformly distributed delay [s].
    - `stalls`: mean rate of stalls of 200 ms, as after a lost packet [Hz].
    - `rate`: throughput [bytes/s].
    """

    delay: float = 0.0
    jitter: float = 0.0
    stalls: float = 0.0
    rate: float = inf


UNIMPAIRED = Impairment()


class Flow:
    """One direction of a connection: bytes in transit, each with its release time."""

    def __init__(self, source: net.socket, sink: net.socket, duplicate: net.socket | None, seed: int) -> None:
        self.source, self.sink, self.duplicate = source, sink, duplicate
        self.bytes = 0
        self.ended = False
        self._queue: deque[tuple[int, bytes]] = deque()
        self._taken_ns = self._last_ns = 0
        self._random = random.Random(seed)

    @property
    def due_ns(self) -> float:
        """Return when the next byte is released, or infinity [ns]."""
        return self._queue[0][0] if self._queue else inf

    @property
    def open(self) -> bool:
        """Return whether the flow accepts more bytes."""
        return not self.ended and self.bytes < MAX_BYTES

    @property
    def finished(self) -> bool:
        """Return whether all bytes have been released and no more will come."""
        return self.ended and not self._queue

    def read(self, impairment: Impairment, now: int) -> None:
        """Read from the source."""
        data = self.source.recv(CHUNK_BYTES)
        if data:
            self._queue.append((self._arrival(impairment, len(data), now), data))
            self.bytes += len(data)
        else:
            self.ended = True

    def forward(self, now: int) -> None:
        """Send the bytes that are due, as far as the sink accepts them."""
        while self._queue and self._queue[0][0] <= now:
            due, data = self._queue.popleft()
            try:
                sent = self.sink.send(data)
            except BlockingIOError:
                sent = 0
            self.bytes -= sent
            if self.duplicate is not None:
                with suppress(BlockingIOError):
                    self.duplicate.send(data[:sent])
            if sent < len(data):
                self._queue.appendleft((due, data[sent:]))
                return

    def _arrival(self, impairment: Impairment, size: int, now: int) -> int:
        """Return when a chunk is released, never before the one ahead of it [ns]."""
        seconds = impairment.delay + impairment.jitter * self._random.random() + size / impairment.rate
        arrival = max(now + round(seconds * 1e9), self._last_ns + round(size / impairment.rate * 1e9))
        since = (now - self._taken_ns) * 1e-9 if self._taken_ns else 0.0
        if self._random.random() < impairment.stalls * since:
            arrival += STALL_NS
        self._taken_ns, self._last_ns = now, arrival
        return arrival


@dataclass(frozen=True, eq=False)
class Connection:
    """A peer's connection through the relay, and its duplicate."""

    up: Flow
    down: Flow

    @property
    def sockets(self) -> tuple[net.socket, ...]:
        """Return all its sockets."""
        ends = (self.up.source, self.up.sink, self.up.duplicate)
        return tuple(end for end in ends if end is not None)


class Relay:
    """The line of one peer, which listens at one port for each target, from `port` on."""

    def __init__(self, targets: Sequence[Place]) -> None:
        self.port = free_port()
        self._targets = targets
        self._listeners = [_listen(("127.0.0.1", self.port + channel)) for channel in range(len(targets))]
        self._connections: list[Connection] = []
        self._up = self._down = UNIMPAIRED
        self._holding = self._cutting = self._duplicating = self._ending = False
        self._made = 0
        self._waker, self._woken = net.socketpair()
        self._thread = threading.Thread(target=self._run, name=f"relay {self.port}", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self._ending = True
        self._wake()
        self._thread.join()
        for socket in (*self._listeners, self._waker, self._woken):
            socket.close()

    def impair(self, up: Impairment = UNIMPAIRED, down: Impairment = UNIMPAIRED) -> None:
        """Change the delay, jitter and stalls from now on: to the server, and from it."""
        self._up, self._down = up, down

    def hold(self) -> None:
        """Hold all bytes without losing any."""
        self._holding = True
        self._wake()

    def cut(self) -> None:
        """Reset all connections, old and new, until `restore`."""
        self._cutting = True
        self._wake()

    def restore(self) -> None:
        """End `hold` and `cut`."""
        self._holding = self._cutting = False
        self._wake()

    def duplicate(self, wanted: bool) -> None:
        """Turn the duplication of new connections on or off."""
        self._duplicating = wanted

    def _wake(self) -> None:
        self._waker.send(b"!")

    def _run(self) -> None:
        _request_real_time()
        while not self._ending:
            readable = self._wait()
            if self._cutting:
                self._drop(_reset, *self._connections)
            for connection in tuple(self._connections):
                self._serve(connection, readable)
        self._drop(_reset, *self._connections)

    def _wait(self) -> set[net.socket]:
        """Wait for activity, accept new connections, and return the sockets that are readable."""
        readers: list[net.socket] = [self._woken, *self._listeners]
        writers: list[net.socket] = []
        due = inf
        if not self._holding:
            now = now_ns()
            for flow in self._flows():
                if flow.open:
                    readers.append(flow.source)
                if flow.due_ns <= now:
                    writers.append(flow.sink)
                else:
                    due = min(due, flow.due_ns)
        left = None if due == inf else max(0.0, (due - now_ns()) * 1e-9)
        readable, _, _ = select.select(readers, writers, (), left)
        ready = set(readable)
        if self._woken in ready:
            self._woken.recv(CHUNK_BYTES)
        for channel, listener in enumerate(self._listeners):
            if listener in ready:
                self._admit(listener, self._targets[channel])
        return ready

    def _flows(self) -> list[Flow]:
        return [flow for connection in self._connections for flow in (connection.up, connection.down)]

    def _admit(self, listener: net.socket, target: Place) -> None:
        peer, _ = listener.accept()
        if self._cutting:
            _reset(peer)
            return
        try:
            server = net.create_connection(target, CONNECT_SECONDS)
            duplicate = net.create_connection(target, CONNECT_SECONDS) if self._duplicating else None
        except OSError:  # there is no server: refuse the peer's connection too
            _reset(peer)
            return
        self._made += 1
        up, down = Flow(peer, server, duplicate, 2 * self._made), Flow(server, peer, None, 2 * self._made + 1)
        connection = Connection(up, down)
        for socket in connection.sockets:
            socket.setblocking(False)
            socket.setsockopt(net.IPPROTO_TCP, net.TCP_NODELAY, 1)
        self._connections.append(connection)

    def _serve(self, connection: Connection, readable: set[net.socket]) -> None:
        """Forward bytes in both directions; when one end closes, close the other."""
        if self._holding:
            return
        finished = False
        try:
            for flow, impairment in ((connection.up, self._up), (connection.down, self._down)):
                if flow.source in readable:
                    flow.read(impairment, now_ns())
                flow.forward(now_ns())
                finished |= flow.finished
            if connection.up.duplicate is not None:
                with suppress(BlockingIOError):  # discard the server's answers to the duplicate connection
                    connection.up.duplicate.recv(CHUNK_BYTES)
        except OSError:  # one end has closed
            finished = True
        if finished:
            self._drop(net.socket.close, connection)

    def _drop(self, close: Callable[[net.socket], None], *connections: Connection) -> None:
        for connection in connections:
            for socket in connection.sockets:
                close(socket)
            self._connections.remove(connection)


def relay_to_server(port: int) -> Relay:
    """Return a relay to all channels of a server on this machine; the peer connects to `Relay.port` instead."""
    return Relay([("127.0.0.1", port + channel) for channel in range(len(CHANNELS))])


def _listen(place: Place) -> net.socket:
    listener = net.create_server(place, backlog=64)
    listener.setblocking(False)
    return listener


def _reset(socket: net.socket) -> None:
    """Close a connection with a reset, losing the bytes in transit."""
    socket.setsockopt(net.SOL_SOCKET, net.SO_LINGER, _RESET)
    socket.close()


def _request_real_time() -> None:
    """Request real-time priority for this thread."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except OSError as error:
        log.info("the relay runs without real-time scheduling (%s)", error.strerror)
