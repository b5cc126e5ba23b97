"""Every ZeroMQ socket of netboard, made in one place. The only module that imports zmq.

Rules that hold here: options are set before bind or connect (later ones do not take hold); the motion channel keeps at
most a few frames and never waits (the newest sample wins, an absent peer gets nothing stale); the log channel keeps
many and lingers; views are single frames and conflated. A cut cable is noticed by TCP keepalive and, much earlier, by
silence; not by ZeroMQ's heartbeats: libzmq 4.3.5 aborts a process that was stopped for some seconds with full queues
and heartbeats on. Sockets are used by the thread that made them.
"""

import select
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeAlias

import zmq
from zmq import Again, ZMQError

from netboard.config import Network, Side
from netboard.errors import NetboardError

Socket: TypeAlias = "zmq.Socket[bytes]"
Context: TypeAlias = "zmq.Context[zmq.Socket[bytes]]"

MOTION, LOG, VIEW_LEFT, VIEW_RIGHT, CONTROL, NERVE = range(6)
"""Channels: TCP port = network.port + channel."""

VIEW: dict[Side, int] = {"left": VIEW_LEFT, "right": VIEW_RIGHT}
"""Channel of each station's views."""

MOTION_HWM = 4
LOG_HWM = 64
CONTROL_HWM = 1000
LOG_LINGER_MS = 2000
GOODBYE_LINGER_MS = 200
"""Last words on a channel that else lets nothing linger are given so long [ms]."""
LARGEST_FRAME = 2**20
"""Whoever sends a larger frame is cut off, before it is received [bytes]."""
KEEPALIVE_S = 1
KEEPALIVE_PROBES = 3
RECONNECT_IVL_MS = 100
RECONNECT_IVL_MAX_MS = 1000


@dataclass(frozen=True, slots=True)
class Addresses:
    """Where the channels are.

    Attributes
    ----------
    host : str
        Where peers connect to.
    bind : str
        What the server binds to.
    port : int
        Port of channel 0.
    """

    host: str
    bind: str
    port: int

    def listen(self, channel: int) -> str:
        """Endpoint the server binds for a channel."""
        return f"tcp://{self.bind}:{self.port + channel}"

    def reach(self, channel: int) -> str:
        """Endpoint a peer connects to for a channel."""
        return f"tcp://{self.host}:{self.port + channel}"


def addresses(network: Network) -> Addresses:
    """Take the addresses from the configuration."""
    return Addresses(network.host, network.bind, network.port)


@contextmanager
def open_context() -> Iterator[Context]:
    """Make a context; on leaving, its sockets are closed and what lingers is sent."""
    context: Context = zmq.Context()
    try:
        yield context
    finally:
        context.destroy()


def _make(context: Context, kind: int, hwm: int, linger_ms: int = 0) -> Socket:
    """A socket with the options every link has."""
    socket = context.socket(kind)
    socket.setsockopt(zmq.LINGER, linger_ms)
    socket.setsockopt(zmq.SNDHWM, hwm)
    socket.setsockopt(zmq.RCVHWM, hwm)
    socket.setsockopt(zmq.MAXMSGSIZE, LARGEST_FRAME)
    socket.setsockopt(zmq.TCP_KEEPALIVE, 1)
    socket.setsockopt(zmq.TCP_KEEPALIVE_IDLE, KEEPALIVE_S)
    socket.setsockopt(zmq.TCP_KEEPALIVE_INTVL, KEEPALIVE_S)
    socket.setsockopt(zmq.TCP_KEEPALIVE_CNT, KEEPALIVE_PROBES)
    socket.setsockopt(zmq.RECONNECT_IVL, RECONNECT_IVL_MS)
    socket.setsockopt(zmq.RECONNECT_IVL_MAX, RECONNECT_IVL_MAX_MS)
    return socket


def _bind(socket: Socket, endpoint: str) -> Socket:
    """Bind, or say in words why not."""
    try:
        socket.bind(endpoint)
    except ZMQError as error:
        socket.close()
        raise NetboardError(f"cannot listen on {endpoint}: {error.strerror}; is another server running?") from error
    return socket


def _connect(socket: Socket, endpoint: str) -> Socket:
    """Connect, or say in words why not; that nobody is there yet is no error."""
    try:
        socket.connect(endpoint)
    except ZMQError as error:
        socket.close()
        raise NetboardError(f"cannot connect to {endpoint}: {error.strerror}") from error
    return socket


def _router(context: Context, endpoint: str, hwm: int, linger_ms: int = 0) -> Socket:
    """A ROUTER that reports unroutable messages and lets a restarted peer take over its name."""
    socket = _make(context, zmq.ROUTER, hwm, linger_ms)
    socket.setsockopt(zmq.ROUTER_MANDATORY, 1)
    socket.setsockopt(zmq.ROUTER_HANDOVER, 1)
    return _bind(socket, endpoint)


