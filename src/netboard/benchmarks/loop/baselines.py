"""Baselines without netboard: an echo over the same sockets, and a timer, each in its own process.

``echo`` answers frames of a stylus' size with frames of a force's size and does nothing else. ``peer`` wakes every
millisecond, like an agent, sends one and waits for the answer. ``timer`` wakes every millisecond. They have the
options, the scheduling, the memory and the garbage collection of netboard's loops, and block in ZeroMQ itself, which is
the fastest way to wait.
"""

import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from netboard.base.clock import Pacer, now_ns
from netboard.base.config import Config, parse
from netboard.base.process.realtime import Priority, cpus_for, io_priority, prepare, steady_loop
from netboard.base.process.resources import NAME
from netboard.base.terminal.logs import log_to_stderr
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.harness.workers import serve
from netboard.network import keys
from netboard.network.protocol.fixed import FORCE, STYLUS
from netboard.network.transport import channels, endpoints, sockets
from netboard.network.transport.authenticator import Authenticator

PACKET_TIMEOUT_MS = 10_000
"""Timeout of an echo, after which the benchmark ends [ms]."""

Order = dict[str, Any]
ANSWER = bytes(FORCE.size)


def echo(router: endpoints.Router, authenticator: Authenticator | None, order: Order) -> Order:
    """Answer frames.

    - `order`: ``count``: number of frames [1]; ``greeting``: whether they are the first, whose senders must
    authenticate.
    """
    if order["greeting"]:
        _greet(router, authenticator, order["count"])
        return {}
    socket = router.socket
    for _ in range(order["count"]):
        sender, _ = socket.recv_multipart()
        socket.send_multipart((sender, ANSWER))
    return {}


def _greet(router: endpoints.Router, authenticator: Authenticator | None, count: int) -> None:
    """Answer a number of frames, and authenticate their senders meanwhile."""
    while count > 0:
        if authenticator is not None:
            authenticator.answer_handshakes()
        if (received := router.receive()) is None:
            time.sleep(TICK_SECONDS)
        elif router.send(received[0], ANSWER):
            count -= 1


def peer(socket: sockets.Socket, order: Order) -> Order:
    """Wake every millisecond, send a frame, wait for the answer.

    - `order`: ``count``: number of frames [1]; ``start_ns``: start time, monotonic clock [ns].
    """
    frame, took = bytes(STYLUS.size), []
    pacer = Pacer(order["start_ns"])
    for _ in range(order["count"]):
        pacer.wait()
        woke_ns = now_ns()
        socket.send(frame)
        socket.recv()
        took.append(now_ns() - woke_ns)
    return {"took_ns": took}


def timer(order: Order) -> Order:
    """Wake each ms: ``late_ns``, delays after deadlines; ``moved_ns``, shift of all deadlines in total [ns]."""
    pacer, late = Pacer(order["start_ns"]), []
    for _ in range(order["count"]):
        late.append(pacer.wait())
    return {"late_ns": late, "moved_ns": pacer.moved_ns}


def main(role: str, name: str, file: Path) -> None:
    """Run one of the baselines.

    - `file`: configuration with the addresses of the sockets and the real-time settings.
    """
    config = parse(file.read_text(encoding="utf-8"), str(file))
    log_to_stderr(f"{role} {name}")
    agent = role == "peer"
    priority = Priority.AGENT if agent else Priority.SERVER
    cpus = cpus_for(name.removeprefix("agent.") if agent else "server", config.realtime)
    prepared = prepare(config.realtime, priority, cpus)
    with sockets.open_context(io_priority(prepared, priority)) as context:
        carry_out = _role(role, name, config, context)
        steady_loop()
        serve(carry_out)


def _role(role: str, name: str, config: Config, context: sockets.Context) -> Callable[[Order], Order]:
    """Open the sockets of a role, and return the function that carries out its orders."""
    match role:
        case "echo":
            authenticator = keys.make_authenticator(config.network)
            where = channels.addresses(config.network, authenticator).listen(channels.MOTION)
            router = sockets.motion_server(context, where)
            router.socket.rcvtimeo = PACKET_TIMEOUT_MS
            return partial(echo, router, authenticator)
        case "peer":
            where = keys.reach(config.network, name).reach(channels.MOTION)
            socket = sockets.motion_agent(context, where, f"{name}@{NAME}")
            socket.rcvtimeo = socket.sndtimeo = PACKET_TIMEOUT_MS
            return partial(peer, socket)
    return timer


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], Path(sys.argv[3]))
