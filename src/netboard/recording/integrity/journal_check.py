"""Compares the journal of a session with a recording of it.

Pure: journal entries and judged attempts in, findings out. The journal was written live; the recording is judged
afterwards. Three differences do not indicate damage: a killed server did not write its last lines; an attempt that is
only partly in this file cannot be judged again; and frames that a display reported too late did not count live.
"""

from collections.abc import Iterator, Sequence

from netboard.recording.integrity.severity import Finding, Grade
from netboard.recording.integrity.walk import Walk
from netboard.task.journal.entries import AttemptEnded, Ended, Entry, Opened, Resumed
from netboard.task.trials.quality import Verdict

_COMPARED = ("success", "fell", "timed_out")
"""Outcomes that the ticks alone determine; only the server knows how a command ended an attempt."""

_BY_REPORTS = {"frozen_display"}
"""Flags that depend on the content and time of display reports."""


def check_journal(
    entries: Sequence[Entry], run: str, block: int, seen: Walk, verdicts: Sequence[Verdict]
) -> Iterator[Finding]:
    """Compare the journal's attempts with those of the recording."""
    if not seen.count:
        return
    first, last = int(seen.first["tick"][0]), int(seen.last["tick"][0])
    told = {
        (entry.trial, entry.attempt): entry
        for entry in entries
        if isinstance(entry, AttemptEnded) and (entry.run, entry.block) == (run, block) and first <= entry.tick <= last
    }
    judged = {(verdict.trial, verdict.attempt): verdict for verdict in verdicts}
    end = _end_of(entries, run)
    untold = [place for place in sorted(judged.keys() - told.keys()) if end is None or judged[place].end <= end]
    both = [(told[place], judged[place]) for place in sorted(judged.keys() & told.keys())]
    problems = [
        *(f"trial {n}, attempt {k} is in the recording only" for n, k in untold),
        *(problem for there, here in both for problem in _differs(there, here, whole=_is_whole(seen, here))),
    ]
    if problems:
        yield Finding("journal", Grade.DAMAGE, f"contradicts the recording: {'; '.join(problems)}")
    missing = [place for place in told.keys() - judged.keys() if told[place].outcome in _COMPARED]
    losses = [
        *_loss("tells of attempts whose ticks are not here", missing),
        *_loss("ends before", [place for place in judged.keys() - told.keys() if place not in untold]),
        *_loss("has another flag for a frozen display than the frames reported in the end give", _late(both)),
    ]
    yield from losses
    if not (problems or losses):
        yield Finding("journal", Grade.SOUND, f"tells the same of all {len(judged)} attempts")


def _end_of(entries: Sequence[Entry], run: str) -> int | None:
    """Return the last tick that the journal has of a crashed run; None for a run that ended normally."""
    mine = False
    end = -1
    for entry in entries:
        if isinstance(entry, Opened | Resumed):
            mine = entry.run == run
        elif isinstance(entry, Ended) and mine:
            return None
        elif mine:
            end = max(end, int(getattr(entry, "tick", -1)))
    return end


def _is_whole(seen: Walk, verdict: Verdict) -> bool:
    """Return True if the recording has every tick of an attempt, so that it can be judged again."""
    first = seen.first[0]
    begun = int(first["tick"]) < verdict.release or int(first["run_ticks"]) == 0
    return begun and all(gap.first > verdict.end or gap.first + gap.count < verdict.release for gap in seen.gaps)


def _differs(told: AttemptEnded, judged: Verdict, *, whole: bool) -> Iterator[str]:
    """Describe the differences between the journal and the recording for an attempt."""
    where = f"trial {told.trial}, attempt {told.attempt}"
    if judged.outcome not in _COMPARED and told.outcome not in _COMPARED:
        return
    if told.outcome != judged.outcome:
        yield f"{where} is {told.outcome} there and {judged.outcome} here"
    elif told.outcome == "success" and told.completion != judged.completion:
        yield f"{where} took {told.completion} s there and {judged.completion} s here"
    elif whole and _difference(told, judged) - _BY_REPORTS:
        there, here = (", ".join(flags) or "none" for flags in (told.flags, judged.flags))
        yield f"{where} has the flags {there} there and {here} here"


def _difference(told: AttemptEnded, judged: Verdict) -> set[str]:
    return set(told.flags) ^ set(judged.flags)


def _late(both: Sequence[tuple[AttemptEnded, Verdict]]) -> list[tuple[int, int]]:
    """Return the attempts that differ only in flags from display reports."""
    return [
        (told.trial, told.attempt)
        for told, judged in both
        if told.outcome in _COMPARED and _difference(told, judged) and _difference(told, judged) <= _BY_REPORTS
    ]


def _loss(what: str, places: Sequence[tuple[int, int]]) -> Iterator[Finding]:
    """Yield a loss for a list of attempts, unless it is empty."""
    if places:
        which = ", ".join(f"trial {n}, attempt {k}" for n, k in sorted(places))
        yield Finding("journal", Grade.LOSS, f"{what}: {which}")
