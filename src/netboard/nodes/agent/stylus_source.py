"""Who moves the stylus of a virtual device, in the agent's process: a simulated participant or a player with a mouse.

A simulated participant sees the views of its station's display, feels the force that its device renders, and acts. In a
dyadic block each station has its own controller, which moves the hand on that side's device. In a bimanual block one
controller in the left agent sees the view of the block's station and moves both hands: it sends the movements of the
right hand over the channel ``moves`` to the right agent. Simulated participants are re-created for each block. A player
sits at the display, which sends the pointer's position to its side's agent and receives the force on the hand.
"""

import logging
from collections.abc import Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from math import isfinite
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Config, Side, parse
from netboard.base.errors import ConfigError, NetboardError, WireError
from netboard.base.process.realtime import beside_loop
from netboard.base.tables.experiment import PERSON, STILL
from netboard.devices.contract.device import Device
from netboard.network import keys
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.motion import Felt, Move, Pointer
from netboard.network.transport import channels, sockets
from netboard.network.transport.fastpath import Receiver
from netboard.network.transport.waiting import NO_FILE
from netboard.nodes.agent.agent_runs import NEVER_DUE_NS
from netboard.nodes.agent.partner_watch import WatchedPartner, watch
from netboard.participants.people.controller import Controller, pack_constants
from netboard.participants.people.senses import DECISION_INTERVAL, Glimpse, write_glimpse
from netboard.participants.people.submovement import Submovement
from netboard.participants.policy import SIMULATED_PARTICIPANT, Policy, identity_of
from netboard.participants.seat.closed_loop import force_scales
from netboard.stage.view import View

log = logging.getLogger(__name__)

HOST: Side = "left"
"""Side whose agent runs the controller of a bimanual participant."""

DECISION_INTERVAL_NS = round(DECISION_INTERVAL * 1e9)

MIN_MOVE = 1e-3
"""Shortest movement that may be commanded to the other hand [s]."""

FORCE_VIEW_INTERVAL_NS = 8_000_000
"""Interval at which a player's display receives the force on the hand: the interval of views [ns]."""


@runtime_checkable
class SimulatedHandDevice(Protocol):
    """A device in a simulated hand, which can be felt and moved."""

    side: Side

    @property
    def felt(self) -> float:
        """Vertical force of the motors on the hand [N]."""

    def command(self, moves: Iterable[Submovement]) -> None:
        """Begin submovements of the hand."""

    def live(self, now_ns: int) -> None:
        """Integrate the hand's mechanics up to now."""


@runtime_checkable
class PointerDevice(Protocol):
    """A device whose stylus follows a pointer."""

    side: Side

    @property
    def felt(self) -> float:
        """Vertical force on the hand [N]."""

    def point(self, z: float | None, now_ns: int) -> None:
        """Take the pointer's position [m]; None before the player has pointed anywhere."""


class ViewReceiver:
    """Receives the views of a station."""

    def __init__(self, socket: sockets.Socket) -> None:
        self.glimpse: Glimpse | None = None
        self.trial = 0  # the one that is shown
        self._receiver = Receiver(socket, "view", sockets.MAX_SAMPLE)
        self.file = self._receiver.file

    def poll(self, now_ns: int) -> None:
        """Take the newest view."""
        while (frame := self._receiver.receive()) is not None:  # the file signals again once the socket is empty
            try:
                view = decode(frame)
            except WireError:
                continue
            if isinstance(view, View):
                self.trial = view.trial
                self.glimpse = Glimpse(
                    now_ns * 1e-9, view.phase, view.z, view.theta, view.p, view.target, view.left, view.right
                )

    def close(self) -> None:
        """Close the subscription."""
        self._receiver.close()


