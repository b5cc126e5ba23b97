"""How durations are distributed: percentiles as rows of a table, histograms over a logarithmic axis, and ratios.

Tables are in milliseconds, the unit of a tick.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.recording.summary import Spread, spread
from netboard.studies.results import Part, Value

Times = NDArray[np.int64]

HEADS = ("50 % [ms]", "99 % [ms]", "99.9 % [ms]", "largest [ms]")
"""Heads of the columns that `in_milliseconds` fills."""

LEAST_NS, MOST_NS = 1_000, 1_000_000_000
PER_DECADE = 20
EDGES_NS: NDArray[np.float64] = np.geomspace(LEAST_NS, MOST_NS, 1 + PER_DECADE * round(np.log10(MOST_NS / LEAST_NS)))
"""Edges of the bins: from a microsecond to a second [ns]."""


def in_milliseconds(found: Spread) -> tuple[float, float, float, float]:
    """Return what a table says of a spread.

    Parameters
    ----------
    found : Spread
        The spread.

    Returns
    -------
    tuple of float
        Percentiles 50, 99 and 99.9, and the largest [ms].
    """
    return found.p50 * 1e3, found.p99 * 1e3, found.p999 * 1e3, found.largest * 1e3


def spread_rows(named: Mapping[str, Times]) -> list[tuple[Value, ...]]:
    """Return a row for each set of durations: its name, how many there are, `in_milliseconds`.

    Parameters
    ----------
    named : mapping of str to ndarray of int64
        Durations by name [ns].
    """
    return [(name, times.size, *in_milliseconds(spread(times))) for name, times in named.items()]


def ratio_row(name: str, above: Times, below: Times) -> tuple[Value, ...]:
    """Return how many times as long some durations are as others: at percentiles 50, 99 and 99.9, and the largest [1].

    Parameters
    ----------
    name : str
        Head of the row.
    above, below : ndarray of int64
        Durations [ns].
    """
    ours, theirs = in_milliseconds(spread(above)), in_milliseconds(spread(below))
    return (name, *(a / b if b > 0 else float("nan") for a, b in zip(ours, theirs, strict=True)))


def histogram(times: Times) -> NDArray[np.int64]:
    """Count durations between `EDGES_NS`; what is shorter or longer goes to the first or the last bin [1].

    Parameters
    ----------
    times : ndarray of int64
        Durations [ns].
    """
    inside = np.clip(times, LEAST_NS, MOST_NS)
    counts: NDArray[np.int64] = np.histogram(inside, EDGES_NS)[0]
    return counts


def histogram_part(named: Mapping[str, Times]) -> Part:
    """Return the histograms as a table: a row for each bin that any of them fills.

    Parameters
    ----------
    named : mapping of str to ndarray of int64
        Durations by name [ns].
    """
    counts = np.stack([histogram(times) for times in named.values()], axis=1)
    rows: list[tuple[Value, ...]] = [
        (float(EDGES_NS[i] * 1e-6), float(EDGES_NS[i + 1] * 1e-6), *map(int, counts[i]))
        for i in np.flatnonzero(counts.any(axis=1))
    ]
    heads = ("from [ms]", "to [ms]", *(f"{name} [1]" for name in named))
    return Part("histogram", "How often, by duration", heads, rows, on_screen=False)


def draw_histogram(named: Mapping[str, Times], title: str) -> Any:
    """Draw histograms over a logarithmic axis, with marks at the percentiles 50, 99 and 99.9.

    Parameters
    ----------
    named : mapping of str to ndarray of int64
        Durations by name [ns].
    title : str
        Head of the figure.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 5.0), layout="constrained")
    FigureCanvasAgg(figure)
    ax = figure.subplots()
    shares = {name: np.maximum(histogram(times) / max(times.size, 1), 1e-12) for name, times in named.items()}
    for name, times in named.items():
        (line,) = (ax.stairs(shares[name], EDGES_NS * 1e-6, label=name, baseline=None, linewidth=1.5),)
        found = spread(times)
        for value in (found.p50, found.p99, found.p999):
            ax.axvline(value * 1e3, color=line.get_edgecolor(), linestyle=":", linewidth=1.0)
    ax.set_xscale("log")
    ax.set_yscale("log")
    least = min((float(share[share > 1e-12].min()) for share in shares.values() if share.max() > 1e-12), default=1e-6)
    ax.set_ylim(bottom=least / 2)
    ax.set_xlabel("duration [ms]; dotted: 50 %, 99 %, 99.9 %")
    ax.set_ylabel("share of all, in twentieths of a decade [1]")
    ax.set_title(title)
    ax.grid(True, which="major", alpha=0.3)
    ax.legend()
    return figure
