"""The state of a session: what its parts share, and what answers to operators are made from."""

import uuid
from collections.abc import Iterator, Mapping

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Side
from netboard.base.device_kind import SEATED, DeviceKind, held_by
from netboard.base.tables.experiment import PERSON, STILL
from netboard.base.tick import STATE, TICK, TICK_NS
from netboard.network.protocol.records import AGENT_PRESENT, DISPLAY_PRESENT
from netboard.network.transport import sockets
from netboard.network.transport.authenticator import Authenticator
from netboard.nodes.ports import emergency, samples
from netboard.nodes.ports.emergency import EmergencyStop, Event
from netboard.nodes.ports.ports import Ports
from netboard.nodes.ports.welcomes import Welcomes, welcomes_of
from netboard.nodes.server.attempts import Attempts
from netboard.nodes.server.blocks import BlockSequence
from netboard.nodes.server.event_log import EventLog
from netboard.nodes.server.operators import Operators
from netboard.nodes.server.questionnaires import Questionnaires
from netboard.nodes.server.stand_ins import AWAITING_WORDS, TRIGGER_STAND_IN, Confirmations, stand_ins
from netboard.nodes.server.still_hand import IDENTITY
from netboard.nodes.server.supervision import TrialSupervisor
from netboard.nodes.server.tick_clock import TickClock
from netboard.nodes.server.triggers import SessionTriggers
from netboard.stage.curtain import Pause
from netboard.task.trials.state_machine import Phase

RING_ROWS = 1024
"""Ticks kept in memory: more than the longest `block.force_delay_ms`, and a second of what operators see [1]."""

REST = "the end of the rest break"
"""What a block waits for that would start by itself."""

_FIRST_ACTIVE, _LAST_ACTIVE = int(Phase.LEVELLING), int(Phase.FAILED)


