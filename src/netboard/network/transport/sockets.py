"""Makes every ZeroMQ socket of netboard. What the server does with its ends is in `endpoints`.

Rules that hold here: options are set before bind or connect (later ones do not take hold); the motion channel keeps at
most a few frames and never waits (the newest sample wins, an absent peer gets nothing stale); the log channel keeps
many and lingers; views are single frames, sent to who looks, and conflated where they are seen. With keys (a `Door` at
the server, `Credentials` at a peer) every frame is encrypted, and a peer is let in by its key, at the handshake. A cut
cable is noticed by TCP keepalive and, much earlier, by silence; not by ZeroMQ's heartbeats: libzmq 4.3.5 aborts a
process that was stopped for some seconds with full queues and heartbeats on. Sockets are used by the thread that made
them.
"""

import errno
import logging
import os
import secrets
import socket as net
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeAlias
from weakref import WeakKeyDictionary

import zmq
from zmq import Again, ZMQError

from netboard.base.errors import NetboardError
from netboard.network.transport import authenticator
from netboard.network.transport.authenticator import Credentials, Door
from netboard.network.transport.channels import CHANNELS, CONTROL, LOG, VIEW_LEFT, VIEW_RIGHT, Endpoint
from netboard.network.transport.endpoints import GOODBYE_LINGER_MS, Publisher, Router

log = logging.getLogger(__name__)

Socket: TypeAlias = authenticator.Socket
Context: TypeAlias = authenticator.Context

MOTION_HWM = 4
LOG_HWM = 64
CONTROL_HWM = 1000
SERVED_HWM, HEARD_HWM = 64, 16
"""Messages for a peer, and of a peer, that wait at the server's ends: what waits takes memory, and making room for much
of it at once would hold up the tick [1]."""
VIEW_HWM = 2
LOG_LINGER_MS = 2000
LARGEST_FRAME = 2**20
"""Whoever sends a larger frame is cut off, before it is received [bytes]."""
LARGEST_SAMPLE, LARGEST_REQUEST = 2**12 + 2**8, 2**13 + 2**8
"""The same for what a server takes on the motion channel, and on the log and control channels: the largest message of a
peer, and what encryption adds [bytes]."""
LARGEST_SUBSCRIPTION = 2**10
"""The same for views, to which a peer only subscribes: each byte of that becomes a node of a tree [bytes]."""
_THREADS = {CONTROL: 0, LOG: 1, VIEW_LEFT: 2, VIEW_RIGHT: 2}
"""Which thread of a context of their own serves channels that may wait."""
IO_THREAD = "ZMQbg/IO"
"""How libzmq's threads that exchange frames are called."""
START_S = 1.0
"""They have begun within this time [s]."""
PROMPT = -15
"""Niceness of the threads that serve channels that may wait."""
KEEPALIVE_S = 1
KEEPALIVE_PROBES = 3
RECONNECT_IVL_MS = 100
RECONNECT_IVL_MAX_MS = 1000
RENEW_S, MOST_RENEW_S = 2.0, 16.0
"""A peer that finds nobody at the other end connects anew after this time, and after twice as long each time, up to
the longest: a server that is slow to answer must not be asked again and again before it has [s]."""
_renewed: WeakKeyDictionary[Socket, tuple[float, float]] = WeakKeyDictionary()


# --- contexts ----------------------------------------------------------------------------------------------------


def library() -> str:
    """Which libzmq this is, and whether it cannot encrypt."""
    return f"libzmq {zmq.zmq_version()}{'' if zmq.has('curve') else ' without CURVE'}"


@contextmanager
def open_context(
    io_priority: int | None = None, io_cpus: Iterable[int] = (), *, apart: bool = False, loop_priority: int = 0
) -> Iterator[Context]:
    """Make a context; on leaving, its sockets are closed and what lingers is sent.

    Parameters
    ----------
    io_priority : int or None
        SCHED_FIFO priority of libzmq's own thread; None: that of the thread that makes the first socket.
    io_cpus : iterable of int
        CPUs it runs on; empty: any. What the system refuses is said, and not asked of libzmq, which would abort.
    apart : bool
        Server ends of all channels but motion are made in a context of their own, with a thread for each, that run on
        any CPU at no priority: whoever knocks there takes no time from the motion channel.
    loop_priority : int
        Priority of the loop that uses the context: while strangers knock, libzmq's thread runs below it; 0: never.
    """
    context = Context()
    if apart:
        context.patient = _patient_context()
    cpus = set(io_cpus)
    if io_priority is not None and _granted(
        f"SCHED_FIFO {io_priority}", lambda: os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(io_priority))
    ):
        context.set(zmq.THREAD_SCHED_POLICY, os.SCHED_FIFO)
        context.set(zmq.THREAD_PRIORITY, io_priority)
    if cpus and _granted(f"CPUs {sorted(cpus)}", lambda: os.sched_setaffinity(0, cpus)):
        for cpu in cpus:
            context.set(zmq.THREAD_AFFINITY_CPU_ADD, cpu)
    if loop_priority and io_priority is not None:
        context.threads, context.above, context.below = _started(context), io_priority, loop_priority - 1
    try:
        yield context
    finally:
        for one in filter(None, (context.patient, context)):
            one.destroy()


