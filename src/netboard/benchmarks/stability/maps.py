"""Maps of the largest stable step over stiffness and damping, and over masses, in theory and in nonlinear runs.

Theory is the spectral radius of the exact matrix of a step (`netboard.physics.stability.step_matrix`) for the level
board. Exponential methods solve the level board exactly, so for them the board is tilted by 10 degrees, and some step
lengths are tried. Runs are those of `netboard.benchmarks.stability.runs`: only the step length is changed, until the
run is no longer bounded.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.looks import PRINT_BODY, PRINT_FINE, PRINT_SMALL
from netboard.base.tables.scene import Physics
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.harness.results import ResultPart
from netboard.benchmarks.harness.running import Tell, no_progress
from netboard.benchmarks.stability.runs import (
    STUDIED,
    is_bounded,
    ladder,
    largest_bounded,
    largest_stable,
    scaled,
    telling_duration,
)
from netboard.physics.scene.parameters import pack_scene, parts_of
from netboard.physics.stability.method_choice import EXPONENTIAL, GROWTH_TOLERANCE
from netboard.physics.stability.step_matrix import Matrix, is_stable, largest_step, spectral_radius, tilted_matrix

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ALLOWED = {"verlet": 0.08}
USUALLY_ALLOWED = 0.04
"""Largest relative difference between theory and runs [1]."""

FOLLOWED = 0.1
"""Step above which no method follows 3 Hz hand motion, so theory and runs are not compared [s]."""

TILT = math.radians(10.0)

MAX_SCALE = 1e4
"""Largest scale that is tried [1]."""


@dataclass(frozen=True)
class Plane:
    """The plane of scales that a map covers."""

    name: str
    across: str
    down: str


PLANES = (Plane("coupling", "k_h", "c_h"), Plane("inertia", "M", "I"))


@dataclass(frozen=True)
class MapCell:
    """One scene with one method.

    - `theory`, `nonlinear`: largest stable step; infinite if every tried step is stable [s].
    """

    method: str
    across: float
    down: float
    theory: float
    nonlinear: float

    @property
    def difference(self) -> float:
        """Return the relative excess of the limit in runs over theory; NaN if theory has no limit [1]."""
        return self.nonlinear / self.theory - 1.0 if math.isfinite(self.theory) else math.nan

    @property
    def counts(self) -> bool:
        """Return whether theory and runs can be compared."""
        return self.theory <= FOLLOWED

    @property
    def agrees(self) -> bool:
        """Return whether theory and runs agree within the tolerance."""
        return abs(self.difference) <= ALLOWED.get(self.method, USUALLY_ALLOWED)


def board_matrix(physics: Physics, tilt: float = 0.0) -> Matrix:
    """Return the matrix of the board alone."""
    return tilted_matrix(parts_of(physics), pack_scene(physics)[0], physics.balls, tilt)


def theoretical_step(physics: Physics, method: str) -> float:
    """Return the largest stable step in theory; infinite if every step is stable, or every tried one [s]."""
    level = board_matrix(physics)
    if method not in EXPONENTIAL:
        return largest_step(method, level)
    tilted = board_matrix(physics, TILT)
    return largest_stable(
        lambda h: spectral_radius(method, tilted, h, level) <= 1.0 + GROWTH_TOLERANCE, ladder(), math.inf
    )


def measure_cell(physics: Physics, method: str, across: float = 1.0, down: float = 1.0) -> MapCell:
    """Find the largest stable step of one scene, in theory and in runs."""
    theory = theoretical_step(physics, method)
    duration = telling_duration(method, board_matrix(physics), theory)
    return MapCell(method, across, down, theory, largest_bounded(physics, method, theory, duration))


def make_map(
    plane: Plane, scales: Sequence[float], methods: Sequence[str] = STUDIED, tell: Tell = no_progress
) -> list[MapCell]:
    """Measure every method in every scene of a plane."""
    cells: list[MapCell] = []
    count = len(scales) ** 2
    for i, (across, down) in enumerate((across, down) for down in scales for across in scales):
        physics = scaled(Physics(), **{plane.across: across, plane.down: down})
        tell(f"map over {plane.across} x{across:.3g}, {plane.down} x{down:.3g}", i / count)
        cells += [measure_cell(physics, method, across, down) for method in methods]
    return cells


def map_parts(plane: Plane, cells: Sequence[MapCell]) -> Iterator[ResultPart]:
    """Return the parts of a map: all cells, and a summary with checked claims."""
    over = f"{plane.across}, {plane.down}"
    yield ResultPart(
        f"map-{plane.name}",
        f"Largest stable step over {over}",
        f"method | {plane.across} x [1] | {plane.down} x [1] | theory [s] | runs [s] | runs / theory - 1 [1]",
        [(cell.method, cell.across, cell.down, cell.theory, cell.nonlinear, cell.difference) for cell in cells],
        on_screen=False,
    )
    summary = ResultPart(
        f"map-{plane.name}-summary",
        f"Largest stable step over {over}, x1 to x{max(cell.across for cell in cells):g}: theory and nonlinear runs",
        "method | paper's scene: theory [s] | runs [s] | smallest [s] | scenes compared | worst difference [1]",
    )
    for method in dict.fromkeys(cell.method for cell in cells):
        _summarise(summary, method, [cell for cell in cells if cell.method == method])
    yield summary


def _summarise(part: ResultPart, method: str, cells: Sequence[MapCell]) -> None:
    """Add the row and the claim of a method."""
    smallest, limited = min(cell.nonlinear for cell in cells), [cell for cell in cells if cell.counts]
    worst = max(limited, key=lambda cell: abs(cell.difference), default=None)
    difference = worst.difference if worst else "no limit in theory"
    part.add(method, cells[0].theory, cells[0].nonlinear, smallest, len(limited), difference)
    if worst is None:
        found = "in any step tried" if math.isinf(smallest) else f"up to {smallest:.3g} s in each"
        part.claim(f"{method} holds every scene in steps of a tick", smallest >= TICK_SECONDS, found)
        return
    agreeing = sum(cell.agrees for cell in limited)
    part.claim(
        f"{method}: theory within {ALLOWED.get(method, USUALLY_ALLOWED):.0%} of runs",
        agreeing == len(limited),
        f"{agreeing} of {len(limited)} scenes, worst {worst.difference:+.1%} at x{worst.across:.3g}, x{worst.down:.3g}",
    )


def largest_scale(stable: Callable[[float], bool]) -> float:
    """Return the scale up to which theory predicts stability."""
    return largest_stable(stable, np.geomspace(1.0, MAX_SCALE, 161).tolist(), 1.001)


WAYS: dict[str, Callable[[float], dict[str, float]]] = {
    "k_h alone": lambda scale: {"k_h": scale},
    "c_h alone": lambda scale: {"c_h": scale},
    "k_h, and c_h by its root": lambda scale: {"k_h": scale, "c_h": math.sqrt(scale)},
}


def tick_limits(methods: Sequence[str] = STUDIED, tell: Tell = no_progress) -> ResultPart:
    """Find the stability limit of the coupling at 1 ms steps, by theory and by runs on both sides of it."""
    part = ResultPart(
        "tick-limits",
        f"How far the couplings may be scaled, in steps of {TICK_SECONDS:g} s",
        ("method", *(f"{way} x [1]" for way in WAYS)),
    )
    failures: list[str] = []
    checked = 0
    for i, method in enumerate(methods):
        tell(f"largest scales in steps of a tick: {method}", i / len(methods))
        found = []
        for way, factors in WAYS.items():
            scale = math.inf if method in EXPONENTIAL else largest_scale(_stable(method, factors))
            found.append(scale)
            for share, bounded in ((0.96, True), (1.04, False)) if math.isfinite(scale) and scale > 1.0 else ():
                physics = scaled(Physics(), **factors(share * scale))
                checked += 1
                if is_bounded(physics, method, TICK_SECONDS, 4.0) is not bounded:
                    failures.append(f"{method}, {way} x{share * scale:.3g}")
        part.add(method, *found)
    part.claim(
        "runs are bounded 4 % below each limit, and not 4 % above",
        not failures,
        f"{checked - len(failures)} of {checked}{': not ' + '; '.join(failures) if failures else ''}",
    )
    return part


def _stable(method: str, factors: Callable[[float], dict[str, float]]) -> Callable[[float], bool]:
    """Return a function that returns whether a scale is stable in steps of one tick."""
    return lambda scale: is_stable(method, board_matrix(scaled(Physics(), **factors(scale))), TICK_SECONDS)


def draw_map(plane: Plane, cells: Sequence[MapCell]) -> Any:
    """Draw a map: a row for each method, theory on the left, runs on the right."""
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    methods = list(dict.fromkeys(cell.method for cell in cells))
    across, down = sorted({cell.across for cell in cells}), sorted({cell.down for cell in cells})
    figure = Figure(figsize=(3.0 + 1.1 * len(across), 1.0 + 0.45 * len(down) * len(methods)), layout="constrained")
    axes = figure.subplots(len(methods), 2, squeeze=False, sharex=True, sharey=True)
    norm = LogNorm(1e-6, 1.0)
    for row, method in zip(axes, methods, strict=True):
        for ax, kind in zip(row, ("theory", "nonlinear"), strict=True):
            steps = np.full((len(down), len(across)), math.inf)
            for cell in cells:
                if cell.method == method:
                    steps[down.index(cell.down), across.index(cell.across)] = getattr(cell, kind)
            _draw_steps(ax, steps, norm)
            ax.set_title(f"{method}: {'theory' if kind == 'theory' else 'nonlinear runs'}", fontsize=PRINT_BODY)
            ax.set_xticks(range(len(across)), [f"{value:.4g}" for value in across], fontsize=PRINT_SMALL)
            ax.set_yticks(range(len(down)), [f"{value:.4g}" for value in down], fontsize=PRINT_SMALL)
        row[0].set_ylabel(f"{plane.down} x", fontsize=PRINT_BODY)
    for ax in axes[-1]:
        ax.set_xlabel(f"{plane.across} x", fontsize=PRINT_BODY)
    figure.colorbar(axes[0, 0].images[0], ax=axes, label="largest stable step [s]; in the cells [ms]", shrink=0.25)
    return figure


def _draw_steps(ax: "Axes", steps: NDArray[np.float64], norm: Any) -> None:
    """Draw one heat map with its values in milliseconds."""
    ax.imshow(np.minimum(steps, 1.0), origin="lower", norm=norm, cmap="viridis", aspect="auto")
    for (i, j), h in np.ndenumerate(steps):
        text = "any" if math.isinf(h) else f"{h * 1e3:.3g}"
        ax.text(j, i, text, ha="center", va="center", fontsize=PRINT_FINE, color="black" if h > 1e-3 else "white")
