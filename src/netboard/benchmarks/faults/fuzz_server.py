"""Malformed messages for a real server during a trial: counts of refusals, and the effect on the trial.

The agents' devices log the forces that they are sent, and the session is recorded, so that any effect can be measured.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.config import SIDES
from netboard.base.tick import TICK_NS
from netboard.benchmarks.faults.checks import gentle, goes_on, whole
from netboard.benchmarks.faults.devices import read_traces
from netboard.benchmarks.faults.evidence import between
from netboard.benchmarks.faults.gathering import Evidence, Window, take
from netboard.benchmarks.faults.hostile_clients import (
    FuzzingClient,
    NonZmqClient,
    agent_clients,
    other_clients,
    refusals,
    send_all,
)
from netboard.benchmarks.faults.process_health import memory, memory_part, require_running
from netboard.benchmarks.faults.rigs import Rig, tampered
from netboard.benchmarks.faults.sites import PACE
from netboard.benchmarks.harness.results import Part, Value, Verdict
from netboard.benchmarks.harness.running import Tell
from netboard.network.protocol.joining import Goodbye
from netboard.network.protocol.records import EventRecord
from netboard.nodes.server.tick_clock import LATE_NS
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording

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


def server_parts(folder: Path, count: int, tell: Tell, quiet: float = QUIET_SECONDS) -> Iterator[Part]:
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
        rig.until_felt()
        rig.until(lambda status: "display.left" in status.peers)
        before_period = _period("nothing", lambda: time.sleep(quiet))
        before = memory(rig)
        others = other_clients(rig.config.network, count)
        non_zmq = NonZmqClient(rig.config.network, round(count * STREAM_SHARE))
        fuzzed_period = _period("malformed messages", lambda: _fuzz_in_trial(rig, others, non_zmq, tell))
        after_period = _period("nothing again", lambda: time.sleep(quiet))
        after = memory(rig)
        tell("server: checking the results", 1.0)
        (path,) = rig.finish()
    yield _sockets_part(take([path]).events, [*agents, *others], non_zmq)
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
        require_running(rig)
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
        require_running(rig)
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
    require_running(rig)


def _sockets_part(events: Sequence[EventRecord], clients: Sequence[FuzzingClient], non_zmq: NonZmqClient) -> Part:
    """Tabulate the messages sent to each socket and the refusals that the server reports."""
    refused = refusals(events)
    totals: dict[str, list[int]] = {}
    for client in clients:
        total = totals.setdefault(client.channel, [0, 0, 0])
        for i, number in enumerate((client.sent, client.malformed, client.connection.connections)):
            total[i] += number
    streams = non_zmq.sent // len(totals)
    rows: list[tuple[Value, ...]] = []
    shares = []
    for channel, (sent, malformed, connections) in totals.items():
        if channel.startswith("view"):  # a publisher reads no messages, so it refuses none
            rows.append((channel, sent, "", "", connections, streams))
        else:
            rows.append((channel, sent, malformed, refused[channel], connections, streams))
            shares.append(refused[channel] / malformed)
    return Part(
        "server-sockets",
        "Malformed messages for the sockets of a server",
        ("socket", "messages [1]", "malformed [1]", "reported refusals [1]", "connections [1]", "without ZeroMQ [1]"),
        rows,
        [
            Verdict(
                f"the server counts and records at least {MIN_COUNTED:.0%} of the refusals on every channel",
                min(shares) > MIN_COUNTED,
                f"at least {min(shares):.1%} of the malformed messages",
            )
        ],
    )


def _trial_part(rig: Rig, path: Path, periods: Sequence[Period]) -> Part:
    """Tabulate deadline misses and pauses in each period, and check the recording."""
    taken = take([path])
    with Recording(path) as recording:
        verification = verify_recording(recording)
    rows: list[tuple[Value, ...]] = []
    for name, window in periods:
        ticks = between(taken.ticks, window.start_ns, window.stop_ns)
        late = int(np.sum(ticks["late_ns"] > LATE_NS))
        skipped = int(np.sum(np.diff(ticks["time_ns"]) > TICK_NS))
        pauses = sum(window.start_ns <= pause.at_ns < window.stop_ns for pause in taken.pauses)
        rows.append((name, ticks.size, late, 1000 * late / max(ticks.size, 1), skipped, pauses))
    trial = Window(periods[0][1].start_ns, periods[-1][1].stop_ns)
    traces = {
        side: [between(trace, trial.start_ns, trial.stop_ns) for trace in read_traces(rig.folder, side)]
        for side in SIDES
    }
    evidence = Evidence(trial, rig.config.safety, traces, taken, None)
    found = f"{verification.checked} ticks recomputed" if verification.identical else str(verification)
    return Part(
        "server-trial",
        "The trial while malformed messages arrive",
        ("sent", "ticks [1]", "late [1]", "late, per 1000 [1]", "ticks after a gap [1]", "pauses [1]"),
        rows,
        [
            Verdict("replay reproduces the recording to the bit", verification.identical, found),
            whole()(evidence),
            gentle()(evidence),
            goes_on()(evidence),
        ],
    )
