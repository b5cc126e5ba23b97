"""A session: the blocks of one dyad in order, their ticks, and the operators' commands.

Each tick has a deadline, 1 ms after the previous one (`netboard.nodes.server.tick_clock`). It does not wait for a side
that was late at the last tick. Its simulated time is always that of the deadline. Forces are sent first; everything
else follows: log the tick, publish the views, answer operators.

While no agent is connected and no trial is running, ticks are processed in groups. A message on the motion channel
still wakes the session at once.

A session is not open until its form is complete: until then nothing is recorded and no block can begin.
"""

import logging
import uuid
from dataclasses import asdict

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.config import SIDES
from netboard.base.errors import NetboardError
from netboard.base.tick import STATE, TICK, TICK_NS
from netboard.network.protocol.codec import encode
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.protocol.records import BLOCK_BEGAN, TickRecord
from netboard.network.transport import authenticator, sockets
from netboard.nodes.ports import emergency, samples
from netboard.nodes.ports.backfill import Backfiller
from netboard.nodes.ports.control_port import Wish
from netboard.nodes.ports.emergency import Alarm
from netboard.nodes.ports.ports import Ports
from netboard.nodes.server.answers import SessionAnswers
from netboard.nodes.server.attempts import Ledger
from netboard.nodes.server.blocks import Programme
from netboard.nodes.server.commands import Decision, Desk, Situation, form_of, note_of
from netboard.nodes.server.event_log import Chronicle, change_of
from netboard.nodes.server.readiness import Readiness
from netboard.nodes.server.supervision import Supervisor
from netboard.nodes.server.tick_clock import Pace
from netboard.task.studies.factors import TrialDetails
from netboard.task.trials.state_machine import STAGE_FAULT, Cause, Phase

log = logging.getLogger(__name__)

RING_ROWS = 1024
"""Ticks kept in memory: more than the longest force delay, and a second of what operators see [1]."""

HOUSE_TICKS = 10
FRAMES_A_TICK = 4
"""Painted frames recorded after each tick; displays paint at most one frame in several ticks [1]."""

ANSWER_NS = 4_000_000
"""Interval between answers to operators, one answer at a time; an answer takes a fifth of a tick [ns]."""

CLOCKS_NS = 1_000_000_000
"""Interval at which clock probes are recorded [ns]."""

PAGE_TICKS = 1500
"""Ticks between the last trial of a block and the next block, so that participants see that the block is over [1]."""

FAREWELL_NS = 200_000_000
"""Time before the control channel closes, so that its peers can read the last messages [ns]."""

FINISH_NS = 10_000_000_000
"""Longest wait for the loggers to bring the last records to disk [ns]."""

_AT = {name: place for place, name in enumerate(TICK.names or ())}
_COMMAND, _EVENT, _PHASE = _AT["command"], _AT["event"], _AT["phase"]
_FIRST_ACTIVE, _LAST_ACTIVE = int(Phase.LEVELLING), int(Phase.FAILED)
_ALL_FINE = 3 * (samples.LIVE | samples.ARMED)
_STOPPED, _TRIPPED = 3 * samples.STOPPED, 3 * samples.TRIPPED
_RECORD_HEAD = encode(TickRecord(bytes(TICK.itemsize)))[: -TICK.itemsize]


