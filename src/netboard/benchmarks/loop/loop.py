"""The loop from stylus to force as it is in use, and beside it, in turns, what the transport and a timer alone take.

In each round netboard plays for a while and is then stopped where it is; an echo over the same sockets, with as many
peers, in step as the agents are, and with frames of the same size, runs for as long; then a timer. So all of them see
the same machine. What netboard took is read from its own recording.

Verdicts hold netboard's loop against the echo and its ticks against the timer, both measured in the same run; only the
last ones are about the machine as well.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Config
from netboard.base.tick import TICK_NS, TICK_SECONDS
from netboard.benchmarks.harness.results import Part, Value, Verdict
from netboard.benchmarks.harness.running import Tell
from netboard.benchmarks.loop.played import Played, Punctuality, played, punctuality
from netboard.benchmarks.loop.rig import Rig, own_configs, write_configs
from netboard.benchmarks.loop.spreads import HEADS, Times, ratio_row, spread_rows
from netboard.benchmarks.loop.usage import KINDS, LOOP, TRANSPORT, Cost, Costs, add_costs, read_usage, total
from netboard.benchmarks.loop.workers import Worker, Workers
from netboard.recording.files.reader import Recording
from netboard.recording.format.summary import spread

BASELINES = "netboard.benchmarks.loop.baselines"

LEAD_NS = 50_000_000
"""Lead time between the order and the common start of the baselines [ns]."""

GREETINGS = 100
"""Frames exchanged before an echo is measured [1]."""


@dataclass
class Measured:
    """Everything that was found.

    - `echo_ns`: of each peer of the echo: from waking to the answer [ns].
    - `costs`, `echo_costs`: of netboard's processes, and of those of the echo, by name.
    """

    played: Played
    echo_ns: dict[str, Times]
    timer: Punctuality
    costs: Costs
    echo_costs: Costs


def measure_loop(config: Config, folder: Path, displays: int, seconds: float, rounds: int, tell: Tell) -> Measured:
    """Measure netboard and the baselines in turns."""
    own, spare = own_configs(config, folder, 2)
    costs: Costs = {}
    times = []
    with Workers() as workers, Rig([own], folder, displays) as rig:
        baselines = Baselines(spare, folder, workers, round(seconds / rounds * 1e9) // TICK_NS)
        for number in range(rounds):
            say = _progress(tell, number, rounds)
            say("waiting for a trial", 0.0)
            rig.play()
            stretch = rig.measure(seconds / rounds, partial(say, "netboard"))
            times.append((stretch.start_ns, stretch.end_ns))
            add_costs(costs, stretch.before, stretch.after)
            rig.halt()
            say("echo", 1.0)
            baselines.run_echo()
            say("timer", 1.0)
            baselines.run_timer()
            rig.go_on()
        tell("reading the recording", 1.0)
        (path,) = rig.finish()
    with Recording(path) as recording:
        found = played(recording.ticks(), times)
    return Measured(found, baselines.echo_ns, baselines.timer, costs, baselines.costs)


def _progress(tell: Tell, number: int, rounds: int) -> Tell:
    """Return a function that reports progress within one of several rounds."""
    return lambda text, share: tell(f"round {number + 1} of {rounds}: {text}", (number + share) / rounds)


class Baselines:
    """An echo with a peer for each agent, and a timer; they sleep until it is their turn."""

    def __init__(self, config: Config, folder: Path, workers: Workers, count: int) -> None:
        (file,) = write_configs([config], folder)

        def start(role: str, name: str = "") -> Worker:
            return workers.start(f"{role} {name}".strip(), BASELINES, role, name, str(file), folder=folder)

        self.costs: Costs = {}
        self._count = count
        self._echo, self._timer = start("echo"), start("timer")
        self._peers = {f"peer {side}": start("peer", f"agent.{side}") for side in SIDES}
        self._took: dict[str, list[int]] = {name: [] for name in self._peers}
        self._late: list[int] = []
        self._moved_ns = 0
        self._exchange(GREETINGS, greeting=True)

    @property
    def echo_ns(self) -> dict[str, Times]:
        """Return the time from waking to the answer, for each peer [ns]."""
        return {name: np.array(took, np.int64) for name, took in self._took.items()}

    @property
    def timer(self) -> Punctuality:
        """Return the timing of the timer."""
        return punctuality(np.array(self._late, np.int64), self._moved_ns // TICK_NS)

    def run_echo(self) -> None:
        """Run the echo's turn."""
        processes = {"echo": self._echo, **self._peers}
        before = {name: read_usage(worker.process_id) for name, worker in processes.items()}
        found = self._exchange(self._count)
        add_costs(self.costs, before, {name: read_usage(worker.process_id) for name, worker in processes.items()})
        for name, took in found.items():
            self._took[name] += took

    def run_timer(self) -> None:
        """Run the timer's turn."""
        self._timer.order(count=self._count, start_ns=now_ns() + LEAD_NS)
        found = self._timer.answer()
        self._late += found["late_ns"]
        self._moved_ns += found["moved_ns"]

    def _exchange(self, count: int, *, greeting: bool = False) -> dict[str, list[int]]:
        self._echo.order(count=count * len(self._peers), greeting=greeting)
        start_ns = now_ns() + LEAD_NS
        for worker in self._peers.values():
            worker.order(count=count, start_ns=start_ns)
        found = {name: worker.answer()["took_ns"] for name, worker in self._peers.items()}
        self._echo.answer()
        return found


