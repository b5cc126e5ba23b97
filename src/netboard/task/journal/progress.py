"""Derive the progress of a session from its journal alone.

- A resumed session continues with the trial after the last one that succeeded or was skipped.
- An attempt that began and did not end is kept, with the outcome ``incomplete``.
- Attempt numbers are unique: the next attempt at a trial gets the next number.
- Any prefix of a journal gives the progress at that time.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias

from netboard.base.errors import RecordingError
from netboard.base.plural import plural
from netboard.task.journal.entries import (
    AttemptBegan,
    AttemptEnded,
    BlockBegan,
    BlockEnded,
    Ended,
    Entry,
    FormAwaited,
    Header,
    Opened,
    Repeat,
    Resumed,
    Veto,
)
from netboard.task.journal.outcome import AttemptOutcome
from netboard.task.trials.repeats import Repeats

Place: TypeAlias = tuple[int, int, int]
"""Numbers of block, trial and attempt."""

INCOMPLETE = "incomplete"
"""Outcome of an attempt that began and never ended."""


class PlannedBlock(Protocol):
    """What this module needs of a planned block."""

    @property
    def number(self) -> int:
        """Number of the block, from 1 [1]."""

    @property
    def trials(self) -> int:
        """Number of trials [1]."""


@dataclass(frozen=True, slots=True)
class SessionProgress:
    """Progress of a session.

    Attributes
    ----------
    blocks : int
        Number of blocks in the plan [1].
    done : tuple of int
        Numbers of the finished blocks [1].
    block : int
        Number of the current or next block; 0 if all are finished [1].
    begun : bool
        Whether this block has begun.
    trial, attempt : int
        Next trial and attempt of this block [1].
    successes, failures, skipped : int
        Successful trials, failed attempts and skipped trials of this block so far [1].
    repeats : Repeats
        Trials of this block whose repeat was requested, or cancelled.
    completions : tuple of float
        Completion times of the successful trials of this block [s].
    block_ticks : int
        Duration of this block so far, in ticks [1].
    outcomes : tuple of AttemptOutcome
        Every attempt of the session, in order.
    incomplete : tuple of Place
        Attempts that began and never ended.
    under_way : Place or None
        The incomplete attempt at the end of the journal, if there is one.
    runs : tuple of str
        Ids of all runs of the server so far.
    form : FormAwaited
        Answers that were awaited when the server ended; without stations, if none were.
    """

    blocks: int
    done: tuple[int, ...]
    block: int
    begun: bool
    trial: int
    attempt: int
    successes: int
    failures: int
    skipped: int
    repeats: Repeats
    completions: tuple[float, ...]
    block_ticks: int
    outcomes: tuple[AttemptOutcome, ...]
    incomplete: tuple[Place, ...]
    under_way: Place | None
    runs: tuple[str, ...]
    form: FormAwaited

    @property
    def complete(self) -> bool:
        """Whether all blocks are finished."""
        return self.block == 0

    @property
    def extra(self) -> int:
        """Number of trials added to the block [1]."""
        return self.repeats.extra


@dataclass
class _BlockSoFar:
    """State of a block after the entries so far."""

    repeats: Repeats
    begun: bool = False
    over: bool = False
    stopped: bool = False
    last_done: int = 0
    attempt: int = 0  # newest attempt at the trial after `last_done`
    failures: int = 0
    skipped: int = 0
    completions: list[float] = field(default_factory=list)
    ticks: int = 0

    @property
    def finished(self) -> bool:
        return self.over or self.last_done >= self.repeats.trials + self.repeats.extra


class _Reader:
    """Apply entries one by one; raise ValueError if one contradicts those before."""

    def __init__(self, plan_blocks: Sequence[PlannedBlock]) -> None:
        self.blocks = {block.number: _BlockSoFar(Repeats(block.trials)) for block in plan_blocks}
        self.outcomes: list[AttemptOutcome] = []
        self.incomplete: list[Place] = []
        self.under_way: Place | None = None
        self.runs: list[str] = []
        self.form = FormAwaited(0, ())
        self._newest = 0  # block that began last

    def take(self, entry: Entry) -> None:
        """Apply the next entry."""
        match entry:
            case Opened(run=run) | Resumed(run=run):
                self.interrupt()
                self.runs.append(run)
            case BlockBegan(block=number):
                self.interrupt()
                self._begin(number)
            case AttemptBegan():
                self.interrupt()
                self._number(entry)
                self.under_way = (entry.block, entry.trial, entry.attempt)
            case AttemptEnded():
                self._end(entry)
            case Repeat(block=number, trial=trial):
                so_far = self._reopened(number)
                so_far.repeats = so_far.repeats.ask(trial)
            case Veto(block=number, trial=trial):
                so_far = self._present(number)
                if trial not in so_far.repeats.asked:
                    raise ValueError(f"a veto of the repeat of trial {trial}, which was not requested")
                so_far.repeats = so_far.repeats.veto(trial)
            case BlockEnded(block=number, how=how):
                self.interrupt()
                so_far = self._present(number)
                so_far.over, so_far.stopped = how != "stopped", how == "stopped"
            case FormAwaited():
                self.form = entry
            case Ended():
                self.interrupt()

    def interrupt(self) -> None:
        """Mark an attempt under way as incomplete: it will not end any more."""
        if self.under_way is not None:
            self.incomplete.append(self.under_way)
            self.outcomes.append(AttemptOutcome(*self.under_way, INCOMPLETE, float("nan"), "", 0))
            self.under_way = None

    def _begin(self, number: int) -> None:
        """Begin or continue a block; an earlier block that was stopped is given up."""
        if number not in self.blocks:
            raise ValueError(f"block {number}, and the plan has blocks {min(self.blocks)} to {max(self.blocks)}")
        if self.blocks[number].over:
            raise ValueError(f"block {number} begins, although it is over")
        for other, so_far in self.blocks.items():
            if other < number and not so_far.finished:
                if not so_far.stopped:
                    raise ValueError(f"block {number} begins before the end of block {other}")
                so_far.over = True
        self.blocks[number].begun, self.blocks[number].stopped = True, False
        self._newest = number

    def _present(self, number: int) -> _BlockSoFar:
        so_far = self.blocks.get(number)
        if so_far is None or not so_far.begun or so_far.over:
            raise ValueError(f"an entry of block {number}, which is not the current block")
        return so_far

    def _reopened(self, number: int) -> _BlockSoFar:
        """Return the current block; a repeat reopens it if it is over and no other block has begun."""
        so_far = self.blocks.get(number)
        if so_far is not None and number == self._newest and so_far.finished:
            so_far.over = False
        return self._present(number)

    def _number(self, entry: AttemptBegan | AttemptEnded) -> _BlockSoFar:
        """Check and store the numbers of a new attempt; they never decrease."""
        so_far = self._present(entry.block)
        expected = so_far.last_done + 1
        skipped = isinstance(entry, AttemptEnded) and entry.outcome == "skipped"
        if entry.trial != expected or entry.attempt < so_far.attempt + (not skipped):
            raise ValueError(
                f"trial {entry.trial}, attempt {entry.attempt} of block {entry.block}, where trial {expected}, "
                f"attempt {so_far.attempt + 1} comes next"
            )
        so_far.attempt = entry.attempt
        return so_far

    def _end(self, entry: AttemptEnded) -> None:
        """Apply the outcome of an attempt."""
        place = (entry.block, entry.trial, entry.attempt)
        if place == self.under_way:
            so_far, self.under_way = self._present(entry.block), None
        else:
            self.interrupt()
            so_far = self._number(entry)
        completion = float("nan") if entry.completion is None else entry.completion
        flags = ",".join(entry.flags)
        self.outcomes.append(AttemptOutcome(*place, entry.outcome, completion, flags, entry.repeats))
        so_far.ticks = entry.block_ticks
        so_far.failures += entry.outcome in ("fell", "timed_out")
        so_far.skipped += entry.outcome == "skipped"
        if entry.outcome == "success":
            so_far.completions.append(completion)
        if entry.outcome in ("success", "skipped"):
            so_far.last_done, so_far.attempt = entry.trial, 0
        if entry.again:
            so_far.repeats = so_far.repeats.ask(entry.trial)


def progress_of(
    header: Header, entries: Sequence[Entry], plan_blocks: Sequence[PlannedBlock], source: str = "the journal"
) -> SessionProgress:
    """Return the progress of a session.

    Parameters
    ----------
    plan_blocks : sequence of PlannedBlock
        Blocks of the planned session, in order.

    Raises
    ------
    RecordingError
        If an entry contradicts the plan or earlier entries; the message names the line.
    """
    reader = _Reader(plan_blocks)
    for line, entry in enumerate(entries, start=2):
        try:
            reader.take(entry)
        except ValueError as error:
            raise RecordingError(
                f"{source}, line {line}: does not fit session {header.name} of dyad {header.dyad}: {error}"
            ) from None
    under_way = reader.under_way
    reader.interrupt()
    done = tuple(number for number, so_far in reader.blocks.items() if so_far.finished)
    number = next((number for number in reader.blocks if number not in done), 0)
    now = reader.blocks.get(number, _BlockSoFar(Repeats(0)))
    return SessionProgress(
        blocks=len(reader.blocks),
        done=done,
        block=number,
        begun=now.begun,
        trial=now.last_done + 1,
        attempt=now.attempt + 1,
        successes=len(now.completions),
        failures=now.failures,
        skipped=now.skipped,
        repeats=now.repeats,
        completions=tuple(now.completions),
        block_ticks=now.ticks,
        outcomes=tuple(reader.outcomes),
        incomplete=tuple(reader.incomplete),
        under_way=under_way,
        runs=tuple(reader.runs),
        form=reader.form,
    )


def resume_words(progress: SessionProgress) -> str:
    """Describe in one line where a session resumes, for the operator, and which answers it lacks."""
    where, form = _place_words(progress), progress.form
    if not form.stations:
        return where
    # Not whose: only people answer, and the block may be blinded.
    return f"{where}; answers to the questionnaires of block {form.block} are lost (the journal names the stations)"


def _place_words(progress: SessionProgress) -> str:
    """Describe where a session resumes."""
    if progress.complete:
        return f"nothing to resume: all {progress.blocks} blocks are complete"
    where = f"block {progress.block} of {progress.blocks}"
    if not progress.begun:
        return f"{'begins' if progress.block == 1 else 'resumes'} at the start of {where}"
    counts = [f"{progress.successes} done"]
    if progress.skipped:
        counts.append(f"{progress.skipped} skipped")
    if progress.failures:
        counts.append(plural(progress.failures, "failed attempt"))
    if progress.extra:
        counts.append(f"{plural(progress.extra, 'trial')} added")
    trials = progress.repeats.trials + progress.extra
    words = f"resumes at {where}, trial {progress.trial} of {trials} ({', '.join(counts)})"
    if progress.attempt > 1:
        words += f", attempt {progress.attempt}"
    if progress.under_way is not None:
        words += "; the unfinished attempt is kept as incomplete"
    return words
