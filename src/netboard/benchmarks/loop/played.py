"""Sample-to-force latency and tick jitter, from a recording.

The latencies and their parts are those of `netboard trace` (`netboard.recording.timing.stamps`). All times are those of
one clock, since the processes of a benchmark share a machine.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES
from netboard.base.tick import LATE_NS, TICK_NS
from netboard.benchmarks.loop.spreads import Times
from netboard.recording.timing.stamps import UNKNOWN, Mask, SideStamps, Stamps

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


def played(stamps: Stamps, times: Sequence[tuple[int, int]]) -> Played:
    """Read a dyad's timing from its recording."""
    inside = within(stamps.due_ns, times)
    felt = inside & stamps.in_trial
    took: dict[str, Times] = {name: side.loop_ns[felt & (side.loop_ns > 0)] for name, side in stamps.sides.items()}
    halves = [_loop_parts(stamps, side, felt) for side in stamps.sides.values()]
    parts = {name: np.concatenate([half[name] for half in halves]) for name in (UP, WAIT, REST)}
    due = [stamps.due_ns[within(stamps.due_ns, [one])] for one in times]
    late_ns = (stamps.late_ns - stamps.moved_ns)[inside]  # after the deadline to which a stall has moved the tick
    return Played(
        took,
        parts,
        punctuality(late_ns, sum(map(passed_over, due))),
        sum(times.size for times in took.values()) / max(len(SIDES) * int(np.count_nonzero(felt)), 1),
    )


def within(time_ns: Times, times: Sequence[tuple[int, int]]) -> NDArray[np.bool_]:
    """Return which times are within some periods."""
    inside: NDArray[np.bool_] = np.zeros(time_ns.shape, np.bool_)
    for start, end in times:
        inside |= (time_ns >= start) & (time_ns < end)
    return inside


def _loop_parts(stamps: Stamps, side: SideStamps, felt: Mask) -> dict[str, Times]:
    """Split the latencies of a side into their parts where the time of rendering is known."""
    known = felt & (side.rendered_ns != UNKNOWN)
    read_ns, arrived_ns, rendered_ns = side.read_ns[known], side.arrived_ns[known], side.rendered_ns[known]
    began_ns = stamps.began_ns[known]
    return {UP: arrived_ns - read_ns, WAIT: began_ns - arrived_ns, REST: rendered_ns - began_ns}