def _started(context: Context) -> tuple[int, ...]:
    """Let the threads of a context start, and find those that exchange frames; none where the system does not tell."""
    tasks = Path("/proc/self/task")
    if not tasks.exists():
        return ()
    before = {task.name for task in tasks.iterdir()}
    context.socket(zmq.PAIR).close()
    end = time.monotonic() + START_S
    while time.monotonic() < end:  # each gives itself a name when it begins
        new = [task for task in tasks.iterdir() if task.name not in before]
        found = tuple(int(task.name) for task in new if (task / "comm").read_text().startswith(IO_THREAD))
        if found:
            return found
        time.sleep(START_S / 100)
    return ()


def _patient_context() -> Context:
    """A context whose threads may run anywhere, whatever CPU the thread that makes them keeps to."""
    context = Context(io_threads=len(_THREADS))
    cpus = range(os.cpu_count() or 1)
    if hasattr(os, "sched_setaffinity") and _granted("any CPU", lambda: os.sched_setaffinity(0, cpus)):
        for cpu in cpus:
            context.set(zmq.THREAD_AFFINITY_CPU_ADD, cpu)
    with _promptly():
        context.socket(zmq.PAIR).close()  # with the first socket its threads begin, as nice as the one that makes it
    return context


@contextmanager
def _promptly() -> Iterator[None]:
    """While entered, threads begin ahead of all others that have no real-time priority, where the system allows it.

    A loop with such a priority may wait for them for a moment (they allocate memory as it does), and one that had to
    wait for its turn would keep the loop waiting, too.
    """
    if sys.platform != "linux" or not _granted(f"niceness {PROMPT}", lambda: _be_nice(PROMPT)):
        yield
        return
    before = os.getpriority(os.PRIO_PROCESS, 0)
    _be_nice(PROMPT)
    try:
        yield
    finally:
        _be_nice(before)


def _be_nice(niceness: int) -> None:
    """Set the niceness of this thread alone, as Linux has it."""
    os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), niceness)


def _place_of(context: Context, endpoint: Endpoint) -> tuple[Context, int]:
    """The context of a server end, and the set of its threads that serve the channel, as libzmq wants it."""
    thread = _THREADS.get(endpoint.channel)
    if context.patient is None or thread is None:
        return context, 0
    return context.patient, 1 << thread


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


def require_free(endpoint: Endpoint) -> None:
    """Find out whether another server listens on a channel, before anything is started that would join its session."""
    try:
        _refuse_taken(endpoint.address)
        if endpoint.address.startswith("tcp://"):
            host, _, port = endpoint.address.removeprefix("tcp://").rpartition(":")
            with net.socket() as probe:
                probe.setsockopt(net.SOL_SOCKET, net.SO_REUSEADDR, 1)
                probe.bind((host, int(port)))
    except (OSError, ZMQError) as error:
        if error.errno == errno.EADDRINUSE:
            raise NetboardError(
                f"another server listens on {endpoint.address}, perhaps another user's; "
                "end it, or choose another [network] port"
            ) from error
        # Whatever else is wrong with the address, the server itself will say.


def _refuse_taken(address: str) -> None:
    """Find out whether somebody listens on a socket of the file system: libzmq would just take it away."""
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
    context, threads = _place_of(context, endpoint)
    socket = _make(context, zmq.ROUTER, hwm, linger_ms, largest)
    socket.setsockopt(zmq.RCVHWM, min(hwm, HEARD_HWM))
    socket.setsockopt(zmq.AFFINITY, threads)
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
    return _router(context, endpoint, MOTION_HWM, LARGEST_SAMPLE)


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
    return _router(context, endpoint, SERVED_HWM, LARGEST_REQUEST)


def control_client(context: Context, endpoint: Endpoint, identity: str) -> Socket:
    """Peer end of the control channel."""
    return _dealer(context, endpoint, identity, CONTROL_HWM)


def view_publisher(context: Context, endpoint: Endpoint) -> Publisher:
    """Server end of one station's view channel."""
    context, threads = _place_of(context, endpoint)
    socket = _make(context, zmq.XPUB, VIEW_HWM, largest=LARGEST_SUBSCRIPTION)
    socket.setsockopt(zmq.AFFINITY, threads)
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
        _renewed.pop(socket, None)
        return True
    renew(socket)
    return False


def renew(socket: Socket) -> None:
    """Connect anew, unless it was done lately: after a handshake that failed libzmq itself never tries again."""
    now = time.monotonic()
    since, wait = _renewed.get(socket, (now, RENEW_S))
    if now - since > 2 * MOST_RENEW_S:  # all has been well since
        since, wait = now, RENEW_S
    _renewed[socket] = since, wait
    if now - since < wait:
        return
    _renewed[socket] = now, min(2 * wait, MOST_RENEW_S)
    endpoint = socket.getsockopt_string(zmq.LAST_ENDPOINT)
    socket.disconnect(endpoint)
    socket.connect(endpoint)


def close_after_goodbye(socket: Socket) -> None:
    """Close a socket whose last words have just been sent."""
    socket.close(linger=GOODBYE_LINGER_MS)
