"""Every ZeroMQ socket of netboard, made in one place. With `netboard.doors`, the only one that imports zmq.

Rules that hold here: options are set before bind or connect (later ones do not take hold); the motion channel keeps at
most a few frames and never waits (the newest sample wins, an absent peer gets nothing stale); the log channel keeps
many and lingers; views are single frames, sent to who looks, and conflated where they are seen. With keys (a `Door` at
the server, `Credentials` at a peer) every frame is encrypted, and a peer is let in by its key, at the handshake. A cut
cable is noticed by TCP keepalive and, much earlier, by silence; not by ZeroMQ's heartbeats: libzmq 4.3.5 aborts a
process that was stopped for some seconds with full queues and heartbeats on. Sockets are used by the thread that made
them.
"""

import logging
import os
import secrets
import select
import socket as net
import stat
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias
from weakref import WeakKeyDictionary

import zmq
from zmq import Again, ZMQError

from netboard import doors
from netboard.config import Network, Side
from netboard.doors import NOBLOCK, Credentials, Door, readable
from netboard.errors import ConfigError, NetboardError

log = logging.getLogger(__name__)

Socket: TypeAlias = doors.Socket
Context: TypeAlias = doors.Context

MOTION, LOG, VIEW_LEFT, VIEW_RIGHT, CONTROL, NERVE = range(6)
"""Channels: TCP port = network.port + channel."""

CHANNELS = ("motion", "log", "view.left", "view.right", "control", "nerve")
"""Their names."""

VIEW: dict[Side, int] = {"left": VIEW_LEFT, "right": VIEW_RIGHT}
"""Channel of each station's views."""

MOTION_HWM = 4
LOG_HWM = 64
CONTROL_HWM = 1000
VIEW_HWM = 2
LOG_LINGER_MS = 2000
GOODBYE_LINGER_MS = 200
"""Last words on a channel that else lets nothing linger are given so long [ms]."""
LARGEST_FRAME = 2**20
"""Whoever sends a larger frame is cut off, before it is received [bytes]."""
LARGEST_REQUEST, LARGEST_REPORT = 2**13, 2**17
"""The same for what a server takes on the motion and log channels, and on the control channel [bytes]."""
LARGEST_SUBSCRIPTION = 2**10
"""The same for views, to which a peer only subscribes: each byte of that becomes a node of a tree [bytes]."""
KEEPALIVE_S = 1
KEEPALIVE_PROBES = 3
RECONNECT_IVL_MS = 100
RECONNECT_IVL_MAX_MS = 1000
RENEW_S = 2.0
"""Whoever finds nobody at the other end connects anew this often [s]."""
_renewed: WeakKeyDictionary[Socket, float] = WeakKeyDictionary()

SUBSCRIBED, UNSUBSCRIBED = b"\1", b"\0"
"""What an XPUB hears when the first one subscribes to everything, and when the last one leaves."""
MOST_SUBSCRIPTIONS = 16
"""Subscriptions heard in one go [1]."""
MOST_NAMES = 1000
"""Peers whose name has been found to go with their key, remembered [1]."""
NOBLOCK_MORE = int(zmq.NOBLOCK | zmq.SNDMORE)
"""A plain number, as `NOBLOCK`."""


