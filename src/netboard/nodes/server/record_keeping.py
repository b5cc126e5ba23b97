"""What a session records beside its ticks, and how it ends: its loggers must first have everything on disk."""

import logging

from netboard.base.clock import now_ns
from netboard.base.errors import WireError
from netboard.base.tables.questionnaires import ANSWERS
from netboard.network.protocol.records import STAND_IN_CONFIRMED
from netboard.nodes.ports.backfill import Backfiller
from netboard.nodes.server.state import SessionState
from netboard.task.trials.state_machine import Phase

log = logging.getLogger(__name__)

CLOCKS_NS = 1_000_000_000
"""Interval at which clock probes are recorded [ns]."""

FRAMES_AT_ONCE = 12
"""Painted frames recorded at once: more, in the 50 turns a second of a long run, than two displays paint [1]."""

DEVICE = ("device", "model", "serial")
"""Details of an agent that identify its device."""

BACKFILL_NS = 30_000_000_000
"""Longest wait at the end for what agents rendered during an interruption; two minutes of it take 4 s [ns]."""

BACKFILL_SILENCE_NS = 5_000_000_000
"""Longest wait at the end for the next part of it [ns]."""

CLOSING_NS = 200_000_000
"""Time before the control channel closes, for its peers to read the last messages [ns].

With `zmq.IMMEDIATE`, libzmq drops what a peer has not read when its connection ends.
"""

ANSWERS_NS = 300_000_000
"""Longest wait at the end for what participants had filled in: their displays send it at the goodbye [ns]."""

FINISH_NS = 10_000_000_000
"""Longest wait for the loggers to bring the last records to disk [ns]."""


