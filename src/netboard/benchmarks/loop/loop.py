"""Sample-to-force latency in real operation, interleaved with an echo over the same transport and with a timer.

In each round netboard runs for a period and is then suspended. An echo over the same sockets, with the same number of
peers, the same phases and frames of the same size, runs equally long; then a timer. So all are measured on the machine
in the same state. Netboard's latency is read from its recording.

Claims compare the loop with the echo and the ticks with the timer of the same run.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Config
from netboard.base.tick import TICK_NS, TICK_SECONDS
from netboard.benchmarks.harness.results import BenchVerdict, ResultPart, Value
from netboard.benchmarks.harness.running import Tell
from netboard.benchmarks.harness.workers import Worker, Workers
from netboard.benchmarks.loop import baselines
from netboard.benchmarks.loop.rig import Dyads, dyad_configs, write_configs
from netboard.benchmarks.loop.stand_in import AGENT
from netboard.benchmarks.loop.timing import (
    HEADS,
    LoopTiming,
    TickTiming,
    Times,
    loop_timing,
    ratio_row,
    spread_rows,
)
from netboard.benchmarks.loop.usage import KINDS, LOOP, TRANSPORT, Costs, Usage, add_costs, read_usage, total
from netboard.recording.files.reader import Recording
from netboard.recording.format.summary import spread
from netboard.recording.timing.stamps import Stamps, stamps_of

LEAD_NS = 50_000_000
"""Lead time between the order and the common start of the baselines [ns]."""

GREETINGS = 100
"""Frames exchanged before an echo is measured [1]."""


@dataclass
class Round:
    """A turn of netboard, of the echo and of the timer.

    - `span_ns`: start and end of netboard's turn, monotonic clock [ns].
    - `echo_ns`: times from waking to the answer, of both peers of the echo [ns].
    - `costs`: resource use of netboard's processes and of those of the echo, by name.
    """

    span_ns: tuple[int, int]
    echo_ns: Times
    timer: TickTiming
    costs: Costs


@dataclass
class MeasuredLoop:
    """All measurements.

    - `stamps`, `timing`: stamps of netboard's ticks, and their timing in all rounds, from the recording.
    - `costs`: as in each round, summed.
    """

    rounds: list[Round]
    stamps: Stamps
    timing: LoopTiming
    costs: Costs

    @property
    def echo_ns(self) -> Times:
        """Return the times of the echo in all rounds [ns]."""
        return np.concatenate([one.echo_ns for one in self.rounds])

    @property
    def timer(self) -> TickTiming:
        """Return the timing of the timer in all rounds."""
        late_ns = np.concatenate([one.timer.late_ns for one in self.rounds])
        return TickTiming(late_ns, sum(one.timer.skipped for one in self.rounds))


def measure_loop(config: Config, folder: Path, displays: int, seconds: float, rounds: int, tell: Tell) -> MeasuredLoop:
    """Measure netboard and the baselines, interleaved."""
    measured, spare = dyad_configs(config, folder, 2)
    costs: Costs = {}
    found: list[Round] = []
    agent = AGENT if config.agents.left.device == "openhaptics" else ()
    with Workers() as workers, Dyads([measured], folder, displays, agent) as processes:
        others = Baselines(spare, folder, workers, round(seconds / rounds * 1e9) // TICK_NS)
        for number in range(rounds):
            report = _progress(tell, number, rounds)
            report("waiting for a trial", 0.0)
            processes.wait_for_trials()
            period = processes.measure(seconds / rounds, partial(report, "netboard"))
            processes.suspend()
            report("echo", 1.0)
            echo_ns, before, after = others.run_echo()
            report("timer", 1.0)
            found.append(Round((period.start_ns, period.end_ns), echo_ns, others.run_timer(), {}))
            for where in (costs, found[-1].costs):
                add_costs(where, period.before, period.after)
                add_costs(where, before, after)
            processes.resume()
        tell("reading the recording", 1.0)
        (path,) = processes.finish()
    with Recording(path) as recording:
        stamps = stamps_of(recording)
    return MeasuredLoop(found, stamps, loop_timing(stamps, [one.span_ns for one in found]), costs)


def _progress(tell: Tell, number: int, rounds: int) -> Callable[[str, float], object]:
    """Return the progress callback of a round."""
    return lambda what, done: tell(f"round {number + 1} of {rounds}: {what}", (number + done) / rounds)


class Baselines:
    """An echo with a peer for each agent, and a timer, which sleep between their turns."""

    def __init__(self, config: Config, folder: Path, workers: Workers, count: int) -> None:
        (file,) = write_configs([config], folder)

        def start(role: str, name: str = "") -> Worker:
            return workers.start(f"{role} {name}".strip(), baselines.__name__, role, name, str(file), folder=folder)

        self._count = count
        self._echo, self._timer = start("echo"), start("timer")
        self._peers = {f"peer {side}": start("peer", f"agent.{side}") for side in SIDES}
        self._exchange(GREETINGS, greeting=True)

    def run_echo(self) -> tuple[Times, dict[str, Usage], dict[str, Usage]]:
        """Run the echo's turn; return the times of both peers [ns], and all resource use before and after."""
        processes = {"echo": self._echo, **self._peers}

        def usage() -> dict[str, Usage]:
            return {name: read_usage(worker.process_id) for name, worker in processes.items()}

        before, found, after = usage(), self._exchange(self._count), usage()
        return np.concatenate([np.array(took, np.int64) for took in found.values()]), before, after

    def run_timer(self) -> TickTiming:
        """Run the timer's turn."""
        self._timer.order(count=self._count, start_ns=now_ns() + LEAD_NS)
        found = self._timer.answer()
        return TickTiming(np.array(found["late_ns"], np.int64), found["moved_ns"] // TICK_NS)

    def _exchange(self, count: int, *, greeting: bool = False) -> dict[str, list[int]]:
        self._echo.order(count=count * len(self._peers), greeting=greeting)
        start_ns = now_ns() + LEAD_NS
        for worker in self._peers.values():
            worker.order(count=count, start_ns=start_ns)
        found = {name: worker.answer()["took_ns"] for name, worker in self._peers.items()}
        self._echo.answer()
        return found


MAX_RATIOS = {"50 %": 1.15, "99 %": 1.3, "99.9 %": 1.2}
"""Largest ratios of the loop to an echo, at each percentile [1]."""

MANY = 100_000
MAX_MISSED = 5.0
"""Largest number of deadline misses in `MANY` ticks, beyond those of the timer [1]."""

MAX_CPU = 1.4
"""Largest ratio of the CPU time of server and agent to that of the echo and its peer [1]."""

LOOP_NAME, ECHO_NAME = "sample to force", "echo"


def loop_series(found: MeasuredLoop) -> list[dict[str, Times]]:
    """Return the series for histograms: the loop and the echo, the ticks and the timer."""
    return [
        {LOOP_NAME: _concatenated(found.timing.latency_ns), ECHO_NAME: found.echo_ns},
        {"tick begins late (left edge: in time)": found.timing.ticks.late_ns, "timer is late": found.timer.late_ns},
    ]


def ratios_part(found: MeasuredLoop) -> ResultPart:
    """Return the ratios of netboard to its baselines over the rounds: medians and extremes."""
    rounds = [_ratios(one, loop_timing(found.stamps, [one.span_ns])) for one in found.rounds]
    limits = [*MAX_RATIOS.values(), MAX_MISSED, MAX_CPU, MAX_CPU]
    part = ResultPart(
        "ratios",
        f"netboard compared with its baselines, over {len(found.rounds)} rounds",
        " | median | least | largest | limit",
    )
    for name, most in zip(rounds[0], limits, strict=True):
        values = [ratios[name] for ratios in rounds]
        median = float(np.median(values))
        part.add(name, median, min(values), max(values), most)
        part.claim(f"{name}: at most {most:g}", median <= most, f"{median:.2f}")
    return part


def _ratios(one: Round, timing: LoopTiming) -> dict[str, float]:
    _, *ratios = ratio_row("", _concatenated(timing.latency_ns), one.echo_ns)
    # Without other threads: the servo of a haptic device belongs to its vendor's library.
    spent = {name: cost.share_of(LOOP, TRANSPORT) for name, cost in one.costs.items()}
    agents, peers = sum(spent[f"{side} agent"] for side in SIDES), sum(spent[f"peer {side}"] for side in SIDES)
    return {
        **{f"sample to force / echo, {at} [1]": float(ratio) for at, ratio in zip(MAX_RATIOS, ratios, strict=False)},
        f"missed of {MANY}, beyond those of the timer [1]": timing.ticks.missed_of(MANY) - one.timer.missed_of(MANY),
        "CPU of the server / echo [1]": spent["server"] / spent["echo"],
        "CPU of the agents / peers [1]": agents / peers,
    }


def latency_part(found: MeasuredLoop, *, real_time: bool) -> ResultPart:
    """Return the latency of the loop, of its parts and of the echo.

    - `real_time`: whether real-time scheduling was requested; then the loop should take less than a tick.
    """
    took = _concatenated(found.timing.latency_ns)
    rows = spread_rows(
        {LOOP_NAME: took}
        | {f"  {side}": times for side, times in found.timing.latency_ns.items()}
        | {f"  of it: {name}": times for name, times in found.timing.parts_ns.items()}
        | {f"{ECHO_NAME} of the same bytes": found.echo_ns}
    )
    p999 = spread(took).p999
    verdicts = [BenchVerdict("99.9 % take less than a tick", p999 < TICK_SECONDS, f"{p999 * 1e3:.3f} ms")]
    return ResultPart(
        "latency",
        f"Sample-to-force latency and that of an echo; {found.timing.answered:.2%} of the ticks have a latency",
        ("", "samples [1]", *HEADS),
        rows,
        verdicts if real_time else [],
    )


def lateness_part(found: MeasuredLoop) -> ResultPart:
    """Return the tick jitter of the server and of the timer."""
    named = {"server's ticks": found.timing.ticks, "timer alone": found.timer}
    return ResultPart(
        "lateness",
        f"Start of ticks after their deadline; late: by over {TICK_NS / 2e6:g} ms; missed: by over a tick, or never",
        ("", "ticks [1]", *HEADS, "late [1]", "missed [1]", f"missed of {MANY} [1]"),
        [
            (*row, one.late, one.missed, one.missed_of(MANY))
            for row, one in zip(
                spread_rows({name: one.late_ns for name, one in named.items()}), named.values(), strict=True
            )
        ],
    )


def costs_part(costs: Costs) -> ResultPart:
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
                *(cost.spent[kind].sleeps * TICK_SECONDS / cost.seconds for kind in (LOOP, TRANSPORT)),
                whole.preemptions * TICK_SECONDS / cost.seconds,
            )
        )
    return ResultPart(
        "costs",
        "CPU time of each process as a share of one core, and its context switches per tick: sleeps, and preemptions",
        (
            "",
            *(f"{kind} [%]" for kind in KINDS),
            "all [%]",
            "waiting for a core [%]",
            *(f"{kind} sleeps [1]" for kind in (LOOP, TRANSPORT)),
            "preempted [1]",
        ),
        rows,
    )


def _concatenated(named: Mapping[str, Times]) -> Times:
    """Return all durations in one array."""
    return np.concatenate([*named.values(), np.empty(0, np.int64)])
