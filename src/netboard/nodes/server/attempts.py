"""The attempts of a session: their outcomes, their flags, and which trials are repeated.

The session passes every tick and every decision of the trial state machine to `Attempts`. Operators read the
outcomes. A session that follows a plan also writes them to a journal, from which it resumes after an interruption.
Nothing here waits for a disk.
"""

import re
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import NetboardError
from netboard.base.safeguards import Safeguard
from netboard.network.protocol.control import Outcomes
from netboard.network.protocol.records import FrameRecord
from netboard.nodes.ports.emergency import RELEASE, STOP, Event
from netboard.recording.recovery.journal_file import Journal
from netboard.task.journal.entries import (
    AttemptBegan,
    AttemptEnded,
    BlockBegan,
    BlockEnded,
    EmergencyReleased,
    EmergencyStopped,
    Ended,
    Entry,
    FormAwaited,
    Note,
    Opened,
    Repeat,
    Resumed,
    Veto,
)
from netboard.task.journal.lost import Losses, losses
from netboard.task.journal.outcome import AttemptOutcome
from netboard.task.journal.progress import SessionProgress
from netboard.task.trials.exclusion import ExclusionRule, rule_of
from netboard.task.trials.quality import Referee, Verdict
from netboard.task.trials.repeats import Repeats, wants_repeat
from netboard.task.trials.state_machine import BALL_FREE, EMERGENCY_STOP, OUTCOMES, TABLE, Cause, Outcome, Phase, ticks

MAX_ROWS = 200
"""Largest number of attempts in one answer to an operator [1]."""

MAX_EARLY = 100
"""Newest notes and emergency stops kept until the session is open, and has a journal [1]."""

_OfRun = Note | EmergencyStopped | EmergencyReleased

_NUMBER = re.compile("[0-9]{1,9}")
"""Number of a trial as an operator writes it; int() would refuse other digits, and very long numbers."""