class LiveController:
    """A controller with one or two hands; it moves the hand on this device directly, the other one by messages.

    ``moves_socket``: channel to the other hand, if this participant has two.
    """

    def __init__(
        self,
        config: Config,
        device: SimulatedHandDevice,
        context: sockets.Context,
        moves_socket: "sockets.Socket | None" = None,
    ) -> None:
        where = keys.reach(config.network, f"agent.{device.side}")
        bimanual = config.block.configuration == "bimanual"
        station = config.block.station if bimanual else device.side
        sides: tuple[Side, ...] = ("left", "right") if bimanual else (device.side,)
        # The virtual devices draw their hands from the streams (seed, 0) and (seed, 1).
        rng = np.random.default_rng((config.block.seed, len(SIDES) + SIDES.index(device.side)))
        self._controller = Controller(config.participant, config.physics, config.task, config.virtual, sides, rng)
        self._views = ViewReceiver(sockets.view_subscriber(context, where.reach(channels.VIEW[station])))
        self._device = device
        self._reads = config.block.force == "full"  # only the full force shows where the partner is
        self._moves = moves_socket
        self.due_ns = 0
        self.file = self._views.file

    def step(self, now_ns: int, haptics: bool) -> None:
        """Look, and at times feel, decide, move."""
        self._device.live(now_ns)
        self._views.poll(now_ns)
        if now_ns < self.due_ns:
            return
        self.due_ns = now_ns + DECISION_INTERVAL_NS
        felt = self._device.felt if haptics and self._reads and self._moves is None else None
        moves = self._controller.decide(now_ns * 1e-9, self._views.glimpse, felt)
        for move in moves:
            if move.side == self._device.side:
                self._device.command((move,))
            elif self._moves is not None:
                delay = move.start - now_ns * 1e-9
                sockets.send(self._moves, encode(Move(move.side, delay, move.duration, move.displacement)))

    def close(self) -> None:
        """Close the subscription."""
        self._views.close()


class SecondHand:
    """A hand without a controller of its own: it makes the movements that the other agent commands."""

    def __init__(self, config: Config, device: SimulatedHandDevice, context: sockets.Context) -> None:
        self._device = device
        socket = sockets.moves_receiver(context, channels.addresses(config.network).reach(channels.MOVES))
        self._moves = Receiver(socket, "moves", sockets.MAX_SAMPLE)
        self.due_ns = NEVER_DUE_NS
        self.file = self._moves.file

    def step(self, now_ns: int, haptics: bool) -> None:
        """Begin the commanded movements."""
        self._device.live(now_ns)
        while (frame := self._moves.receive()) is not None:
            try:
                move = decode(frame)
            except WireError:
                continue
            if isinstance(move, Move) and move.side == self._device.side and _is_possible(move):
                start = now_ns * 1e-9 + move.delay
                self._device.command((Submovement(self._device.side, start, move.duration, move.displacement),))

    def close(self) -> None:
        """Close the channel."""
        self._moves.close()


@runtime_checkable
class PartnerDevice(WatchedPartner, Protocol):
    """A device whose stylus a robot partner holds, as its source sees it."""

    side: Side
    partner: str  # its name
    identity: Mapping[str, str]
    observation: NDArray[Any]

    def prepared(self, config: Config) -> tuple[Policy, NDArray[Any]]:
        """Return the partner for the block of a configuration, and its state."""

    def play(self, policy: Policy, state: NDArray[Any]) -> None:
        """Begin a block."""

    @property
    def fault(self) -> str:
        """Why the partner has let go of the stylus in this block; empty if it has not."""

    def tell(self, scale: float) -> None:
        """Tell the partner the factor of the board's force on its hand; 0 if the force tells nothing [1]."""

    def live(self, now_ns: int) -> None:
        """Integrate the hand's mechanics up to now."""


