"""A session of one dyad: the loop that takes messages, runs the ticks that are due, and sends the forces.

Each tick has a deadline, 1 ms after the previous one (`netboard.nodes.server.tick_clock`). It does not wait for a side
that was late at the last tick. Its simulated time is always that of the deadline. Forces are sent first; everything
else follows: log the tick, publish the views, answer operators.

While no agent is connected and no trial is running, ticks are processed in groups. A message on the motion channel
still wakes the session at once.

A session is not open until its form is complete: until then nothing is recorded and no block can begin.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from netboard.base.clock import now_ns
from netboard.base.config import SIDES
from netboard.base.tick import TICK, TICK_NS, TICK_WORDS
from netboard.network.protocol.codec import encode
from netboard.network.protocol.records import TickRecord
from netboard.network.transport import sockets
from netboard.network.transport.authenticator import Authenticator
from netboard.network.transport.waiting import NO_FILE
from netboard.nodes.ports import samples
from netboard.nodes.server.answers import SessionAnswers
from netboard.nodes.server.attempts import Attempts
from netboard.nodes.server.block_changes import BlockChanges
from netboard.nodes.server.blocks import BlockSequence
from netboard.nodes.server.decisions import Decisions
from netboard.nodes.server.operator_requests import OperatorRequests
from netboard.nodes.server.operators import CAUSES, PAUSE_AFTER
from netboard.nodes.server.record_keeping import RecordKeeping
from netboard.nodes.server.server_runs import (
    ALL_FINE,
    DONE,
    FAILED,
    IN_TRIAL,
    INTERRUPTED,
    MESSAGE,
    RUN,
    RUN_WORDS,
    STEPS,
    WAITING,
    WAITS,
)
from netboard.nodes.server.state import RING_ROWS, SessionState
from netboard.stage.perturbing import begins_perturbation
from netboard.task.trials.state_machine import Cause, Phase

FEED_TICKS = 18
"""Ticks after which latencies are checked and loggers fed; a multiple of those between two views at their usual rate
[1]."""

HOUSEKEEPING_TICKS = 2 * FEED_TICKS
"""Ticks between two rounds of the other periodic work [1]."""

DEADLINE_MARGIN_NS, MAX_POSTPONED = 400_000, 4
"""Work that can wait is not begun so shortly before a deadline [ns], at most this many times in a row [1].

