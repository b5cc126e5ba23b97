"""A process that sends a server the most that the protocol allows, as fast as its link takes it.

The attack cases run it. It gives way to everything else on its machine (niceness 19, not on the server's CPU): what is
judged is what the server does with what it is sent, not who gets the processor. ``python -m
netboard.benchmarks.faults.attackers ATTACK FILE FOLDER SECONDS [PORT]`` says ``ready``, waits for a line, attacks, and
says what it did as JSON. FOLDER has the keys it comes with, if keys are in use; PORT is another server's, the sink's.
"""

import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from itertools import count, cycle, islice
from pathlib import Path

from netboard.base.clock import now_ns
from netboard.base.config import Config, parse
from netboard.network import keys
from netboard.network.protocol.codec import encode
from netboard.network.protocol.control import Command, OutcomesRequest, StatusRequest, TraceRequest
from netboard.network.protocol.joining import Goodbye, Hello, Pong
from netboard.network.protocol.messages import KINDS, PROTOCOL_VERSION, Message
from netboard.network.protocol.motion import Stylus
from netboard.network.protocol.records import LogAck, LogRequest
from netboard.network.protocol.views import MOST_SHOWN, Frames
from netboard.network.transport import authenticator, channels, sockets

TURN = 32
"""Messages sent in a row before answers are read [1]."""

OPEN = 1000
"""Connections without a good key that are open at any time [1]."""

IN_A_CONTEXT = 250
RENEWED = 25
"""Connections renewed at once [1]."""

CHURN_HZ = 100
"""Connections made a second by a peer that comes and goes [Hz]."""

NAME = "attacker:1"
LATE_NS = 2**60
STYLUS = Stylus(0, 0, 0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 0, 0, 0.0, -1, 0, 0, 0, 0)
SERVERS = (channels.MOTION, channels.LOG, channels.CONTROL)


def hello(role: str, side: str = "", pairs: int = 0) -> Hello:
    """Return a greeting with as many details of the largest size as fit."""
    room = (KINDS[1].most_bytes - 200) // max(pairs, 1) - 10
    return Hello(role, side, PROTOCOL_VERSION, NAME, "0", {f"{number:05}": "x" * room for number in range(pairs)})


