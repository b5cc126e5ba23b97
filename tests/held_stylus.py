"""A stylus in a simulated hand or in none, with the mechanics and the muscles behind one object, for tests."""

from collections.abc import Iterable

import numpy as np

from netboard.base.tables.simulated import Participant, VirtualDevice
from netboard.participants.body.device_models import resolved
from netboard.participants.body.stylus import ACTION, HandMechanics, StylusMechanics, hold
from netboard.participants.people.hand import Hand
from netboard.participants.people.submovement import Submovement


class HeldStylus:
    """A stylus of a device; `held` says whether the hand of a participant holds it."""

    def __init__(self, person: Participant, device: VirtualDevice, held: bool = True, seed: int = 1) -> None:
        model = resolved(device)
        self.hand = Hand(person, model, np.random.default_rng(seed)) if held else None
        self.stylus = (
            self.hand.stylus if self.hand else StylusMechanics(hold(model, HandMechanics(), np.zeros(1, ACTION)))
        )
        self.advance = self.stylus.advance

    def plan(self, moves: Iterable[Submovement]) -> None:
        assert self.hand is not None
        self.hand.plan(moves)

    def put(self, z: float) -> None:
        self.stylus.put(0.0, 0.0, z)

    def muscle(self, name: str) -> float:
        assert self.hand is not None
        return float(self.hand.muscles[name][0])

    @property
    def position(self) -> tuple[float, float, float]:
        return self.stylus.position

    @property
    def velocity(self) -> tuple[float, float, float]:
        return self.stylus.velocity

    @property
    def tip(self) -> tuple[float, float, float]:
        return self.stylus.tip

    def bits(self) -> bytes:
        assert self.hand is not None
        return self.hand.muscles.tobytes() + self.stylus.held.stylus.tobytes() + self.stylus.held.tip.tobytes()
