"""Checks the trials of a recording against its configuration.

Pure: attempts and configurations in, findings out. A stopped block is a loss, because planned trials are missing. An
order of trials that the trial state machine cannot produce is damage.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, replace
from itertools import pairwise
from math import isnan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config
from netboard.base.plural import plural
from netboard.base.tables.experiment import Block
from netboard.recording.format.summary import Attempt
from netboard.recording.integrity.severity import CheckFinding, Severity
from netboard.recording.integrity.walk import Walk
from netboard.task.trials.state_machine import Cause, Phase, first_target, ticks

NO_TICKS = CheckFinding(Severity.LOSS, "contains no ticks, so no trials")

_ENDS = (Cause.LAST, Cause.STOP)


class Tally(NamedTuple):
    """Trials of a block that were done, and those wanted: planned, and requested as repeats."""

    done: int
    wanted: int


def check_trials(
    config: Config, seen: Walk, listed: Sequence[Attempt], goes_on: Callable[[], bool]
) -> Iterator[CheckFinding]:
    """Check the trials by the rules in the configuration; ``goes_on``: whether another file continues the block."""
    if not seen.count:
        yield NO_TICKS
        return
    attempts = seen.attempts()
    problems = [
        *_wrong_list(attempts, listed),
        *_wrong_targets(config, attempts),
        *_wrong_order(attempts),
        *_wrong_forces(config.block, seen),
        *_wrong_counts(seen, attempts),
    ]
    yield from (CheckFinding(Severity.DAMAGE, problem) for problem in problems)
    _, done = check_done(config, np.concatenate(seen.turns), goes_on)
    if not problems or done.severity != Severity.SOUND:
        yield done


def check_measured(seen: Walk, listed: Sequence[Attempt]) -> Iterator[CheckFinding]:
    """Check the trials of an imported table, which followed other rules and may lack columns."""
    attempts = seen.attempts() if seen.count else ()
    problems = list(_wrong_list(attempts, listed))
    yield from (CheckFinding(Severity.DAMAGE, problem) for problem in problems)
    if not problems:
        done = sum(attempt.outcome == "success" for attempt in attempts)
        counts = f"{plural(len(attempts), 'attempt')}, {plural(done, 'success')}"
        text = f"{counts}, as imported; not compared with netboard's rules or a plan"
        yield CheckFinding(Severity.SOUND, text)


_BY_COMMAND = ("stop", "pause", "abort", "skip", "fault")


def _wrong_list(attempts: Sequence[Attempt], listed: Sequence[Attempt]) -> Iterator[str]:
    """Compare the file's list of attempts with its ticks; yield a difference."""
    if listed and attempts and listed[-1].outcome == "unfinished" and attempts[-1].outcome in _BY_COMMAND:
        # Older loggers listed the last attempt so, too, if a command ended it in the last tick.
        attempts = (*attempts[:-1], replace(attempts[-1], outcome="unfinished"))
    if list(map(_comparable, attempts)) != list(map(_comparable, listed)):
        yield f"{plural(len(listed), 'attempt is', 'attempts are')} listed, expected the {len(attempts)} in the ticks"


def _comparable(attempt: Attempt) -> tuple[object, ...]:
    """Return the values of an attempt; a completion time that is no number is None, which equals itself."""
    return tuple(None if isinstance(value, float) and isnan(value) else value for value in astuple(attempt))


def _wrong_targets(config: Config, attempts: Sequence[Attempt]) -> Iterator[str]:
    """Check that targets change side from trial to trial, starting with the first."""
    first = first_target(config)
    swapped = [attempt for attempt in attempts if attempt.target != (first if attempt.trial % 2 else -first)]
    if swapped:
        where = ", ".join(f"trial {attempt.trial}, attempt {attempt.attempt}" for attempt in swapped[:3])
        yield f"{len(swapped)} of {len(attempts)} attempts have their target on the wrong side: {where}"


def _wrong_order(attempts: Sequence[Attempt]) -> Iterator[str]:
    """Check the order of trials: repeated until a success or a skip, and never a lower number."""
    for before, now in pairwise(attempts):
        again = now.trial == before.trial and now.attempt > before.attempt and before.outcome != "success"
        if now.trial <= before.trial and not again:
            yield (
                f"trial {now.trial}, attempt {now.attempt} at tick {now.tick} follows trial {before.trial}, attempt "
                f"{before.attempt} ({before.outcome}), which is impossible"
            )


def _wrong_forces(block: Block, seen: Walk) -> Iterator[str]:
    """Check that the forces match the condition: no force without haptic feedback."""
    if seen.force_where_none:
        catch = f" and catch trials {', '.join(map(str, block.catch))}" if block.catch else ""
        found = plural(seen.force_where_none, "tick has", "ticks have")
        yield f'{found} a force where none is allowed (condition "{block.force}"{catch}, and between trials)'


def _wrong_counts(seen: Walk, attempts: Sequence[Attempt]) -> Iterator[str]:
    """Compare the trial state machine's count of successes with the attempts, where no tick is missing."""
    last = seen.last[0]
    counted = int(last["successes"]) - int(seen.first[0]["successes"])
    if int(last["event"]) == Cause.HELD:  # it is counted in the next tick
        counted += 1
    found = sum(attempt.outcome == "success" for attempt in attempts)
    if not seen.missing and counted != found:
        yield f"the trial state machine counted {plural(counted, 'success')}, and there are {found}"


def check_done(config: Config, rows: NDArray[Any], goes_on: Callable[[], bool]) -> tuple[Tally, CheckFinding]:
    """Count the trials that were done, and judge whether they are those planned.

    ``rows``: at least the tick that ended the block, and the last one. ``goes_on``: whether another file continues the
    block.
    """
    block, ends = config.block, rows[np.isin(rows["event"], _ENDS)]
    if len(ends) and rows[-1]["tick"] > ends[-1]["tick"] and rows[-1]["phase"] != Phase.FINISHED:
        ends = ends[:0]  # the block was over, and was reopened for repeats
    row = ends[-1] if len(ends) else rows[-1]
    over = int(row["event"]) == Cause.LAST
    current, extra = int(row["trial"]), int(row["extra"])
    is_current_done = (over and int(row["phase"]) != Phase.FAILED) or int(row["event"]) == Cause.HELD
    done = current if is_current_done else current - 1
    # A veto in the last tick of a trial may make it the last one.
    is_vetoed = int(row["command"]) == Cause.VETO and extra > 0
    wanted = block.trials + (extra - 1 if is_vetoed else extra)
    timed = 0 < ticks(block.duration) <= int(row["block_ticks"]) + 1
    condition = block.label or f"{block.configuration}, force {block.force}"
    failed = plural(int(row["failures"]), "failed attempt")
    words = f"{done} of the block's {wanted} trials done, {failed}, condition: {condition}"
    if done > wanted or (over and done < wanted and not timed):
        finding = CheckFinding(Severity.DAMAGE, f"{words}: the trial state machine never ends a block like this")
    elif over:
        finding = CheckFinding(Severity.SOUND, f"{words}; numbers, targets and forces are as expected")
    else:
        why = "an operator stopped the block" if len(ends) else "the end of the block is not in this file"
        why = "continued in another file" if not len(ends) and goes_on() else why
        finding = CheckFinding(Severity.LOSS, f"{words}: {why}")
    return Tally(done, wanted), finding
