"""Many dyads in one server process on one core: CPU cost and tick jitter by number of dyads, up to the limit.

The server is a real one. Two more processes run all its lightweight peers (`evidence.loop.light_peers`);
their orders say which peers, and for how long.

Every dyad is in a trial with haptic feedback and has a logger; all peers are on another core. Then as many dyads as
asked for, with server and peers on all cores. Then idle dyads: with agents but no trial, and without peers.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from evidence.loop import light_peers
from netboard.base.clock import now_ns
from netboard.base.config import Config
from netboard.benchmarks.harness.results import BenchVerdict, ResultPart
from netboard.benchmarks.harness.rig import Rig
from netboard.benchmarks.harness.running import Tell
from netboard.benchmarks.harness.workers import Workers
from netboard.benchmarks.loop.rig import dyad_configs, write_configs
from netboard.benchmarks.loop.timing import HEADS, TickTiming, Times, in_milliseconds
from netboard.benchmarks.loop.usage import LOOP, TRANSPORT, Cost, read_usage
from netboard.recording.format.summary import spread

WARM_SECONDS, WARM_SECONDS_A_DYAD = 4.0, 0.5
"""Time for sessions to begin their trials and for agents to adjust their phase, before counting starts; and more
for each dyad [s]."""


@dataclass(frozen=True)
class Peers:
    """The kinds of peers of a server, whether hands move, and whether a trial runs."""

    agents: bool = True
    loggers: bool = True
    displays: bool = False
    moving: bool = True
    trial: bool = True


@dataclass(frozen=True)
class Served:
    """Resource use and timing of a server.

    - `counts`: frames received by its peers [Hz].
    - `peers_late_ns`: delay of the samples when the peers sent them [ns].
    """

    cost: Cost
    counts: dict[str, float]
    ticks: TickTiming
    active: float
    peers_late_ns: Times


class LightPeers(Workers):
    """The two processes that are all peers of a server; leaving the context ends them."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self._folder = folder
        self._agents = self.start("agents", light_peers.__name__, "agents", folder=folder)
        self._watchers = self.start("watchers", light_peers.__name__, "watchers", folder=folder)

    def serve(self, config: Config, dyads: int, peers: Peers, seconds: float) -> Served:
        """Run a server of some dyads with these peers."""
        configs = dyad_configs(config, self._folder, dyads)
        files = [str(file) for file in write_configs(configs, self._folder)]
        with Rig(self._folder, configs[-1]) as rig:  # its recording is not needed
            others = [word for file in files[:-1] for word in ("-c", file)]
            rig.start("server", "server", *others, *([] if peers.trial else ["--no-autostart"]))
            rig.until(lambda status: True)
            rig.disconnect()
            from_ns = now_ns() + round((WARM_SECONDS + WARM_SECONDS_A_DYAD * dyads) * 1e9)
            until_ns = from_ns + round(seconds * 1e9)
            order: dict[str, Any] = {"files": files, "from_ns": from_ns, "until_ns": until_ns}
            self._watchers.order(**order, loggers=peers.loggers, displays=peers.displays)
            if peers.agents:
                self._agents.order(**order, moving=peers.moving)
            cost, process = Cost(), rig.running["server"].pid
            light_peers.sleep_until(from_ns)
            before = read_usage(process)
            light_peers.sleep_until(until_ns)
            cost.add(before, read_usage(process))
            received = self._watchers.answer()
            of_agents = self._agents.answer() if peers.agents else {"counts": {}, "late_ns": []}
        return Served(
            cost,
            {name: count / seconds for name, count in (received["counts"] | of_agents["counts"]).items()},
            TickTiming(np.array(received["late_ns"], np.int64), received["skipped_ticks"]),
            received["active"],
            np.array(of_agents["late_ns"], np.int64),
        )


MAX_LATE, MIN_ACTIVE = 0.02, 0.99
"""Criteria for the capacity: largest share of deadline misses, smallest share of ticks in a trial [1]."""

MANY_DYADS = 8
"""Dyads that one core should hold [1]."""

MAX_P99_MS = 0.5
"""Largest lateness of 99 % of the ticks of many dyads on all cores [ms]."""

MAX_GROWTH = 1.2
"""Largest ratio of the cost per dyad among many to that of one alone; up to it, cost counts as linear [1]."""

MAX_IDLE = 0.005
"""Largest share of a core for a dyad without peers [1]."""


def on_cores(config: Config) -> Config:
    """Put the server on one core and its peers on another, where there are two."""
    cores = sorted(os.sched_getaffinity(0))
    return replace(config, realtime=replace(config.realtime, server_cpus=str(cores[0]), agent_cpus=str(cores[-1])))


def on_all_cores(config: Config) -> Config:
    """Let the server and its peers share all cores."""
    return replace(config, realtime=replace(config.realtime, server_cpus="", agent_cpus=""))


def holds(served: Served) -> bool:
    """Return whether a server met the criteria for its dyads."""
    return served.ticks.late <= MAX_LATE * served.ticks.ticks and served.active >= MIN_ACTIVE


