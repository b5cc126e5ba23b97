"""Malformed messages for a real server during a trial: counts of refusals, and the effect on the trial.

The agents' devices log the forces that they are sent, and the session is recorded, so that any effect can be measured.
Some clients have joined the server, others have not, and others do not speak ZeroMQ. They send at a fixed rate below
the server's rate limit, because the test is about the content of the messages. Frames that have an effect when a joined
client sends them (a command, an acknowledgement, an emergency stop) are skipped.
"""

import random
import socket as net
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np

from evidence.faults import zmtp
from evidence.faults.checks import continues, ticks_accounted, within_slew_limit
from evidence.faults.devices import read_traces
from evidence.faults.evidence import Evidence, Window, between, read_recordings
from evidence.faults.malformed_frames import MalformedFrames, decode_or_none, valid_frames
from evidence.faults.rigs import tampered, until_forces
from evidence.faults.sites import PACE
from netboard.base.clock import now_ns
from netboard.base.config import SIDES
from netboard.base.errors import NetboardError
from netboard.base.safeguards import Safeguard
from netboard.base.tables.rig import Network
from netboard.base.tick import LATE_NS, TICK_NS
from netboard.benchmarks.harness.results import ResultPart
from netboard.benchmarks.harness.rig import Rig
from netboard.benchmarks.harness.running import Tell
from netboard.network.protocol.codec import encode
from netboard.network.protocol.control import Command
from netboard.network.protocol.joining import Goodbye, Hello
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.motion import Stylus
from netboard.network.protocol.records import EventRecord, LogAck, LogRequest
from netboard.network.transport import channels, sockets
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording

MAX_GROWTH = 32e6
"""Largest growth of a process's resident memory [bytes]."""

RATE_HZ = 450.0
"""Rate of malformed messages per socket, below a peer's rate limit so that the server decodes all of them [Hz]."""

STREAMS_HZ = 20.0
"""Rate of connections per socket that do not speak ZeroMQ [Hz]."""

MAX_OPEN = 20
"""Number of these connections that are open at a time [1]."""

MESSAGES_PER_CONNECTION = 100
"""Number of messages after which a subscriber reconnects, which clears its subscriptions [1]."""

OVERSIZED_SHARE = 0.005
"""Share of oversized frames that are sent; the server closes the connection after each one [1]."""

MULTIPART_SHARE = 0.03
"""Share of multipart messages [1]."""

STUCK_SECONDS = 60.0
"""Time without progress after which a socket counts as stuck [s]."""

TURN_SECONDS = 0.004
NAME_PREFIX = "fuzz"
EFFECTIVE: tuple[type[Message], ...] = (Hello, Goodbye, Command, LogAck, LogRequest)
"""Message types that have an effect when a joined client sends them."""


class FuzzingClient:
    """Sends malformed messages to one channel; joins first if it has a greeting.

    - `sent`: number of messages sent [1].
    - `malformed`: number of messages sent that the server must refuse [1].
    """

    def __init__(self, channel: int, network: Network, hello: Hello | None, count: int, seed: int) -> None:
        self.channel = channels.CHANNELS[channel]
        self.count = count
        self.sent = self.malformed = 0
        self._joined = hello is not None
        self._rng = random.Random(seed)
        self._frames = MalformedFrames(valid_frames(seed), seed)
        name = f"{NAME_PREFIX}.{self.channel}.{hello.role + hello.side if hello else 'stranger'}"
        self._subscribes = channel in channels.VIEW.values()
        socket_type = b"SUB" if self._subscribes else b"DEALER"
        opening = [] if hello is None else [encode(hello)]
        self.connection = zmtp.Connection((network.host, network.port + channel), socket_type, name.encode(), opening)
        self._next = self._make()
        self._stuck_since = time.monotonic()

    def send_until(self, due: float) -> None:
        """Send until `due` messages are sent or the connection accepts no more."""
        while self.sent < min(due, self.count):
            if not self.connection.send(*self._next):
                if time.monotonic() - self._stuck_since > STUCK_SECONDS:
                    raise NetboardError(f"the {self.channel} socket has accepted no message for {STUCK_SECONDS:g} s")
                return
            self.sent += 1
            self.malformed += self._must_be_refused(self._next)
            self._stuck_since = time.monotonic()
            self._next = self._make()
            if self._subscribes and self.sent % MESSAGES_PER_CONNECTION == 0:
                self.connection.close()

    def send(self, message: Message) -> None:
        """Send a valid message."""
        self.connection.send(encode(message))

    def _make(self) -> list[bytes]:
        rng = self._rng
        if rng.random() < MULTIPART_SHARE:
            return [next(self._frames) for _ in range(rng.choice((2, 2, 3, 50)))]
        frame = next(self._frames)
        while self._is_skipped(frame):
            frame = next(self._frames)
        if self._subscribes:
            return [rng.choice((b"", b"\0", b"\1")) + frame]  # 1 subscribes, 0 unsubscribes
        return [frame]

    def _is_skipped(self, frame: bytes) -> bool:
        """Return whether to skip a frame: most oversized ones, and those that have an effect."""
        if len(frame) > sockets.MAX_REQUEST:
            return self._rng.random() > OVERSIZED_SHARE
        return self._joined and _has_effect(decode_or_none(frame))

    def _must_be_refused(self, parts: list[bytes]) -> bool:
        """Return whether the server must refuse a message: if the client has not joined, or the message is invalid."""
        return not self._joined or len(parts) > 1 or decode_or_none(parts[0]) is None