class RecordKeeping:
    """Passes to the loggers what the ports report."""

    def __init__(self, state: SessionState) -> None:
        self._state = state
        self._log = state.ports.log
        self._backfiller = Backfiller()
        self._started = False  # whether a trial has started: before, nothing is lost if there is no logger
        self._devices: dict[str, str] = {}  # by side
        self._clocks_ns = 0
        self._backfill_began_ns = self._backfill_heard_ns = 0  # 0: not yet
        self._goodbye_ns = self._ended_ns = 0
        self._log_closing = False

    @property
    def ending(self) -> bool:
        """Whether the blocks are over and the loggers are taking the remaining records."""
        return self._goodbye_ns > 0

    @property
    def over(self) -> bool:
        """Whether the session is complete, and the loggers have all records or have run out of time."""
        return self._log_closing and self._log.store.closed and now_ns() - self._ended_ns > CLOSING_NS

    @property
    def everything_recorded(self) -> bool:
        """Whether every record that matters is known to be on disk."""
        return self._log.done or not self._records_expected

    @property
    def _records_expected(self) -> bool:
        return self._state.block.config.network.require_logger and self._started

    def start(self) -> None:
        """Note that a trial has started; if it must be recorded, its records are kept even if the logger has gone."""
        self._started = True
        self._log.store.needed |= self._records_expected

    def record_frames(self, most: int | None = FRAMES_AT_ONCE) -> None:
        """Record the painted frames that displays have reported, at most this many [1]."""
        state = self._state
        state.event_log.record_frames(state.ports.control.take_frames(most), state.attempts)

    def keep(self, now: int) -> None:
        """Record clock probes, samples that arrived late, and the news of all ports [ns]."""
        state = self._state
        if now >= self._clocks_ns:
            self._clocks_ns = now + CLOCKS_NS
            for port in (state.ports.motion, state.ports.control, self._log):
                state.event_log.record_probes(port.clock_records(state.event_log.probes))
        self._backfill(now)
        self._record_news(now)
        state.attempts.await_form(state.forms.awaited)
        if state.operators.opened and state.block.config.session.real:
            for details in state.confirmations.take_news(state.find_stand_ins()):
                state.note(STAND_IN_CONFIRMED, details)

    def _backfill(self, now: int) -> int:
        """Ask the agents what they rendered during an interruption; return how many answers were recorded [ns]."""
        state = self._state
        if not state.operators.opened:
            return 0
        self._backfiller.expect(state.block.moved, state.number)
        records = self._backfiller.attend(state.ports.motion, state.rows, state.number, now)
        for record in records:
            state.event_log.record(record)
        return len(records)

    def _record_news(self, now: int) -> None:
        """Record the news of all ports, and send records to the loggers."""
        state = self._state
        latency = state.block.latency
        for port in (state.ports.motion, state.ports.control, self._log, latency):
            for name, details in port.news:
                state.note(name, details)
                if name == "agent_joined":
                    latency.take_limit("left" if details["side"] == "left" else "right", details)
                    self._know_device(details)
                if name == "logger_joined" and state.event_log.opened:
                    state.note_peers()  # its file may be the second part of a block
            port.news.clear()
        for name, details in state.triggers.take_news(now):
            state.note(name, details)
        for details in state.authenticator.reports(now) if state.authenticator is not None else ():
            state.note("refused", details)
        self._log.pump(now)

    def take_answers(self) -> None:
        """Record the answers of participants."""
        state, waiting = self._state, self._state.ports.control.answers
        while waiting:
            answers = waiting.popleft()
            try:
                state.note(ANSWERS, state.forms.take(answers))
            except WireError as error:
                state.note("answers_refused", {"station": answers.station, "reason": str(error)})

    def _know_device(self, details: dict[str, str]) -> None:
        """Compare the device of an agent that has joined with the side's last one; in a trial it must be the same.

        Many devices have no serial number, so one at another machine is another one.
        """
        # A name is host:process; a restarted agent is another process with the same device.
        side, machine = details["side"], details["name"].rpartition(":")[0]
        device = " ".join(filter(None, (*map(details.get, DEVICE), machine and f"at {machine}")))
        before, self._devices[side] = self._devices.get(side, device), device
        in_use = side in self._state.block.moved and self._state.phase not in (Phase.IDLE, Phase.FINISHED)
        if device != before and in_use:
            self._state.supervisor.device_replaced(side)
            self._state.note("device_replaced", {"side": side, "before": before, "now": device})

    def backfilling(self, now: int) -> bool:
        """Ask on, before the session ends; return whether agents still have something to send [ns]."""
        self._backfill_began_ns = self._backfill_began_ns or now
        if self._backfill(now) or not self._backfill_heard_ns:
            self._backfill_heard_ns = now
        state = self._state
        in_time = now - self._backfill_began_ns < BACKFILL_NS and now - self._backfill_heard_ns < BACKFILL_SILENCE_NS
        return in_time and self._backfiller.pending(state.ports.motion, state.rows, state.number)

    def end(self) -> None:
        """Record what is left of the peers, and say goodbye; displays with an open form then send what it holds."""
        state = self._state
        self.record_frames(None)
        for refusals in state.ports.refusals:
            refusals.settle()
        for details in state.authenticator.final_reports() if state.authenticator is not None else ():
            state.note("refused", details)
        self._record_news(now_ns())
        state.ports.goodbye("the session is over")
        self._goodbye_ns = now_ns()
        if not state.forms.unsent:
            self._end_log()

    def continue_ending(self, now: int) -> None:
        """Take the last answers, then feed the loggers until they have everything or the time is up [ns]."""
        if not self._ended_ns:
            self._state.ports.control.drain(now_ns)
            self.take_answers()
            if not self._state.forms.unsent or now - self._goodbye_ns > ANSWERS_NS:
                self._end_log()
            return
        if self._log_closing:
            return
        self._record_news(now)
        awaited = self._records_expected or self._log.loggers
        if self._log.done or not awaited or now - self._ended_ns > FINISH_NS:
            self._log_closing = True
            self._log.close()

    def _end_log(self) -> None:
        """Record that the session has ended; nothing is recorded after that."""
        self._state.attempts.await_form(self._state.forms.awaited)
        self._state.note("session_ended", {"late_ticks": str(self._state.clock.late_ticks)})
        self._record_news(now_ns())
        self._log.end()
        self._ended_ns = now_ns()

    def close(self) -> None:
        """Close what is still open, and log which records are not known to be on disk."""
        self._state.ports.close()
        if self._log.store.shortfall:
            log.error("%s", self._log.store.shortfall)
        self._state.attempts.close()
