"""Many dyads in one server process on one core: CPU cost and tick jitter by number of dyads, up to the limit.

The server is a real one. Two more processes are all its lightweight peers (`netboard.benchmarks.loop.crowd`); their
orders say which peers, and for how long.

Every dyad is in a trial with haptic feedback and has a logger; all peers are on another core. Then idle dyads: with
agents but no trial, and without peers.
"""

import os
import signal
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.config import Config
from netboard.benchmarks.harness.results import Part, Verdict
from netboard.benchmarks.harness.running import Tell
from netboard.benchmarks.loop.rig import await_status, own_configs, write_configs
from netboard.benchmarks.loop.timing import HEADS, Punctuality, Times, in_milliseconds, punctuality
from netboard.benchmarks.loop.usage import LOOP, TRANSPORT, Cost, read_usage, total
from netboard.benchmarks.loop.workers import Workers
from netboard.network.transport import sockets
from netboard.nodes.operator.launcher import Launcher
from netboard.nodes.operator.operator import Operator
from netboard.recording.format.summary import spread

CROWD = "netboard.benchmarks.loop.crowd"

WARM_SECONDS = 4.0
"""Time for sessions to begin their trials and for agents to adjust their phase, before counting starts [s]."""


@dataclass(frozen=True)
class Peers:
    """The peers of a server."""

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
    ticks: Punctuality
    active: float
    peers_late_ns: Times


class Crowd(Workers):
    """The two processes that are all peers of a server; leaving the context ends them."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self._folder = folder
        self._agents, self._watchers = (self.start(role, CROWD, role, folder=folder) for role in ("agents", "watchers"))

    def serve(self, config: Config, dyads: int, peers: Peers, seconds: float) -> Served:
        """Run a server of some dyads with these peers."""
        configs = own_configs(config, self._folder, dyads)
        files = [str(file) for file in write_configs(configs, self._folder)]
        with Launcher(self._folder, {}) as launcher:
            words = [word for file in files for word in ("-c", file)]
            launcher.start("server", "server", *words, *([] if peers.trial else ["--no-autostart"]))
            with sockets.open_context() as context:
                operator = Operator(configs[-1].network, context)  # the context closes its socket
                await_status(launcher, operator)
            from_ns = now_ns() + round(WARM_SECONDS * 1e9)
            until_ns = from_ns + round(seconds * 1e9)
            order: dict[str, Any] = {"files": files, "from_ns": from_ns, "until_ns": until_ns}
            self._watchers.order(**order, loggers=peers.loggers, displays=peers.displays)
            if peers.agents:
                self._agents.order(**order, moving=peers.moving)
            cost, process = Cost(), launcher.process_id("server")
            _sleep_until(from_ns)
            before = read_usage(process)
            _sleep_until(until_ns)
            cost.add(before, read_usage(process))
            seen = self._watchers.answer()
            felt = self._agents.answer() if peers.agents else {"counts": {}, "late_ns": []}
            os.kill(process, signal.SIGKILL)  # its recording is not needed
        return Served(
            cost,
            {name: count / seconds for name, count in (seen["counts"] | felt["counts"]).items()},
            punctuality(np.array(seen["late_ns"], np.int64), seen["passed_over"]),
            seen["active"],
            np.array(felt["late_ns"], np.int64),
        )


def _sleep_until(at_ns: int) -> None:
    time.sleep(max(0.0, (at_ns - now_ns()) * 1e-9))


MAX_LATE, MIN_ACTIVE = 0.02, 0.99
"""Criteria for the capacity: largest share of deadline misses, smallest share of ticks in a trial [1]."""

MANY_DYADS = 8
"""Dyads that one core should hold [1]."""

MAX_GROWTH = 1.2
"""Largest ratio of the cost per dyad among many to that of one alone; up to it, cost counts as linear [1]."""

MAX_IDLE = 0.005
"""Largest share of a core for a dyad without peers [1]."""


def on_cores(config: Config) -> Config:
    """Put the server on one core and its peers on another, where there are two."""
    cores = sorted(os.sched_getaffinity(0))
    return replace(config, realtime=replace(config.realtime, server_cpus=str(cores[0]), agent_cpus=str(cores[-1])))


def holds(served: Served) -> bool:
    """Return whether a server met the criteria for its dyads."""
    return served.ticks.late <= MAX_LATE * served.ticks.ticks and served.active >= MIN_ACTIVE


def core_share(served: Served) -> float:
    """Return the share of a core that a server used [1]."""
    return total(served.cost.spent.values()).seconds / served.cost.seconds


def measure_scale(config: Config, crowd: Crowd, dyads: Sequence[int], seconds: float, tell: Tell) -> dict[int, Served]:
    """Add dyads to one server until it no longer holds them."""
    found: dict[int, Served] = {}
    for step, count in enumerate(sorted(dyads)):
        tell(f"dyads at one server: {count}", step / len(dyads))
        found[count] = crowd.serve(on_cores(config), count, Peers(), seconds)
        if not holds(found[count]):
            break
    return found


def scale_part(found: Mapping[int, Served]) -> Part:
    """Tabulate the cost of many dyads."""
    part = Part(
        "scale",
        "Dyads in trials, served by one process on one core; start of its ticks after their deadline",
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
        share, seconds = core_share(served), served.cost.seconds
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
    part.verdicts += _verdicts(found)
    return part


def _verdicts(found: Mapping[int, Served]) -> list[Verdict]:
    held = {count: core_share(served) for count, served in found.items() if holds(served)}
    most = max(held, default=0)
    verdicts = []
    if max(found) >= MANY_DYADS:
        said = f"{most} dyads" + ("" if most == max(found) else f", not {max(found)}")
        verdicts.append(Verdict(f"one core holds {MANY_DYADS} dyads", most >= MANY_DYADS, said))
    if len(held) > 1:
        slope, base = np.polyfit(list(held), list(held.values()), 1)
        least = min(held)
        growth = max(share / count for count, share in held.items()) * least / held[least]
        fit = (
            f"{100 * base:.2f} % + {100 * slope:.2f} % a dyad; each costs at most {growth:.2f} times as much as {least}"
        )
        verdicts.append(Verdict("cost grows linearly", growth <= MAX_GROWTH, fit))
    return verdicts


WAITING = {
    "agents, loggers, no trial": Peers(trial=False),
    "no peers": Peers(agents=False, loggers=False, trial=False),
}
"""Kinds of idle dyads, by the peers that are connected."""


def measure_waiting(config: Config, crowd: Crowd, dyads: int, seconds: float, tell: Tell) -> dict[str, Served]:
    """Measure idle dyads."""
    found = {}
    for step, (name, peers) in enumerate(WAITING.items()):
        tell(f"idle dyads: {name}", step / len(WAITING))
        found[name] = crowd.serve(on_cores(config), dyads, peers, seconds)
    return found


def waiting_part(dyads: int, found: Mapping[str, Served]) -> Part:
    """Tabulate the cost of idle dyads."""
    idle = core_share(found["no peers"]) / dyads
    claim = f"a dyad without peers costs less than {MAX_IDLE:.1%} of a core"
    part = Part(
        "waiting",
        f"{dyads} idle dyads, served by one process",
        "peers | all [%] | each dyad [%]",
        [(name, 100 * core_share(served), 100 * core_share(served) / dyads) for name, served in found.items()],
    )
    part.claim(claim, idle < MAX_IDLE, f"{idle:.2%}")
    return part
