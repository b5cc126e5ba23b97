"""Distributions of durations: percentiles as rows of a table, histograms over a logarithmic axis, and ratios.

Tables are in milliseconds, the unit of a tick.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.benchmarks.harness.results import Part, Value
from netboard.recording.format.summary import Spread, spread

Times = NDArray[np.int64]

HEADS = ("50 % [ms]", "99 % [ms]", "99.9 % [ms]", "largest [ms]")
"""Heads of the columns that `in_milliseconds` fills."""

MIN_NS, MAX_NS = 1_000, 1_000_000_000
PER_DECADE = 20
EDGES_NS: NDArray[np.float64] = np.geomspace(MIN_NS, MAX_NS, 1 + PER_DECADE * round(np.log10(MAX_NS / MIN_NS)))
"""Edges of the bins: from a microsecond to a second [ns]."""


def in_milliseconds(found: Spread) -> tuple[float, float, float, float]:
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


def histogram_part(named: Mapping[str, Times]) -> Part:
    """Return the histograms as a table: a row for each bin that is not empty in all."""
    counts = np.stack([histogram(times) for times in named.values()], axis=1)
    return Part(
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

    - `groups`: durations by name; each group is drawn in one axes [ns].
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
                ax.axvline(mark, color=colour, linestyle=":", linewidth=1.2)
        ax.set_ylabel(f"share in 1/{PER_DECADE} of a decade [1]")
        ax.grid(True, which="major", alpha=0.3)
        ax.legend()
    axes[0].set_title(title)
    axes[-1].set_xscale("log")
    axes[-1].set_xlim(MIN_NS * 1e-6, MAX_NS * 1e-6)
    axes[-1].set_xlabel("duration [ms]; dotted: 50, 99 and 99.9 %")
    return figure
