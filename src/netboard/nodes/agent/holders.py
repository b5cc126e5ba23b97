"""What an agent serves in a block: its own device, or a simulated one that the block's robot partner holds.

A block that names a robot partner at the agent's side makes the agent serve the partner's device, behind a safety chain
like any other; its own device has no force meanwhile. The configuration of a block is read in a thread, and the partner
made there, because both take long.
"""

import logging
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple, Protocol

from netboard.base.config import Config, Side
from netboard.base.device_kind import SEATED
from netboard.base.errors import NetboardError
from netboard.base.process.realtime import beside_loop
from netboard.base.tables.experiment import PERSON, STILL
from netboard.devices.contract.device import Device
from netboard.devices.safety.chain import SafetyChain
from netboard.devices.simulated.partner import BACKEND, RobotPartner
from netboard.network.transport import channels, sockets
from netboard.nodes.agent.stylus_source import PartnerSource, block_of
from netboard.participants.seat.partners import make_partner

log = logging.getLogger(__name__)


class StylusSource(Protocol):
    """The simulated participant, robot partner or player that moves a virtual stylus, in the agent's process."""

    @property
    def due_ns(self) -> int:
        """When it must be advanced, if `file` does not signal first [ns]."""

    @property
    def file(self) -> int:
        """Number of a file that signals when it must be advanced, or `netboard.network.transport.waiting.NO_FILE`."""

    @property
    def identity(self) -> Mapping[str, str]:
        """What is recorded of it; see `netboard.participants.policy`."""

    def begin(self, text: str) -> None:
        """Take the configuration of the block that begins."""

    def step(self, now_ns: int, haptics: bool) -> None:
        """Advance up to now; `haptics` says whether haptic feedback is on."""


class Holder(NamedTuple):
    """A device, what moves its stylus if no person does, and the safety chain before its motors."""

    config: Config
    device: Device
    source: StylusSource | None
    safety: SafetyChain
    seated: bool = False  # whether it is the robot partner of a block, and not the agent's own device

    @property
    def identity(self) -> Mapping[str, str]:
        """What is recorded of who moves the stylus, and whether that is one of a block; empty for a person."""
        policy = {} if self.source is None else self.source.identity
        return {**policy, SEATED: "true"} if self.seated else policy


def holder_of(config: Config, device: Device, source: StylusSource | None) -> Holder:
    """Return the holder of an open device."""
    return Holder(
        config, device, source, SafetyChain(config.safety, device.info.max_force, device.info.continuous_force)
    )


class Holders:
    """The holders of one agent: its own, and those of the robot partners of its blocks."""

    def __init__(self, side: Side, own: Holder, context: sockets.Context) -> None:
        self._side, self._own, self._context = side, own, context
        self._partners: dict[tuple[str, str], Holder] = {}  # by name and identity
        self._reader = ThreadPoolExecutor(1, "holder", beside_loop)
        self._coming: Future[tuple[Holder, bool]] | None = None
        self.blinded = False  # whether operators may not see who holds the stylus in the newest block

    def begin(self, text: str) -> None:
        """Choose the holder for the block of a configuration."""
        self._coming = self._reader.submit(self._chosen, text)

    def chosen(self) -> Holder | None:
        """Return the holder of the block that has begun, once it is made; else None."""
        if self._coming is None or not self._coming.done():
            return None
        coming, self._coming = self._coming, None
        try:
            holder, self.blinded = coming.result()
            return holder
        except NetboardError as error:  # the server waits, and says for what
            log.error("the robot partner of the block cannot be seated: %s", error)
            return None

    def renewed(self, holder: Holder, safety: SafetyChain) -> Holder:
        """Return a holder with the new safety chain of its device, which was lost and is back."""
        new = holder._replace(safety=safety)
        if holder is self._own:
            self._own = new
        else:
            self._partners = {key: new if one is holder else one for key, one in self._partners.items()}
        return new

    def close(self) -> None:
        """Close the devices of all partners, with zero force."""
        self._reader.shutdown(wait=True, cancel_futures=True)
        for holder in self._partners.values():
            holder.device.close()

    def _chosen(self, text: str) -> tuple[Holder, bool]:
        """Return the holder for a block, and whether the block is blinded; a partner is made, if it is a new one."""
        config = block_of(self._own.config, text)
        return self._holder_for(config), config.block.blinded

    def _holder_for(self, config: Config) -> Holder:
        mover = getattr(config.block, self._side)
        if mover in (PERSON, STILL):
            return self._own
        # What is recorded of a holder never changes: with other parameters, or another file, it is another one.
        key = mover, repr(sorted(make_partner(mover, config, self._side).identity.items()))
        if key not in self._partners:
            self._partners[key] = self._seated(mover, config)
        return self._partners[key]

    def _seated(self, mover: str, config: Config) -> Holder:
        """Return a robot partner that holds a simulated device."""
        agent = replace(config.agents.of(self._side), device=BACKEND, options={"partner": mover})
        agents = config.agents
        agents = replace(agents, left=agent) if self._side == "left" else replace(agents, right=agent)
        config = replace(config, agents=agents)
        device = RobotPartner(self._side, config)
        device.open()
        source = PartnerSource(config, device, self._context, channels.PARTNER[self._side])
        return holder_of(config, device, source)._replace(seated=True)
