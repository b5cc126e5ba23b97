"""A simulated participant behind the curtain: sees its station's views, feels its own hand, and decides.

Rule 1: `netboard.stage.curtain.view_of` makes its views, at the server's view rate, and it sees them one tick later.
Rule 2: it infers the partner's height from the force only where the force tells it: where the hands feel the full
board. Any other force pushes the hand, but carries no information. Rule 3: time is that of the ticks; randomness comes
from the given generator.
"""

from dataclasses import replace
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Config, Side
from netboard.base.tables.simulated import Participant
from netboard.base.tick import TICK_NS, TICK_SECONDS
from netboard.participants.controller import THINK_EVERY, Brain
from netboard.participants.senses import Glimpse
from netboard.participants.submovement import Submovement
from netboard.stage.curtain import make_curtain, view_of
from netboard.task.trials.state_machine import Phase

THINK_TICKS = round(THINK_EVERY / TICK_SECONDS)
"""A mind decides after each tick whose number is a multiple of this [1]."""

_FIRST_ACTIVE, _LAST_ACTIVE = int(Phase.LEVELLING), int(Phase.FAILED)


class Mind:
    """One participant's eyes, sense of force and brain."""

    def __init__(
        self, config: Config, person: Participant, station: Side, sides: tuple[Side, ...], rng: np.random.Generator
    ) -> None:
        block = config.block
        self._brain = Brain(person, config.physics, config.task, sides, rng)
        seen = replace(block, left="person", right="person")  # whoever moves a hand is shown the board, a robot too
        self._curtain = make_curtain(replace(config, block=seen))
        self._station = station
        self._view_ticks = ceil(1.0 / (TICK_SECONDS * config.network.view_rate_hz))
        self._turn = self._view_ticks // 2 if station == "right" else 0
        self._glimpse: Glimpse | None = None
        self._scales = (block.trial_scales or (block.force_scale,)) if block.force == "full" and len(sides) == 1 else ()
        self._catch = frozenset(block.catch)

    def shown(self, tick: int) -> int:
        """Return the newest tick that has been seen when a tick is done.

        Returns
        -------
        int
            Its number, less than `tick`; negative before the first view [1].
        """
        return tick - 1 - (tick - 1 - self._turn) % self._view_ticks

    def look(self, row: NDArray[Any] | np.void) -> None:
        """Take the view of a tick."""
        time_ns = int(row["time_ns"])
        view = view_of(self._curtain, row, self._station, None, time_ns)
        when = (time_ns + TICK_NS) * 1e-9
        self._glimpse = Glimpse(when, view.phase, view.z, view.theta, view.p, view.target, view.left, view.right)

    def think(self, row: NDArray[Any] | np.void, force: float) -> tuple[Submovement, ...]:
        """Decide, at a multiple of `THINK_TICKS`.

        Parameters
        ----------
        force : float
            Vertical force that acts on the own hand from now on [N].
        """
        scale = self._scale_in(row)
        felt = force / scale if scale else None
        return self._brain.think(int(row["time_ns"]) * 1e-9, self._glimpse, felt)

    def _scale_in(self, row: NDArray[Any] | np.void) -> float:
        """Return the factor by which to multiply the force on the hand; 0 where it tells nothing [1]."""
        trial = int(row["trial"])
        if not self._scales or not _FIRST_ACTIVE <= row["phase"] <= _LAST_ACTIVE or trial in self._catch:
            return 0.0
        return self._scales[(trial - 1) % len(self._scales)]


def seats_of(config: Config) -> tuple[tuple[Side, tuple[Side, ...]], ...]:
    """Return who decides in a block: at which station, with which hands.

    Returns
    -------
    tuple of (station, sides)
        One for each mind; a hand that is held still has none.
    """
    block = config.block
    if block.configuration == "bimanual":
        return ((block.station, SIDES),)
    moved = {"left": block.left, "right": block.right}
    return tuple((side, (side,)) for side in SIDES if moved[side] != "still")
