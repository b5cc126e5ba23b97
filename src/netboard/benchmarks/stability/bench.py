"""``netboard bench stability``: where each method is stable, in theory and in runs, and where it fails.

Every part is a table with claims that are checked against its numbers; a claim may fail. The quick form does less of
everything; a test runs parts of it.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np

from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Options, Tell, run
from netboard.benchmarks.stability.maps import PLANES, draw_map, make_map, map_parts, tick_limits
from netboard.benchmarks.stability.rest import energy_drift, perfect_rest
from netboard.benchmarks.stability.runs import STUDIED
from netboard.benchmarks.stability.stress import ball_at_ends, large_tilts, stiff_forces

SCALES = tuple(float(scale) for scale in np.geomspace(1.0, 1000.0, 7))
QUICK_SCALES = (1.0, 1000.0)
QUICK_METHODS = ("semi_implicit", "verlet", "rk4", "etdrk4")


def main(options: Options) -> None:
    """Run the study."""
    run("stability", study, options)


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Run the parts of the study, one after the other."""
    methods = QUICK_METHODS if quick else STUDIED
    yield tick_limits(methods, tell)
    for plane in PLANES:
        cells = make_map(plane, QUICK_SCALES if quick else SCALES, methods, tell)
        folder.save(f"map-{plane.name}", partial(draw_map, plane, cells))
        yield from map_parts(plane, cells)
    yield stiff_forces(tell=tell)
    yield large_tilts(tell=tell)
    yield energy_drift(100_000 if quick else 10_000_000, methods, tell)
    yield ball_at_ends(tell=tell)
    yield perfect_rest(20_000 if quick else 200_000, methods, tell)