class SessionState:
    """The parts of a session and its present state.

    ``stage``: state of the stage after the last tick: one record of `STATE`. ``confirmation``: words of the command
    line that confirm stand-ins; see `netboard.nodes.server.stand_ins`.
    """

    def __init__(
        self,
        sequence: BlockSequence,
        attempts: Attempts,
        context: sockets.Context,
        authenticator: Authenticator | None,
        *,
        autostart: bool,
        confirmation: str = "",
    ) -> None:
        self.session = uuid.uuid4().hex
        self.sequence, self.attempts, self.authenticator = sequence, attempts, authenticator
        self.block = sequence.block
        self.ports = Ports(self.block.config, self._welcomes(), context, authenticator)
        self.clock = TickClock()
        self.supervisor = TrialSupervisor(autostart)
        self.emergency_stop = EmergencyStop()
        self.operators = Operators(opened=False, armed=autostart or not sequence.planned)
        self.confirmations = Confirmations(confirmation)
        self.event_log = EventLog(self.ports.log)
        self.triggers = SessionTriggers(self.ports.control.triggers)
        # The recent ticks, in a ring: as records of `TICK`, and as 64-bit words of the same memory.
        self.rows = np.zeros(RING_ROWS, TICK)
        self.words = self.rows.view(np.int64).reshape(RING_ROWS, -1)
        self.number = 0  # number of the next tick
        self.missing: tuple[str, ...] = ()  # what is missing before the block can begin
        self.rest_until_ns = 0  # end of the rest before the block [ns]
        self.questionnaires = ""  # questionnaires that are to be filled in now
        self.forms = Questionnaires()
        self.end_requested = False  # whether the session is to end as soon as it can
        self._own_devices: dict[Side, Mapping[str, str]] = {}  # the last ones that no robot partner held
        self.update_arming([])

    def _welcomes(self) -> Welcomes:
        return welcomes_of(self.block.texts, self.session)

    @property
    def phase(self) -> Phase:
        """Phase of the trial state machine."""
        return Phase(self._phase_word[0])

    @property
    def active(self) -> bool:
        """Whether a trial is under way."""
        return _FIRST_ACTIVE <= self._phase_word[0] <= _LAST_ACTIVE

    @property
    def felt(self) -> bool:
        """Whether a trial with haptic feedback is under way."""
        return self.active and self.block.config.block.haptics

    @property
    def idle(self) -> bool:
        """Whether no trial is under way and no agent is connected."""
        return self.ports.motion.empty and not self.active

    @property
    def alone(self) -> bool:
        """Whether no peer is connected, and none can be waiting for the answer to a handshake."""
        return self.authenticator is None and self.ports.unused

    def enter_block(self) -> None:
        """Make the current block of the sequence that of the session."""
        block = self.block = self.sequence.block
        self.event_log.blinded, self.event_log.any_blinded = block.config.block.blinded, self.sequence.any_blinded
        self.stage = block.stage.initial(**self.attempts.start_of(block.config.block.number))
        # A view of one word: it is read several times a tick, and a field of a record takes ten times as long.
        self._phase_word = self.stage.view(np.int64)[(STATE.names or ()).index("phase") :].data
        for side in SIDES:  # with a force delay the first ticks would otherwise send forces of the last block
            self.rows[f"{side}_force"] = 0.0
        hands = block.config.block
        robots = (side for side in SIDES if not hands.blinded and getattr(hands, side) not in (PERSON, STILL))
        self.emergency_stop.robots = frozenset(robots)
        motion = self.ports.motion
        motion.gains = block.latency.gains
        for side, agent in motion.agents.items():
            if agent.hello is not None:
                block.latency.take_limit(side, agent.hello.details)
        self.ports.renew(self._welcomes(), block.ends, block.moved)
        self.triggers.begin_block(block.config.triggers)
        self.rest_until_ns = now_ns() + int(block.config.block.rest * 1e9)
        self.missing = self.find_missing()  # otherwise the block would start by itself with what the last one needed

    def rest(self, now: int) -> float | None:
        """Return the remaining rest before the block [s], or None."""
        left = (self.rest_until_ns - now) * 1e-9
        return left if left > 0 and self.phase == Phase.IDLE else None

    def find_stand_ins(self) -> tuple[str, ...]:
        """Return what stands in for a haptic device or a screen now, in the words that confirm it."""
        return self._stand_ins_for({side: one for side, one in self._details.items() if side in self.block.people})

    def shown_stand_ins(self) -> tuple[str, ...]:
        """Return the stand-ins that operators see, and must confirm.

        In a blinded block these are those of both sides' own devices, whether or not a person holds them.
        """
        if not self.block.config.block.blinded:
            return self.find_stand_ins()
        for side, details in self._details.items():
            if side in self.block.people or held_by(details).kind != DeviceKind.ROBOT:
                self._own_devices[side] = details
        return self._stand_ins_for(self._own_devices)

    def _stand_ins_for(self, agents: Mapping[Side, Mapping[str, str]]) -> tuple[str, ...]:
        boxes = (TRIGGER_STAND_IN,) if self.triggers.simulated else ()
        return (*stand_ins(self.block.config, agents, self.ports.control.platforms), *boxes)

    @property
    def _details(self) -> dict[Side, Mapping[str, str]]:
        """What the connected agents say of their own devices; not of robot partners, which blocks seat and release."""
        found = {side: agent.hello.details for side, agent in self.ports.motion.agents.items() if agent.hello}
        return {side: details for side, details in found.items() if SEATED not in details}

    def find_missing(self) -> tuple[str, ...]:
        """Return what is missing now before the block can begin."""
        now, log = now_ns(), self.ports.log
        lacking = [*self.ports.motion.find_missing(now, self.block.moved), *self._missing_holders()]
        lacking += self.block.latency.missing
        if self.block.config.network.require_logger and not log.loggers:
            lacking.append("the logger")
        if self.phase == Phase.IDLE:
            lacking += self.triggers.missing
        if self.block.config.session.real and (found := self.confirmations.unconfirmed(self.shown_stand_ins())):
            lacking.append(f"{AWAITING_WORDS}: {', '.join(found)}")
        if self.emergency_stop.halted:
            lacking.append(emergency.AWAITING_RELEASE)
        if self.supervisor.autostart and self.rest(now) is not None:
            lacking.append(REST)
        return tuple(lacking)

    def _missing_holders(self) -> Iterator[str]:
        """Yield the agents that do not serve yet what the block has at their sides: a robot partner, or a person."""
        blinded = self.block.config.block.blinded
        for side in self.block.people:
            agent = self.ports.motion.agents[side].hello
            if agent is not None and SEATED in agent.details:
                yield f"the {side} agent{'' if blinded else ' to return to its own device'}"
        for side, sha256 in self.block.partners.items():
            wanted, hello = getattr(self.block.config.block, side), self.ports.motion.agents[side].hello
            if hello is None:
                continue
            words = "" if blinded else f" to seat the robot partner {wanted}"
            if hello.details.get("partner") != wanted:
                yield f"the {side} agent{words}"
            elif sha256 and hello.details.get("policy_sha256") != sha256:
                yield f"the {side} agent{words and words + ' with the parameters and files of the server'}"

    @property
    def loss(self) -> str:
        """How many trials of the block are lost, if the operator is asked to repeat them; else empty."""
        return self.attempts.lost.text if self.attempts.loses_too_many else ""

    @property
    def awaits_decision(self) -> bool:
        """Whether the block is over, and the next one waits until the operator has decided on repeats."""
        return self.phase == Phase.FINISHED and self.attempts.loses_too_many and not self.supervisor.autostart

    @property
    def view_notice(self) -> Pause:
        """What the participants' displays say of a pause, or of a block that waits for the operator's decision."""
        if self.phase == Phase.PAUSED:
            return Pause.STOP if self.emergency_stop.halted else self.supervisor.pause
        return Pause.DECISION if self.awaits_decision else Pause.NONE

    @property
    def in_trouble(self) -> bool:
        """Whether something other than the samples of a tick may keep a trial from going on, as `trouble` then says."""
        stopped = self.emergency_stop.halted or (self.active and not self.operators.armed)
        return bool(stopped or self.clock.gap or self.block.latency.trouble or self.ports.log.trouble)

    def trouble(self, found: int) -> str:
        """Return why a running trial cannot continue, empty if it can; a gap in time is reported once.

        ``found``: what the samples of the tick tell.
        """
        if self.emergency_stop.halted:
            return self.emergency_stop.halted
        if not self.operators.armed:
            return "the operator has disarmed the devices"
        if self.clock.gap:
            return self.clock.take_gap()
        for place, side in enumerate(SIDES):
            if not found & (samples.LIVE << place):
                return f"no sample from the {side} agent"
            if not found & (samples.ARMED << place):
                return f"the {side} device is not armed{self.emergency_stop.why(side, now_ns())}"
        if self.block.latency.trouble:
            return self.block.latency.trouble
        return self.ports.log.trouble if self.block.config.network.require_logger else ""

    def allow_arming(self, allowed: bool) -> None:
        """Permit forces of the devices, as far as the operator is concerned, or forbid them at once."""
        self.operators.armed = allowed
        self.update_arming([])

    def update_arming(self, events: list[Event]) -> None:
        """Allow arming, as the next heartbeat tells the devices, or forbid it at once; record the events of a stop."""
        motion, may_arm = self.ports.motion, self.operators.armed and not self.emergency_stop.halted
        forbidden, motion.may_arm = motion.may_arm and not may_arm, may_arm
        if forbidden:
            motion.send_heartbeat(self.number, at_once=True)
        for name, details in events:
            self.note(name, details)
            self.attempts.emergency(name, details, self.number)

    def note(self, name: str, details: dict[str, str], tick: int | None = None) -> None:
        """Record an event of a tick, by default the current one, and send its trigger."""
        tick = self.number if tick is None else tick
        if self.event_log.opened:  # first, because a trigger is urgent
            tick_ns = self.clock.due_ns + (tick - self.number) * TICK_NS
            self.triggers.event(name, details, tick, tick_ns, now_ns())
        self.event_log.note(tick, name, details)

    def note_peers(self) -> None:
        """Record which agents and displays are there, and let each confirmed stand-in be recorded again."""
        for side, agent in self.ports.motion.agents.items():
            if agent.hello is not None:
                own = {"side": side, "name": agent.hello.name}
                self.note(AGENT_PRESENT, {**own, **agent.hello.details, **own})
        for hello in self.ports.control.displays:
            own = {"side": hello.side, "name": hello.name}
            self.note(DISPLAY_PRESENT, {**own, **hello.details, **own})
        self.confirmations.begin_file()
        for held in self.block.still:
            self.note("robot_joined", {"side": held, **IDENTITY})
