"""The hand of a simulated participant on the stylus of one device: muscles that move by planned submovements."""

from collections.abc import Iterable
from typing import Any, final

import numpy as np

from netboard.base.compiled import inlined
from netboard.base.tables.simulated import Participant
from netboard.participants.body.device_models import DeviceModel
from netboard.participants.body.stylus import ACTION, StylusMechanics, hold
from netboard.participants.people.muscles import CAPACITY, hand_mechanics, initial_muscles, pack_arm, update_muscles
from netboard.participants.people.submovement import Submovement


@inlined
def act(holder: tuple[Any, ...], stylus: np.void, force: float, when: float, action: np.void) -> None:
    """Update the muscles, which are the holder's first part; the second one has their constants."""
    muscles, arm = holder
    update_muscles(muscles[0], arm[0], when, stylus["place"][2], force, action)


@final
class Hand:
    """A simulated hand on a stylus, which makes the submovements that it is given."""

    def __init__(self, participant: Participant, device: DeviceModel, rng: np.random.Generator) -> None:
        self.muscles, arm = initial_muscles(participant, rng), pack_arm(participant, device)
        held = hold(device, hand_mechanics(participant, device), np.zeros(1, ACTION), (self.muscles, arm))
        self.stylus = StylusMechanics(held, act)
        self.stylus.put(float(self.muscles["rest_x"][0]), float(self.muscles["rest_y"][0]), 0.0)

    def plan(self, moves: Iterable[Submovement]) -> None:
        """Add submovements to those under way; a start may be in the past.

        Raises
        ------
        ValueError
            If more than `CAPACITY` submovements would be under way.
        """
        for move in moves:
            count = int(self.muscles["moves"][0])
            if count == CAPACITY:
                raise ValueError(f"a hand can have at most {CAPACITY} submovements under way")
            self.muscles["submovements"][0, count] = move.start, move.duration, move.displacement
            self.muscles["moves"] = count + 1