class Session:
    """Everything the server needs for one dyad.

    Parameters
    ----------
    ledger : Ledger
        Outcomes of the attempts in earlier runs of the session.
    door : authenticator.Door or None
        Authenticator of the peers; None without authentication.

    Attributes
    ----------
    inlets : (zmq.Socket, zmq.Socket)
        Sockets that wake the session when a message arrives: motion, control.
    """

    def __init__(
        self,
        programme: Programme,
        ledger: Ledger,
        context: sockets.Context,
        door: authenticator.Door | None,
        *,
        autostart: bool,
    ) -> None:
        self.session = uuid.uuid4().hex
        self.pace = Pace()
        self._door = door
        self._programme, self.ledger = programme, ledger
        self.block = programme.block
        self.desk = Desk(opened=False, armed=autostart or not programme.planned)
        self.watch = Supervisor(autostart)
        self.rows = np.zeros(RING_ROWS, TICK)
        self._words = self.rows.view(np.int64).reshape(RING_ROWS, -1)
        self.number = 0
        self._clocks_ns = 0
        self._rest_until_ns = 0
        self._page_at = -1
        self.missing: tuple[str, ...] = ()
        self._asked_to_end = False
        self._ended_ns = self._ending_until_ns = 0
        self._log_closing = self._stopping = False
        self._unheard, self._hear_ns, self._answer_ns = False, 0, 0
        self._started = False
        self.questionnaires = ""
        self._alarm = Alarm()
        self._ports = Ports(self.block.config, self._welcome(), SessionAnswers(self), context, door)
        self.motion, self.control, self.log = self._ports.motion, self._ports.control, self._ports.log
        self.inlets = self._ports.inlets
        self._chronicle = Chronicle(self.log)
        self._backfiller = Backfiller()
        self._readiness = Readiness(self._ports, self.desk, self._alarm, self.pace)
        self._sound([])

    def _welcome(self) -> Welcome:
        return Welcome(self.session, PROTOCOL_VERSION, now_ns(), self.block.text)

    # --- state, for the server ---------------------------------------------------------------------------------

    @property
    def wake_ns(self) -> int:
        """When the session wants to run next if no message arrives first [ns]."""
        return self.pace.wake_ns

    @property
    def phase(self) -> Phase:
        """Phase of the trial state machine."""
        return Phase(int(self._phase_word[0]))

    @property
    def ending(self) -> bool:
        """Whether the blocks are over and the loggers are taking the remaining records."""
        return self._ending_until_ns > 0

    @property
    def over(self) -> bool:
        """Whether the session is complete, and the loggers have all records or have run out of time."""
        return self._log_closing and self.log.closed and now_ns() - self._ended_ns > FAREWELL_NS

    @property
    def everything_recorded(self) -> bool:
        """Whether every record that matters is known to be on disk."""
        return self.log.done or not self._records_expected

    @property
    def _records_expected(self) -> bool:
        return self.block.config.network.require_logger and self._started

    @property
    def refused(self) -> tuple[tuple[str, str, int], ...]:
        """The most frequent refusals, as in `Status.refused`."""
        return self._ports.refused(self._door)

    # --- running -----------------------------------------------------------------------------------------------

    def begin(self, due_ns: int, machine: dict[str, str]) -> None:
        """Make the first tick due at a time [ns].

        Parameters
        ----------
        machine : dict of str
            Real-time settings that the process got from its machine, for the recording.
        """
        self.pace.begin(due_ns)
        self._note("session_started", {"session": self.session, **machine})
        if self.ledger.opened or not self._programme.planned or self.block.config.session.ready:
            self._open()
        else:
            self._enter()

    def _open(self) -> None:
        """Open the session: record everything from now on."""
        self.block = self._programme.block
        self.ledger.open(self.block.config, self.session)
        self.desk.opened = self._chronicle.opened = True
        self._begin_block()
        self._chronicle.catch_up(self.number)

    def _enter(self) -> None:
        """Make the programme's block the current one."""
        block = self.block = self._programme.block
        self.state = block.stage.initial(**self.ledger.place(block.config.block.number))
        self._phase_word = self.state.view(np.int64)[(STATE.names or ()).index("phase") :]
        for side in SIDES:  # with a force delay the first ticks would otherwise send forces of the last block
            self.rows[f"{side}_force"] = 0.0
        block.delays.gains[:] = 1.0
        self.motion.gains = block.delays.gains
        for side, seat in self.motion.seats.items():
            if seat.hello is not None:
                block.delays.know(side, seat.hello.details)
        self._ports.renew(self._welcome(), block.ends)
        self._rest_until_ns = now_ns() + int(block.config.block.rest * 1e9)

    def _begin_block(self) -> None:
        """Begin the programme's block: all following records belong to it."""
        self._page_at = -1
        self._enter()
        config = self.block.config
        self._details = TrialDetails(config)
        self.ledger.begin(config, self.number)
        stepping = {name: str(value) for name, value in asdict(self.block.stage.choice).items()}
        label = {"number": str(config.block.number), "blocks": str(config.block.blocks), "label": config.block.label}
        self._note(BLOCK_BEGAN, {**label, **stepping, "config": self.block.text})

    def _turn_page(self) -> None:
        """Begin the next block, or end the session if an operator asked for that."""
        self._page_at = -1
        if self.desk.end_after:
            self._asked_to_end = True
        elif not self._programme.last:
            self._programme.next()
            self._begin_block()

    def rest(self, now: int) -> float | None:
        """Return the remaining rest before the block [s], or None."""
        left = (self._rest_until_ns - now) * 1e-9
        return left if left > 0 and self.phase == Phase.IDLE else None

    def stop(self) -> None:
        """Ask the session to end."""
        self._asked_to_end = True

    def go_on(self, motion: bool, control: bool) -> None:
        """Take the messages that have arrived, and run the ticks that are due.

        The motion channel is read last, until it is empty, because its socket only then signals again. If it holds more
        than one tick can take, the rest is read at the next tick, signalled or not.
        """
        if self.ending:
            self._go_on_ending()
            return
        pace = self.pace
        idle = self.motion.empty and not self._active
        self.motion.drain(now_ns, pace.due_ns, motion)
        now = now_ns()
        if moved_ns := pace.catch_up(now, idle):
            self._note("stood_still", {"milliseconds": f"{moved_ns / TICK_NS:.0f}"})
        if idle:
            self._idle_ticks(now)
        elif pace.is_time(now, self.motion.complete):
            self.tick(pace.due_ns, now - pace.due_ns)
        self.motion.drain(now_ns, pace.due_ns)
        self._unheard |= control
        self._do_a_little(now_ns())
        if self._asked_to_end:
            self._end()
            return
        pace.sleep(self.motion.empty and not self._active, self.motion.complete)
        if self._unheard or self.motion.unheard:
            pace.wake_ns = min(pace.wake_ns, self._hear_ns)

    def _do_a_little(self, now: int) -> None:
        """Do a bounded part of the work that can wait, once a millisecond.

        A peer that sends too much thus only delays itself.
        """
        if now < self._hear_ns:
            return
        self._hear_ns = now + TICK_NS
        self.motion.attend(now, self.pace.due_ns)
        # Its signal comes only once, so it is read until drain() says that nothing is left.
        self._unheard = self._unheard and self.control.drain(now)
        if now >= self._answer_ns:
            self._answer_ns = now + ANSWER_NS
            self.control.answer()
        self._chronicle.keep_frames(self.control.take_frames(FRAMES_A_TICK), self.ledger)
        if self._door is not None:
            self._door.attend()

    @property
    def _active(self) -> bool:
        return bool(_FIRST_ACTIVE <= self._phase_word[0] <= _LAST_ACTIVE)

    def tick(self, due_ns: int, late_ns: int) -> None:
        """Run one tick."""
        number = self.number
        if 0 <= self._page_at <= number:
            self._turn_page()
        block = self.block
        words = self._words[number % RING_ROWS]
        found = self.motion.fill(words, number, due_ns, late_ns)
        if block.robots or block.unrelated is not None:
            found |= block.stand_in(self.rows[number % RING_ROWS], words, number, due_ns, self.state[0])
        active = self._active
        trouble = self.pace.gap or self.log.trouble or block.delays.trouble
        # In an undisturbed trial no command can be due, and asking for one would delay the forces.
        if not active or found != _ALL_FINE or self.control.wishes or trouble or self._asks or self._stopping:
            words[_COMMAND] = self._command(found)
        block.stage.advance(self.state, self.rows, number)
        if active and block.config.block.haptics and not self._alarm.halted:
            self.motion.force(words, block.stage.commanded_row(self._words, number))
        else:
            self.motion.beat(number, now_ns(), at_once=active and bool(self._alarm.halted))
        for robot in block.robots:
            robot.take(words)
        self.pace.began(late_ns)
        self._count(1)
        if number % HOUSE_TICKS == 0:
            self._keep_house()
        else:
            self.log.listen(now_ns())

    def _idle_ticks(self, now: int) -> None:
        """Run all due ticks together."""
        due_ns, first = self.pace.due_ns, self.number
        count = min(self.pace.how_many(now), RING_ROWS)
        if count < 1:
            return
        for number in range(first, first + count):
            self.motion.fill(self._words[number % RING_ROWS], number, due_ns + (number - first) * TICK_NS, 0)
        if 0 <= self._page_at < first + count:
            self._turn_page()
        self._words[first % RING_ROWS, _COMMAND] = self._command(0)
        self.block.stage.advance(self.state, self.rows, first, count)
        self._count(count)
        self._keep_house()

    def _count(self, count: int) -> None:
        """Log the finished ticks, handle their events, and publish the views."""
        for number in range(self.number, self.number + count):
            words = self._words[number % RING_ROWS]
            if self.desk.opened:
                self.log.append(_RECORD_HEAD + words.tobytes())
            if words[_EVENT]:
                self._happened(number)
        self.number += count
        self.pace.did(count)
        newest = (self.number - 1) % RING_ROWS
        rest = self.rest(now_ns()) if self._rest_until_ns else None
        seen = self.rows[newest], self._words[newest]
        self._ports.views.show(self.number, self.block.curtain, *seen, self.ledger.best, rest)

    def _lacks(self) -> tuple[str, ...]:
        """Return what is missing before the block can begin."""
        now = now_ns()
        return self._readiness.lacks(self.block, self.watch.autostart and self.rest(now) is not None, now)

    @property
    def _asks(self) -> bool:
        """Whether something that was asked for earlier may be due."""
        return self.desk.pause_after or bool(self.ledger.wanted)

    def _command(self, found: int) -> Cause:
        """Return the command of a tick: from the supervisor, from an earlier request, or from an operator."""
        if found & (_STOPPED | _TRIPPED):
            row = self.rows[self.number % RING_ROWS]
            bits = {side: int(row[f"{side}_safeguards"]) for side in SIDES}
            self._sound(self._alarm.look(found, bits, now_ns()))
        if self._stopping:
            return Cause.STOP
        missing = self.missing if self.desk.opened else (*self.missing, "the session's form")
        kept = self.watch.command(
            self.number, self.phase, missing, self._readiness.trouble(self.block, found, now_ns())
        )
        first = kept or self.ledger.take_wanted(self.phase) or self.desk.due(self.phase)
        if first or not self.control.wishes:
            return first  # an operator's command that arrives at the same time waits for the next tick
        return self._obey(self.control.wishes.pop(0))

    def _obey(self, wish: Wish) -> Cause:
        """Decide on an operator's command, reply, record it and carry it out.

        Return the cause for the trial state machine.
        """
        command, who = wish.command, wish.who
        if self.desk.commander and not self.control.is_there(self.desk.commander):
            self.desk.leave()
        situation = Situation(self.phase, self._lacks(), self._programme.last, self._programme.planned)
        decision = self.desk.decide(command.name, who, wish.name, situation)
        if decision.accepted:
            decision = self._do(command.name, command.argument, decision)
        self.control.reply(wish, decision.accepted, decision.reason)
        outcome = {"accepted": str(decision.accepted).lower(), "reason": decision.reason}
        told = {"name": command.name, "argument": command.argument, "by": wish.name, **outcome}
        self._note("command", {name: value for name, value in told.items() if value})
        if decision.accepted and decision.cause:
            self.watch.obeyed()
        elif not decision.accepted:
            self.watch.refused(decision.reason)
        return decision.cause

    def _do(self, name: str, argument: str, decision: Decision) -> Decision:
        """Carry out the part of a command that the trial state machine does not; refuse it if that fails."""
        try:
            match name:
                case "end":
                    self._asked_to_end = True
                case emergency.STOP:
                    self._sound(self._alarm.halt("emergency stop by an operator"))
                case emergency.RELEASE:
                    self.watch.await_operator()
                    self._sound(self._alarm.release())
                case "arm" | "disarm":
                    self._sound([])
                case "open":
                    self._programme.open(form_of(argument, self.block.config.session))
                    self._open()
                case "repeat" | "veto":
                    trial = self.ledger.ask(name, argument, int(self.state[0]["trial"]))
                    how = "is repeated" if name == "repeat" else "is not repeated"
                    return Decision(True, f"trial {trial} {how} at the end of the block", decision.cause)
                case "note":
                    self.ledger.note(*note_of(argument, self.number))
                case "next":
                    return self._give_up(decision)
        except NetboardError as error:
            return Decision(False, str(error))
        return decision

    def _give_up(self, decision: Decision) -> Decision:
        """Begin the next block with the next tick."""
        self._page_at = self.number + 1
        self.desk.end_after = False
        self.ledger.give_up()
        return decision if self.phase == Phase.FINISHED else Decision(True, cause=Cause.STOP)

    def _sound(self, events: list[emergency.Event]) -> None:
        """Record the events of an emergency stop; the next heartbeat tells the devices."""
        self.motion.may_arm = self.desk.armed and not self._alarm.halted
        for name, details in events:
            self._note(name, details)

    def _happened(self, number: int) -> None:
        """Record what the stage has decided."""
        row = self.rows[number % RING_ROWS]
        cause, state = Cause(int(row["event"])), self.state[0]
        self._started = self._started or cause == Cause.START
        details = change_of(cause, row, state) | self._details.of(int(row["trial"]))
        if cause == Cause.FAULT:
            if row["command"] != row["event"]:
                self.watch.faulted(STAGE_FAULT)
            details["notice"] = self.watch.notice
        self._note(cause.name.lower(), details)
        for name, judged in self.ledger.happened(cause, row, state, self.rows, number):
            self._note(name, judged)
        if cause == Cause.LAST:
            self._page_at = number + PAGE_TICKS
        if cause == Cause.START:
            self.questionnaires = ""
        elif int(state["phase"]) == Phase.FINISHED and (asked := self.block.config.block.questionnaires):
            self.questionnaires = asked
            self._note("questionnaire", {"text": asked})

    def _keep_house(self) -> None:
        """Do the periodic work that is not urgent: records to the loggers, clock probes, missing peers."""
        now = now_ns()
        self.motion.expire(now)
        felt = self._active and self.block.config.block.haptics
        self.block.delays.look(self.motion.loops_ns, felt=felt)
        self.ledger.look(self.rows, self.number)
        self.missing = self._lacks()
        self.control.pump(now)
        self._unheard = True  # look at the control channel even without a signal, which may have been missed
        if now >= self._clocks_ns:
            self._clocks_ns = now + CLOCKS_NS
            self._note_clocks()
        for record in self._backfiller.attend(self.motion, self.rows, self.number, now) if self.desk.opened else ():
            self._chronicle.record(record)
        self._keep_records(now)

    def _keep_records(self, now: int) -> None:
        """Record the news of all ports, and send records to the loggers."""
        for port in (self.motion, self.control, self.log, self.block.delays):
            for name, details in port.news:
                self._note(name, details)
                if name == "agent_joined":
                    self.block.delays.know("left" if details["side"] == "left" else "right", details)
            port.news.clear()
        for details in self._door.news(now) if self._door is not None else ():
            self._note("refused", details)
        self.log.pump(now)

    def _note_clocks(self) -> None:
        """Record the newest clock probe of every peer."""
        for port in (self.motion, self.control, self.log):
            self._chronicle.record_probes(port.clock_records(self._chronicle.probes))

    def _note(self, name: str, details: dict[str, str]) -> None:
        """Record an event with the current tick."""
        self._chronicle.note(self.number, name, details)

    # --- ending ------------------------------------------------------------------------------------------------

    def _end(self) -> None:
        """Stop the block, and let the loggers bring everything to disk."""
        if self.phase != Phase.FINISHED:
            self._stopping = True
            self.tick(self.pace.due_ns, max(0, now_ns() - self.pace.due_ns))
        self._settle()
        self._ports.goodbye("the session is over")
        self._note("session_ended", {"late_ticks": str(self.pace.late_ticks)})
        self._keep_records(now_ns())
        self.log.end()
        self._ended_ns = now_ns()
        self._ending_until_ns = self._ended_ns + FINISH_NS

    def _settle(self) -> None:
        """Record what is left of the peers: painted frames and the final counts of refusals."""
        self._chronicle.keep_frames(self.control.take_frames(), self.ledger)
        for refusals in self._ports.refusals:
            refusals.settle()
        for details in self._door.rest() if self._door is not None else ():
            self._note("refused", details)
        self._keep_records(now_ns())

    def _go_on_ending(self) -> None:
        """Feed the loggers until they have everything or the time is up."""
        now = now_ns()
        if not self._log_closing:
            self._keep_records(now)
            awaited = self._records_expected or self.log.loggers
            if self.log.done or not awaited or now > self._ending_until_ns:
                self._log_closing = True
                self.log.close()
        self.pace.wake_ns = now + TICK_NS

    def close(self) -> None:
        """Close what is still open, and log which records are not known to be on disk."""
        self._ports.close()
        if self.log.shortfall:
            log.error("%s", self.log.shortfall)
        self.ledger.close()
