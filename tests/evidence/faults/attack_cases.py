"""Attack cases: peers that flood the server with the largest messages that the protocol allows.

Each attack runs twice in one recording: on a sink, which receives the messages and discards them, and on the server.
The attackers run on the server's machine, so even an attack on the sink costs the server deadlines. Periods without an
attack, before and after, show the deadline misses of the machine itself.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from evidence.faults import attackers
from evidence.faults.actions import Facts
from evidence.faults.cases import Case
from evidence.faults.checks import Check, agent_stalled, nothing_lost, recorded
from evidence.faults.deferred import deferred
from evidence.faults.evidence import Evidence, between
from evidence.faults.sites import GUESTS, Setup, Site
from netboard.base.clock import now_ns
from netboard.base.tick import LATE_NS
from netboard.benchmarks.harness.results import BenchVerdict, Value
from netboard.benchmarks.harness.workers import Workers
from netboard.network import keys
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import HELLO_INTERVAL_NS, Goodbye, Hello, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.transport import channels, sockets

SECONDS, QUICK_SECONDS = 60.0, 2.0
"""Duration of an attack on the sink, and of one on the server [s]."""

RATIO = 1.2
"""Largest ratio of deadline misses with an attack on the server to those with one on the sink, beyond chance [1]."""

JOIN_S = 0.5
"""Longest time that a peer with a valid key may take to join [s]."""

JOINS, QUICK_JOINS = 20, 4
"""Number of joins that are timed before and during an attack [1]."""

JOIN_TIMEOUT_S = 20.0
PART = "attacks"
COLUMNS = (
    *("case", "messages [1]", "connections [1]", "deadline misses: no attack / on sink / on server [1]"),
    *("misses per 100 000 ticks [1]", "server / sink [1]", "pauses [1]", "latest tick [ms]"),
    *("slowest join: no attack / attack [s]", "holds"),
)

OPEN_DYAD = Setup("one dyad, attacked", settings=("network.curve=off",))
KEYED_DYAD = Setup("one dyad with keys, attacked", settings=("network.curve=on",), keyed=True)


@deferred
def attack(site: Site, name: str) -> Facts:
    """Run an attacker, first on a sink and then on the server."""
    span = QUICK_SECONDS if site.quick else SECONDS
    before_ns = now_ns()
    time.sleep(span / 4)
    quiet = before_ns, now_ns()
    on_sink = _attack_sink(name, site, span)
    on_server = _attack(name, site, span, site.rig.config.network.port)
    after_ns = now_ns()
    time.sleep(span / 4)
    return _facts(on_server, on_sink, quiet, (after_ns, now_ns()))


@deferred
def join_during(site: Site, name: str) -> Facts:
    """Time the joins of consoles with a valid key, without an attack and during it."""
    span = 3 * QUICK_SECONDS if site.quick else SECONDS
    joins = QUICK_JOINS if site.quick else JOINS
    before_ns = now_ns()
    without = [_join(site) for _ in range(joins)]
    time.sleep(max(0.0, span - (now_ns() - before_ns) * 1e-9))
    quiet = before_ns, now_ns()
    on_sink = _attack_sink(name, site, span)
    during: list[float] = []

    def join_in_attack() -> None:
        time.sleep(span / 3)
        during.extend(_join(site) for _ in range(joins))

    on_server = _attack(name, site, span, site.rig.config.network.port, meanwhile=join_in_attack)
    slowest = {"join without": f"{max(without):.3f}", "join with": f"{max(during):.3f}"}
    return {**_facts(on_server, on_sink, quiet, (quiet[1], quiet[1])), **slowest}


def _attack_sink(name: str, site: Site, seconds: float) -> dict[str, int]:
    with Workers() as workers:
        sink = workers.start("sink", attackers.__name__, folder=site.rig.folder)
        sink.order(attack="sink", file=str(site.rig.file))
        return _attack(name, site, seconds, sink.answer()["port"])


def _attack(
    name: str, site: Site, seconds: float, port: int, meanwhile: Callable[[], object] = lambda: None
) -> dict[str, int]:
    """Run an attacker for a duration [s] on a port; return its counts and times."""
    with Workers() as workers:
        attacker = workers.start("attacker", attackers.__name__, folder=site.rig.folder)
        attacker.order()
        attacker.answer()  # it is ready
        files = {"file": str(site.rig.file), "folder": str(site.rig.folder / GUESTS)}
        attacker.order(attack=name, **files, seconds=seconds, port=port)
        meanwhile()
        return attacker.answer()


def _facts(on_server: dict[str, int], on_sink: dict[str, int], *quiet: tuple[int, int]) -> dict[str, str]:
    """Return an attacker's counts, and the start and stop of the attacks and of the periods without one [ns]."""
    return {
        "calm": " ".join(str(time_ns) for period in quiet for time_ns in period),
        "aside": f"{on_sink['begun_ns']} {on_sink['over_ns']}",
        **{name: str(value) for name, value in on_server.items()},
    }


