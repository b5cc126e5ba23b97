"""``make evidence ARGS=coupling``: maximum stable delay of the virtual coupling, in theory and simulation.

Every part is a table with claims that are checked against its numbers. Apart from its duration, nothing here depends on
the machine.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from evidence.coupling import boundary, remedies
from evidence.coupling.boundary import HANDS, MAPS, STIFFEST, Limit, ruled_stiffness
from netboard.base.looks import PRINT_BODY
from netboard.base.tables.scene import Physics
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Tell

QUICK_HANDS = ("bare stylus", "hand")

REMEDY_DELAYS, QUICK_REMEDY_DELAYS = (0, 5, 10, 20, 30), (20,)
FELT_DELAYS, QUICK_FELT_DELAYS = (0, 1, 5, 20), (20,)
EVERYDAY_DELAYS, QUICK_EVERYDAY_DELAYS = (0, 1, 5), (0,)


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Run the parts of the study, one after the other."""
    hands = QUICK_HANDS if quick else tuple(HANDS)
    yield boundary.delays_part(hands, tell)
    delays = boundary.QUICK_DELAYS if quick else boundary.DELAYS
    found = boundary.limits(hands, delays, tell, 2 * boundary.AGREED if quick else 5e-3)
    folder.save("coupling", lambda: draw_limits(found))
    yield boundary.limits_part(found)
    yield remedies.releases_part(remedies.QUICK_DELAYS if quick else remedies.DELAYS, tell)
    yield remedies.remedies_part(QUICK_REMEDY_DELAYS if quick else REMEDY_DELAYS, tell)
    yield remedies.transparency_part(QUICK_FELT_DELAYS if quick else FELT_DELAYS, tell)
    yield remedies.everyday_part(QUICK_EVERYDAY_DELAYS if quick else EVERYDAY_DELAYS, tell)


def draw_limits(found: Sequence[Limit]) -> Any:
    """Draw the largest stable stiffness over the delay: theory as lines, the simulated service as dots."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 4), layout="constrained")
    axes = figure.subplots(1, len(MAPS), sharey=True)
    physics = Physics()
    for axis, (at, end) in zip(axes, MAPS, strict=True):
        for number, hand in enumerate(HANDS):
            mine = [one for one in found if (one.case.at, one.case.end, one.case.hand) == (at, end, hand)]
            delays = [one.case.delay for one in mine]
            axis.plot(delays, [_shown(one.virtual) for one in mine], color=f"C{number}", label=hand if mine else None)
            axis.plot(delays, [one.simulated for one in mine], "o", color=f"C{number}", markersize=4)
            if mine and at == "server" and end == "fixed":
                ruled = [ruled_stiffness(HANDS[hand], physics.c_h, 2e-3 * delay) for delay in delays]
                axis.plot(delays, ruled, ":", color=f"C{number}", linewidth=1)
        axis.axhline(physics.k_h, color="grey", linewidth=0.8, linestyle="--")
        axis.set(yscale="log", ylim=(5.0, STIFFEST), xlabel="delay one way (ms)")
        axis.set_title(f"coupling at {at}, {'a fixed end' if end == 'fixed' else 'the board of the paper'}")
    axes[0].set_ylabel("largest stable stiffness (N/m)")
    axes[0].legend(
        loc="best",
        title="lines: theory, dots: simulated,\ndotted: Gil's rule",
        fontsize=PRINT_BODY,
        title_fontsize=PRINT_BODY,
    )
    return figure


def _shown(k: float) -> float:
    return STIFFEST if math.isinf(k) else k if k > 0.0 else np.nan