# --- where the channels are --------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Endpoint:
    """Where a channel is bound or connected to.

    Attributes
    ----------
    address : str
        For ZeroMQ.
    channel : int
        Which one it is.
    lock : Door or Credentials or None
        The door that is bound there, or the keys to come in with; None where nothing is encrypted.
    """

    address: str
    channel: int = MOTION
    lock: Door | Credentials | None = None


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
    transport : str
        ``tcp`` or ``ipc``.
    lock : Door or Credentials or None
        At the server its door, at a peer its keys; None where nothing is encrypted.
    """

    host: str
    bind: str
    port: int
    transport: str = "tcp"
    lock: Door | Credentials | None = None

    def listen(self, channel: int) -> Endpoint:
        """Endpoint the server binds for a channel."""
        return self._endpoint(self.bind, channel)

    def reach(self, channel: int) -> Endpoint:
        """Endpoint a peer connects to for a channel."""
        return self._endpoint(self.host, channel)

    def pointer(self, side: Side) -> Endpoint:
        """Endpoint at which the agent of a side hears where its player points."""
        return self._beside("pointer", side)

    def felt(self, side: Side) -> Endpoint:
        """Endpoint at which the agent of a side says what its player would feel."""
        return self._beside("felt", side)

    def _beside(self, what: str, side: Side) -> Endpoint:
        """What display and agent of one side say to each other stays on the machine, and with its user.

        It is a socket of the file system whatever the transport: it takes no port, and nobody else who uses the
        machine can move a hand or see its force.
        """
        return Endpoint(f"ipc://{_own_folder() / f'{self.port}.{what}.{side}'}")

    def _endpoint(self, machine: str, channel: int) -> Endpoint:
        """The nerve does not leave the machine: who has two hands has them at one station."""
        port = self.port + channel
        inside = channel == NERVE
        if self.transport == "ipc":
            return Endpoint(f"ipc://{_own_folder() / str(port)}", channel, None if inside else self.lock)
        if inside:
            return Endpoint(f"tcp://127.0.0.1:{port}", channel)
        return Endpoint(f"tcp://{machine}:{port}", channel, self.lock)


def addresses(network: Network, lock: Door | Credentials | None = None) -> Addresses:
    """Take the addresses from the configuration."""
    return Addresses(network.host, network.bind, network.port, network.transport, lock)


def _own_folder() -> Path:
    """Where sockets of the file system are: a folder that is this user's alone.

    The same for every process of the user, whatever its environment.
    """
    if not hasattr(os, "getuid"):
        raise ConfigError(
            'this system has no sockets in its file system, which [network] transport = "ipc" needs, and '
            'device = "mouse"; expected "tcp", and another device'
        )
    folder = Path(f"/tmp/netboard-{os.getuid()}")
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or stat.S_IMODE(found.st_mode) != 0o700:
        raise NetboardError(f"{folder}: is not a folder of this user alone (mode 0700); remove it")
    return folder


# --- contexts ----------------------------------------------------------------------------------------------------


def library() -> str:
    """Which libzmq this is, and whether it cannot encrypt."""
    return f"libzmq {zmq.zmq_version()}{'' if zmq.has('curve') else ' without CURVE'}"


@contextmanager
def open_context(io_priority: int | None = None, io_cpus: Iterable[int] = ()) -> Iterator[Context]:
    """Make a context; on leaving, its sockets are closed and what lingers is sent.

    Parameters
    ----------
    io_priority : int or None
        SCHED_FIFO priority of libzmq's own thread; None: that of the thread that makes the first socket.
    io_cpus : iterable of int
        CPUs it runs on; empty: any. What the system refuses is said, and not asked of libzmq, which would abort.
    """
    context = Context()
    cpus = set(io_cpus)
    if io_priority is not None and _granted(
        f"SCHED_FIFO {io_priority}", lambda: os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(io_priority))
    ):
        context.set(zmq.THREAD_SCHED_POLICY, os.SCHED_FIFO)
        context.set(zmq.THREAD_PRIORITY, io_priority)
    if cpus and _granted(f"CPUs {sorted(cpus)}", lambda: os.sched_setaffinity(0, cpus)):
        for cpu in cpus:
            context.set(zmq.THREAD_AFFINITY_CPU_ADD, cpu)
    try:
        yield context
    finally:
        context.destroy()


def _granted(what: str, ask: Callable[[], None]) -> bool:
    """Whether the system gives a thread what it asks for, as one that is made for asking finds out."""
    refused: list[Exception] = []

    def find_out() -> None:
        try:
            ask()
        except (OSError, AttributeError) as error:
            refused.append(error)

    thread = threading.Thread(target=find_out)
    thread.start()
    thread.join()
    for error in refused:
        log.info("%s for the network's thread refused (%s); going on without it", what, error)
    return not refused


# --- sockets -----------------------------------------------------------------------------------------------------


class Router:
    """A ROUTER: frames of many peers, each with the peer's name.

    With keys a peer must be named after what its key is for, such as ``agent.left@`` and something of its own.

    Attributes
    ----------
    key : str
        Key with which the sender of the last frame came in (Z85); empty without keys.
    """

    def __init__(self, socket: Socket, endpoint: Endpoint) -> None:
        self.key = ""
        self.socket = socket
        self._door = endpoint.lock if isinstance(endpoint.lock, Door) else None
        self._channel = CHANNELS[endpoint.channel]
        self._names: dict[bytes, str] = {}
        self._owed: dict[bytes, bytes] = {}

    def receive(self) -> tuple[bytes, bytes] | None:
        """Next (peer, frame), or None if there is none now.

        What is not one frame, or comes under a name that is not the sender's, is taken for an empty frame, which no
        message is.
        """
        socket = self.socket
        if not readable(socket):  # quicker than an exception
            return None
        try:
            peer = socket.recv(NOBLOCK)
        except Again:
            return None
        frame = socket.recv(NOBLOCK, copy=False)
        if frame.more:
            while socket.getsockopt(zmq.RCVMORE):
                socket.recv(NOBLOCK)
            return peer, b""
        if self._door is None:
            return peer, frame.bytes
        return self.checked(peer, _property(frame, "User-Id"), _property(frame, "Peer-Address"), frame.bytes)

    def checked(self, peer: bytes, key: str, address: str, frame: bytes) -> tuple[bytes, bytes]:
        """(peer, frame) of what has just come in; under a name that is not the sender's an empty frame.

        Parameters
        ----------
        peer : bytes
            Name of the sender.
        key, address : str
            Its key (Z85), and where it is.
        frame : bytes
            What came.
        """
        self.key = key
        return peer, frame if self._door is None or self._rightly_named(self._door, peer, key, address) else b""

    def send(self, peer: bytes, frame: bytes) -> bool:
        """Send without waiting; False if the peer is gone or its queue is full."""
        try:
            self.socket.send(peer, NOBLOCK_MORE)  # refused here or not at all
            self.socket.send(frame, NOBLOCK)
        except ZMQError as error:
            if error.errno in (zmq.EAGAIN, zmq.EHOSTUNREACH):
                if error.errno == zmq.EHOSTUNREACH:
                    self._owed.pop(peer, None)
                return False
            raise
        return True

    def owe(self, peer: bytes, frame: bytes) -> None:
        """Send what a peer that is there must hear: if its queue is full now, whenever `pay` finds that it is not."""
        self._owed[peer] = frame
        self.pay()

    def pay(self) -> None:
        """Send whatever is still owed."""
        for peer, frame in list(self._owed.items()):
            if self.send(peer, frame):
                del self._owed[peer]

    @property
    def keyed(self) -> bool:
        """Whether peers come in by keys."""
        return self._door is not None

    def forbids(self, role: str, side: str) -> str:
        """Why the sender of the last frame may not speak as this; empty if it may, as everybody may without keys."""
        return "" if self._door is None else self._door.ring.forbids(self.key, role, side)

    def close_after_goodbye(self) -> None:
        """Close when the last words, which have just been sent, are gone."""
        self.socket.close(linger=GOODBYE_LINGER_MS)

    def _rightly_named(self, door: Door, peer: bytes, key: str, address: str) -> bool:
        """Whether a name goes with the key: it is looked up once."""
        if self._names.get(peer) == key:
            return True
        if peer.partition(b"@")[0] != door.ring.owner(key).encode():
            name = peer[:64].decode(errors="replace")
            door.refuse(self._channel, address, key, f"it calls itself {name}")
            return False
        if len(self._names) >= MOST_NAMES:
            self._names.clear()
        self._names[peer] = key
        return True


def _property(frame: zmq.Frame, name: str) -> str:
    """What libzmq knows of where a frame came from; empty if it does not, as of addresses in the file system."""
    try:
        return str(frame.get(name))
    except ZMQError:
        return ""


class Publisher:
    """The server's end of a view channel: knows whether anybody looks."""

    def __init__(self, socket: Socket) -> None:
        self.socket = socket
        self._wanted = False

    def wanted(self) -> bool:
        """Whether anybody has subscribed."""
        for _ in range(MOST_SUBSCRIPTIONS):
            if not readable(self.socket):
                break
            word = self.socket.recv(NOBLOCK)
            if word in (SUBSCRIBED, UNSUBSCRIBED):
                self._wanted = word == SUBSCRIBED
        return self._wanted

    def send(self, frame: bytes) -> bool:
        """Send to all who have subscribed and keep up, without waiting; False if nobody has."""
        if not self.wanted():
            return False
        self.socket.send(frame, NOBLOCK)
        return True

    def close(self) -> None:
        """Close at once."""
        self.socket.close()


