"""Makes every ZeroMQ socket of netboard. `endpoints` has what the server does with its sockets.

Rules: options are set before bind or connect, because later ones have no effect. The motion channel queues a few frames
at most and never waits: the newest sample wins, and an absent peer gets nothing stale. The log channel queues many
frames and lingers. Views are single frames, sent to subscribers and conflated by them. With keys (`Authenticator` at
the server, `Credentials` at a peer) every frame is encrypted, and peers are authenticated at the handshake. A broken
connection is detected by TCP keepalive and, much earlier, by silence. ZeroMQ's heartbeats are off: with them, libzmq
4.3.5 aborts a process that was stopped for some seconds with full queues. A socket is used by the thread that made it.
"""

import logging
import os
import secrets
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

from netboard.base.errors import NetboardError
from netboard.base.system.scheduling import scheduling
from netboard.network.transport import authenticator
from netboard.network.transport.addresses import IN_USE, host_and_port, is_ipv6, local_address, refuse_taken, url_of
from netboard.network.transport.authenticator import Authenticator, Credentials, SharedKey, readable
from netboard.network.transport.channels import CONTROL, LOG, NAMES, PARTNER, VIEW, Endpoint
from netboard.network.transport.endpoints import GOODBYE_LINGER_MS, Publisher, Router
from netboard.network.transport.names import Name, is_numeric, known

log = logging.getLogger(__name__)

Socket: TypeAlias = authenticator.Socket
Context: TypeAlias = authenticator.Context

MOTION_HWM = 16
LOG_HWM = 64
CONTROL_HWM = 1000
CONTROL_SERVER_HWM, SERVER_RECEIVE_HWM = 64, 16
"""Messages queued for a peer, and from a peer, at the server.

Queued messages take memory, and allocating much of it at once would hold up the tick. But reading a queue wakes the
thread at its other end each time that half of the queue has been read: with 4 messages, at every second one [1].
"""
HANDSHAKE_MS = 5_000
"""Time after which a connection without a complete handshake is closed: it holds a file of the server [ms]."""

VIEW_HWM = 2
LOG_LINGER_MS = 2000
MAX_FRAME = 2**20
"""Size above which a frame is rejected unread and its sender disconnected [bytes]."""
MAX_SAMPLE, MAX_REQUEST = 2**12 + 2**8, 2**13 + 2**8
"""The same limit for frames to the server on the motion channel, and on the log and control channels [bytes].

This is a peer's largest message plus the overhead of encryption.
"""
MAX_SUBSCRIPTION = 2**10
"""The same limit for the view channels: each byte of a subscription becomes a node of a tree in the server [bytes]."""
_THREADS = {CONTROL: 0, LOG: 1, **dict.fromkeys((*VIEW.values(), *PARTNER.values()), 2)}
"""Thread of the second context that serves each channel that may wait."""
IO_THREAD = "ZMQbg/IO"
"""Prefix of the names of libzmq's threads that exchange frames."""
START_S = 1.0
"""Time within which these threads have started [s]."""
# A pulled cable is noticed within seconds; the default of Linux is two hours.
KEEPALIVE_S = 1
KEEPALIVE_PROBES = 3
RECONNECT_IVL_MS = 100
RECONNECT_IVL_MAX_MS = 1000
RENEW_S, MAX_RENEW_S = 2.0, 16.0
"""Time after which a peer that finds no server reconnects, doubled each time up to the longest [s].

A server that is slow to answer must not get new handshakes before it has answered.
"""
_renewed: WeakKeyDictionary[Socket, tuple[float, float]] = WeakKeyDictionary()


@dataclass(slots=True)
class Target:
    """The server of a socket that connects by name, and the address of it that is in use."""

    name: Name
    port: str
    address: str = ""  # empty while the name is not resolved
    turn: int = 0  # which of the name's addresses is tried next


_targets: WeakKeyDictionary[Socket, Target] = WeakKeyDictionary()


# --- contexts ----------------------------------------------------------------------------------------------------


def library() -> str:
    """Return the version of libzmq, and a note if it cannot encrypt."""
    return f"libzmq {zmq.zmq_version()}{'' if zmq.has('curve') else ' without CURVE'}"


