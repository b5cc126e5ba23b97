"""The number of dyads that one logger can record: a real process over real sockets, at increasing rates.

A rate is sustained if nothing is lost, the records that are not on disk at the end are no more than those of a flush
interval and some slow syncs, and their number has not grown since the middle. The feeder must have kept up, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from netboard.benchmarks.harness.results import ResultPart
from netboard.benchmarks.harness.running import Tell
from netboard.benchmarks.loop.usage import read_usage, total
from netboard.benchmarks.recording.feeding import Feeder
from netboard.recording.files.reader import Recording

TARGET = 20
"""Target rate, as a multiple of one dyad's [1]."""

SETTLE_SECONDS = 1.0
BACKLOG_SECONDS = 1.0
"""Largest backlog of a logger that keeps up: the flush interval and some slow syncs [s]."""

GROWTH_SECONDS = 0.3
"""Largest growth of that backlog since the middle of the run [s]."""

FEEDER_BEHIND_NS = 200_000_000
"""Largest delay of a feeder that keeps up [ns]."""


@dataclass(frozen=True)
class Load:
    """Result at one rate.

    - `halfway`, `backlog`: records that were not on disk in the middle and at the end, as time at this rate [s].
    - `feeder_behind`: largest delay of the feeder [s].
    """

    cpu: float
    halfway: float
    backlog: float
    feeder_behind: float
    lost: int

    @property
    def sustained(self) -> bool:
        """Return whether the logger kept up."""
        kept_up = self.backlog < BACKLOG_SECONDS and self.backlog < self.halfway + GROWTH_SECONDS
        return kept_up and not self.lost and self.feeder_behind * 1e9 < FEEDER_BEHIND_NS


def measure_load(folder: Path, log: list[list[bytes]], rate: int, seconds: float) -> Load:
    """Feed a logger at one rate and return the result."""
    each_second = sum(map(len, log)) / len(log) * 1e3 * rate
    with Feeder(folder, log) as feeder:
        feeder.wait_for_logger()
        feeder.feed(SETTLE_SECONDS, 1)
        before = read_usage(feeder.process.pid)
        feeder.behind_ns = 0
        feeder.feed(seconds / 2, rate)
        halfway = feeder.port.store.backlog / each_second
        feeder.feed(seconds / 2, rate)
        after = read_usage(feeder.process.pid)
        backlog = feeder.port.store.backlog / each_second
        feeder.end()
    (path,) = (folder / "recordings").glob("*.mcap")
    with Recording(path) as recording:
        lost = int(recording.end["lost"])
    cpu = total(after.since(before).values()).seconds / ((after.at_ns - before.at_ns) * 1e-9)
    return Load(cpu, halfway, backlog, feeder.behind_ns * 1e-9, lost)


def headroom_part(folder: Path, log: list[list[bytes]], rates: Sequence[int], seconds: float, tell: Tell) -> ResultPart:
    """Raise the rate until the logger no longer keeps up."""
    part = ResultPart(
        "headroom",
        f"A logger fed over a socket for {seconds:g} s at multiples of one dyad's rate",
        "times the rate [1] | CPU [cores] | not on disk halfway [ms] | at the end [ms] | feeder behind [ms] | "
        "lost | sustained",
    )
    most = 0
    for rate in rates:
        tell(f"a logger at {rate} times the live rate", 0.4)
        load = measure_load(folder, log, rate, seconds)
        if not load.sustained:  # a stall of the machine is no evidence about the rate: measure again
            load = measure_load(folder, log, rate, seconds)
        times = (1e3 * value for value in (load.halfway, load.backlog, load.feeder_behind))
        part.add(rate, load.cpu, *times, load.lost, load.sustained)
        if not load.sustained:
            break
        most = max(most, rate)
    part.claim(f"a logger takes {TARGET} times one dyad's rate", most >= TARGET, f"{most} times, on this machine")
    cpu = float(part.rows[0][1])
    part.claim("at one dyad's rate it uses a tenth of a core at most", cpu <= 0.1, f"{cpu:.3f}")
    return part