class Waiter:
    """Waits until any of some sockets can be read.

    ZeroMQ's own poll counts in whole milliseconds, a tick. A socket's file descriptor only tells that something has
    changed, so what can be read is asked before and after every wait.

    Parameters
    ----------
    sockets : iterable of zmq.Socket
        All of them.
    """

    def __init__(self, sockets: Iterable[Socket]) -> None:
        self._sockets = tuple(sockets)
        self._by_file = {socket.fileno(): socket for socket in self._sockets}
        self._files = list(self._by_file)

    def wait(self, timeout: float) -> bool:
        """Wait at most so long [s]; whether there is something to read."""
        until = time.monotonic() + timeout
        changed: Iterable[Socket] = self._sockets
        while True:
            for socket in changed:
                if readable(socket):
                    return True
            left = until - time.monotonic()
            if left <= 0:
                return False
            files = select.select(self._files, (), (), left)[0]
            changed = [self._by_file[file] for file in files]

    def signalled(self, timeout: float) -> list[Socket]:
        """Wait at most so long for any that may be read [s].

        A signal comes only after a socket has been read until nothing is left, and what is done with a socket in
        between may swallow it: whoever waits like this looks at every socket now and then, signalled or not.
        """
        return [self._by_file[file] for file in select.select(self._files, (), (), max(timeout, 0.0))[0]]