FRAMES = Frames("left", ((LATE_NS, LATE_NS, LATE_NS),) * MOST_SHOWN, 0)
SAID: dict[str, tuple[tuple[int, str, Sequence[Message], Sequence[Message]], ...]] = {
    "display": (
        (channels.CONTROL, "display.left", [hello("display", "left", 32)], [FRAMES]),
        (channels.CONTROL, "display.left", [hello("display", "left"), Goodbye("done")], [FRAMES]),
    ),
    "agent": (
        (channels.MOTION, "agent.left", [], [hello("agent", "left", 32), STYLUS, Goodbye("x" * 4000)]),
        (channels.MOTION, "agent.left", [], [STYLUS]),
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
"""Connections of each role: channel, owner of the key, opening messages, and messages sent repeatedly."""


class Connection:
    """A link that is used as fast as it allows."""

    def __init__(self, socket: sockets.Socket, first: Sequence[bytes], again: Sequence[bytes]) -> None:
        self.socket = socket
        self.sent = 0
        self._first, self._again = list(first), cycle(again)

    def turn(self) -> bool:
        """Send what the link takes and read the answers; return whether anything was sent."""
        before = self.sent
        while self._first and sockets.send(self.socket, self._first[0]):
            del self._first[0]
            self.sent += 1
        for frame in islice(self._again, 0 if self._first else TURN):
            if not sockets.send(self.socket, frame):
                break
            self.sent += 1
        for _ in range(TURN):
            if sockets.receive(self.socket) is None:
                break
        return self.sent > before


def attack_as(role: str, config: Config, folder: Path, stop: Callable[[], bool], stack: ExitStack) -> dict[str, int]:
    """Send the messages that a role may send."""
    context = stack.enter_context(sockets.open_context())
    made = [
        Connection(
            _client(context, config, folder, channel, key, f"{key}@attacker-{number}"),
            [encode(message) for message in first],
            [encode(message) for message in again],
        )
        for number, (channel, key, first, again) in enumerate(SAID[role])
    ]
    return _drive(made, stop)


def attack_as_stranger(config: Config, stop: Callable[[], bool], stack: ExitStack) -> dict[str, int]:
    """Send messages before a greeting, greetings that are refused, and nonsense, on every channel."""
    context = stack.enter_context(sockets.open_context())
    refused = hello("listener", pairs=32)
    frames = [encode(message) for message in (FRAMES, STYLUS, refused, LogRequest(0), StatusRequest())]
    frames += [b"\xc1" * 4000, b"\xdc" + b"\x01" * 4000]
    makers = (sockets.motion_agent, sockets.log_client, sockets.control_client)
    where = channels.addresses(config.network)
    short = [frame for frame in frames if len(frame) <= sockets.LARGEST_SAMPLE]  # what is longer is cut off
    made = [
        Connection(
            maker(context, where.reach(channel), f"stranger-{number}"),
            [],
            short if channel == channels.MOTION else frames,
        )
        for channel, maker in zip(SERVERS, makers, strict=True)
        for number in range(3)
    ]
    return _drive(made, stop)


def come_and_go(config: Config, folder: Path, stop: Callable[[], bool], stack: ExitStack) -> dict[str, int]:
    """Connect, say hello and leave, again and again, on every channel."""
    context = stack.enter_context(sockets.open_context())
    whose = cycle(
        [
            (channels.MOTION, "agent.left"),
            (channels.LOG, "logger"),
            (channels.CONTROL, "console"),
            (channels.CONTROL, "display.left"),
        ]
    )
    came = 0
    began = time.monotonic()
    while not stop():
        here = []
        for number, (channel, key) in enumerate(islice(whose, RENEWED), start=came):
            socket = _client(context, config, folder, channel, key, f"{key}@guest-{number}")
            role, _, side = key.partition(".")
            here.append(Connection(socket, [encode(hello(role, side))], [encode(hello(role, side))]))
        came += len(here)
        time.sleep(max(0.02, began + came / CHURN_HZ - time.monotonic()))
        for connection in here:
            connection.turn()
            connection.socket.close(linger=0)
    return {"connections": came}


def knock(channel: int, config: Config, folder: Path, stop: Callable[[], bool], stack: ExitStack) -> dict[str, int]:
    """Hold many connections with unknown keys open, and continually renew the oldest."""
    server = keys.credentials(folder, "console").server
    contexts = [stack.enter_context(sockets.open_context()) for _ in range(OPEN // IN_A_CONTEXT)]
    places = cycle(contexts)
    address = channels.addresses(config.network).reach(channel).address
    numbers = count()

    def one() -> sockets.Socket:
        public, secret = authenticator.new_keys()
        endpoint = channels.Endpoint(address, channel, authenticator.Credentials(public, secret, server))
        return sockets.control_client(next(places), endpoint, f"console@stranger-{next(numbers)}")

    here = [one() for _ in range(OPEN)]
    while not stop():
        for socket in here[:RENEWED]:
            socket.close()
        here[:RENEWED] = []
        here += [one() for _ in range(RENEWED)]
        time.sleep(0.01)
    return {"connections": next(numbers)}


def _drive(made: Sequence[Connection], stop: Callable[[], bool]) -> dict[str, int]:
    while not stop():
        if not sum(connection.turn() for connection in made):
            time.sleep(0.0002)
    return {"messages": sum(connection.sent for connection in made), "connections": len(made)}


def _client(
    context: sockets.Context, config: Config, folder: Path, channel: int, key: str, name: str
) -> sockets.Socket:
    """Return a link that uses a peer's key if authentication is on."""
    lock = keys.credentials(folder, key) if keys.encrypted(config.network) else None
    endpoint = channels.addresses(config.network, lock).reach(channel)
    if channel == channels.MOTION:
        return sockets.motion_agent(context, endpoint, name)
    return (sockets.log_client if channel == channels.LOG else sockets.control_client)(context, endpoint, name)


def _give_way() -> Iterator[str]:
    """Lower this process's priority below everything else, and yield what the system granted."""
    try:
        cpus = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, cpus[:-1] or cpus)
        os.nice(19)
    except OSError as error:
        yield f"not nice ({error.strerror})"


def main(attack: str, file: Path, folder: Path, seconds: float, port: int | None = None) -> None:
    """Get ready, wait for a line, attack the server of a configuration or another one, and say what was done."""
    config = parse(file.read_text(encoding="utf-8"), str(file))
    if port is not None:
        config = replace(config, network=replace(config.network, port=port))
    granted = list(_give_way())
    print("ready", *granted, flush=True)  # noqa: T201
    sys.stdin.readline()
    begun_ns = now_ns()
    end = time.monotonic() + seconds

    def stop() -> bool:
        return time.monotonic() >= end

    with ExitStack() as stack:
        match attack.split("-"):
            case ["stranger"]:
                done = attack_as_stranger(config, stop, stack)
            case ["churn"]:
                done = come_and_go(config, folder, stop, stack)
            case ["knock", channel]:
                done = knock(channels.CHANNELS.index(channel), config, folder, stop, stack)
            case _:
                done = attack_as(attack, config, folder, stop, stack)
        done |= {"begun_ns": begun_ns, "over_ns": now_ns()}
        print(json.dumps(done), flush=True)  # noqa: T201


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]), float(sys.argv[4]), *map(int, sys.argv[5:]))
