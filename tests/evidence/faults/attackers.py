"""A worker process that floods a server with the largest messages that the protocol allows.

An attack's order is its name (``attack``), the server's configuration (``file``), the folder with the attacker's keys
(``folder``), the port of the server or of a sink (``port``), and the duration (``seconds``); its answer is the number
of messages and connections. The process has the lowest priority (niceness 19) and stays off the server's CPU, because
the test is about the server's work for the messages, not about competition for the processor.

The order ``sink`` makes it a sink instead: it receives an attacker's messages as the server does, and discards them. An
attack on it shows the load that the attack itself puts on the machine; the difference to an attack on the server is the
server's own work for the messages.
"""

import os
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from functools import partial
from itertools import count, cycle, islice
from pathlib import Path
from typing import Any

from netboard.base.clock import now_ns
from netboard.base.config import Config, parse
from netboard.base.tables.rig import Network
from netboard.benchmarks.harness.workers import serve
from netboard.network import keys
from netboard.network.protocol.codec import encode
from netboard.network.protocol.control import Command, OutcomesRequest, StatusRequest, TraceRequest
from netboard.network.protocol.joining import Goodbye, Hello, Pong
from netboard.network.protocol.messages import KINDS, PROTOCOL_VERSION, Message
from netboard.network.protocol.motion import Stylus
from netboard.network.protocol.records import LogAck, LogRequest
from netboard.network.protocol.views import MAX_SHOWN, Frames
from netboard.network.transport import authenticator, channels, sockets
from netboard.network.transport.ports import free_port

MESSAGES_PER_TURN = 32
"""Messages sent over a connection before answers are read [1]."""

SINK_MESSAGES_PER_TURN = 4
"""Messages that the sink receives from each channel in a turn [1]."""

TICK_S = 1e-3
"""Time between the sink's turns, equal to the server's tick [s]."""

OPEN_CONNECTIONS = 1000
"""Connections with unknown keys that are open at any time [1]."""

CONNECTIONS_PER_CONTEXT = 250
BATCH = 25
"""Connections that are opened and closed together [1]."""

CHURN_HZ = 100
"""Rate of connections of a peer that connects and leaves repeatedly [Hz]."""

SAMPLE = Stylus(0, 0, 0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 0, 0, 0.0, -1, 0, 0, 0, 0)
CLIENTS = {
    channels.MOTION: sockets.motion_agent,
    channels.LOG: sockets.log_client,
    channels.CONTROL: sockets.control_client,
}
"""Function that connects to each channel."""


def hello(role: str, side: str = "", pairs: int = 0) -> Hello:
    """Return a greeting whose `pairs` details fill the size limit of the message."""
    room = (KINDS[1].most_bytes - 200) // max(pairs, 1) - 10
    details = {f"{number:05}": "x" * room for number in range(pairs)}
    return Hello(role, side, PROTOCOL_VERSION, "attacker:1", "0", details)


FRAMES = Frames("left", ((2**60,) * 3,) * MAX_SHOWN, 0)
"""The longest report of a display, with times in the far future [ns]."""

ROLE_MESSAGES: dict[str, tuple[tuple[int, str, Sequence[Message], Sequence[Message]], ...]] = {
    "display": (
        (channels.CONTROL, "display.left", [hello("display", "left", 32)], [FRAMES]),
        (channels.CONTROL, "display.left", [hello("display", "left"), Goodbye("done")], [FRAMES]),
    ),
    "agent": (
        (channels.MOTION, "agent.left", [], [hello("agent", "left", 32), SAMPLE, Goodbye("x" * 4000)]),
        (channels.MOTION, "agent.left", [], [SAMPLE]),
    ),
    "console": (
        (
            channels.CONTROL,
            "console",
            [hello("console")],
            [Command("note", "x" * 8000, 1), StatusRequest(), TraceRequest(-1), OutcomesRequest(0)],
        ),
        (channels.CONTROL, "console", [hello("console")], [TraceRequest(-1), StatusRequest()]),
    ),
    "logger": (
        (channels.LOG, "logger", [hello("logger")], [LogRequest(0), LogAck(0, 10**12, "x" * 900, 0), Pong(0, 0, 0)]),
        (channels.LOG, "logger", [hello("logger", pairs=32)], [LogRequest(0)]),
    ),
}
"""Connections of each role: channel, owner of the key, opening messages, and messages that are repeated."""