class Attempts:
    """Follows the attempts of a session.

    ``begin_journal``: makes the journal from the configuration once the form is complete; None for a session without a
    journal. ``warning``: what the operator should check before the first trial.
    """

    def __init__(
        self,
        begin_journal: Callable[[Config], Journal] | None = None,
        journal: Journal | None = None,
        progress: SessionProgress | None = None,
        warning: str = "",
    ) -> None:
        self.finished: list[AttemptOutcome] = list(progress.outcomes) if progress else []
        self.completions: list[float] = []  # completion times of the block so far [s]
        self.wanted = 0  # repeats that have not been passed on to the trial state machine yet
        self._begin_journal, self._journal, self._progress = begin_journal, journal, progress
        self._warning = warning
        self._form = progress.form if progress else FormAwaited(0, ())
        self._early = deque[_OfRun](maxlen=MAX_EARLY)
        self._run = ""
        self._block = 0
        self._repeats = Repeats(1)
        self._rule = ExclusionRule((), simulated=False)
        self._lost = Losses({}, 0)
        self._config: Config | None = None
        self._referee: Referee | None = None
        self._limit_ticks = 0  # of the block; 0: none
        self._seen = 0  # next tick for the quality rules
        self._verdict: Verdict | None = None  # of the attempt that ends at the present tick
        self._end: Literal["finished", "stopped", "given_up"] | None = None  # of the block, once it is known
        self._timed_out = False  # whether the block ended because its time was over

    @property
    def opened(self) -> bool:
        """Whether an earlier run of the server opened the session."""
        return self._progress is not None

    @property
    def warning(self) -> str:
        """What the operator should check before the first trial; empty once an attempt has ended."""
        return "" if self.finished else self._warning

    @property
    def best(self) -> float | None:
        """Best completion time of the block so far; None before the first [s]."""
        return min(self.completions, default=None)

    @property
    def lost(self) -> Losses:
        """Trials of the block that the analysis will exclude and that nothing repeats, among all that are done."""
        return self._lost

    @property
    def loses_too_many(self) -> bool:
        """Whether the share of lost trials is so large that the operator is asked to repeat them."""
        limit = 1.0 if self._config is None else self._config.quality.excluded_share
        return len(self._lost.trials) > limit * max(self._lost.done, 1)

    def pending_repeats(self, present: int) -> tuple[int, ...]:
        """Return the trials whose repeats have not begun, while this trial is the present one [1]."""
        return self._repeats.to_come(present)

    @property
    def trouble(self) -> str:
        """Why the journal cannot be written; empty if it can."""
        said = "" if self._journal is None else self._journal.trouble
        return f"the journal cannot be written: {said}" if said else ""

    def open(self, config: Config, run: str) -> None:
        """Open the session: journal everything from now on."""
        if self._journal is None and self._begin_journal is not None:
            self._journal = self._begin_journal(config)
        self._run = run
        if self._progress is not None:
            self._write(Resumed(run))
        else:
            self._write(Opened(run, {name: str(value) for name, value in asdict(config.session).items()}))
        while self._early:
            self._write(replace(self._early.popleft(), run=run))

    def start_of(self, block: int) -> dict[str, int]:
        """Return the state in which a block starts: empty, or as an earlier run of the server left it."""
        so_far = self._progress
        if so_far is None or so_far.block != block:
            return {}
        names = ("trial", "attempt", "successes", "failures", "extra", "block_ticks")
        return {name: getattr(so_far, name) for name in names}

    def begin(self, config: Config, tick: int) -> None:
        """Begin a block at a tick."""
        so_far = self._progress if self._progress and self._progress.block == config.block.number else None
        self._block, self._config = config.block.number, config
        self._repeats = so_far.repeats if so_far else Repeats(config.block.trials)
        self.completions = list(so_far.completions) if so_far else []
        self._referee = Referee(config, int(Safeguard.CLAMPED))
        self._referee.warm()
        self._rule = rule_of(config)
        self._find_lost()
        self._seen, self._verdict, self._end, self.wanted = tick, None, None, 0
        self._limit_ticks = ticks(config.block.duration)
        start = (so_far.trial, so_far.attempt) if so_far else (1, 1)
        self._write(BlockBegan(self._block, *start, self._run, tick))

    def close(self, reason: str = "the session was ended") -> None:
        """Close the journal when the server ends."""
        self._write(Ended(reason))
        if self._journal is not None:
            self._journal.close()

    # --- ticks and decisions ---------------------------------------------------------------------------------------

    def poll(self, rows: NDArray[np.void], following: int) -> None:
        """Apply the quality rules to all ticks before `following`."""
        if self._referee is not None and following > self._seen:
            verdicts = self._referee.watch(rows, self._seen, following - self._seen)
            self._verdict = verdicts[-1] if verdicts else None
            self._seen = following

    def painted(self, frame: FrameRecord) -> None:
        """Pass a painted frame to the quality rules."""
        if self._referee is not None:
            self._referee.paint(frame.station, frame.tick, frame.painted_ns)

    def record_decision(
        self, rows: NDArray[np.void], number: int, state: np.void, *, halted: bool = False
    ) -> list[Event]:
        """Take the decision of the trial state machine at a tick, and return the events to record.

        ``halted``: whether there is an emergency stop.
        """
        self._verdict = None
        self.poll(rows, number + 1)
        row = rows[number % len(rows)]
        cause = Cause(int(row["event"]))
        over = cause == Cause.LAST
        if over and int(row["command"]) == Cause.SKIP:  # the operator skipped the last trial
            cause = Cause.SKIP
        ended = cause in OUTCOMES and (int(row["phase"]) in (Phase.LEVELLING, *BALL_FREE) or cause == Cause.SKIP)
        outcome = EMERGENCY_STOP if halted and cause == Cause.FAULT else OUTCOMES.get(cause)
        events = [self._end_attempt(outcome, row, state, number)] if ended and outcome else []
        then = int(state["phase"])
        if then == Phase.LEVELLING and (ended or cause in (Cause.START, Cause.NEXT, Cause.RESUME)):
            self._write(AttemptBegan(self._block, int(state["trial"]), int(state["attempt"]), self._run, number))
        if then == Phase.FINISHED:
            self._end = "finished" if over else self._end or "stopped"
            self._timed_out = self._limit_ticks > 0 and int(state["block_ticks"]) >= self._limit_ticks
            self._write(BlockEnded(self._block, self._end))
        elif int(row["phase"]) == Phase.FINISHED:
            self._end = None
        return events

    def _end_attempt(self, outcome: Outcome, row: np.void, state: np.void, number: int) -> Event:
        """Record the outcome of an attempt, and return its event."""
        trial, attempt = int(row["trial"]), int(row["attempt"])
        flags = self._verdict.flags if self._verdict is not None else ()
        completion = float(state["completion"]) if outcome == "success" else None
        if completion is not None:
            self.completions.append(completion)
        assert self._config is not None
        again = wants_repeat(self._config.quality, outcome, flags, trial, self._repeats)
        repeats, flag_text = self._repeats.repeated_by(trial), ",".join(flags)
        self._write(
            AttemptEnded(
                block=self._block,
                trial=trial,
                attempt=attempt,
                outcome=outcome,
                completion=completion,
                flags=flags,
                repeats=repeats,
                again=again,
                run=self._run,
                tick=number,
                block_ticks=int(state["block_ticks"]),
            )
        )
        row_time = float("nan") if completion is None else completion
        self.finished.append(AttemptOutcome(self._block, trial, attempt, outcome, row_time, flag_text, repeats))
        if again:
            self._repeats = self._repeats.ask(trial)
            self.wanted += 1
        self._find_lost()
        details = {"trial": str(trial), "attempt": str(attempt), "outcome": outcome, "flags": flag_text}
        return "attempt_ended", details | ({"repeats": str(repeats)} if repeats else {})

    # --- questions and commands of operators -----------------------------------------------------------------------

    def outcomes(self, first: int) -> Outcomes:
        """Return outcomes starting with attempt number `first`, at most `MAX_ROWS` of them."""
        return Outcomes(max(first, 0), tuple(self.finished[max(first, 0) :][:MAX_ROWS]))

    def _find_lost(self) -> None:
        """Find the lost trials again, after an attempt has ended or repeats have changed."""
        found = losses((one for one in self.finished if one.block == self._block), self._rule)
        self._lost = found.without((*self._repeats.asked, *self._repeats.vetoed))

    def counts(self, side: Side) -> tuple[int, int]:
        """Count the current attempt's ticks without a fresh sample of a side, and those with its force clamped."""
        if self._referee is None:
            return 0, 0
        counts, place = self._referee.counts, SIDES.index(side)
        return int(counts["lost"][place]), int(counts["clipped"][place])

    def ask(self, command: str, argument: str, present: int, phase: Phase) -> int:
        """Order the repeat of a trial, or cancel it ("veto"); return the trial's number."""
        if argument and not _NUMBER.fullmatch(argument):
            raise NetboardError(f'{command}: found "{argument}", expected the number of a trial')
        if command == "repeat":
            trial = int(argument or present - (phase != Phase.FINISHED))
            there = phase in (*BALL_FREE, Phase.FINISHED)
            why_not = self._why_not_reopen(phase) or self._repeats.why_not_ask(trial, present, under_way=there)
        else:
            trial = int(argument or self._repeats.newest(present))
            why_not = self._repeats.why_not_veto(trial, present) if trial else "no repeat is pending in this block"
        if why_not:
            raise NetboardError(why_not)
        if command == "repeat":
            self._repeats = self._repeats.ask(trial)
            self._write(Repeat(self._block, trial))
        else:
            self._repeats = self._repeats.veto(trial)
            self._write(Veto(self._block, trial))
        self._find_lost()
        return trial

    def repeat_lost(self, phase: Phase) -> tuple[int, ...]:
        """Order the repeats of all lost trials, one in each of the next ticks; return the trials' numbers."""
        trials = self._lost.trials
        if why_not := self._why_not_reopen(phase) or ("" if trials else "there is no lost trial to repeat"):
            raise NetboardError(why_not)
        for trial in trials:
            self._repeats = self._repeats.ask(trial)
            self._write(Repeat(self._block, trial))
        self.wanted += len(trials)
        self._find_lost()
        return trials

    def _why_not_reopen(self, phase: Phase) -> str:
        """Return why a block that is over cannot go on with a repeat; empty if it can, or is not over."""
        if phase != Phase.FINISHED or (self._end == "finished" and not self._timed_out):
            return ""
        if self._timed_out:
            return "no trial can be repeated: the time of the block is over"
        return "no trial can be repeated: the block was stopped"

    def give_up(self) -> None:
        """Note that the rest of the block is skipped."""
        if self._end == "stopped":
            self._write(BlockEnded(self._block, "given_up"))
        self._end = "given_up"

    def take_wanted(self, phase: Phase) -> Cause:
        """Return `Cause.REPEAT` if a quality rule wants a repeat and the phase allows it, else `Cause.NONE`."""
        if self.wanted and Cause.REPEAT in TABLE[phase]:
            self.wanted -= 1
            return Cause.REPEAT
        return Cause.NONE

    def await_form(self, form: FormAwaited) -> None:
        """Write whose answers are awaited to the journal, if that has changed."""
        if form != self._form:
            self._form = form
            self._write(form)

    def lost_answers(self) -> Iterator[dict[str, str]]:
        """Answers that were awaited when an earlier run of the server ended, as event details."""
        if self._progress is not None:
            form = self._progress.form
            for station in form.stations:
                yield {"station": station, "block": str(form.block), "reason": "the server had ended"}

    def note(self, text: str, tick: int) -> None:
        """Write an operator's note to the journal, or keep it until there is one."""
        self._write_or_keep(Note(text, self._run, tick))

    def emergency(self, name: str, details: dict[str, str], tick: int) -> None:
        """Write an emergency stop, or its release, to the journal, or keep it until there is one."""
        if name == STOP:
            self._write_or_keep(EmergencyStopped(details["reason"], self._run, tick))
        elif name == RELEASE:
            self._write_or_keep(EmergencyReleased(self._run, tick))

    def _write_or_keep(self, entry: _OfRun) -> None:
        if self._journal is None and self._begin_journal is not None:
            self._early.append(entry)
        self._write(entry)

    def _write(self, entry: Entry) -> None:
        if self._journal is not None:
            self._journal.append(entry)