class PartnerSource:
    """The robot partner at a device: it gets the views of a channel, and is made anew for each block.

    The configuration of a block is read in a thread, and the partner made, because both take many milliseconds.
    """

    def __init__(self, config: Config, device: PartnerDevice, context: sockets.Context, channel: int) -> None:
        where = keys.reach(config.network, f"agent.{device.side}")
        self._views = ViewReceiver(sockets.view_subscriber(context, where.reach(channel)))
        self._reader = ThreadPoolExecutor(1, "configuration", beside_loop)
        self._coming: Future[tuple[Config, Policy, NDArray[Any]] | None] | None = None
        self._config, self._device = config, device
        self._scales = force_scales(config)
        self._fault = ""
        self.file = self._views.file
        watch(device)

    @property
    def identity(self) -> Mapping[str, str]:
        """What is recorded of the partner."""
        return self._device.identity

    @property
    def due_ns(self) -> int:
        """When Python must advance the partner, if `file` does not signal first [ns]."""
        return 0 if self._coming is not None else NEVER_DUE_NS

    def begin(self, text: str) -> None:
        """Make the partner for a block, as soon as its configuration has been read."""
        self._coming = self._reader.submit(self._prepare, text)

    def step(self, now_ns: int, haptics: bool) -> None:
        """Take the newest view."""
        self._device.live(now_ns)
        if self._coming is not None and self._coming.done():
            coming, self._coming = self._coming.result(), None
            if coming is not None:
                self._enter(*coming)
        if self._device.fault != self._fault:
            self._fault = self._device.fault
            if self._fault:
                log.error("%s: no force is rendered until the next block", self._fault)
        self._views.poll(now_ns)
        if self._views.glimpse is not None:
            write_glimpse(self._views.glimpse, self._device.observation["seen"])
        self._device.tell(self._scale() if haptics else 0.0)

    def _enter(self, config: Config, policy: Policy, state: NDArray[Any]) -> None:
        """Enter a block with the partner that the recording names; a robot partner of the block has another holder."""
        if policy.identity == self.identity:
            self._config, self._scales = config, force_scales(config)
            self._device.play(policy, state)
        elif getattr(config.block, self._device.side) in (PERSON, STILL):
            raise ConfigError(
                f"the file of the partner at the {self._device.side} device has changed since this agent was started; "
                "start it again"
            )

    def _scale(self) -> float:
        """Return the factor of the force in the trial that is shown; 0 if the force tells nothing [1]."""
        trial = self._views.trial
        if not self._scales or trial < 1 or trial in self._config.block.catch:
            return 0.0
        return self._scales[(trial - 1) % len(self._scales)]

    def _prepare(self, text: str) -> tuple[Config, Policy, NDArray[Any]] | None:
        """Return the partner for a block; None if another one is to hold the stylus, or it cannot be made here."""
        config = block_of(self._config, text)
        mover = getattr(config.block, self._device.side)
        if mover not in (PERSON, STILL, self._device.partner):
            return None
        try:
            return config, *self._device.prepared(config)
        except NetboardError:
            if mover != self._device.partner:
                raise
            return None  # the block's holder says why, and the server waits


class PlayerSource:
    """A player at this side's display, whose pointer moves the stylus."""

    def __init__(self, config: Config, device: PointerDevice, context: sockets.Context) -> None:
        where = channels.addresses(config.network)
        self.identity = identity_of("player with a mouse")
        self._device = device
        socket = sockets.pointer_receiver(context, where.pointer(device.side))
        self._pointer = Receiver(socket, "pointer", sockets.MAX_SAMPLE)
        self._felt = sockets.felt_publisher(context, where.felt(device.side))
        self._published_ns = 0
        self.due_ns = 0  # always
        self.file = NO_FILE

    def begin(self, text: str) -> None:
        """Keep the player: it is the same in every block."""

    def step(self, now_ns: int, haptics: bool) -> None:
        """Take the pointer's position, and send the force on the hand."""
        frame = self._pointer.receive()
        if frame is not None:
            self._take(frame, now_ns)
        if now_ns - self._published_ns >= FORCE_VIEW_INTERVAL_NS and self._felt.wanted():
            self._published_ns = now_ns
            self._felt.send(encode(Felt(self._device.side, self._device.felt)))

    def _take(self, frame: bytes, now_ns: int) -> None:
        try:
            pointer = decode(frame)
        except WireError:
            return
        if isinstance(pointer, Pointer) and pointer.side == self._device.side and isfinite(pointer.z or 0.0):
            self._device.point(pointer.z, now_ns)


