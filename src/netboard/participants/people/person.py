"""A simulated participant as a policy: its controller decides every 10 ms, its muscles act every millisecond."""

from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.base.config import SIDES, Config, Side
from netboard.base.tables.simulated import Participant
from netboard.base.tick import TICK_SECONDS
from netboard.participants.body.device_models import resolved
from netboard.participants.body.stylus import HandMechanics
from netboard.participants.people import controller
from netboard.participants.people.muscles import (
    ARM,
    MUSCLES,
    begin,
    hand_mechanics,
    initial_muscles,
    pack_arm,
    update_muscles,
)
from netboard.participants.people.senses import DECISION_INTERVAL
from netboard.participants.policy import SIMULATED_PARTICIPANT, Policy, identity_of

DECISION_TICKS = round(DECISION_INTERVAL / TICK_SECONDS)
"""A participant decides after each tick whose number is a multiple of this [1]."""

PERSON = np.dtype(
    [
        ("brain", controller.STATE),
        ("muscles", MUSCLES, (2,)),  # of the left and the right hand
        ("moves", controller.MOVE, (2,)),  # room for new movements
    ]
)
"""State of a simulated participant."""

_CONSTANTS = np.dtype([("brain", controller.CONSTANTS), ("arm", ARM), ("hands", "<i8", (2,))])


@inlined
def decide(state: np.void, k: np.void, observation: np.void, actions: NDArray[Any]) -> None:
    """Decide at times, and update the muscles of each own hand."""
    if observation["tick"] % DECISION_TICKS == 0:
        _command(state, k, observation)
    for side in range(2):
        if k["hands"][side]:
            height, force = observation["height"][side], observation["force"][side]
            update_muscles(state["muscles"][side], k["arm"], observation["start"], height, force, actions[side])


@inlined
def _command(state: np.void, k: np.void, observation: np.void) -> None:
    """Let the controller decide, and begin its new movements."""
    moves, now = state["moves"], observation["time"]
    count = controller.decide(state["brain"], k["brain"], now, observation["seen"], observation["felt"], moves)
    for i in range(count):
        move = moves[i]
        begin(state["muscles"][move["side"]], move["start"], move["duration"], move["displacement"])


@final
class ParticipantPolicy(Policy):
    """A simulated participant in a block, with one hand or both."""

    kind = SIMULATED_PARTICIPANT
    checked = False
    decide = staticmethod(decide)

    def __init__(self, config: Config, person: Participant, sides: tuple[Side, ...]) -> None:
        self.sides = sides
        self._person, self._device = person, resolved(config.virtual)
        self.constants = np.zeros(1, _CONSTANTS)
        brain = controller.pack_constants(person, config.physics, config.task, config.virtual, sides)
        self.constants["brain"], self.constants["arm"] = brain[0], pack_arm(person, self._device)[0]
        self.constants["hands"] = [side in sides for side in SIDES]

    def initial(self, seed: tuple[int, ...]) -> NDArray[Any]:
        """Return its state; brain and hands have random numbers of their own."""
        state = np.zeros(1, PERSON)
        place = SIDES.index(self.sides[0])
        packed = self.constants["brain"].copy()
        state["brain"] = controller.initial_state(packed, np.random.default_rng((*seed, 3 + place)))[0]
        for number, _ in enumerate(SIDES):
            rng = np.random.default_rng((*seed, 1 + number))
            state["muscles"][0, number] = initial_muscles(self._person, rng)[0]
        return state

    def hand(self) -> HandMechanics:
        """Return what its arm adds to the mechanics of a device."""
        return hand_mechanics(self._person, self._device)

    def across(self, state: NDArray[Any], side: Side) -> tuple[float, float]:
        """Return the rest position of a hand across the vertical line [m]."""
        muscles = state["muscles"][0, SIDES.index(side)]
        return float(muscles["rest_x"]), float(muscles["rest_y"])

    @property
    def identity(self) -> dict[str, str]:
        """What is recorded of it."""
        return identity_of(self.kind, self._person)


def partner(config: Config, side: Side) -> ParticipantPolicy:
    """Return the simulated participant of ``[participant]`` as a partner."""
    return ParticipantPolicy(config, config.participant, (side,))