def _has_effect(message: Message | None) -> bool:
    stop = isinstance(message, Stylus) and bool(message.safeguards & Safeguard.STOPPED)
    return stop or isinstance(message, EFFECTIVE)


class NonZmqClient:
    """Connects to every socket of a server and sends bytes that violate ZeroMQ's protocol.

    - `count`: number of connections to each socket [1].
    - `sent`: number of connections made to all sockets [1].
    """

    def __init__(self, network: Network, count: int) -> None:
        self._addresses = [(network.host, network.port + channel) for channel in range(channels.CONTROL + 1)]
        self.count = count * len(self._addresses)
        self.sent = 0
        self._streams = zmtp.StreamSender(MAX_OPEN, seed=77)

    def send_until(self, due: float) -> None:
        """Open connections until `due` are made, and send the next part over those that are open."""
        while self.sent < min(due, self.count):
            address = self._addresses[self.sent % len(self._addresses)]
            self._streams.add(net.create_connection(address, zmtp.CONNECT_SECONDS))
            self.sent += 1
        self._streams.send_next()

    def close(self) -> None:
        """Close all connections."""
        self._streams.close()


def agent_clients(network: Network, count: int) -> list[FuzzingClient]:
    """Return clients that join as the two agents."""
    return [
        FuzzingClient(channels.MOTION, network, _hello("agent", side), count, seed)
        for seed, side in enumerate(("left", "right"), start=1)
    ]


