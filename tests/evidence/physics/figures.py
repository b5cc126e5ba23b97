"""Work-precision diagrams as in SciML: a line for each method, error and cost on logarithmic axes.

Errors fall to the right, so better is down and to the right. Needs matplotlib, which is imported when a figure is
drawn.
"""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import groupby
from math import isfinite
from typing import Any

from evidence.physics.reference import ERRORS
from evidence.physics.work_precision import COSTS, OURS, PHYSICS, Row, by_problem, frontier
from netboard.base.looks import PRINT_SMALL
from netboard.benchmarks.harness.results import Folder

_LARGEST = 1.0
"""Runs with errors E beyond this are left out [1]."""

_COLOURS = {
    "heyoka": "tab:red",
    "scipy": "tab:gray",
    "CVODE": "tab:olive",
    "diffrax": "tab:purple",
    "Drake": "tab:brown",
}
_TITLES = {
    "physics": "physics alone",
    "whole": "with evaluating the hands",
    "dense": "physics, and states kept every 2 ms",
}
"""Title of each cost."""

_OTHER = "tab:orange"
_MARKS = "osD^v<>pXP*h"


def draw(rows: Sequence[Row], folder: Folder, signals: bool = True) -> None:
    """Draw each problem: E against both costs, and each signal's error against the physics' cost."""
    for problem, every in by_problem(rows).items():
        here = [row for row in every if row.scaled < _LARGEST]
        here.sort(key=lambda row: (row.library != OURS, row.library, row.method))
        name = problem.replace(", ", "-")
        folder.save(f"work-precision-{name}", partial(_overview, here, problem))
        if signals:
            folder.save(f"work-precision-{name}-signals", partial(_signals, here, problem))


def _figure(width: float, height: float, across: int, down: int) -> tuple[Any, list[Any]]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, list(figure.subplots(down, across, squeeze=False).flat)


def _overview(rows: Sequence[Row], problem: str) -> Any:
    """Draw E against each cost."""
    figure, axes = _figure(7.5 * len(_TITLES), 7.0, len(_TITLES), 1)
    for ax, (name, title) in zip(axes, _TITLES.items(), strict=True):
        cost = COSTS[name]
        _curves(ax, rows, lambda row: row.scaled, cost)
        best = frontier(rows, cost)
        ax.plot([row.scaled for row in best], [cost(row) for row in best], color="black", alpha=0.15, linewidth=8)
        ax.set_xlabel("E: largest error of any signal over the signal's largest value [1]")
        ax.set_ylabel("cost of a second of simulated time [us]")
        ax.set_title(f"{problem}: {title}")
    axes[-1].legend(fontsize=PRINT_SMALL, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _signals(rows: Sequence[Row], problem: str) -> Any:
    figure, axes = _figure(13.0, 10.0, 2, 2)
    for i, (ax, signal) in enumerate(zip(axes, ERRORS, strict=True)):
        _curves(ax, rows, partial(_error, i), PHYSICS)
        ax.set_xlabel(f"largest error of {signal}")
        ax.set_ylabel("cost of a second of simulated time, physics alone [us]")
    figure.suptitle(problem)
    axes[1].legend(fontsize=PRINT_SMALL, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def _error(signal: int, row: Row) -> float:
    return row.errors[signal]


def _curves(ax: Any, rows: Sequence[Row], error: Callable[[Row], float], cost: Callable[[Row], float]) -> None:
    """Draw the Pareto frontier of each method's settings, ours from blue to green."""
    import matplotlib as mpl

    ours = [method for method, _ in groupby(row.method for row in rows if row.library == OURS)]
    shade = mpl.colormaps["viridis"]
    for i, ((library, method), curve) in enumerate(groupby(rows, key=lambda row: (row.library, row.method))):
        shown = [(error(row), cost(row)) for row in frontier(curve, cost) if isfinite(error(row)) and error(row) > 0.0]
        is_ours = library == OURS
        ax.plot(
            [x for x, _ in shown],
            [y for _, y in shown],
            marker=_MARKS[i % len(_MARKS)],
            markersize=4,
            linewidth=1.5 if is_ours else 1.0,
            linestyle="-" if is_ours else "--",
            color=shade(0.05 + 0.8 * ours.index(method) / len(ours)) if is_ours else _COLOURS.get(library, _OTHER),
            label=f"{library} {method}",
        )
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.invert_xaxis()
    ax.grid(True, which="major", alpha=0.3)
