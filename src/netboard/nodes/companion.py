"""The simulated person at a station: sees what the station's display is sent, feels what the own device renders, acts.

In a dyadic block each station has its own brain, which moves the hand on that side's device. In a bimanual block one
brain sits at the left station and moves both hands: what the right one shall do travels over the nerve, a channel from
the left agent to the right one.
"""

from collections.abc import Iterable
from typing import Protocol, runtime_checkable

import numpy as np

from netboard import keys, sockets
from netboard.config import SIDES, Config, Side
from netboard.errors import WireError
from netboard.participants.brain import Brain
from netboard.participants.senses import Glimpse
from netboard.participants.submovement import Submovement
from netboard.wire.codec import decode, encode
from netboard.wire.messages import Move, View

HOST: Side = "left"
"""Where the brain of a bimanual participant sits."""

SHORTEST_MOVE = 1e-3
"""No movement over the nerve is shorter than this [s]."""


@runtime_checkable
class Held(Protocol):
    """A device in a simulated hand, which can be felt and told to move."""

    side: Side

    @property
    def felt(self) -> float:
        """Vertical force the motors exert on the hand now [N]."""

    def command(self, moves: Iterable[Submovement]) -> None:
        """Let the hand do something."""

    def live(self, now_ns: int) -> None:
        """Let the hand's mechanics run up to now."""


class Eye:
    """Looks at what a station's display is sent."""

    def __init__(self, socket: sockets.Socket) -> None:
        self.glimpse: Glimpse | None = None
        self._socket = socket

    def look(self, now_ns: int) -> None:
        """Take the newest view."""
        frame = sockets.receive(self._socket)
        if frame is None:
            return
        try:
            view = decode(frame)
        except WireError:
            return
        if isinstance(view, View):
            self.glimpse = Glimpse(
                now_ns * 1e-9, view.phase, view.z, view.theta, view.p, view.target, view.left, view.right
            )


class Person:
    """A brain with one or two hands; the hand on the own device is moved directly, the other one over the nerve.

    Parameters
    ----------
    config : Config
        Rig and experiment.
    device : Held
        The device in the own hand.
    context : zmq.Context
        Where the sockets are made.
    """

    def __init__(self, config: Config, device: Held, context: sockets.Context) -> None:
        where = keys.reach(config.network, f"agent.{device.side}")
        bimanual = config.block.configuration == "bimanual"
        sides: tuple[Side, ...] = ("left", "right") if bimanual else (device.side,)
        rng = np.random.default_rng((config.block.seed, len(SIDES) + SIDES.index(device.side)))
        self._brain = Brain(config.participant, config.physics, config.task, sides, rng)
        self._eye = Eye(sockets.view_subscriber(context, where.reach(sockets.VIEW[device.side])))
        self._device = device
        self._nerve = sockets.nerve_sender(context, where.reach(sockets.NERVE)) if bimanual else None

    def step(self, now_ns: int, haptics: bool) -> None:
        """Look, feel, decide, move."""
        self._device.live(now_ns)
        self._eye.look(now_ns)
        felt = self._device.felt if haptics and self._nerve is None else None
        moves = self._brain.step(now_ns * 1e-9, self._eye.glimpse, felt)
        for move in moves:
            if move.side == self._device.side:
                self._device.command((move,))
            elif self._nerve is not None:
                delay = move.start - now_ns * 1e-9
                sockets.send(self._nerve, encode(Move(move.side, delay, move.duration, move.displacement)))


class Limb:
    """A hand without a brain of its own: it does what comes over the nerve."""

    def __init__(self, config: Config, device: Held, context: sockets.Context) -> None:
        self._device = device
        self._nerve = sockets.nerve_receiver(context, sockets.addresses(config.network).reach(sockets.NERVE))

    def step(self, now_ns: int, haptics: bool) -> None:
        """Do what has been asked for."""
        self._device.live(now_ns)
        while (frame := sockets.receive(self._nerve)) is not None:
            try:
                move = decode(frame)
            except WireError:
                continue
            if isinstance(move, Move) and move.side == self._device.side and _possible(move):
                start = now_ns * 1e-9 + move.delay
                self._device.command((Submovement(self._device.side, start, move.duration, move.displacement),))


def _possible(move: Move) -> bool:
    """Whether a hand can move like that."""
    return abs(move.displacement) <= 1.0 and SHORTEST_MOVE <= move.duration <= 60.0 and abs(move.delay) <= 60.0


def companion_of(config: Config, device: Held, context: sockets.Context) -> Person | Limb:
    """Make who holds a virtual device in this block."""
    if config.block.configuration == "bimanual" and device.side != HOST:
        return Limb(config, device, context)
    return Person(config, device, context)
