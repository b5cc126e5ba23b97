"""Attacks: peers that send the most that the protocol allows, as fast as their links take it, and what a tick loses.

Each attack is compared with an equally long one, in the same run, on a sink that takes the messages and does nothing
else: the attackers are on the server's machine, and take time from it wherever they send. Calm stretches before and
after show what the machine misses by itself.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.errors import NetboardError
from netboard.benchmarks.faults.case import Case
from netboard.benchmarks.faults.checks import Check, agents_stood_still, noted, nothing_lost
from netboard.benchmarks.faults.evidence import between
from netboard.benchmarks.faults.gathering import Evidence
from netboard.benchmarks.faults.harm import Act, Facts
from netboard.benchmarks.faults.sites import GUESTS, Setup, Site
from netboard.benchmarks.harness.results import Value, Verdict
from netboard.network import keys
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Goodbye, Hello, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.transport import channels, sockets
from netboard.nodes.operator.operator import HELLO_NS
from netboard.nodes.server.tick_clock import LATE_NS

SECONDS, QUICK_SECONDS = 60.0, 2.0
"""Duration of an attack, and of the calm stretch that it is compared with [s]."""

START_S = 60.0
"""Timeout for an attacker to become ready [s]."""

RATIO = 1.2
"""Largest factor by which deadline misses may grow, beyond chance [1]."""

JOIN_S = 0.5
"""Longest time a peer with a good key may take to join, attack or not [s]."""

JOINS, QUICK_JOINS = 20, 4
"""Joins that are timed before and in an attack [1]."""

PATIENCE_S = 20.0
PART = "attacks"
COLUMNS = (
    *("case", "messages [1]", "connections [1]", "misses in calm / on a sink / on the server [1]"),
    *("per 100 000 ticks [1]", "server / sink [1]", "pauses [1]", "latest tick [ms]"),
    *("slowest join in calm / in the attack [s]", "holds"),
)

OPEN_DYAD = Setup("one dyad, attacked", settings=("network.curve=off",))
KEYED_DYAD = Setup("one dyad with keys, attacked", settings=("network.curve=on",), keyed=True)


def attack(name: str) -> Act:
    """Return an act that runs an attacker for a while [s], first at a sink and then at the server."""

    def act(site: Site) -> Facts:
        span = QUICK_SECONDS if site.quick else SECONDS
        before_ns = now_ns()
        time.sleep(span / 4)
        calm_ns = now_ns()
        aside = _attack_sink(name, site, span)
        with _attacker(name, site, span) as process:
            _begin(process)
            done = _finish(process, name, span)
        after_ns = now_ns()
        time.sleep(span / 4)
        return _facts(done, aside, (before_ns, calm_ns), (after_ns, now_ns()))

    return act


def join_during(name: str) -> Act:
    """Return an act in which strangers knock for a while [s] while consoles with a good key join, as before."""

    def act(site: Site) -> Facts:
        span = 3 * QUICK_SECONDS if site.quick else SECONDS
        joins = QUICK_JOINS if site.quick else JOINS
        calm_ns = now_ns()
        calm = [_join(site) for _ in range(joins)]
        time.sleep(max(0.0, span - (now_ns() - calm_ns) * 1e-9))
        over_ns = now_ns()
        aside = _attack_sink(name, site, span)
        with _attacker(name, site, span) as process:
            _begin(process)
            time.sleep(span / 3)
            meanwhile = [_join(site) for _ in range(joins)]
            done = _finish(process, name, span)
        slowest = {"join without": f"{max(calm):.3f}", "join with": f"{max(meanwhile):.3f}"}
        return {**_facts(done, aside, (calm_ns, over_ns), (over_ns, over_ns)), **slowest}

    return act


def _attack_sink(name: str, site: Site, seconds: float) -> dict[str, int]:
    """Run an attacker for a while [s] against a sink; return what it did."""
    with _start("sink", str(site.rig.file)) as sink:
        assert sink.stdin is not None
        port = _said(sink, "sink")
        with _attacker(name, site, seconds, port) as process:
            _begin(process)
            done = _finish(process, name, seconds)
        sink.stdin.close()
    return done


def _attacker(name: str, site: Site, seconds: float, *port: str) -> "subprocess.Popen[str]":
    """Start an attacker, and wait until it is ready."""
    process = _start("attackers", name, str(site.rig.file), str(site.rig.folder / GUESTS), str(seconds), *port)
    if not _said(process, name).startswith("ready"):
        raise NetboardError(f"the attacker {name} did not start")
    return process


def _start(module: str, *arguments: str) -> "subprocess.Popen[str]":
    command = (sys.executable, "-m", f"netboard.benchmarks.faults.{module}", *arguments)
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment)


def _said(process: "subprocess.Popen[str]", name: str) -> str:
    """Return the next line that a process prints."""
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line:
        process.kill()
        raise NetboardError(f"the process of {name} ended before it was ready")
    return line.strip()


def _begin(process: "subprocess.Popen[str]") -> None:
    assert process.stdin is not None
    process.stdin.write("go\n")
    process.stdin.flush()


def _finish(process: "subprocess.Popen[str]", name: str, seconds: float) -> dict[str, int]:
    try:
        said, _ = process.communicate(timeout=seconds + START_S)
        return dict(json.loads(said))
    except (subprocess.TimeoutExpired, ValueError) as error:
        process.kill()
        raise NetboardError(f"the attacker {name} did not end well: {error}") from error


def _facts(done: dict[str, int], aside: dict[str, int], *calm: tuple[int, int]) -> dict[str, str]:
    """Return what an attacker did, with the bounds of the attacks and of the calm stretches [ns]."""
    times = " ".join(str(time_ns) for stretch in calm for time_ns in stretch)
    elsewhere = f"{aside['begun_ns']} {aside['over_ns']}"
    return {"calm": times, "aside": elsewhere, **{name: str(value) for name, value in done.items()}}


def _join(site: Site) -> float:
    """Return how long a console waits for its welcome [s]."""
    hello = encode(Hello("console", "", PROTOCOL_VERSION, "guest:1", "0", {}))
    network = site.rig.config.network
    began = time.monotonic()
    with sockets.open_context() as context:
        endpoint = keys.reach(network, "console").reach(channels.CONTROL)
        console = sockets.control_client(context, endpoint, f"console@guest-{now_ns()}")
        again = began
        while (now := time.monotonic()) - began < PATIENCE_S:
            if now >= again and sockets.send(console, hello):
                again = now + HELLO_NS * 1e-9
            frame = sockets.receive(console)
            if frame is not None and isinstance(decode(frame), Welcome):
                sockets.send(console, encode(Goodbye("joined")))
                sockets.close_after_goodbye(console)
                return time.monotonic() - began
            time.sleep(0.002)
    return PATIENCE_S


# --- judging -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Toll:
    """Deadline misses in some stretches of a run.

    - `variance`: of the number of misses, if stalls come by chance: when the machine stands still for 19 ms, 19 ticks
      in a row are late, so it is the sum of the squares of such runs (compound Poisson) [1].
    - `latest`: the latest one [ms].
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


