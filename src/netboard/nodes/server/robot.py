"""A robot partner: a simulated participant within the server, or a hand that is held still.

It sees what the curtain lets its side see, with a delay, feels the force on its hand (if any) and moves a simulated
hand. It fills in the row of a tick what an agent would have sent, and uses nothing else. It never waits: the server
calls `Robot.fill` before a tick and `Robot.take` after it.
"""

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Config, Side
from netboard.base.tick import TICK_WORDS
from netboard.nodes.ports.samples import leave_out
from netboard.participants.policy import SIMULATED_PARTICIPANT, identity_of
from netboard.participants.seat.body import Body, plan
from netboard.participants.seat.closed_loop import DECISION_TICKS, SimulatedParticipant, person_at

_TICK, _TIME = TICK_WORDS["tick"], TICK_WORDS["time_ns"]


class Robot:
    """Moves one hand of a block.

    ``[block] left`` or ``right`` is ``robot`` or ``still``, and ``[participant]`` has the robot's parameters.
    """

    def __init__(self, config: Config, side: Side) -> None:
        self.side = side
        who = person_at(config, side, {})
        self.identity = identity_of("held still" if who is None else SIMULATED_PARTICIPANT, who)
        seed = (config.block.seed, config.block.number, SIDES.index(side))
        # Another body is warmed, because that changes its state and takes random numbers.
        Body(config, side, config.participant, np.random.default_rng(seed)).warm()
        self._body = Body(config, side, who, np.random.default_rng((*seed, 0)))
        self._participant = (
            None if who is None else SimulatedParticipant(config, who, side, (side,), np.random.default_rng((*seed, 1)))
        )
        if self._participant is not None:
            self._participant.warm()

    def fill(self, words: NDArray[np.int64], tick: int, time_ns: int) -> None:
        """Fill in the sample of a tick: live flag, sequence number, stamp, height and velocity.

        ``words``: the row of the tick as 64-bit words; the other side's sample may already be there, and one of a
        device that is connected at this side but not in use, which is left out.
        """
        leave_out(words, SIDES.index(self.side))
        words[_TICK], words[_TIME] = tick, time_ns
        self._body.fill(words)

    def take(self, words: NDArray[np.int64]) -> None:
        """Take what the hand sees and feels in a finished tick, and perhaps begin a movement."""
        if self._participant is None:
            return
        force = self._body.apply_force(words)
        tick = int(words[_TICK])
        if tick % DECISION_TICKS == 0:
            moves = self._participant.decide(words, force)
            plan(self._body.bodies, moves, len(moves))
        if self._participant.shown(tick + 1) == tick:
            self._participant.see(words)
