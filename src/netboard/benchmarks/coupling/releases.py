"""A stylus released 10 mm from rest, with friction, encoder steps, and every limit of the safety chain.

Friction damps a small motion but not a large one, so a loop that is stable for small motions may still oscillate.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from netboard.base.config import Config
from netboard.base.tables.rig import Safety
from netboard.base.tables.scene import Physics
from netboard.base.tables.simulated import VirtualDevice
from netboard.benchmarks.coupling.boundary import HANDS, Case, loops_of, scene
from netboard.benchmarks.coupling.far import Distance, Far
from netboard.benchmarks.harness.results import Part, Value
from netboard.benchmarks.harness.running import Tell
from netboard.participants.device_models import resolved
from netboard.physics.stability.delayed_coupling import is_stable

RELEASED = 0.010
"""Distance from rest at the release [m]."""

LED, WAITED = 300, 200
"""Durations of the movement to that position, and of the hold there [ms]."""

SECONDS = 4
"""Observation time after the release [s]."""

QUIET = 0.5e-3
"""Peak-to-peak movement below which a stylus counts as at rest: some encoder steps [m]."""

FRICTION = resolved(VirtualDevice()).friction

WAYS = (0, 1, 2, 3, 4, 5, 10, 20, 40)
QUICK_WAYS = (2, 10)


@dataclass(frozen=True)
class Release:
    """Outcome of a release.

    - `swing`: peak-to-peak movement in the last second [m].
    - `rest`: settling time, to within `QUIET` of the final position; infinite if it did not settle [s].
    - `cut`: the safety chain cut the force because the stylus was too fast.
    """

    swing: float
    rest: float
    cut: bool

    @property
    def quiet(self) -> bool:
        """Whether the stylus settled without a cut of the force."""
        return self.swing < QUIET and not self.cut

    def __str__(self) -> str:
        if self.cut:
            return "cut by the safety chain"
        return f"rests in {self.rest:.2f} s" if self.quiet else f"{self.swing * 1e3:.1f} mm"


class Loop(Protocol):
    """A simulated loop of the left hand."""

    heights: list[tuple[float, float]]
    forces: list[tuple[float, float]]
    cut: bool

    def get_ready(self) -> None:
        """Simulate until the loop is ready."""

    def put(self, left: float, right: float) -> None:
        """Place the styluses at heights [m]."""

    def live(self, ticks: int) -> None:
        """Simulate a duration [ms]."""


def lead(loop: Loop, height: Callable[[int], float], ticks: int) -> None:
    """Move the left stylus along a path."""
    for t in range(ticks):
        loop.put(height(t), 0.0)
        loop.live(1)


def let_go(loop: Loop) -> Release:
    """Move the left stylus away, hold it until the server has received this, and release it."""
    loop.get_ready()
    lead(loop, lambda t: RELEASED * smooth(t / LED), LED + WAITED)
    start = len(loop.heights)
    loop.live(1000 * SECONDS)
    heights = np.array(loop.heights)[start:, 0]
    away = np.flatnonzero(np.abs(heights - heights[-1]) > QUIET)
    rest = (int(away[-1]) + 1) * 1e-3 if len(away) else 0.0
    swing = float(np.ptp(heights[-1000:]))
    return Release(swing, rest if swing < QUIET else float("inf"), loop.cut)


def smooth(share: float) -> float:
    """Return the completed share of a smooth movement after a share of its duration, from 0 to 1 [1]."""
    s = min(max(share, 0.0), 1.0)
    return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)


def release(physics: Physics, device: VirtualDevice, way: int, *, passivity: bool = False) -> Release:
    """Release the left stylus, and return the outcome."""
    far = Far(Config(physics=physics, virtual=device, safety=Safety(passivity=passivity)), Distance(way, way))
    return let_go(far)


def releases_part(ways: Sequence[int], tell: Tell) -> Part:
    """Release a bare stylus with several delays."""
    part = Part(
        "releases",
        "A bare stylus let go 10 mm from rest, 200 N/m and 2 N s/m, encoder steps and limits on: swing in the last "
        "second, or time to rest",
        "one way [ms] | server, fixed end: theory | no friction | friction 0.26 N | "
        "both, paper's board: theory | no friction  | friction 0.26 N ",
    )
    bare = HANDS["bare stylus"]
    slick, rough = (VirtualDevice(mass=bare.mass, damping=bare.damping, friction=f) for f in (0.0, FRICTION))
    quiet: dict[tuple[str, str], list[int]] = {}
    for i, way in enumerate(ways):
        tell(f"releases: {way} ms one way", i / len(ways))
        row: list[Value] = [way]
        for at in ("server", "both"):
            case = Case("bare stylus", at, "fixed" if at == "server" else "board", way)
            stable = all(is_stable(loop) for loop in loops_of(case, Physics().k_h).values())
            row.append("stable" if stable else "unstable")
            for name, device in (("no friction", slick), ("friction", rough)):
                found = release(scene(at, case.end), device, way)
                row.append(str(found))
                if found.quiet:
                    quiet.setdefault((at, name), []).append(way)
        part.add(*row)
    furthest = {key: max(found) for key, found in quiet.items()}
    part.claim(
        "with both a stylus comes to rest further from its server than with the server alone",
        all(furthest[("both", name)] > furthest[("server", name)] for name in ("no friction", "friction")),
        ", ".join(f"{at}, {name}: {way} ms" for (at, name), way in furthest.items()),
    )
    return part
