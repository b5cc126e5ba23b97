"""The loop from stylus to force as it is in use, and beside it, in turns, what the transport and a timer alone take.

In each round netboard plays for a while and is then stopped where it is; an echo over the same sockets, with as many
peers, in step as the agents are, and with frames of the same size, runs for as long; then a timer. So all of them see
the same machine. What netboard took is read from its own recording.
"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Config
from netboard.base.tick import TICK_NS
from netboard.benchmarks.harness.running import Tell
from netboard.benchmarks.loop.played import Played, Punctuality, played, punctuality
from netboard.benchmarks.loop.rig import Rig, own_configs, write_configs
from netboard.benchmarks.loop.spreads import Times
from netboard.benchmarks.loop.usage import Costs, add_costs, read_usage
from netboard.benchmarks.loop.workers import Worker, Workers
from netboard.recording.files.reader import Recording

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