def block_of(config: Config, text: str) -> Config:
    """Return an agent's configuration with the block, the scene and the task of the server's.

    So are the parameters of a robot partner that the block names, because they may be the study's.
    """
    received = parse(text, "the server's configuration")
    named = {side: received.partners.of(side) for side in SIDES if getattr(received.block, side) not in (PERSON, STILL)}
    partners = replace(config.partners, **named)
    return replace(config, block=received.block, physics=received.physics, task=received.task, partners=partners)


def _is_possible(move: Move) -> bool:
    """Return whether a movement is within the limits of a hand."""
    return abs(move.displacement) <= 1.0 and MIN_MOVE <= move.duration <= 60.0 and abs(move.delay) <= 60.0


class LiveParticipant:
    """The simulated participant at a device, re-created for each block.

    The configuration of a block is read in a thread, and so are the gains of its observer, because both take many
    milliseconds.
    """

    def __init__(self, config: Config, device: SimulatedHandDevice, context: sockets.Context) -> None:
        self.identity = identity_of(SIMULATED_PARTICIPANT, config.participant)
        self._reader = ThreadPoolExecutor(1, "configuration", beside_loop)
        self._configuration: Future[Config] | None = None
        self._config, self._device, self._context = config, device, context
        self._moves: sockets.Socket | None = None
        self._current = self._create()

    @property
    def due_ns(self) -> int:
        """When Python must advance the participant, if `file` does not signal first [ns]."""
        return 0 if self._configuration is not None else self._current.due_ns

    @property
    def file(self) -> int:
        """File of the socket whose messages the participant needs."""
        return self._current.file

    def begin(self, text: str) -> None:
        """Make a new participant for a block, as soon as its configuration has been read."""
        self._configuration = self._reader.submit(self._read, text)

    def step(self, now_ns: int, haptics: bool) -> None:
        """Advance up to now."""
        if self._configuration is not None and self._configuration.done():
            self._enter(self._configuration.result())
            self._configuration = None
        self._current.step(now_ns, haptics)

    def _read(self, text: str) -> Config:
        """Return the configuration of a block; the gains of its observer are then known, too."""
        config = block_of(self._config, text)
        pack_constants(config.participant, config.physics, config.task, config.virtual, (self._device.side,))
        return config

    def _enter(self, config: Config) -> None:
        """Enter a block, unless its configuration is the current one."""
        if config != self._config:
            self._config = config
            self._current.close()
            self._current = self._create()

    def _create(self) -> LiveController | SecondHand:
        if self._config.block.configuration != "bimanual":
            return LiveController(self._config, self._device, self._context)
        if self._device.side != HOST:
            return SecondHand(self._config, self._device, self._context)
        return LiveController(self._config, self._device, self._context, self._own_moves_socket())

    def _own_moves_socket(self) -> sockets.Socket:
        """Return the channel to the other hand; bound only once, because an address is not free again at once."""
        if self._moves is None:
            where = keys.reach(self._config.network, f"agent.{self._device.side}")
            self._moves = sockets.moves_sender(self._context, where.reach(channels.MOVES))
        return self._moves


def stylus_source_of(
    config: Config, device: Device, context: sockets.Context
) -> LiveParticipant | PartnerSource | PlayerSource | None:
    """Return the simulated participant, robot partner or player of a device; None if a real hand holds it."""
    if isinstance(device, PartnerDevice):
        return PartnerSource(config, device, context, channels.VIEW[device.side])
    if isinstance(device, PointerDevice):
        return PlayerSource(config, device, context)
    return LiveParticipant(config, device, context) if isinstance(device, SimulatedHandDevice) else None
