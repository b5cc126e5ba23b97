"""Many dyads in one server process on one core: CPU cost and tick jitter by number of dyads, up to the limit.

Every dyad is in a trial with haptic feedback and has a logger; all peers are on another core. Then idle dyads: with
agents but no trial, and without peers.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from netboard.base.config import Config
from netboard.benchmarks.harness.results import Part, Value, Verdict
from netboard.benchmarks.harness.running import Tell
from netboard.benchmarks.loop.serving import Company, Crowd, Served
from netboard.benchmarks.loop.spreads import HEADS, in_milliseconds
from netboard.benchmarks.loop.usage import LOOP, TRANSPORT, total
from netboard.recording.format.summary import spread

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
        found[count] = crowd.serve(on_cores(config), count, Company(), seconds)
        if not holds(found[count]):
            break
    return found


def scale_part(found: Mapping[int, Served]) -> Part:
    """Tabulate the cost of many dyads."""
    rows: list[tuple[Value, ...]] = []
    for count, served in found.items():
        share, seconds = core_share(served), served.cost.seconds
        rows.append(
            (
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
        )
    return Part(
        "scale",
        "Dyads in trials at one server process on one core; its ticks: how late they begin",
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
        rows,
        _verdicts(found),
    )


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
    "agents, loggers, no trial": Company(trial=False),
    "nobody": Company(agents=False, loggers=False, trial=False),
}
"""Kinds of waiting dyads, by the peers that are present."""


def measure_waiting(config: Config, crowd: Crowd, dyads: int, seconds: float, tell: Tell) -> dict[str, Served]:
    """Measure dyads that wait."""
    found = {}
    for step, (name, company) in enumerate(WAITING.items()):
        tell(f"dyads that wait: {name}", step / len(WAITING))
        found[name] = crowd.serve(on_cores(config), dyads, company, seconds)
    return found


def waiting_part(dyads: int, found: Mapping[str, Served]) -> Part:
    """Tabulate the cost of waiting dyads."""
    rows: list[tuple[Value, ...]] = [
        (name, 100 * core_share(served), 100 * core_share(served) / dyads) for name, served in found.items()
    ]
    idle = core_share(found["nobody"]) / dyads
    claim = f"a dyad with nobody costs less than {MAX_IDLE:.1%} of a core"
    return Part(
        "waiting",
        f"{dyads} dyads that wait, at one server process",
        ("who is there", "all [%]", "each dyad [%]"),
        rows,
        [Verdict(claim, idle < MAX_IDLE, f"{idle:.2%}")],
    )