@contextmanager
def open_context(
    io_priority: int | None = None, io_cpus: Iterable[int] = (), *, best_effort: bool = False, loop_priority: int = 0
) -> Iterator[Context]:
    """Make a context; on leaving, its sockets are closed and lingering frames are sent.

    ``io_priority``: SCHED_FIFO priority of libzmq's own thread; None: that of the thread that makes the first socket.
    ``io_cpus``: CPUs on which it runs; empty: any. A setting that the system refuses is logged and not given to libzmq,
    which would abort. ``best_effort``: make the server's sockets of all channels but motion in a second context, with
    its own threads, on any CPU and without priority. Handshakes there take no time from the motion channel.
    ``loop_priority``: priority of the loop that uses the context: while handshakes are being refused, libzmq's thread
    runs below it; 0: never.
    """
    context = Context()
    if best_effort:
        context.best_effort = _best_effort_context()
    cpus = set(io_cpus)
    if (
        io_priority is not None
        and scheduling.policy is not None
        and _is_granted(f"priority {io_priority}", lambda: scheduling.set_priority(io_priority))
    ):
        # Before the first socket, with which libzmq starts its threads.
        context.set(zmq.THREAD_SCHED_POLICY, scheduling.policy)
        context.set(zmq.THREAD_PRIORITY, io_priority)
    if cpus and _is_granted(f"CPUs {sorted(cpus)}", lambda: scheduling.stay_on(cpus)):
        for cpu in cpus:
            context.set(zmq.THREAD_AFFINITY_CPU_ADD, cpu)
    if loop_priority and io_priority is not None:
        context.threads, context.above, context.below = _started_threads(context), io_priority, loop_priority - 1
    try:
        yield context
    finally:
        if context.best_effort is not None:
            context.best_effort.destroy()
        context.destroy()


def _started_threads(context: Context) -> tuple[int, ...]:
    """Start the threads of a context and return those that exchange frames; empty if the system lists none."""
    tasks = Path("/proc/self/task")
    if not tasks.exists():
        return ()
    before = {task.name for task in tasks.iterdir()}
    context.socket(zmq.PAIR).close()
    end = time.monotonic() + START_S
    while time.monotonic() < end:  # each thread sets its name when it begins
        new = [task for task in tasks.iterdir() if task.name not in before]
        found = tuple(int(task.name) for task in new if (task / "comm").read_text().startswith(IO_THREAD))
        if found:
            return found
        time.sleep(START_S / 100)
    return ()


def _best_effort_context() -> Context:
    """Return a context whose threads may run on any CPU, whatever the affinity of the calling thread."""
    context = Context(io_threads=len(_THREADS))
    cpus = range(os.cpu_count() or 1)
    if _is_granted("any CPU", lambda: scheduling.stay_on(cpus)):
        for cpu in cpus:
            context.set(zmq.THREAD_AFFINITY_CPU_ADD, cpu)
    return context


def _context_for(context: Context, endpoint: Endpoint) -> tuple[Context, int]:
    """Return the context of a server's socket, and the bit mask of its threads that serve the channel."""
    thread = _THREADS.get(endpoint.channel)
    if context.best_effort is None or thread is None:
        return context, 0
    return context.best_effort, 1 << thread


def _is_granted(setting: str, request: Callable[[], None]) -> bool:
    """Return whether the system grants a thread a setting; it is requested in a thread made for that."""
    errors: list[OSError] = []

    def try_it() -> None:
        try:
            request()
        except OSError as error:
            errors.append(error)

    thread = threading.Thread(target=try_it)
    thread.start()
    thread.join()
    for error in errors:
        log.info("%s for ZeroMQ's thread refused (%s); continuing without it", setting, error)
    return not errors


# --- sockets -----------------------------------------------------------------------------------------------------


def _make(context: Context, kind: int, hwm: int, linger_ms: int = 0, largest: int = MAX_FRAME) -> Socket:
    """Make a socket with the options that all have in common."""
    socket: Socket = context.socket(kind)
    # By default libzmq lingers for ever: a process whose peer is gone would not end.
    socket.setsockopt(zmq.LINGER, linger_ms)
    socket.setsockopt(zmq.SNDHWM, hwm)
    socket.setsockopt(zmq.RCVHWM, hwm)
    socket.setsockopt(zmq.MAXMSGSIZE, largest)
    socket.setsockopt(zmq.HANDSHAKE_IVL, HANDSHAKE_MS)
    socket.setsockopt(zmq.TCP_KEEPALIVE, 1)
    socket.setsockopt(zmq.TCP_KEEPALIVE_IDLE, KEEPALIVE_S)
    socket.setsockopt(zmq.TCP_KEEPALIVE_INTVL, KEEPALIVE_S)
    socket.setsockopt(zmq.TCP_KEEPALIVE_CNT, KEEPALIVE_PROBES)
    socket.setsockopt(zmq.RECONNECT_IVL, RECONNECT_IVL_MS)
    socket.setsockopt(zmq.RECONNECT_IVL_MAX, RECONNECT_IVL_MAX_MS)
    return socket


