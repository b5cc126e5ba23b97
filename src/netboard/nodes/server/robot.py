"""A robot partner within the server: a policy in its seat, or a hand that is held still.

It sees what the curtain lets its side see, with a delay, feels the force on its hand (if any) and moves a simulated
stylus. It fills in the row of a tick what an agent would have sent, and uses nothing else. It never waits: the server
calls `Robot.fill` before a tick and `Robot.take` after it.
"""

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, Words, composed, machine_code
from netboard.base.config import SIDES, Config, Side
from netboard.base.tick import TICK_WORDS
from netboard.nodes.ports.samples import leave_out
from netboard.participants.body.stylus import ACTION
from netboard.participants.policy import identity_of
from netboard.participants.seat.body import BODY, READINGS, advance, apply_force, pack_body, read
from netboard.participants.seat.closed_loop import Seat, kernels_of, make_seat
from netboard.participants.seat.partners import make_partner
from netboard.physics.scene.rendering import pack_rendering

_TICK, _TIME = TICK_WORDS["tick"], TICK_WORDS["time_ns"]


def _fill(bodies: Records, actions: Records, side: int, readings: Records, words: Words) -> None:
    """Advance a stylus by a millisecond, and put it into a tick's row."""
    numbers = words.view(np.float64)
    advance(bodies, actions, side, side + 1, words, numbers)
    read(bodies, side, side + 1, readings[0], words, numbers)


def _take(
    seat: Seat,
    bodies: Records,
    actions: Records,
    side: int,
    force_queue: NDArray[np.float64],
    catch: NDArray[np.int64],
    words: Words,
    before: Words,
) -> None:
    """Take the force of a tick, and let the policy attend to it."""
    numbers = words.view(np.float64)
    apply_force(bodies, side, force_queue, catch, words, numbers)
    _attend(seat, bodies, actions, words, numbers, before, before.view(np.float64))


def _attend(*arguments: object) -> None:
    """Placeholder for how a seat attends to a tick, which `composed` replaces."""
    raise NotImplementedError


class Robot:
    """Moves one hand of a block: the partner that ``[block] left`` or ``right`` names, or ``still``."""

    def __init__(self, config: Config, side: Side) -> None:
        mover = config.block.left if side == "left" else config.block.right
        policy = None if mover == "still" else make_partner(mover, config, side)
        self.side = side
        self.identity = identity_of("held still") if policy is None else policy.identity
        self._place = place = SIDES.index(side)
        self._bodies, self._actions = np.zeros(len(SIDES), BODY), np.zeros(len(SIDES), ACTION)
        self._readings = np.zeros(1, READINGS)
        self._before = np.zeros(len(TICK_WORDS), np.int64)
        self._take = None
        seat = None
        if policy is not None:
            seat = make_seat(config, policy, side, (config.block.seed, config.block.number))
            queue = np.zeros((len(SIDES), config.block.force_delay_ms + 1))
            catch = pack_rendering(config)["catch"][0].copy()
            self._arguments = seat, self._bodies, self._actions, place, queue, catch
            code = composed(_take, _attend=kernels_of(policy.decide).attend)
            self._take = machine_code(code, *self._arguments, self._before, self._before)
        across = (0.0, 0.0) if policy is None or seat is None else policy.across(seat.state, side)
        pack_body(config, None if policy is None else policy.hand(), across, self._bodies[place])
        self._stylus = self._bodies, self._actions, place, self._readings
        self._fill = machine_code(_fill, *self._stylus, self._before)

    def fill(self, words: NDArray[np.int64], tick: int, time_ns: int) -> None:
        """Fill in the sample of a tick: live flag, sequence number, stamp, height and velocity.

        ``words``: the row of the tick as 64-bit words; the other side's sample may already be there, and one of a
        device that is connected at this side but not in use, which is left out.
        """
        leave_out(words, self._place)
        words[_TICK], words[_TIME] = tick, time_ns
        self._fill(*self._stylus, words)

    def take(self, words: NDArray[np.int64]) -> None:
        """Take what the hand sees and feels in a finished tick, and act."""
        if self._take is not None:
            self._take(*self._arguments, words, self._before)
            self._before[:] = words