class Connection:
    """A connection that sends as fast as the transport accepts messages.

    - `sent`: number of messages sent [1].
    """

    def __init__(self, socket: sockets.Socket, first: Sequence[bytes], repeated: Sequence[bytes]) -> None:
        self.socket = socket
        self.sent = 0
        self._first, self._repeated = list(first), cycle(repeated)

    def turn(self) -> bool:
        """Send what the transport accepts, at most one batch, and read answers; return whether anything was sent."""
        before = self.sent
        while self._first and sockets.send(self.socket, self._first[0]):
            del self._first[0]
            self.sent += 1
        for frame in islice(self._repeated, 0 if self._first else MESSAGES_PER_TURN):
            if not sockets.send(self.socket, frame):
                break
            self.sent += 1
        for _ in range(MESSAGES_PER_TURN):
            if sockets.receive(self.socket) is None:
                break
        return self.sent > before


def flood_as_role(
    role: str, config: Config, folder: Path, stop: Callable[[], bool], stack: ExitStack
) -> dict[str, int]:
    """Send the messages that a role may send, as fast as the transport accepts them."""
    context = stack.enter_context(sockets.open_context())
    connections = [
        Connection(
            _client(context, config, folder, channel, key, f"{key}@attacker-{number}"),
            [encode(message) for message in first],
            [encode(message) for message in repeated],
        )
        for number, (channel, key, first, repeated) in enumerate(ROLE_MESSAGES[role])
    ]
    return _flood(connections, stop)


def flood_as_stranger(config: Config, stop: Callable[[], bool], stack: ExitStack) -> dict[str, int]:
    """Send messages without a greeting, greetings that the server refuses, and invalid bytes, on every channel."""
    context = stack.enter_context(sockets.open_context())
    refused = hello("listener", pairs=32)
    frames = [encode(message) for message in (FRAMES, SAMPLE, refused, LogRequest(0), StatusRequest())]
    frames += [b"\xc1" * 4000, b"\xdc" + b"\x01" * 4000]
    addresses = channels.addresses(config.network)
    short = [frame for frame in frames if len(frame) <= sockets.MAX_SAMPLE]  # a longer one closes the connection
    connections = [
        Connection(
            connect(context, addresses.reach(channel), f"stranger-{number}"),
            [],
            short if channel == channels.MOTION else frames,
        )
        for channel, connect in CLIENTS.items()
        for number in range(3)
    ]
    return _flood(connections, stop)


def connect_and_leave(config: Config, folder: Path, stop: Callable[[], bool], stack: ExitStack) -> dict[str, int]:
    """Connect, send a greeting and leave, repeatedly, on every channel."""
    context = stack.enter_context(sockets.open_context())
    peers = cycle(
        [
            (channels.MOTION, "agent.left"),
            (channels.LOG, "logger"),
            (channels.CONTROL, "console"),
            (channels.CONTROL, "display.left"),
        ]
    )
    opened = 0
    began = time.monotonic()
    while not stop():
        batch = []
        for number, (channel, key) in enumerate(islice(peers, BATCH), start=opened):
            socket = _client(context, config, folder, channel, key, f"{key}@guest-{number}")
            role, _, side = key.partition(".")
            greeting = encode(hello(role, side))
            batch.append(Connection(socket, [greeting], [greeting]))
        opened += len(batch)
        time.sleep(max(0.02, began + opened / CHURN_HZ - time.monotonic()))
        for connection in batch:
            connection.turn()
            connection.socket.close(linger=0)
    return {"connections": opened}