def _bind(context: Context, socket: Socket, endpoint: Endpoint) -> Socket:
    """Bind, or raise an error that says why not."""
    match endpoint.security:
        case Authenticator() as keys:
            keys.guard(context, socket, NAMES[endpoint.channel])
        case SharedKey() as key:
            socket.setsockopt(zmq.CURVE_SERVER, 1)
            socket.setsockopt(zmq.CURVE_SECRETKEY, key.secret.encode())
    try:
        address = local_address(endpoint.address)
        refuse_taken(address)
        socket.setsockopt(zmq.IPV6, is_ipv6(address))
        socket.bind(address)
    except ZMQError as error:
        socket.close()
        advice = "is another server running?" if error.errno in IN_USE else "check [network] bind; is that network up?"
        raise NetboardError(f"cannot listen on {endpoint.address}: {error.strerror}; {advice}") from error
    except NetboardError:
        socket.close()
        raise
    return socket


def _connect(socket: Socket, endpoint: Endpoint) -> Socket:
    """Connect, or raise an error that says why not; a missing server, or one without an address yet, is no error."""
    if isinstance(endpoint.security, Credentials | SharedKey):
        key = endpoint.security
        server = key.server if isinstance(key, Credentials) else key.public
        socket.setsockopt(zmq.CURVE_SERVERKEY, server.encode())
        socket.setsockopt(zmq.CURVE_PUBLICKEY, key.public.encode())
        socket.setsockopt(zmq.CURVE_SECRETKEY, key.secret.encode())
    host, port = host_and_port(endpoint.address)
    try:
        if host and not is_numeric(host):
            _targets[socket] = target = Target(known(host), port)
            target.name.wait()
            _connect_next(socket, target)
        else:
            socket.setsockopt(zmq.IPV6, is_ipv6(endpoint.address))
            socket.connect(endpoint.address)
    except ZMQError as error:
        socket.close()
        raise NetboardError(f"cannot connect to {endpoint.address}: {error.strerror}") from error
    return socket


def _connect_next(socket: Socket, target: Target) -> None:
    """Connect to the next address of a name, instead of the one before; to none while the name is not resolved."""
    if target.address:
        socket.disconnect(target.address)
        target.address = ""
    if addresses := target.name.addresses:
        address = url_of(addresses[target.turn % len(addresses)], target.port)
        target.turn += 1
        socket.setsockopt(zmq.IPV6, is_ipv6(address))
        socket.connect(address)
        target.address = address


def _router(context: Context, endpoint: Endpoint, hwm: int, largest: int, linger_ms: int = 0) -> Router:
    """Make a ROUTER that reports unroutable messages and lets a restarted peer take over its name."""
    context, threads = _context_for(context, endpoint)
    socket = _make(context, zmq.ROUTER, hwm, linger_ms, largest)
    socket.setsockopt(zmq.RCVHWM, min(hwm, SERVER_RECEIVE_HWM))
    socket.setsockopt(zmq.AFFINITY, threads)
    # Otherwise libzmq drops silently what it cannot send, and refuses a restarted peer while its old connection lasts.
    socket.setsockopt(zmq.ROUTER_MANDATORY, 1)
    socket.setsockopt(zmq.ROUTER_HANDOVER, 1)
    return Router(_bind(context, socket, endpoint), endpoint)


def _dealer(context: Context, endpoint: Endpoint, identity: str, hwm: int, linger_ms: int = 0) -> Socket:
    """Make a DEALER with a name, which queues nothing for a server that is not there.

    With keys the name ends in a random part, because a peer that connects under another's name gets its messages.
    """
    socket = _make(context, zmq.DEALER, hwm, linger_ms)
    if endpoint.security is not None:
        identity += f".{secrets.token_hex(8)}"
    socket.setsockopt(zmq.IDENTITY, identity.encode())
    socket.setsockopt(zmq.IMMEDIATE, 1)
    return _connect(socket, endpoint)


def motion_server(context: Context, endpoint: Endpoint) -> Router:
    """Make the server's socket of the motion channel."""
    return _router(context, endpoint, MOTION_HWM, MAX_SAMPLE)


def motion_agent(context: Context, endpoint: Endpoint, identity: str) -> Socket:
    """Make the agent's socket of the motion channel."""
    return _dealer(context, endpoint, identity, MOTION_HWM)


def log_server(context: Context, endpoint: Endpoint) -> Router:
    """Make the server's socket of the log channel."""
    return _router(context, endpoint, LOG_HWM, MAX_REQUEST, LOG_LINGER_MS)