def _join(site: Site) -> float:
    """Return the time from the first connection of a console to its welcome [s]."""
    hello = encode(Hello("console", "", PROTOCOL_VERSION, "guest:1", "0", {}))
    network = site.rig.config.network
    began = time.monotonic()
    with sockets.open_context() as context:
        endpoint = keys.reach(network, "console").reach(channels.CONTROL)
        console = sockets.control_client(context, endpoint, f"console@guest-{now_ns()}")
        next_hello = began
        while (now := time.monotonic()) - began < JOIN_TIMEOUT_S:
            if now >= next_hello and sockets.send(console, hello):
                next_hello = now + HELLO_INTERVAL_NS * 1e-9
            frame = sockets.receive(console)
            if frame is not None and isinstance(decode(frame), Welcome):
                sockets.send(console, encode(Goodbye("joined")))
                sockets.close_after_goodbye(console)
                return time.monotonic() - began
            time.sleep(0.002)
    return JOIN_TIMEOUT_S


# --- results -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class DeadlineMisses:
    """Deadline misses in some periods of a recording.

    - `ticks`, `misses`, `pauses`: number of ticks, of deadline misses and of pauses of the trial [1].
    - `variance`: variance of the number of misses under a compound Poisson model: a stall of the machine makes several
      ticks in a row late, so it is the sum of the squared lengths of such runs [1].
    - `latest`: largest lateness of a tick [ms].
    """

    ticks: int
    misses: int
    variance: float
    pauses: int
    latest: float

    @property
    def rate(self) -> float:
        """Misses per 100 000 ticks [1]."""
        return 1e5 * self.misses / max(self.ticks, 1)


def deadline_misses(evidence: Evidence) -> tuple[DeadlineMisses, DeadlineMisses, DeadlineMisses]:
    """Return the deadline misses without an attack, with the attack on the sink, and with the attack on the server."""
    facts = evidence.window.facts
    start_1, stop_1, start_2, stop_2 = map(int, facts["calm"].split())
    start_sink, stop_sink = map(int, facts["aside"].split())
    return (
        _misses_in(evidence, [(start_1, stop_1), (start_2, stop_2)]),
        _misses_in(evidence, [(start_sink, stop_sink)]),
        _misses_in(evidence, [(int(facts["begun_ns"]), int(facts["over_ns"]))]),
    )


def _misses_in(evidence: Evidence, periods: Sequence[tuple[int, int]]) -> DeadlineMisses:
    """Count the deadline misses and pauses in some periods [ns]."""
    late_ns = np.concatenate([between(evidence.rig.ticks, start, stop)["late_ns"] for start, stop in periods])
    missed = np.concatenate(([False], late_ns > LATE_NS, [False]))
    bounds = np.flatnonzero(missed[1:] != missed[:-1])
    runs = bounds[1::2] - bounds[::2]
    pauses = sum(start <= pause.at_ns < stop for pause in evidence.rig.pauses for start, stop in periods)
    latest = float(late_ns.max(initial=0)) * 1e-6
    return DeadlineMisses(len(late_ns), int(runs.sum()), float(np.sum(runs.astype(float) ** 2)), pauses, latest)


def no_more_misses(evidence: Evidence) -> BenchVerdict:
    """Check that the attack on the server causes no more deadline misses than that on the sink, beyond chance."""
    claim = f"deadline misses grow by a factor of {RATIO:g} at most, beyond chance (3 standard deviations)"
    if "calm" not in evidence.window.facts:
        return BenchVerdict(claim, False, "the attack was not made")
    _, on_sink, on_server = deadline_misses(evidence)
    scale = RATIO * on_server.ticks / max(on_sink.ticks, 1)
    deviation = sqrt(on_server.variance + scale**2 * (on_sink.variance + 1))
    good = on_server.ticks > 0 and on_server.misses <= scale * (on_sink.misses + 1) + 3 * deviation
    found = (
        f"{on_server.misses} in {on_server.ticks} ticks, {on_sink.misses} in {on_sink.ticks} with the attack on a sink"
    )
    return BenchVerdict(claim, good, found)