def _make(context: Context, kind: int, hwm: int, linger_ms: int = 0, largest: int = LARGEST_FRAME) -> Socket:
    """A socket with the options every link has."""
    socket: Socket = context.socket(kind)
    socket.setsockopt(zmq.LINGER, linger_ms)
    socket.setsockopt(zmq.SNDHWM, hwm)
    socket.setsockopt(zmq.RCVHWM, hwm)
    socket.setsockopt(zmq.MAXMSGSIZE, largest)
    socket.setsockopt(zmq.TCP_KEEPALIVE, 1)
    socket.setsockopt(zmq.TCP_KEEPALIVE_IDLE, KEEPALIVE_S)
    socket.setsockopt(zmq.TCP_KEEPALIVE_INTVL, KEEPALIVE_S)
    socket.setsockopt(zmq.TCP_KEEPALIVE_CNT, KEEPALIVE_PROBES)
    socket.setsockopt(zmq.RECONNECT_IVL, RECONNECT_IVL_MS)
    socket.setsockopt(zmq.RECONNECT_IVL_MAX, RECONNECT_IVL_MAX_MS)
    return socket


def _bind(context: Context, socket: Socket, endpoint: Endpoint) -> Socket:
    """Bind, or say in words why not."""
    if isinstance(endpoint.lock, Door):
        endpoint.lock.guard(context, socket, CHANNELS[endpoint.channel])
    try:
        _refuse_taken(endpoint.address)
        socket.bind(endpoint.address)
    except ZMQError as error:
        socket.close()
        raise NetboardError(
            f"cannot listen on {endpoint.address}: {error.strerror}; is another server running?"
        ) from error
    return socket