def tolls(evidence: Evidence) -> tuple[Toll, Toll, Toll]:
    """Return the deadline misses in calm, while the sink was attacked, and while the server was."""
    facts = evidence.window.facts
    first, second, third, fourth = map(int, facts["calm"].split())
    start, stop = map(int, facts["aside"].split())
    attacked = int(facts["begun_ns"]), int(facts["over_ns"])
    calm = [(first, second), (third, fourth)]
    return _toll(evidence, calm), _toll(evidence, [(start, stop)]), _toll(evidence, [attacked])


def _toll(evidence: Evidence, stretches: Sequence[tuple[int, int]]) -> Toll:
    late = np.concatenate([between(evidence.rig.ticks, start, stop)["late_ns"] for start, stop in stretches])
    missed = np.concatenate(([False], late > LATE_NS, [False]))
    bounds = np.flatnonzero(missed[1:] != missed[:-1])
    runs = bounds[1::2] - bounds[::2]
    pauses = sum(start <= pause.at_ns < stop for pause in evidence.rig.pauses for start, stop in stretches)
    latest = float(late.max(initial=0)) * 1e-6
    return Toll(len(late), int(runs.sum()), float(np.sum(runs.astype(float) ** 2)), pauses, latest)


def unmoved(evidence: Evidence) -> Verdict:
    """Check that the attack on the server causes no more deadline misses than that on a sink, beyond chance."""
    claim = f"deadline misses grow by a factor of {RATIO:g} at most, beyond chance (3 standard deviations)"
    if "calm" not in evidence.window.facts:
        return Verdict(claim, False, "the attack was not made")
    _, aside, attacked = tolls(evidence)
    scale = RATIO * attacked.ticks / max(aside.ticks, 1)
    deviation = sqrt(attacked.variance + scale**2 * (aside.variance + 1))
    good = attacked.ticks > 0 and attacked.misses <= scale * (aside.misses + 1) + 3 * deviation
    found = f"{attacked.misses} in {attacked.ticks} ticks, {aside.misses} in {aside.ticks} with the attack on a sink"
    return Verdict(claim, good, found)


