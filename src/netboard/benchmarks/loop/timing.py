"""Distributions of durations, and the sample-to-force latency and tick jitter of a recording.

Durations are shown as percentiles in rows of a table, in milliseconds (the unit of a tick), as histograms over a
logarithmic axis, and as ratios. The latencies and their parts are those of `netboard trace`
(`netboard.recording.timing.stamps`). All times are those of one clock, since the processes of a benchmark share a
machine.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES
from netboard.base.tick import LATE_NS, TICK_NS
from netboard.benchmarks.harness.results import ResultPart, Value
from netboard.recording.format.summary import DurationSpread, spread
from netboard.recording.timing.stamps import UNKNOWN, Mask, SideStamps, Stamps

Times = NDArray[np.int64]

HEADS = ("50 % [ms]", "99 % [ms]", "99.9 % [ms]", "largest [ms]")
"""Heads of the columns that `in_milliseconds` fills."""

MIN_NS, MAX_NS = 1_000, 1_000_000_000
PER_DECADE = 20
EDGES_NS: NDArray[np.float64] = np.geomspace(MIN_NS, MAX_NS, 1 + PER_DECADE * round(np.log10(MAX_NS / MIN_NS)))
"""Edges of the bins: from a microsecond to a second [ns]."""


def in_milliseconds(found: DurationSpread) -> tuple[float, float, float, float]:
    """Return the percentiles of durations in milliseconds."""
    return found.p50 * 1e3, found.p99 * 1e3, found.p999 * 1e3, found.largest * 1e3


def spread_rows(named: Mapping[str, Times]) -> list[tuple[Value, ...]]:
    """Return a row for each set of durations: its name, their number, `in_milliseconds`."""
    return [(name, times.size, *in_milliseconds(spread(times))) for name, times in named.items()]


def ratio_row(name: str, above: Times, below: Times) -> tuple[Value, ...]:
    """Return ratios of two samples of durations: at percentiles 50, 99 and 99.9, and of the largest [1]."""
    ours, theirs = in_milliseconds(spread(above)), in_milliseconds(spread(below))
    return (name, *(a / b if b > 0 else float("nan") for a, b in zip(ours, theirs, strict=True)))


def histogram(times: Times) -> NDArray[np.int64]:
    """Count durations between `EDGES_NS`; shorter or longer ones go to the first or the last bin [1]."""
    inside = np.clip(times, MIN_NS, MAX_NS)
    counts: NDArray[np.int64] = np.histogram(inside, EDGES_NS)[0]
    return counts


def histogram_part(named: Mapping[str, Times]) -> ResultPart:
    """Return the histograms as a table: a row for each bin that is not empty in all."""
    counts = np.stack([histogram(times) for times in named.values()], axis=1)
    return ResultPart(
        "histogram",
        "How often, by duration",
        ("from [ms]", "to [ms]", *(f"{name} [1]" for name in named)),
        [
            (float(EDGES_NS[i] * 1e-6), float(EDGES_NS[i + 1] * 1e-6), *map(int, counts[i]))
            for i in np.flatnonzero(counts.any(axis=1))
        ],
        on_screen=False,
    )


def draw_histograms(groups: Sequence[Mapping[str, Times]], title: str) -> Any:
    """Draw histograms over a logarithmic axis, with marks at the percentiles 50, 99 and 99.9.

    - `groups`: durations by name; each group is drawn in one axes, those below `MIN_NS` at its left edge [ns].
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.2 * len(groups)), layout="constrained")
    axes = figure.subplots(len(groups), sharex=True, squeeze=False)[:, 0]
    for ax, named in zip(axes, groups, strict=True):
        ax.set_yscale("log", nonpositive="clip")
        ax.set_ylim(0.5 / max(1, *(times.size for times in named.values())), 1.0)
        for place, (name, times) in enumerate(named.items()):
            shares, colour = histogram(times) / max(times.size, 1), f"C{place}"
            ax.stairs(shares, EDGES_NS * 1e-6, fill=True, alpha=0.3, color=colour, label=name)
            ax.stairs(shares, EDGES_NS * 1e-6, color=colour)
            for mark in in_milliseconds(spread(times))[:3]:
                ax.axvline(max(mark, MIN_NS * 1e-6), color=colour, linestyle=":", linewidth=1.2)
        ax.set_ylabel(f"share in 1/{PER_DECADE} of a decade [1]")
        ax.grid(True, which="major", alpha=0.3)
        ax.legend(loc="best")
    axes[0].set_title(title)
    axes[-1].set_xscale("log")
    axes[-1].set_xlim(MIN_NS * 1e-6, MAX_NS * 1e-6)
    axes[-1].set_xlabel("duration [ms]; dotted: 50, 99 and 99.9 %")
    return figure


# --- from a recording ----------------------------------------------------------------------------------------------

UPLINK, WAIT, REST = "stylus read to arrival at the server", "wait for the tick", "tick, return and rendering"
"""Parts of a sample-to-force latency."""


@dataclass(frozen=True)
class TickTiming:
    """Timing of ticks.

    - `late_ns`: start of each after its deadline; negative: before it [ns].
    - `skipped`: ticks that a stalled loop has left out [1].
    """

    late_ns: Times
    skipped: int

    @property
    def ticks(self) -> int:
        """Return the number of ticks, without those passed over [1]."""
        return self.late_ns.size

    @property
    def late(self) -> int:
        """Return the number of deadline misses [1]."""
        return int(np.count_nonzero(self.late_ns > LATE_NS))

    @property
    def missed(self) -> int:
        """Return the number of ticks that began more than a whole tick late, or never [1]."""
        return int(np.count_nonzero(self.late_ns > TICK_NS)) + self.skipped

    def missed_of(self, many: int) -> float:
        """Return the expected number of ticks missed by a whole period or more among `many` [1]."""
        return self.missed * many / max(self.ticks, 1)


def skipped_ticks(time_ns: Times) -> int:
    """Return the number of ticks skipped while the loop stalled [1]."""
    return int(np.sum(np.diff(time_ns) // TICK_NS - 1))


@dataclass(frozen=True)
class LoopTiming:
    """Timing of a dyad's recording during its measurements.

    - `latency_ns`: sample-to-force latency of each side, once for each sample with a force [ns].
    - `parts_ns`: parts of the latency, of both sides [ns].
    """

    latency_ns: dict[str, Times]
    parts_ns: dict[str, Times]
    ticks: TickTiming
    answered: float


def loop_timing(stamps: Stamps, times: Sequence[tuple[int, int]]) -> LoopTiming:
    """Read a dyad's timing from its recording."""
    inside = within(stamps.due_ns, times)
    felt = inside & stamps.in_trial
    took: dict[str, Times] = {name: side.loop_ns[felt & (side.loop_ns > 0)] for name, side in stamps.sides.items()}
    halves = [_loop_parts(stamps, side, felt) for side in stamps.sides.values()]
    parts = {name: np.concatenate([half[name] for half in halves]) for name in (UPLINK, WAIT, REST)}
    due = [stamps.due_ns[within(stamps.due_ns, [one])] for one in times]
    late_ns = (stamps.late_ns - stamps.moved_ns)[inside]  # after the deadline to which a stall has moved the tick
    return LoopTiming(
        took,
        parts,
        TickTiming(late_ns, sum(map(skipped_ticks, due))),
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
    return {UPLINK: arrived_ns - read_ns, WAIT: began_ns - arrived_ns, REST: rendered_ns - began_ns}