def log_client(context: Context, endpoint: Endpoint, identity: str) -> Socket:
    """Make a logger's or subscriber's socket of the log channel."""
    return _dealer(context, endpoint, identity, LOG_HWM, LOG_LINGER_MS)


def control_server(context: Context, endpoint: Endpoint) -> Router:
    """Make the server's socket of the control channel."""
    return _router(context, endpoint, CONTROL_SERVER_HWM, MAX_REQUEST)


def control_client(context: Context, endpoint: Endpoint, identity: str) -> Socket:
    """Make a peer's socket of the control channel."""
    return _dealer(context, endpoint, identity, CONTROL_HWM)


station_server, station_client = control_server, control_client
"""The sockets of a station's service and of the machine that uses it queue as those of the control channel do."""


def view_publisher(context: Context, endpoint: Endpoint) -> Publisher:
    """Make the server's socket of one station's view channel."""
    context, threads = _context_for(context, endpoint)
    socket = _make(context, zmq.XPUB, VIEW_HWM, largest=MAX_SUBSCRIPTION)
    socket.setsockopt(zmq.AFFINITY, threads)
    return Publisher(_bind(context, socket, endpoint))


def view_subscriber(context: Context, endpoint: Endpoint) -> Socket:
    """Make a station's socket of its view channel, which keeps only the newest view."""
    socket = _make(context, zmq.SUB, 1)
    # libzmq keeps only one part of a conflated message, so a view must stay a single frame.
    socket.setsockopt(zmq.CONFLATE, 1)
    socket.setsockopt(zmq.SUBSCRIBE, b"")
    return _connect(socket, endpoint)


def moves_sender(context: Context, endpoint: Endpoint) -> Socket:
    """Make the socket with which the brain of a simulated bimanual participant commands the other hand."""
    return _bind(context, _make(context, zmq.PUSH, CONTROL_HWM), endpoint)


def moves_receiver(context: Context, endpoint: Endpoint) -> Socket:
    """Make the socket at which that other hand receives its commands."""
    return _connect(_make(context, zmq.PULL, CONTROL_HWM), endpoint)


def pointer_sender(context: Context, endpoint: Endpoint) -> Socket:
    """Make the socket with which a player's display sends the pointer's position; only the newest counts."""
    socket = _make(context, zmq.PUSH, 1)
    socket.setsockopt(zmq.CONFLATE, 1)
    socket.setsockopt(zmq.IMMEDIATE, 1)
    return _connect(socket, endpoint)


def pointer_receiver(context: Context, endpoint: Endpoint) -> Socket:
    """Make the socket at which the agent of that side receives the pointer's position."""
    socket = _make(context, zmq.PULL, 1)
    socket.setsockopt(zmq.CONFLATE, 1)
    return _bind(context, socket, endpoint)


felt_publisher, felt_subscriber = view_publisher, view_subscriber
"""The force on a player's hand, from its agent to the display, is sent like views."""


def receive(socket: Socket) -> bytes | None:
    """Return the next frame of a single-frame socket, or None if there is none now."""
    return socket.recv(zmq.NOBLOCK) if readable(socket) else None


def send(socket: Socket, frame: bytes) -> bool:
    """Send without waiting; return False if no peer is connected or the queue is full."""
    try:
        socket.send(frame, zmq.NOBLOCK)
    except Again:
        return False
    return True


def send_or_renew(socket: Socket, frame: bytes) -> bool:
    """Send as `send` does; if no peer is connected, reconnect for the next call."""
    if send(socket, frame):
        _renewed.pop(socket, None)
        return True
    renew(socket)
    return False


def renew(socket: Socket) -> None:
    """Reconnect, unless that was done recently: libzmq itself does not retry after a failed handshake.

    A name is looked up again, and its next address is tried.
    """
    now, target = time.monotonic(), _targets.get(socket)
    if target is not None:
        target.name.ask_again()
        if not target.address:
            _connect_next(socket, target)
            return
    since, wait = _renewed.get(socket, (now, RENEW_S))
    if now - since > 2 * MAX_RENEW_S:  # the connection has worked since then
        since, wait = now, RENEW_S
    _renewed[socket] = since, wait
    if now - since < wait:
        return
    _renewed[socket] = now, min(2 * wait, MAX_RENEW_S)
    if target is not None:
        _connect_next(socket, target)
        return
    endpoint = socket.getsockopt_string(zmq.LAST_ENDPOINT)
    socket.disconnect(endpoint)
    socket.connect(endpoint)


def close_after_goodbye(socket: Socket) -> None:
    """Close a socket after its last messages have been sent."""
    socket.close(linger=GOODBYE_LINGER_MS)