MOST_MEDIAN, MOST_P99 = 1.5, 2.0
"""Largest ratios of the loop to an echo, at the median and the 99th percentile [1]."""

MANY = 100_000
MOST_MISSED = 1.0
"""Largest number of deadline misses in `MANY` ticks, beyond those of the timer [1]."""

MOST_SERVER = 0.2
"""Largest share of a core for a server of one dyad with a logger and two displays [1]."""

LOOP_NAME, ECHO_NAME = "stylus to force", "echo"


def loop_series(found: Measured) -> list[dict[str, Times]]:
    """Return the series for histograms: the loop and the echo, the ticks and the timer."""
    late_ns = found.played.ticks.late_ns
    return [
        {LOOP_NAME: _together(found.played.took_ns), ECHO_NAME: _together(found.echo_ns)},
        {"tick begins late": late_ns[late_ns > 0], "timer is late": found.timer.late_ns},
    ]


def latency_part(found: Measured, *, real_time: bool) -> Part:
    """Return the loop beside the echo, and its parts.

    - `real_time`: real-time scheduling was asked for: then the loop should take less than a tick.
    """
    took, echo = _together(found.played.took_ns), _together(found.echo_ns)
    rows = spread_rows(
        {LOOP_NAME: took}
        | {f"  {side}": times for side, times in found.played.took_ns.items()}
        | {f"  of it: {name}": times for name, times in found.played.parts_ns.items()}
        | {f"{ECHO_NAME} of the same bytes": echo}
    )
    ratios = ratio_row("stylus to force / echo [1]", took, echo)
    median, p99 = float(ratios[1]), float(ratios[2])
    rows.append((ratios[0], "", *ratios[1:]))
    verdicts = [
        Verdict(
            f"at 50 % the loop takes at most {MOST_MEDIAN:g} times an echo", median <= MOST_MEDIAN, f"{median:.2f}"
        ),
        Verdict(f"at 99 % it takes at most {MOST_P99:g} times an echo", p99 <= MOST_P99, f"{p99:.2f}"),
    ]
    if real_time:
        p999 = spread(took).p999
        verdicts.append(Verdict("99.9 % take less than a tick", p999 < TICK_SECONDS, f"{p999 * 1e3:.3f} ms"))
    return Part(
        "latency",
        f"Stylus read to force at the device, beside an echo; {found.played.answered:.2%} of the ticks closed a loop",
        ("", "samples [1]", *HEADS),
        rows,
        verdicts,
    )


def lateness_part(ticks: Punctuality, timer: Punctuality, *, real_time: bool) -> Part:
    """Return how the server's ticks kept their time, beside a timer alone.

    - `real_time`: real-time scheduling was asked for: then no more should be missed.
    """
    named = {"server's ticks": ticks, "timer alone": timer}
    rows: list[tuple[Value, ...]] = [
        (*row, one.late, one.missed, one.missed_of(MANY))
        for row, one in zip(
            spread_rows({name: one.late_ns for name, one in named.items()}), named.values(), strict=True
        )
    ]
    beyond = ticks.missed_of(MANY) - timer.missed_of(MANY)
    claim = f"of {MANY} ticks at most {MOST_MISSED:g} more is missed than by a timer alone"
    found = f"{beyond:+.2f}, of {ticks.ticks} ticks measured"
    return Part(
        "lateness",
        f"How late ticks begin; late: by more than {TICK_NS / 2e6:g} ms; missed: by more than a tick, or never",
        ("", "ticks [1]", *HEADS, "late [1]", "missed [1]", f"missed of {MANY} [1]"),
        rows,
        [Verdict(claim, beyond <= MOST_MISSED, found)] if real_time else [],
    )


def costs_part(costs: Costs, *verdicts: Verdict) -> Part:
    """Return the resource use of every process."""
    rows: list[tuple[Value, ...]] = []
    for name, cost in costs.items():
        whole, percent = total(cost.spent.values()), 100 / cost.seconds
        rows.append(
            (
                name,
                *(percent * cost.spent[kind].seconds for kind in KINDS),
                percent * whole.seconds,
                percent * whole.waited,
                *(cost.spent[kind].slept * TICK_SECONDS / cost.seconds for kind in (LOOP, TRANSPORT)),
                whole.ousted * TICK_SECONDS / cost.seconds,
            )
        )
    return Part(
        "costs",
        "What every process uses of a core, and how often in a tick it goes to sleep or is put aside for another",
        (
            "",
            *(f"{kind} [%]" for kind in KINDS),
            "all [%]",
            "waits for a core [%]",
            *(f"{kind} sleeps [1]" for kind in (LOOP, TRANSPORT)),
            "put aside [1]",
        ),
        rows,
        list(verdicts),
    )


def server_verdict(server: Cost, echo: Cost, displays: int) -> Verdict:
    """Judge the CPU use of a one-dyad server, with that of a bare echo for comparison."""
    share, least = (total(cost.spent.values()).seconds / cost.seconds for cost in (server, echo))
    claim = f"the server uses at most {MOST_SERVER:.0%} of a core"
    found = f"{share:.1%}, with a logger, displays: {displays}; the bare echo {least:.1%}"
    return Verdict(claim, share <= MOST_SERVER, found)


def _together(named: Mapping[str, Times]) -> Times:
    """Return all durations in one array."""
    return np.concatenate([*named.values(), np.empty(0, np.int64)])