def measure_scale(
    config: Config, light_peers: LightPeers, dyads: Sequence[int], seconds: float, tell: Tell
) -> dict[int, Served]:
    """Add dyads to one server until it no longer holds them."""
    found: dict[int, Served] = {}
    for step, count in enumerate(sorted(dyads)):
        tell(f"dyads at one server: {count}", step / len(dyads))
        found[count] = light_peers.serve(on_cores(config), count, Peers(), seconds)
        if not holds(found[count]):
            break
    return found


def scale_part(found: Mapping[int, Served]) -> ResultPart:
    """Tabulate the cost of many dyads on one core."""
    part = _table(
        "scale", "Dyads in trials, served by one process on one core; start of its ticks after their deadline", found
    )
    part.verdicts += _verdicts(found)
    return part


def measure_shared(config: Config, folder: Path, dyads: int, seconds: float, tell: Tell) -> Served:
    """Run a server of some dyads that shares all cores with its peers."""
    tell(f"dyads at one server on all cores: {dyads}", 0.0)
    with LightPeers(folder) as light_peers:  # those of other measurements stay on the core of their first one
        return light_peers.serve(on_all_cores(config), dyads, Peers(), seconds)


def shared_part(dyads: int, served: Served) -> ResultPart:
    """Tabulate the cost of many dyads on all cores."""
    cores = len(os.sched_getaffinity(0))
    caption = f"Dyads in trials, served by one process that shares {cores} cores with their peers"
    part = _table("shared", caption, {dyads: served})
    p99_ms = spread(served.ticks.late_ns).p99 * 1e3
    claim = f"{dyads} dyads on {cores} cores: 99 % of the ticks begin less than {MAX_P99_MS:g} ms after their deadline"
    found = f"{p99_ms:.3f} ms" if served.active >= MIN_ACTIVE else f"in trials only {served.active:.0%} of the time"
    part.claim(claim, p99_ms < MAX_P99_MS and served.active >= MIN_ACTIVE, found)
    return part


def _table(name: str, caption: str, found: Mapping[int, Served]) -> ResultPart:
    part = ResultPart(
        name,
        caption,
        (
            "dyads",
            f"{LOOP} [%]",
            f"{TRANSPORT} [%]",
            "all [%]",
            "each dyad [%]",
            *HEADS,
            "late [%]",
            "missed [1]",
            "in a trial [%]",
            "peers late, 99 % [ms]",
            "holds",
        ),
    )
    for count, served in found.items():
        share, seconds = served.cost.core_share, served.cost.seconds
        part.add(
            count,
            *(100 * served.cost.spent[kind].seconds / seconds for kind in (LOOP, TRANSPORT)),
            100 * share,
            100 * share / count,
            *in_milliseconds(spread(served.ticks.late_ns)),
            100 * served.ticks.late / max(served.ticks.ticks, 1),
            served.ticks.missed,
            100 * served.active,
            spread(served.peers_late_ns).p99 * 1e3,
            holds(served),
        )
    return part


def _verdicts(found: Mapping[int, Served]) -> list[BenchVerdict]:
    shares = {count: served.cost.core_share for count, served in found.items() if holds(served)}
    most = max(shares, default=0)
    verdicts = []
    if max(found) >= MANY_DYADS:
        capacity = f"{most} dyads" + ("" if most == max(found) else f", not {max(found)}")
        verdicts.append(BenchVerdict(f"one core holds {MANY_DYADS} dyads", most >= MANY_DYADS, capacity))
    if len(shares) > 1:
        slope, base = np.polyfit(list(shares), list(shares.values()), 1)
        least = min(shares)
        growth = max(share / count for count, share in shares.items()) * least / shares[least]
        fit = f"{100 * base:.2f} % + {100 * slope:.2f} % a dyad"
        fit += f"; each costs at most {growth:.2f} times as much as {least}"
        verdicts.append(BenchVerdict("cost grows linearly", growth <= MAX_GROWTH, fit))
    return verdicts


IDLE = {
    "agents, loggers, no trial": Peers(trial=False),
    "no peers": Peers(agents=False, loggers=False, trial=False),
}
"""Kinds of idle dyads, and their connected peers."""


def measure_idle(config: Config, light_peers: LightPeers, dyads: int, seconds: float, tell: Tell) -> dict[str, Served]:
    """Measure idle dyads."""
    found = {}
    for step, (name, peers) in enumerate(IDLE.items()):
        tell(f"idle dyads: {name}", step / len(IDLE))
        found[name] = light_peers.serve(on_cores(config), dyads, peers, seconds)
    return found


def idle_part(dyads: int, found: Mapping[str, Served]) -> ResultPart:
    """Tabulate the cost of idle dyads."""
    idle = found["no peers"].cost.core_share / dyads
    claim = f"a dyad without peers costs less than {MAX_IDLE:.1%} of a core"
    part = ResultPart(
        "waiting",
        f"{dyads} idle dyads, served by one process",
        "peers | all [%] | each dyad [%]",
        [(name, 100 * served.cost.core_share, 100 * served.cost.core_share / dyads) for name, served in found.items()],
    )
    part.claim(claim, idle < MAX_IDLE, f"{idle:.2%}")
    return part
