"""A thousand million steps through random scenes with random hands: states stay finite, and no energy is created.

States and energies are checked every hundred ticks. Balls that leave the board are put back. Ticks in which the board
or a ball is outside the range for which the method was chosen are counted separately: no method with steps of one tick
can follow a board that turns over under a heavy ball.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.physics.batch import LANES, in_blocks, make_batch, out_of_blocks, scene_blocks
from evidence.stability import soak_audit, soak_dyads
from netboard.base.compiled import fast
from netboard.base.tables.scene import Physics
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.harness.results import ResultPart
from netboard.benchmarks.harness.running import Tell, no_progress
from netboard.physics.scene.parameters import pack_scene, parts_of, state_length

Array = NDArray[np.float64]

BETWEEN = 100
"""Ticks between checks [1]."""

RUN_AWAY = 0.5
"""A ball farther than this from the centre is put back there [m]."""

BALANCE = 0.25
"""Largest allowed imbalance of energy relative to the flows between two checks [1]."""

MIN_FLOW = 1e-9
"""Sum of the flows between two checks below which the balance is not checked [J]."""


@dataclass
class Tally:
    """Results of the checks.

    - `excess`: largest growth of energy beyond the work that hands can do, relative to the flows [1].
    - `imbalance`: largest imbalance of energy and flows, relative to the flows [1].
    """

    checks: int = 0
    lost: int = 0
    excess: float = -math.inf
    imbalance: float = 0.0

    @classmethod
    def of(cls, tallies: Sequence["Tally"]) -> "Tally":
        """Return the results of all."""
        checks, lost = sum(one.checks for one in tallies), sum(one.lost for one in tallies)
        return cls(checks, lost, max(one.excess for one in tallies), max(one.imbalance for one in tallies))

    def take(self, x: Array, sums: Array) -> None:
        """Check simulations."""
        fine: NDArray[np.bool_] = np.isfinite(np.concatenate([x, sums], axis=1)).all(axis=1)
        self.checks += len(x)
        self.lost += int(np.count_nonzero(~fine))
        flowed = sums[fine, soak_audit.THROUGH] + MIN_FLOW
        excess = (sums[fine, soak_audit.GROWTH] - sums[fine, soak_audit.SUPPLY]) / flowed
        imbalance = np.abs(sums[fine, soak_audit.IMBALANCE]) / flowed
        self.excess = max(self.excess, float(np.max(excess, initial=-1.0)))
        self.imbalance = max(self.imbalance, float(np.max(imbalance, initial=0.0)))


@dataclass
class Soaked:
    """Results of one kind of scene.

    - `within`, `beyond`: inside and outside the range of tilts and ball positions for which the method was chosen.
    - `seconds`: run time [s].
    """

    steps: int = 0
    restarts: int = 0
    within: Tally = field(default_factory=Tally)
    beyond: Tally = field(default_factory=Tally)
    seconds: float = 0.0


def soak_kind(
    kind: Physics, steps: int, seed: int, scenes: int = 256, tell: Callable[[float], object] = lambda share: None
) -> Soaked:
    """Soak one kind of scene."""
    rng = np.random.default_rng(seed)
    drawn = np.concatenate([pack_scene(soak_dyads.draw_scene(rng, kind)) for _ in range(scenes)])
    packed = scene_blocks(np.resize(drawn, soak_dyads.DYADS))
    parts, length = parts_of(kind), state_length(kind)
    step, audit = make_batch(parts, length, True), soak_audit.make_audit(parts, length)
    x = in_blocks(np.zeros((soak_dyads.DYADS, length)))
    before, drives, sums = np.empty_like(x), np.zeros((len(x), 8, LANES)), np.zeros((len(x), soak_audit.SUMS, LANES))
    hands = [np.zeros((len(x), soak_dyads.HAND, LANES)) for _ in range(2)]
    for hand in hands:
        soak_dyads.draw_hands(rng, hand, 1.0)
        hand[:, soak_dyads.LAST_Z] = hand[:, soak_dyads.PLACE]
    found, begun = Soaked(), perf_counter()
    while found.steps < steps:
        for _ in range(BETWEEN):
            for side, hand in enumerate(hands):
                soak_dyads.move_hands(hand, side, packed, drives)
            before[:] = x
            step(x, drives, packed, TICK_SECONDS)
            audit(before, x, drives, packed, sums)
            found.restarts += _restart(x)
        found.steps += BETWEEN * soak_dyads.DYADS
        states, did = out_of_blocks(x), out_of_blocks(sums)
        beyond = did[:, soak_audit.BEYOND] > 0.0
        found.within.take(states[~beyond], did[~beyond])
        found.beyond.take(states[beyond], did[beyond])
        fine: NDArray[np.bool_] = np.all(np.isfinite(x), axis=1)
        x[:] = np.where(fine[:, None, :], x, 0.0)
        sums[:] = 0.0
        for hand in hands:
            soak_dyads.draw_hands(rng, hand, 0.1)
        tell(found.steps / steps)
    found.seconds = perf_counter() - begun
    return found


@fast
def _restart(x: Any) -> int:
    """Put balls that left the board back to the centre, and return the number of dyads concerned."""
    count = 0
    for b in range(len(x)):
        for j in range(LANES):
            away = False
            for i in range(4, x.shape[1], 2):
                away |= abs(x[b, i, j]) > RUN_AWAY
            if away:
                count += 1
                x[b, 4:, j] = 0.0
    return count


def soak(steps: int, seed: int = 1, scenes: int = 256, tell: Tell = no_progress) -> ResultPart:
    """Soak every kind of scene."""
    found = {}
    for i, (name, kind) in enumerate(soak_dyads.KINDS.items()):
        tell(f"soak: {name}: drawing scenes", 0.0)
        share = steps // len(soak_dyads.KINDS) + 1
        found[name] = soak_kind(kind, share, seed + i, scenes, partial(tell, f"soak: {name}"))
    done, seconds = sum(one.steps for one in found.values()), sum(one.seconds for one in found.values())
    part = ResultPart(
        "soak",
        f"Soak: {done:.4g} steps of 1 ms in {len(found) * scenes} random scenes, {seconds:.3g} s, "
        f"{sum(one.restarts for one in found.values())} balls put back; "
        f"within: tilts to {math.degrees(soak_audit.MAX_TILT):.0f} deg, "
        f"turns to {soak_audit.MAX_TURN:g} rad in a step, "
        "balls to twice the arm",
        f"kind of scene | where | checks, each of {BETWEEN} steps [1] | not finite [1] | "
        "growth - what hands can put in, over flows [1] | growth - flows, over flows [1]",
    )
    for name, one in found.items():
        for where, tally in (("within", one.within), ("beyond", one.beyond)):
            part.add(name, where, tally.checks, tally.lost, tally.excess, tally.imbalance)
    within, beyond = Tally.of([one.within for one in found.values()]), Tally.of([one.beyond for one in found.values()])
    excess = f"{within.excess:+.2g} of the flows"
    part.claim("within: every state is finite", within.lost == 0, f"{within.lost} of {within.checks} are not")
    part.claim("within: energy grows by no more than hands can put in", within.excess < 0.0, excess)
    claim = f"within: energy is off by less than {BALANCE:.0%} of the flows"
    part.claim(claim, within.imbalance < BALANCE, f"{within.imbalance:.2g}")
    part.claim(
        "beyond: every state is finite, and energy grows by no more than hands can put in",
        beyond.lost == 0 and beyond.excess < 0.0,
        f"{beyond.lost} of {beyond.checks} are not finite, {beyond.excess:+.2g} of the flows",
    )
    return part