def unpaused(evidence: Evidence) -> Verdict:
    """Check that the attack causes no more pauses than the machine itself makes in the same run.

    A pause does not count if an agent, a process of its own, stood still at the same time: then the machine did.
    """
    claim = "no pause in the attack that there is not with the attack on a sink, or without"
    if "calm" not in evidence.window.facts:
        return Verdict(claim, False, "the attack was not made")
    calm, aside, attacked = tolls(evidence)
    most = max(calm.pauses, aside.pauses)
    start_ns, stop_ns = int(evidence.window.facts["begun_ns"]), int(evidence.window.facts["over_ns"])
    meanwhile = [pause for pause in evidence.rig.pauses if start_ns <= pause.at_ns < stop_ns]
    excused = sum(agents_stood_still(pause, evidence.stalls) for pause in meanwhile)
    found = f"{attacked.pauses}, {excused} of them when an agent stood still too; at most {most} otherwise"
    return Verdict(claim, attacked.pauses - excused <= most, found)


def joined(evidence: Evidence) -> Verdict:
    """Check that a peer with a good key joined in time."""
    slowest = float(evidence.window.facts.get("join with", PATIENCE_S))
    return Verdict(f"a peer with a good key joins within {JOIN_S:g} s", slowest < JOIN_S, f"at most {slowest:.3f} s")


def figures(evidence: Evidence) -> tuple[Value, ...]:
    """Return the figures of an attack: the columns after its name in the table."""
    facts = evidence.window.facts
    if "calm" not in facts:
        return ("",) * (len(COLUMNS) - 2)
    found = tolls(evidence)
    _, aside, attacked = found
    ratio: Value = attacked.rate / aside.rate if aside.misses else ""
    return (
        int(facts.get("messages", 0)),
        int(facts.get("connections", 0)),
        " / ".join(str(toll.misses) for toll in found),
        " / ".join(f"{toll.rate:.0f}" for toll in found),
        ratio,
        " / ".join(str(toll.pauses) for toll in found),
        " / ".join(f"{toll.latest:.2f}" for toll in found),
        f"{facts['join without']} / {facts['join with']}" if "join with" in facts else "",
    )


# --- the cases ---------------------------------------------------------------------------------------------------

_EXPECTED = "no deadline is missed for it, no trial paused; what is refused is counted"
_WHAT = {
    "display": "displays send reports of 256 frames, one of them after its goodbye",
    "agent": "agents whose side is taken send greetings of 4 kB, samples and goodbyes",
    "console": "consoles give commands of 8 kB and ask for everything",
    "logger": "loggers ask for all records again and again, and acknowledge",
    "stranger": "nobody in particular sends 8 kB messages, greetings and nonsense on every channel",
    "churn": "a hundred connections a second are made, say hello and are closed, on every channel",
}


def _case(what: str, *, keyed: bool) -> Case:
    setup = KEYED_DYAD if keyed else OPEN_DYAD
    checks: tuple[Check, ...] = (unmoved, unpaused, nothing_lost())
    return Case(
        f"attack-{what}" + ("-keys" if keyed else ""),
        PART,
        f"{_WHAT[what]}, as fast as it goes" + (", with good keys" if keyed else ""),
        _EXPECTED,
        setup,
        attack(what),
        checks,
    )


def _knock(channel: str) -> Case:
    return Case(
        f"strangers-{channel}-keys",
        PART,
        f"1000 connections with unknown keys knock on the {channel} channel; consoles join on control",
        f"a good key is let in within {JOIN_S:g} s; {_EXPECTED}",
        KEYED_DYAD,
        join_during(f"knock-{channel}"),
        (unmoved, unpaused, joined, noted("refused", "its key is not known here"), nothing_lost()),
    )


ATTACKS = (
    *(_case(what, keyed=False) for what in _WHAT),
    *(_case(what, keyed=True) for what in _WHAT if what != "stranger"),
    *(_knock(channel) for channel in ("motion", "log", "control")),
)
"""Attack cases."""