def _dealer(context: Context, endpoint: str, identity: str, hwm: int, linger_ms: int = 0) -> Socket:
    """A DEALER with a name, that queues nothing for a server that is not there."""
    socket = _make(context, zmq.DEALER, hwm, linger_ms)
    socket.setsockopt(zmq.IDENTITY, identity.encode())
    socket.setsockopt(zmq.IMMEDIATE, 1)
    return _connect(socket, endpoint)


def motion_server(context: Context, endpoint: str) -> Socket:
    """Server end of the motion channel."""
    return _router(context, endpoint, MOTION_HWM)


def motion_agent(context: Context, endpoint: str, identity: str) -> Socket:
    """Agent end of the motion channel."""
    return _dealer(context, endpoint, identity, MOTION_HWM)


def log_server(context: Context, endpoint: str) -> Socket:
    """Server end of the log channel."""
    return _router(context, endpoint, LOG_HWM, LOG_LINGER_MS)


def log_client(context: Context, endpoint: str, identity: str) -> Socket:
    """Logger end of the log channel."""
    return _dealer(context, endpoint, identity, LOG_HWM, LOG_LINGER_MS)


def control_server(context: Context, endpoint: str) -> Socket:
    """Server end of the control channel."""
    return _router(context, endpoint, CONTROL_HWM)


def control_client(context: Context, endpoint: str, identity: str) -> Socket:
    """Peer end of the control channel."""
    return _dealer(context, endpoint, identity, CONTROL_HWM)


def view_publisher(context: Context, endpoint: str) -> Socket:
    """Server end of one station's view channel: the newest view only.

    A view written while the one before is being read is lost (libzmq's conflated pipe); the next one makes up for it.
    """
    socket = _make(context, zmq.PUB, 1)
    socket.setsockopt(zmq.CONFLATE, 1)
    return _bind(socket, endpoint)


def view_subscriber(context: Context, endpoint: str) -> Socket:
    """Station end of its view channel: the newest view only."""
    socket = _make(context, zmq.SUB, 1)
    socket.setsockopt(zmq.CONFLATE, 1)
    socket.setsockopt(zmq.SUBSCRIBE, b"")
    return _connect(socket, endpoint)


def nerve_sender(context: Context, endpoint: str) -> Socket:
    """Where the brain of a simulated bimanual participant sends what the other hand shall do."""
    return _bind(_make(context, zmq.PUSH, CONTROL_HWM), endpoint)


def nerve_receiver(context: Context, endpoint: str) -> Socket:
    """Where that other hand receives it."""
    socket = _make(context, zmq.PULL, CONTROL_HWM)
    return _connect(socket, endpoint)


def receive(socket: Socket) -> bytes | None:
    """Next frame of a one-frame socket, or None if there is none now."""
    try:
        return socket.recv(zmq.NOBLOCK)
    except Again:
        return None


def receive_from(socket: Socket) -> tuple[bytes, bytes] | None:
    """Next (sender, frame) of a ROUTER, or None if there is none now. What is not of that shape is dropped."""
    while True:
        try:
            parts = socket.recv_multipart(zmq.NOBLOCK)
        except Again:
            return None
        if len(parts) == 2:
            return parts[0], parts[1]


def send(socket: Socket, frame: bytes) -> bool:
    """Send without waiting; False if nobody is there or the queue is full."""
    try:
        socket.send(frame, zmq.NOBLOCK)
    except Again:
        return False
    return True


def send_to(socket: Socket, peer: bytes, frame: bytes) -> bool:
    """Send to one peer of a ROUTER without waiting; False if it is gone or its queue is full."""
    try:
        socket.send_multipart((peer, frame), zmq.NOBLOCK)
    except ZMQError as error:
        if error.errno in (zmq.EAGAIN, zmq.EHOSTUNREACH):
            return False
        raise
    return True


def close_after_goodbye(socket: Socket) -> None:
    """Close a socket whose last words have just been sent."""
    socket.close(linger=GOODBYE_LINGER_MS)


def wait_readable(socket: Socket, timeout: float) -> bool:
    """Wait until a socket can be read, at most so long [s].

    ZeroMQ's own poll counts in whole milliseconds, a tick. Its file descriptor only tells that something has changed,
    so what can be read is asked before and after every wait.
    """
    until = time.monotonic() + timeout
    while not int(socket.getsockopt(zmq.EVENTS)) & zmq.POLLIN:
        left = until - time.monotonic()
        if left <= 0:
            return False
        select.select((socket.fileno(),), (), (), left)
    return True
