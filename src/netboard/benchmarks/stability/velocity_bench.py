"""``netboard bench velocity``: the ways to a stylus' velocity beside each other."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.harness.results import Folder, Part
from netboard.benchmarks.harness.running import Tell
from netboard.benchmarks.stability.velocity import REACH, SINE, delays, errors_of, figures
from netboard.devices.contract.velocity import KINDS


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[Part]:
    """Run the parts of the study, and draw what they found if matplotlib is there."""
    found = figures(quick=quick, tell=tell)
    yield found
    late = delays(quick=quick, tell=tell)
    folder.save("velocity", lambda: draw(found, late))
    yield late


def draw(found: Part, late: Part) -> Any:
    """Draw errors on a reach and on a sine, and for each estimator its noise beside the delay it leaves."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15.0, 5.0), layout="constrained")
    FigureCanvasAgg(figure)
    reach, sine, trade = figure.subplots(1, 3)
    for kind in KINDS:
        strength = 0.3 if kind == "difference" else 1.0
        t, error = errors_of(kind, REACH, 1)
        reach.plot(t, 1e3 * error[0], label=kind, linewidth=1.0, alpha=strength)
        t, error = errors_of(kind, SINE, 1)
        shown = slice(0, round(0.2 / TICK_SECONDS))
        sine.plot(t[shown], 1e3 * error[0][shown], linewidth=1.0, alpha=strength)
    delay_of = {str(row[0]): row[2] for row in late.rows}
    for row in found.rows:
        kind, noise = str(row[0]), float(np.float64(row[3]))
        trade.plot(noise, delay_of[kind], marker="o")
        trade.annotate(kind, (noise, delay_of[kind]), textcoords="offset points", xytext=(6, 4))
    for ax, title in ((reach, "minimum-jerk reach, 0.1 m in 0.4 s"), (sine, "2 mm at 10 Hz")):
        ax.set_title(title)
        ax.set_xlabel("time [s]")
        ax.set_ylabel("error of the velocity [mm/s]")
        ax.grid(True, alpha=0.3)
    reach.legend(fontsize=8)
    trade.set_xscale("log")
    trade.set_title("to the left: quieter; up: more delay is left")
    trade.set_xlabel(str(found.columns[3]))
    trade.set_ylabel(f"largest delay: {late.columns[2]}")
    trade.margins(0.3)
    trade.grid(True, alpha=0.3)
    return figure
