"""Backend ``virtual``: a simulated device, by default a Touch, held by a simulated hand.

Options (``agents.<side>.options``): see `VirtualOptions`.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from pydantic import StrictBool

from netboard.base.config import SIDES, Config, Side
from netboard.base.settings import FORBID_UNKNOWN_KEYS, about
from netboard.devices.simulated.device import SimulatedDevice
from netboard.participants.body.stylus import ACTION, HandMechanics, StylusMechanics, hold, release
from netboard.participants.people.hand import Hand, act
from netboard.participants.people.submovement import Submovement


@dataclass(frozen=True, slots=True)
class VirtualOptions:
    """Options of the virtual device."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    held: Annotated[StrictBool, about("false: no hand on the stylus")] = True


@final
class VirtualTouch(SimulatedDevice):
    """A simulated device in a simulated hand, which the table ``participant`` describes."""

    def __init__(self, side: Side, config: Config) -> None:
        self._hand: Hand | None = None
        super().__init__(side, config)

    def _held(self, config: Config) -> tuple[StylusMechanics, Callable[..., None]]:
        if not self.read_options(VirtualOptions).held:
            return StylusMechanics(hold(self._model, HandMechanics(), np.zeros(1, ACTION))), release
        rng = np.random.default_rng((config.block.seed, SIDES.index(self.side)))
        self._hand = Hand(config.participant, self._model, rng)
        return self._hand.stylus, act

    def command(self, moves: Iterable[Submovement]) -> None:
        """Command movements of the hand; a stylus that nobody holds does not move.

        ``moves``: movements of this side's hand, timed on the clock of `read`, in seconds.
        """
        planned = tuple(moves)
        if any(move.side != self.side for move in planned):
            raise ValueError(f"the {self.side} hand was given movements of the other one")
        if self._hand is not None:
            self._hand.plan(planned)