def _refuse_taken(address: str) -> None:
    """Find out whether somebody listens on a socket of the file system: libzmq would just take it away.

    Raises
    ------
    ZMQError
        If somebody does. What a dead process has left is no obstacle.
    """
    if not address.startswith("ipc://"):
        return
    with net.socket(net.AF_UNIX) as probe:
        try:
            probe.connect(address.removeprefix("ipc://"))
        except (FileNotFoundError, ConnectionRefusedError):
            return
    raise ZMQError(zmq.EADDRINUSE)


def _connect(socket: Socket, endpoint: Endpoint) -> Socket:
    """Connect, or say in words why not; that nobody is there yet is no error."""
    if isinstance(endpoint.lock, Credentials):
        socket.setsockopt(zmq.CURVE_SERVERKEY, endpoint.lock.server.encode())
        socket.setsockopt(zmq.CURVE_PUBLICKEY, endpoint.lock.public.encode())
        socket.setsockopt(zmq.CURVE_SECRETKEY, endpoint.lock.secret.encode())
    try:
        socket.connect(endpoint.address)
    except ZMQError as error:
        socket.close()
        raise NetboardError(f"cannot connect to {endpoint.address}: {error.strerror}") from error
    return socket


def _router(context: Context, endpoint: Endpoint, hwm: int, largest: int, linger_ms: int = 0) -> Router:
    """A ROUTER that reports unroutable messages and lets a restarted peer take over its name."""
    socket = _make(context, zmq.ROUTER, hwm, linger_ms, largest)
    socket.setsockopt(zmq.ROUTER_MANDATORY, 1)
    socket.setsockopt(zmq.ROUTER_HANDOVER, 1)
    return Router(_bind(context, socket, endpoint), endpoint)


def _dealer(context: Context, endpoint: Endpoint, identity: str, hwm: int, linger_ms: int = 0) -> Socket:
    """A DEALER with a name, that queues nothing for a server that is not there.

    With keys the name ends in what nobody can guess: who connects under another one's name gets what is sent to it.
    """
    socket = _make(context, zmq.DEALER, hwm, linger_ms)
    if endpoint.lock is not None:
        identity += f".{secrets.token_hex(8)}"
    socket.setsockopt(zmq.IDENTITY, identity.encode())
    socket.setsockopt(zmq.IMMEDIATE, 1)
    return _connect(socket, endpoint)


def motion_server(context: Context, endpoint: Endpoint) -> Router:
    """Server end of the motion channel."""
    return _router(context, endpoint, MOTION_HWM, LARGEST_REQUEST)


def motion_agent(context: Context, endpoint: Endpoint, identity: str) -> Socket:
    """Agent end of the motion channel."""
    return _dealer(context, endpoint, identity, MOTION_HWM)


def log_server(context: Context, endpoint: Endpoint) -> Router:
    """Server end of the log channel."""
    return _router(context, endpoint, LOG_HWM, LARGEST_REQUEST, LOG_LINGER_MS)


def log_client(context: Context, endpoint: Endpoint, identity: str) -> Socket:
    """Logger end of the log channel."""
    return _dealer(context, endpoint, identity, LOG_HWM, LOG_LINGER_MS)


def control_server(context: Context, endpoint: Endpoint) -> Router:
    """Server end of the control channel."""
    return _router(context, endpoint, CONTROL_HWM, LARGEST_REPORT)