def open_without_valid_keys(
    channel: int, config: Config, folder: Path, stop: Callable[[], bool], stack: ExitStack
) -> dict[str, int]:
    """Keep many connections with unknown keys open, and continually replace the oldest."""
    server = keys.credentials(folder, "console").server
    contexts = cycle(
        [stack.enter_context(sockets.open_context()) for _ in range(OPEN_CONNECTIONS // CONNECTIONS_PER_CONTEXT)]
    )
    address = channels.addresses(config.network).reach(channel).address
    numbers = count()

    def connect() -> sockets.Socket:
        public, secret = authenticator.new_keys()
        endpoint = channels.Endpoint(address, channel, authenticator.Credentials(public, secret, server))
        return sockets.control_client(next(contexts), endpoint, f"console@stranger-{next(numbers)}")

    opened = deque(connect() for _ in range(OPEN_CONNECTIONS))
    while not stop():
        for _ in range(BATCH):
            opened.popleft().close()
        opened.extend(connect() for _ in range(BATCH))
        time.sleep(0.01)
    return {"connections": next(numbers)}


def _flood(connections: Sequence[Connection], stop: Callable[[], bool]) -> dict[str, int]:
    while not stop():
        if not sum(connection.turn() for connection in connections):
            time.sleep(0.0002)
    return {"messages": sum(connection.sent for connection in connections), "connections": len(connections)}


def _client(
    context: sockets.Context, config: Config, folder: Path, channel: int, key: str, name: str
) -> sockets.Socket:
    """Connect with a peer's key if authentication is on, and return the socket."""
    credentials = keys.credentials(folder, key) if keys.encrypted(config.network) else None
    endpoint = channels.addresses(config.network, credentials).reach(channel)
    return CLIENTS[channel](context, endpoint, name)


def _lower_priority() -> None:
    """Lower this process's priority, and leave the last CPU to the server, as far as the system allows it."""
    with suppress(OSError):
        cpus = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, cpus[:-1] or cpus)
        os.nice(19)


def carry_out(stack: ExitStack, order: dict[str, Any]) -> dict[str, int]:
    """Attack, and return the counts; or become a sink, and return its port. An empty order asks whether it is ready."""
    if not order:
        return {}
    config = parse(Path(order["file"]).read_text(encoding="utf-8"), order["file"])
    attack, port = order["attack"], order.get("port", free_port())
    config = replace(config, network=replace(config.network, port=port))
    if attack == "sink":
        threading.Thread(target=receive_and_discard, args=(config.network,), daemon=True).start()
        return {"port": port}
    _lower_priority()
    folder, begun_ns = Path(order["folder"]), now_ns()
    end = time.monotonic() + float(order["seconds"])

    def stop() -> bool:
        return time.monotonic() >= end

    match attack.split("-"):
        case ["stranger"]:
            counts = flood_as_stranger(config, stop, stack)
        case ["churn"]:
            counts = connect_and_leave(config, folder, stop, stack)
        case ["unauthenticated", channel]:
            counts = open_without_valid_keys(channels.CHANNELS.index(channel), config, folder, stop, stack)
        case _:
            counts = flood_as_role(attack, config, folder, stop, stack)
    return counts | {"begun_ns": begun_ns, "over_ns": now_ns()}


def receive_and_discard(network: Network) -> None:
    """Receive on every channel until the process ends."""
    gate = keys.make_authenticator(network)
    addresses = channels.addresses(network, gate)
    with sockets.open_context(best_effort=True) as context:
        routers = [
            listen(context, addresses.listen(channel))
            for listen, channel in (
                (sockets.motion_server, channels.MOTION),
                (sockets.log_server, channels.LOG),
                (sockets.control_server, channels.CONTROL),
            )
        ]
        while True:
            if gate is not None:
                gate.answer_handshakes()
                gate.reports(time.monotonic_ns())
            for router in routers:
                for _ in range(SINK_MESSAGES_PER_TURN):
                    if router.receive() is None:
                        break
            time.sleep(TICK_S)


if __name__ == "__main__":
    with ExitStack() as stack:
        serve(partial(carry_out, stack))