def other_clients(network: Network, count: int) -> list[FuzzingClient]:
    """Return clients of all sockets of a server whose agents are connected; None stands for one that does not join."""
    greetings: dict[int, list[Hello | None]] = {
        channels.MOTION: [None],
        channels.LOG: [None, _hello("logger", "")],
        channels.CONTROL: [None, _hello("display", "right"), _hello("console", "")],
        channels.VIEW_LEFT: [None],
        channels.VIEW_RIGHT: [None],
    }
    return [
        FuzzingClient(channel, network, hello, count // len(hellos), 10 * channel + number)
        for channel, hellos in greetings.items()
        for number, hello in enumerate(hellos)
    ]


def _hello(role: str, side: str) -> Hello:
    return Hello(role, side, PROTOCOL_VERSION, NAME_PREFIX, "0", {})


def send_all(clients: Sequence[FuzzingClient], non_zmq: NonZmqClient | None, check: Callable[[float], object]) -> None:
    """Send the messages of all clients at their rates, and call `check` once a second with the share sent [1]."""
    rates = {client.channel: RATE_HZ / sum(a.channel == client.channel for a in clients) for client in clients}
    count = sum(client.count for client in clients)
    began = checked = time.monotonic()
    while any(client.sent < client.count for client in clients) or (non_zmq and non_zmq.sent < non_zmq.count):
        now = time.monotonic()
        for client in clients:
            client.send_until((now - began) * rates[client.channel])
        if non_zmq is not None:
            non_zmq.send_until((now - began) * STREAMS_HZ * (channels.CONTROL + 1))
        if now - checked > 1.0:
            checked = now
            check(sum(client.sent for client in clients) / count)
        time.sleep(TURN_SECONDS)


def refusals(events: Sequence[EventRecord]) -> Counter[str]:
    """Return the number of refusals by channel; the last event of a channel, peer and reason has their total."""
    totals: dict[tuple[str, str, str], int] = {}
    for event in events:
        if event.name == "refused":
            channel, peer, reason = (event.details.get(name, "") for name in ("channel", "peer", "reason"))
            totals[channel, peer, reason] = int(event.details["times"])
    counts: Counter[str] = Counter()
    for (channel, _, _), times in totals.items():
        counts[channel] += times
    return counts


AGENT_SHARE = 0.25
"""Messages sent by clients that join as the agents before the trial, relative to those of a socket [1]."""

STREAM_SHARE = 0.01
"""Connections that do not speak ZeroMQ, per message to a socket [1]."""

QUIET_SECONDS = 5.0
"""Duration of the periods without malformed messages, before and after, for comparison [s]."""

REPORT_SECONDS = 2.0
"""Wait for the refusal counts, which the server reports once a second [s]."""

FINAL_MESSAGES = 100
"""Messages of each client after that wait: most kinds of refusal occur again, and are reported with their total [1]."""

MIN_COUNTED = 0.7
"""Smallest share of the malformed messages that must be reported as refused; closed connections lose some [1]."""

Period: TypeAlias = tuple[str, Window]
"""What was sent in a period of a trial, and when."""


def server_parts(folder: Path, count: int, tell: Tell, quiet: float = QUIET_SECONDS) -> Iterator[ResultPart]:
    """Send malformed messages to every socket of a real server."""
    folder.mkdir(parents=True)
    settings, environment = tampered(folder.resolve())
    tell("server: starting", 0.0)
    with Rig(folder, (*PACE, *settings, "network.log_ring_s=5"), environment) as rig:
        rig.start("logger", "logger", "--once")
        rig.start("server", "server")
        rig.until(lambda status: "logger" in status.peers)
        agents = _fuzz_as_agents(rig, round(count * AGENT_SHARE), tell)
        rig.start_stations()
        rig.start("left display", "display", "--station", "left", "--offscreen")
        until_forces(rig)
        rig.until(lambda status: "display.left" in status.peers)
        before_period = _period("nothing", lambda: time.sleep(quiet))
        before = rig.memory()
        others = other_clients(rig.config.network, count)
        non_zmq = NonZmqClient(rig.config.network, round(count * STREAM_SHARE))
        fuzzed_period = _period("malformed messages", lambda: _fuzz_in_trial(rig, others, non_zmq, tell))
        after_period = _period("nothing again", lambda: time.sleep(quiet))
        after = rig.memory()
        tell("server: checking the results", 1.0)
        (path,) = rig.finish()
    yield _sockets_part(read_recordings([path]).events, [*agents, *others], non_zmq)
    yield _trial_part(rig, path, (before_period, fuzzed_period, after_period))
    yield memory_part("server-memory", "Memory of the server and its peers", before, after)


def _period(name: str, act: Callable[[], object]) -> Period:
    """Do something, and return its name with the time window."""
    start_ns = now_ns()
    act()
    return name, Window(start_ns, now_ns())


def _fuzz_as_agents(rig: Rig, count: int, tell: Tell) -> list[FuzzingClient]:
    """Send malformed messages from clients that join as the agents, and disconnect them."""

    def check(share: float) -> None:
        rig.require_running()
        tell("server: malformed messages of the agents", share)

    clients = agent_clients(rig.config.network, count // len(SIDES))
    send_all(clients, None, check)
    for client in clients:
        client.send(Goodbye("enough"))
    rig.until(lambda status: not any(peer.startswith("agent") for peer in status.peers))
    for client in clients:
        client.connection.close()
    return clients


def _fuzz_in_trial(rig: Rig, clients: Sequence[FuzzingClient], non_zmq: NonZmqClient, tell: Tell) -> None:
    """Send the messages of all clients, and wait until the server has reported the refusals."""

    def check(share: float) -> None:
        rig.require_running()
        tell("server: malformed messages in a trial", share)

    send_all(clients, non_zmq, check)
    time.sleep(REPORT_SECONDS)
    for client in clients:
        client.count += FINAL_MESSAGES
        client.send_until(client.count)
    non_zmq.close()
    time.sleep(REPORT_SECONDS)
    for client in clients:
        client.connection.close()
    rig.require_running()


def _sockets_part(events: Sequence[EventRecord], clients: Sequence[FuzzingClient], non_zmq: NonZmqClient) -> ResultPart:
    """Tabulate the messages sent to each socket and the refusals that the server reports."""
    refused = refusals(events)
    totals: dict[str, list[int]] = {}
    for client in clients:
        total = totals.setdefault(client.channel, [0, 0, 0])
        for i, number in enumerate((client.sent, client.malformed, client.connection.connections)):
            total[i] += number
    streams = non_zmq.sent // len(totals)
    part = ResultPart(
        "server-sockets",
        "Malformed messages for the sockets of a server",
        "socket | messages [1] | malformed [1] | reported refusals [1] | connections [1] | without ZeroMQ [1]",
    )
    shares = []
    for channel, (sent, malformed, connections) in totals.items():
        if channel.startswith("view"):  # a publisher reads no messages, so it refuses none
            part.add(channel, sent, "", "", connections, streams)
        else:
            part.add(channel, sent, malformed, refused[channel], connections, streams)
            shares.append(refused[channel] / malformed)
    part.claim(
        f"the server counts and records at least {MIN_COUNTED:.0%} of the refusals on every channel",
        min(shares) > MIN_COUNTED,
        f"at least {min(shares):.1%} of the malformed messages",
    )
    return part


def _trial_part(rig: Rig, path: Path, periods: Sequence[Period]) -> ResultPart:
    """Tabulate deadline misses and pauses in each period, and check the recording."""
    taken = read_recordings([path])
    with Recording(path) as recording:
        verification = verify_recording(recording)
    part = ResultPart(
        "server-trial",
        "The trial while malformed messages arrive",
        "sent | ticks [1] | late [1] | late, per 1000 [1] | ticks after a gap [1] | pauses [1]",
    )
    for name, window in periods:
        ticks = between(taken.ticks, window.start_ns, window.stop_ns)
        late = int(np.sum(ticks["late_ns"] > LATE_NS))
        skipped = int(np.sum(np.diff(ticks["time_ns"]) > TICK_NS))
        pauses = sum(window.start_ns <= pause.at_ns < window.stop_ns for pause in taken.pauses)
        part.add(name, ticks.size, late, 1000 * late / max(ticks.size, 1), skipped, pauses)
    trial = Window(periods[0][1].start_ns, periods[-1][1].stop_ns)
    traces = {
        side: [between(trace, trial.start_ns, trial.stop_ns) for trace in read_traces(rig.folder, side)]
        for side in SIDES
    }
    evidence = Evidence(trial, rig.config.safety, traces, taken, None)
    found = f"{verification.checked} ticks recomputed" if verification.identical else str(verification)
    part.claim("replay reproduces the recording to the bit", verification.identical, found)
    part.verdicts.append(ticks_accounted(evidence))
    part.verdicts.append(within_slew_limit()(evidence))
    part.verdicts.append(continues(evidence))
    return part


def memory_part(name: str, title: str, before: dict[str, float], after: dict[str, float]) -> ResultPart:
    """Tabulate the memory of the processes before and after a test."""
    most = max(after[process] - before[process] for process in before)
    part = ResultPart(
        name,
        title,
        "process | before [MB] | after [MB] | growth [MB]",
        [
            (process, before[process] * 1e-6, after[process] * 1e-6, (after[process] - before[process]) * 1e-6)
            for process in before
        ],
    )
    part.claim(
        f"no process grows by more than {MAX_GROWTH * 1e-6:g} MB",
        not most > MAX_GROWTH,
        f"growth of at most {most * 1e-6:.1f} MB",
    )
    return part