def control_client(context: Context, endpoint: Endpoint, identity: str) -> Socket:
    """Peer end of the control channel."""
    return _dealer(context, endpoint, identity, CONTROL_HWM)


def view_publisher(context: Context, endpoint: Endpoint) -> Publisher:
    """Server end of one station's view channel."""
    socket = _make(context, zmq.XPUB, VIEW_HWM, largest=LARGEST_SUBSCRIPTION)
    return Publisher(_bind(context, socket, endpoint))


def view_subscriber(context: Context, endpoint: Endpoint) -> Socket:
    """Station end of its view channel: the newest view only."""
    socket = _make(context, zmq.SUB, 1)
    socket.setsockopt(zmq.CONFLATE, 1)
    socket.setsockopt(zmq.SUBSCRIBE, b"")
    return _connect(socket, endpoint)


def nerve_sender(context: Context, endpoint: Endpoint) -> Socket:
    """Where the brain of a simulated bimanual participant sends what the other hand shall do."""
    return _bind(context, _make(context, zmq.PUSH, CONTROL_HWM), endpoint)


def nerve_receiver(context: Context, endpoint: Endpoint) -> Socket:
    """Where that other hand receives it."""
    socket = _make(context, zmq.PULL, CONTROL_HWM)
    return _connect(socket, endpoint)


def pointer_sender(context: Context, endpoint: Endpoint) -> Socket:
    """Where a played display says where its player points; the newest counts, and nothing is kept for later."""
    socket = _make(context, zmq.PUSH, 1)
    socket.setsockopt(zmq.CONFLATE, 1)
    socket.setsockopt(zmq.IMMEDIATE, 1)
    return _connect(socket, endpoint)


def pointer_receiver(context: Context, endpoint: Endpoint) -> Socket:
    """Where the agent of that side hears it."""
    socket = _make(context, zmq.PULL, 1)
    socket.setsockopt(zmq.CONFLATE, 1)
    return _bind(context, socket, endpoint)


felt_publisher, felt_subscriber = view_publisher, view_subscriber
"""Where that agent says what its player would feel, and where the display hears it: like views."""


def receive(socket: Socket) -> bytes | None:
    """Next frame of a one-frame socket, or None if there is none now."""
    try:
        return socket.recv(zmq.NOBLOCK)
    except Again:
        return None


def send(socket: Socket, frame: bytes) -> bool:
    """Send without waiting; False if nobody is there or the queue is full."""
    try:
        socket.send(frame, zmq.NOBLOCK)
    except Again:
        return False
    return True


def send_or_renew(socket: Socket, frame: bytes) -> bool:
    """Send as `send` does; where nobody is there, connect anew, for the next time."""
    if send(socket, frame):
        return True
    renew(socket)
    return False


def renew(socket: Socket) -> None:
    """Connect anew, unless it was done lately: after a handshake that failed libzmq itself never tries again."""
    now = time.monotonic()
    if now - _renewed.setdefault(socket, now) < RENEW_S:
        return
    _renewed[socket] = now
    endpoint = socket.getsockopt_string(zmq.LAST_ENDPOINT)
    socket.disconnect(endpoint)
    socket.connect(endpoint)


def close_after_goodbye(socket: Socket) -> None:
    """Close a socket whose last words have just been sent."""
    socket.close(linger=GOODBYE_LINGER_MS)


def wait_signal(socket: Socket, timeout: float) -> bool:
    """Wait until something may have come, at most so long [s]: quicker than being sure of it."""
    return readable(socket) or bool(select.select((socket.fileno(),), (), (), timeout)[0])


def wait_readable(socket: Socket, timeout: float) -> bool:
    """Wait until a socket can be read, at most so long [s]; for one socket alone, as `Waiter` does."""
    until = time.monotonic() + timeout
    while not readable(socket):
        left = until - time.monotonic()
        if left <= 0:
            return False
        select.select((socket.fileno(),), (), (), left)
    return True
