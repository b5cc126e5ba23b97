"""Sample-to-force latency and tick jitter, from a recording.

Every agent measures its latency itself and sends it with the next sample. The parts of the latency follow from the
times that the server records for that sample: read, arrived, start of the tick. All times are those of one clock, since
the processes of a benchmark share a machine.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES
from netboard.base.tick import LATE_NS, TICK_NS
from netboard.benchmarks.loop.spreads import Times
from netboard.task.trials.state_machine import Phase, is_active

UP, WAIT, REST = "stylus read to arrival at the server", "wait for the tick", "tick, return and rendering"
"""Parts of a sample-to-force latency."""


@dataclass(frozen=True)
class Punctuality:
    """Timing of ticks.

    - `late_ns`: start of each after its deadline; negative: before it [ns].
    - `missed`: ticks that began more than a whole tick late, and skipped ticks [1].
    """

    late_ns: Times
    late: int
    missed: int

    @property
    def ticks(self) -> int:
        """Return the number of ticks, without those passed over [1]."""
        return self.late_ns.size

    def missed_of(self, many: int) -> float:
        """Return the expected number of ticks missed by a whole period or more among `many` [1]."""
        return self.missed * many / max(self.ticks, 1)


def punctuality(late_ns: Times, passed_over: int) -> Punctuality:
    """Count deadline misses."""
    missed = int(np.count_nonzero(late_ns > TICK_NS)) + passed_over
    return Punctuality(late_ns, int(np.count_nonzero(late_ns > LATE_NS)), missed)


def passed_over(time_ns: Times) -> int:
    """Return the number of ticks skipped while the loop stalled [1]."""
    return int(np.sum(np.diff(time_ns) // TICK_NS - 1))


@dataclass(frozen=True)
class Played:
    """Timing of a dyad's recording during its measurements.

    - `took_ns`: sample-to-force latency of each side, once for each sample with a force [ns].
    - `parts_ns`: parts of the latency, of both sides [ns].
    """

    took_ns: dict[str, Times]
    parts_ns: dict[str, Times]
    ticks: Punctuality
    answered: float


def played(ticks: NDArray[Any], times: Sequence[tuple[int, int]]) -> Played:
    """Read a dyad's timing from its recording."""
    inside = within(ticks["time_ns"], times)
    felt = inside & np.isin(ticks["phase"], [phase for phase in Phase if is_active(phase)])
    closed: dict[str, NDArray[np.bool_]] = {side: closed_loops(ticks[f"{side}_loop_ns"]) & felt for side in SIDES}
    took: dict[str, Times] = {side: ticks[f"{side}_loop_ns"][closed[side]] for side in SIDES}
    halves = [loop_parts(ticks, side, closed[side]) for side in SIDES]
    parts = {name: np.concatenate([half[name] for half in halves]) for name in (UP, WAIT, REST)}
    due = [ticks["time_ns"][within(ticks["time_ns"], [one])] for one in times]
    return Played(
        took,
        parts,
        punctuality(ticks["late_ns"][inside], sum(map(passed_over, due))),
        sum(times.size for times in took.values()) / max(len(SIDES) * int(np.count_nonzero(felt)), 1),
    )


def within(time_ns: Times, times: Sequence[tuple[int, int]]) -> NDArray[np.bool_]:
    """Return which times are within some periods."""
    inside: NDArray[np.bool_] = np.zeros(time_ns.shape, np.bool_)
    for start, end in times:
        inside |= (time_ns >= start) & (time_ns < end)
    return inside


def closed_loops(loop_ns: Times) -> NDArray[np.bool_]:
    """Return the ticks that first report a latency; an agent repeats the newest until the next."""
    new: NDArray[np.bool_] = (np.diff(loop_ns, prepend=0) != 0) & (loop_ns > 0)
    return new


def loop_parts(ticks: NDArray[Any], side: str, closed: NDArray[np.bool_]) -> dict[str, Times]:
    """Split the latencies into their parts, if a sample reports the latency of the one before it, as is usual.

    - `closed` (shape (n,)): ticks at which a latency is first reported.
    """
    seq, loop_ns = ticks[f"{side}_seq"], ticks[f"{side}_loop_ns"]
    fresh = np.diff(seq, prepend=-1) == 1
    told = 1 + np.flatnonzero(closed[1:] & fresh[1:] & fresh[:-1])
    begun = ticks[told - 1]
    lead_ns = begun[f"{side}_lead_ns"]
    up = begun["time_ns"] - lead_ns - begun[f"{side}_stamp_ns"]
    wait = begun["late_ns"] + lead_ns
    rest = loop_ns[told] - up - wait
    return {UP: up, WAIT: wait, REST: rest}