def no_more_pauses(evidence: Evidence) -> BenchVerdict:
    """Check that the attack on the server causes no more pauses than occur without it in the same recording.

    A pause does not count if an agent stalled at the same time: then the machine stalled, not only the server.
    """
    claim = "the attack on the server adds no pause"
    if "calm" not in evidence.window.facts:
        return BenchVerdict(claim, False, "the attack was not made")
    without, on_sink, on_server = deadline_misses(evidence)
    most = max(without.pauses, on_sink.pauses)
    start_ns, stop_ns = int(evidence.window.facts["begun_ns"]), int(evidence.window.facts["over_ns"])
    during = [pause for pause in evidence.rig.pauses if start_ns <= pause.at_ns < stop_ns]
    stalls = sum(agent_stalled(pause, evidence.stalls) for pause in during)
    found = f"{on_server.pauses} pauses, {stalls} of them while an agent stalled too; at most {most} without the attack"
    return BenchVerdict(claim, on_server.pauses - stalls <= most, found)


def joins_in_time(evidence: Evidence) -> BenchVerdict:
    """Check that peers with a valid key join in time."""
    slowest = float(evidence.window.facts.get("join with", JOIN_TIMEOUT_S))
    return BenchVerdict(
        f"a peer with a valid key joins within {JOIN_S:g} s", slowest < JOIN_S, f"at most {slowest:.3f} s"
    )


def figures(evidence: Evidence) -> tuple[Value, ...]:
    """Return the figures of an attack: the columns after its name in the table."""
    facts = evidence.window.facts
    if "calm" not in facts:
        return ("",) * (len(COLUMNS) - 2)
    periods = deadline_misses(evidence)
    _, on_sink, on_server = periods
    ratio: Value = on_server.rate / on_sink.rate if on_sink.misses else ""
    return (
        int(facts.get("messages", 0)),
        int(facts.get("connections", 0)),
        " / ".join(str(period.misses) for period in periods),
        " / ".join(f"{period.rate:.0f}" for period in periods),
        ratio,
        " / ".join(str(period.pauses) for period in periods),
        " / ".join(f"{period.latest:.2f}" for period in periods),
        f"{facts['join without']} / {facts['join with']}" if "join with" in facts else "",
    )


# --- the cases ---------------------------------------------------------------------------------------------------

EXPECTED = "the attack adds no deadline miss and no pause, and every refusal is counted"
FLOODS = {
    "display": "displays send reports of 256 frames, one of them after its goodbye",
    "agent": "second agents of a side send greetings of 4 kB, samples and goodbyes",
    "console": "consoles send commands of 8 kB and every request",
    "logger": "loggers request all records repeatedly, and acknowledge them",
    "stranger": "unknown peers send 8 kB messages, greetings and invalid bytes on every channel",
    "churn": "a hundred connections per second are opened, send a greeting and are closed, on every channel",
}


def _flood_case(name: str, *, keyed: bool) -> Case:
    checks: tuple[Check, ...] = (no_more_misses, no_more_pauses, nothing_lost)
    return Case(
        f"attack-{name}" + ("-keys" if keyed else ""),
        PART,
        f"{FLOODS[name]}, as fast as possible" + (", with valid keys" if keyed else ""),
        EXPECTED,
        KEYED_DYAD if keyed else OPEN_DYAD,
        attack(name),
        checks,
    )


def _unknown_keys_case(channel: str) -> Case:
    return Case(
        f"strangers-{channel}-keys",
        PART,
        f"1000 connections with unknown keys are kept open on the {channel} channel; consoles join on control",
        f"a peer with a valid key joins within {JOIN_S:g} s; {EXPECTED}",
        KEYED_DYAD,
        join_during(f"unauthenticated-{channel}"),
        (
            no_more_misses,
            no_more_pauses,
            joins_in_time,
            recorded("refused", "its key is not known here"),
            nothing_lost,
        ),
    )


ATTACKS = (
    *(_flood_case(name, keyed=False) for name in FLOODS),
    *(_flood_case(name, keyed=True) for name in FLOODS if name != "stranger"),
    *(_unknown_keys_case(channel) for channel in ("motion", "log", "control")),
)
"""Attack cases."""