The longest piece, a report of 256 frames, takes 0.34 ms (decision 24). A loop that is always late must do it, too.
"""

ANSWER_NS = 4_000_000
"""Interval between answers to operators, one answer at a time; an answer takes a fifth of a tick [ns]."""

_COMMAND, _EVENT, _TICK, _TIME = (TICK_WORDS[name] for name in ("command", "event", "tick", "time_ns"))
_NUMBER, _DUE, _UNTIL, _SLEEPS = (RUN_WORDS[name] for name in ("number", "due_ns", "until", "sleeps"))
_FORCES, _RELEVANT, _FINE = (RUN_WORDS[name] for name in ("forces", "relevant", "fine"))
_WAKE, _LATE, _LATE_TICKS, _FOUND = (RUN_WORDS[name] for name in ("wake_ns", "late_ns", "late_ticks", "found"))
_STOPPED, _TRIPPED = 3 * samples.STOPPED, 3 * samples.TRIPPED  # of either side
_RECORD_HEAD = encode(TickRecord(bytes(TICK.itemsize)))[: -TICK.itemsize]


class DyadSession:
    """Everything the server does for one dyad.

    ``attempts``: outcomes of the attempts in earlier runs of the session. ``authenticator`` is None without
    authentication. ``confirmation``: words of the command line that confirm stand-ins.
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
        state = self._state = SessionState(
            sequence, attempts, context, authenticator, autostart=autostart, confirmation=confirmation
        )
        self._blocks = BlockChanges(state)
        self._requests = OperatorRequests(state, self._blocks)
        self._answers = SessionAnswers(state)
        self.records = RecordKeeping(state)  # knows whether the session is ending, is over, and has everything on disk
        self._decisions = Decisions(state, self._blocks, self.records)
        self._motion, self._control, self._log = state.ports.motion, state.ports.control, state.ports.log
        self._clock = state.clock
        self._stopping = False
        self.sleeps = False  # whether no other session runs in the loop
        self._runs = np.zeros(1, RUN)
        self._run = self._runs.view(np.int64).data
        self._undisturbed_ticks: Callable[[], int] | None = None  # runs the next ticks; None: they need single steps
        self._run_until = 0  # number of the tick before which Python does more than to publish views
        self._control_unread, self._deferred_due_ns, self._answer_ns = False, 0, 0
        self._postponed = self._stagger = 0

    @property
    def wake_ns(self) -> int:
        """When the session wants to run next if no message arrives first [ns]."""
        return self._clock.wake_ns

    @property
    def files(self) -> tuple[int, int]:
        """The files that signal a message on the motion and on the control channel; `NO_FILE`: do not wait for it."""
        motion, control = (NO_FILE, NO_FILE) if self.records.ending else self._state.ports.files
        return motion, NO_FILE if self._control_unread else control

    def begin(self, due_ns: int, machine: dict[str, str], share: float = 0.0) -> None:
        """Make the first tick due at a time [ns].

        ``machine``: real-time settings that the process got from its machine, for the recording. ``share``: by how much
        of its interval the periodic work comes earlier than that of another session [1].
        """
        self._clock.begin(due_ns)
        self._stagger = int(share * HOUSEKEEPING_TICKS)
        self._state.note("session_started", {"session": self._state.session, **machine})
        self._blocks.begin_session()

    def stop(self) -> None:
        """Ask the session to end, at once."""
        if not self._state.end_requested:
            self._state.end_requested, self._clock.wake_ns = True, 0
            self._run_until = self._run[_UNTIL] = 0

    # --- the loop --------------------------------------------------------------------------------------------------

    def run_once(self, motion: bool, control: bool) -> bool:
        """Take the messages that have arrived, and run the ticks that are due.

        The motion channel is read last, until it is empty, because its socket only then signals again. If it holds more
        than one tick can take, the rest is read at the next tick, signalled or not.

        Returns whether the session has begun to end or is over.
        """
        clock, ticks = self._clock, self._undisturbed_ticks
        if self.records.ending:
            now = now_ns()
            self.records.continue_ending(now)
            clock.wake_ns = now + TICK_NS
            return self.records.over
        self._control_unread |= control
        ended = INTERRUPTED if ticks is None else self._continue_run(ticks, control)
        if ended == WAITS:
            clock.wake_ns = self._run[_WAKE]
            return False
        if ended == DONE:  # the compiled call has read the motion channel until it was empty
            self._motion.probe_clocks()
            complete = self._run[_WAKE] < self._run[_DUE]  # the call waits for the deadline only if a sample is awaited
        else:
            if ended == STEPS:
                self._tick(self._run[_LATE], self._run[_FOUND])
            else:
                self._tick_if_due(motion)
            complete = self._motion.drain(now_ns, clock.due_ns)
        self._do_deferred_work(now_ns())
        if self._state.end_requested and self._end():
            return True
        self._undisturbed_ticks = self._plan_run() if self._can_run_in_one_call else None
        self._sleep(complete)
        return False

    def _tick_if_due(self, motion: bool) -> None:
        """Take the samples that have arrived, and run the tick if it is due, or all ticks that are due while idle."""
        clock, idle = self._clock, self._state.idle
        complete = self._motion.drain(now_ns, clock.due_ns, signalled=motion)
        now = now_ns()
        if moved_ns := clock.skip_backlog(now, idle):
            self._state.note("stood_still", {"milliseconds": f"{moved_ns / TICK_NS:.0f}"})
        if idle:
            self._idle_ticks(now)
        elif clock.is_due(now, complete):
            self._tick(now - clock.due_ns)

    def _sleep(self, complete: bool) -> None:
        """Set when the session runs next; a run that sleeps itself begins at once."""
        clock, idle = self._clock, self._state.idle
        clock.sleep(idle, complete, alone=idle and self._state.alone)
        if self._control_unread or self._motion.unhandled:
            clock.wake_ns = min(clock.wake_ns, self._deferred_due_ns)
        if self._undisturbed_ticks is not None and self.sleeps:
            clock.wake_ns = 0

    def _do_deferred_work(self, now: int) -> None:
        """Do a bounded part of the work that can wait, once a millisecond, and after a tick rather than before one.

        A peer that sends too much thus only delays itself.
        """
        if now < self._deferred_due_ns:
            return
        if (
            0 <= self._clock.due_ns - now < DEADLINE_MARGIN_NS
            and not self._state.idle
            and self._postponed < MAX_POSTPONED
        ):
            self._postponed += 1
            self._deferred_due_ns = self._clock.due_ns
            return
        self._postponed = 0
        self._deferred_due_ns = now + TICK_NS
        self._motion.attend(now, self._clock.due_ns)
        # Its signal comes only once, so it is read until drain() says that nothing is left.
        self._control_unread = self._control_unread and self._control.drain(now_ns)
        if now >= self._answer_ns:
            self._answer_ns = now + ANSWER_NS
            self._control.answer(self._answers)
        self.records.record_frames()
        if self._state.authenticator is not None:
            self._state.authenticator.answer_handshakes()

    def _end(self) -> bool:
        """Stop the block, and begin to end once the agents have sent what they rendered during an interruption."""
        if not self._stopping:
            self._stop_block()
            self._blocks.close_form()
        if self.records.backfilling(now_ns()) or self._state.triggers.awaited(now_ns()):
            return False
        self.records.end()
        return True

    def _stop_block(self) -> None:
        """Stop the block, and tell the agents that no force is commanded."""
        self._stopping = True
        while self._state.phase != Phase.FINISHED:  # two ticks just after a trial, when no command has an effect
            self._tick(max(0, now_ns() - self._clock.due_ns))
        self._motion.may_arm = False
        self._motion.send_heartbeat(self._state.number, at_once=True)  # else the last force would have to age

    # --- ticks -----------------------------------------------------------------------------------------------------

    def _plan_run(self) -> Callable[[], int]:
        """Set how many undisturbed ticks may run before other work is due, and return the call that runs them."""
        state, run, motion, block = self._state, self._run, self._motion, self._state.block
        number, now = state.number, now_ns()
        # In a trial the run includes the tick that periodic work follows; between trials it ends before that tick, at
        # which the supervisor is asked whether to begin.
        until = number + -(number + self._stagger) % FEED_TICKS + state.active
        run[_FORCES] = state.felt
        run[_RELEVANT], run[_FINE] = IN_TRIAL if state.active else WAITING
        if self._control_unread or motion.unhandled or self._log.must_read(now):
            until = number + 1
        run[_NUMBER], run[_DUE], run[_SLEEPS] = number, self._clock.due_ns, self.sleeps
        motion.fast.watch(self.files[1])
        scene = (state.stage, state.rows, state.words, block.stage.book, block.stage.tables)
        assert block.run is not None
        self._end_run_before(until)
        return motion.undisturbed_ticks(block.run, scene, self._runs, block.stage.delay)

    def _end_run_before(self, until: int) -> None:
        """Let the run end before a tick; the compiled call ends when views are due."""
        self._run_until = until
        self._run[_UNTIL] = min(until, self._state.ports.views.due(self._run[_NUMBER]))

    def _continue_run(self, undisturbed_ticks: Callable[[], int], control: bool) -> int:
        """Run the next ticks, publish the views on the way, and do what follows them; return why they have ended."""
        state, run, clock = self._state, self._run, self._clock
        if control:
            self._end_run_before(min(self._run_until, run[_NUMBER] + 1))
        while (ended := undisturbed_ticks()) == DONE and run[_NUMBER] < self._run_until:
            if state.words[(run[_NUMBER] - 1) % RING_ROWS, _EVENT]:
                break
            self._show_views(run[_NUMBER])
            self._end_run_before(self._run_until)
        if ended == WAITS:
            return ended
        self._control_unread |= ended == INTERRUPTED
        clock.late_ticks += run[_LATE_TICKS]
        run[_LATE_TICKS] = 0
        if count := run[_NUMBER] - state.number:
            self._follow_up(count)
        if ended == FAILED:
            self._motion.fast.raise_failure("motion")
        if ended == MESSAGE:
            self._motion.read_other_frame(now_ns(), clock.due_ns)
        return ended

    def _follow_up(self, count: int) -> None:
        """Finish some ticks, and do the periodic work if it is due."""
        self._finish_ticks(count)
        staggered = self._state.number - 1 + self._stagger
        if staggered % HOUSEKEEPING_TICKS == 0:
            self._housekeeping()
        elif staggered % FEED_TICKS == 0:
            self._poll_latency()
            self._log.pump(now_ns())
        else:
            self._log.read_if_needed(now_ns())

    @property
    def _no_command_due(self) -> bool:
        """Whether, while all samples are fine, no command can be due at the next tick of a trial."""
        state = self._state
        if state.in_trouble:
            return False
        return not (state.operators.pause_after or state.attempts.wanted or self._control.requests or self._stopping)

    @property
    def _can_run_in_one_call(self) -> bool:
        """Whether the next tick can be run in one call if its samples are in order.

        Between trials the supervisor is asked at the ticks that periodic work follows.
        """
        state = self._state
        if state.block.run is None or state.idle or self._blocks.coming:
            return False
        periodic = (state.number + self._stagger) % FEED_TICKS == 0
        return (state.active or not periodic) and self._no_command_due

    def _tick(self, late_ns: int, found: int | None = None) -> None:
        """Run the tick that is due step by step, this long after its deadline [ns].

        ``found``: what `samples.fill` returned for it; None if its row has not been filled yet.
        """
        state, due_ns = self._state, self._clock.due_ns
        number = state.number
        if not self._stopping:
            self._blocks.change_if_due(number)
        block = state.block
        words = state.words[number % RING_ROWS]
        if found is None:
            found = self._motion.fill(words, number, due_ns, late_ns)
        if block.still or block.unrelated is not None:
            found |= block.stand_in(state.rows[number % RING_ROWS], words, number, due_ns, state.stage[0])
        active, felt = state.active, state.felt
        if not active or found != ALL_FINE or not self._no_command_due:  # asking for a command would delay the forces
            words[_COMMAND] = self._command(found)
        block.stage.advance(state.stage, state.rows, number)
        halted = bool(state.emergency_stop.halted)
        if felt and not halted:
            self._motion.force(words, block.stage.commanded_row(state.words, number))
            if block.still:
                self._motion.send_heartbeat(number, sides=block.still)
        else:
            self._motion.send_heartbeat(number, at_once=active and halted)
        self._clock.began(late_ns)
        self._follow_up(1)

    def _idle_ticks(self, now: int) -> None:
        """Run all due ticks together; a command takes effect at the last one."""
        due_ns, first = self._clock.due_ns, self._state.number
        count = min(self._clock.due_count(now), RING_ROWS)
        if count < 1:
            return
        self._blocks.change_if_due(first + count - 1)
        self._fill_idle(first, count, due_ns)
        last, state = first + count - 1, self._state
        self._advance_idle(first, count - 1)
        state.words[last % RING_ROWS, _COMMAND] = self._command(0)
        state.block.stage.advance(state.stage, state.rows, last, 1)
        self._finish_ticks(1)
        self._housekeeping()

    def _fill_idle(self, first: int, count: int, due_ns: int) -> None:
        """Begin the rows of some ticks; without agents they differ in number and time only."""
        words, numbers = self._state.words, np.arange(first, first + count)
        places = numbers % RING_ROWS
        if not self._motion.empty:  # an agent has just joined
            for number, place in zip(numbers.tolist(), places.tolist(), strict=True):
                self._motion.fill(words[place], number, due_ns + (number - first) * TICK_NS, 0)
            return
        self._motion.fill(words[first % RING_ROWS], first, due_ns, 0)
        words[places] = words[first % RING_ROWS]
        words[places, _TICK] = numbers
        words[places, _TIME] = due_ns + (numbers - first) * TICK_NS

    def _advance_idle(self, first: int, count: int) -> None:
        """Compute and log some ticks; only an event requires more work."""
        state = self._state
        state.block.stage.advance(state.stage, state.rows, first, count)
        words = state.words[np.arange(first, first + count) % RING_ROWS]
        if words[:, _EVENT].any():
            self._finish_ticks(count)
            return
        self._log_ticks(words)
        state.number += count
        self._clock.advance(count)

    def _finish_ticks(self, count: int) -> None:
        """Log the finished ticks, handle their events, and publish the views."""
        state, first = self._state, self._state.number
        words = state.words[np.arange(first, first + count) % RING_ROWS]
        logged = 0
        # A decision is recorded right after its tick: the log has one order however many ticks are finished at once.
        noted, config = words[:, _EVENT] != 0, state.block.config
        if config.perturbation.trials:
            noted |= begins_perturbation(words.view(TICK)[:, 0], config)
        for k in np.flatnonzero(noted).tolist():
            self._log_ticks(words[logged : k + 1])
            self._decisions.record(first + k)
            logged = k + 1
        self._log_ticks(words[logged:])
        state.number += count
        self._clock.advance(count)
        self._show_views(state.number)

    def _log_ticks(self, words: NDArray[np.int64]) -> None:
        """Log ticks, unless the session is not open yet."""
        if self._state.operators.opened and len(words):
            rows, size = words.data.cast("B"), TICK.itemsize
            for at in range(0, len(rows), size):
                self._log.append(_RECORD_HEAD + rows[at : at + size])

    def _show_views(self, number: int) -> None:
        """Publish the views of the tick before this one, if they are due."""
        state = self._state
        rest = state.rest(now_ns()) if state.rest_until_ns else None
        newest = state.words[(number - 1) % RING_ROWS]
        state.ports.views.show(number, state.block.curtain, newest, state.attempts.best, rest, state.view_notice)

    def _command(self, found: int) -> Cause:
        """Return the command of a tick: from the supervisor, from an earlier request, or from an operator."""
        state = self._state
        if found & (_STOPPED | _TRIPPED):
            row = state.rows[state.number % RING_ROWS]
            bits = {side: int(row[f"{side}_safeguards"]) for side in SIDES}
            state.update_arming(state.emergency_stop.poll(found, bits, now_ns()))
        if self._stopping:
            return Cause.STOP
        phase = state.phase
        missing = state.missing if state.operators.opened else (*state.missing, "the session's form")
        trouble = state.trouble(found)
        first = state.supervisor.command(state.number, phase, missing, trouble)
        first = first or state.attempts.take_wanted(phase) or state.operators.due(phase)
        if first == Cause.PAUSE:
            state.supervisor.paused_by_operator(state.operators.pause_by)
        if first or not self._control.requests:
            return first  # an operator's command that arrives at the same time waits for the next tick
        about_trial = self._control.requests[0].command.name in (*CAUSES, PAUSE_AFTER)
        if about_trial and phase in (Phase.SUCCEEDED, Phase.FAILED):
            return Cause.NONE  # this tick would refuse it
        return self._requests.handle_command(self._control.requests.pop(0))

    def _poll_latency(self) -> None:
        block = self._state.block
        loops_ns = zip(SIDES, self._motion.loops_ns, strict=True)
        used = [loop_ns if side in block.moved else 0 for side, loop_ns in loops_ns]
        block.latency.poll(used, haptics=self._state.felt)

    def _housekeeping(self) -> None:
        """Do the periodic work that is not urgent: missing peers, latencies, quality rules, news, records."""
        now, state = now_ns(), self._state
        self._motion.expire(now)
        self._poll_latency()
        state.attempts.poll(state.rows, state.number)
        state.missing = state.find_missing()
        self._control.pump(now)
        self._requests.forget_silent_commander()
        self._control_unread = True  # look at the control channel even without a signal, which may have been missed
        self.records.take_answers()
        self.records.keep(now)
