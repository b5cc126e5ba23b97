"""Checks a recording against the journal of its session beside it, and against the plan that the journal names.

The plan is reproduced from study and seed in the journal. A journal of an older version does not have the study, which
is then known only if it is built in; the blocks of others are checked only against the journal.

The journal was written live; the recording is judged afterwards. Three differences do not indicate damage: a killed
server did not write its last lines; an attempt that is only partly in this file cannot be judged again; and frames that
a display reported too late did not count live.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from itertools import product
from pathlib import Path

from netboard.base.config import Config
from netboard.base.errors import ConfigError, RecordingError
from netboard.base.plural import plural
from netboard.base.tables.experiment import Design
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.severity import CheckFinding, Severity
from netboard.recording.integrity.walk import Walk
from netboard.recording.recovery.journal_file import journal_path
from netboard.task.journal.entries import (
    AttemptEnded,
    Ended,
    Entry,
    Header,
    JournalContent,
    Opened,
    Resumed,
    read_lines,
)
from netboard.task.plans.plan import Plan, config_of, digest, plan_of
from netboard.task.studies import library
from netboard.task.studies.study import Study, digest_of_study, parse_study
from netboard.task.trials.quality import Verdict

_COMPARED = ("success", "fell", "timed_out")
"""Outcomes that the ticks alone determine; only the server knows how a command ended an attempt."""

_BY_REPORTS = {"frozen_display"}
"""Flags that depend on the content and time of display reports."""


def journal_of(path: Path, config: Config) -> JournalContent | None:
    """Read the journal beside a recording; None if there is none."""
    beside = journal_path(path.parent, config)
    return read_lines(beside.read_bytes(), beside.name) if beside.is_file() else None


def check_plan(path: Path, config: Config) -> Iterator[CheckFinding]:
    """Check a block of a study against its plan."""
    if not config.session.study:
        return
    try:
        lines = journal_of(path, config)
        plan = None if lines is None else plan_in(lines.header, config)
        if lines is None or plan is None:
            why = "no journal beside it" if lines is None else _why_unknown(lines.header)
            text = f"block {config.block.number} of {config.block.blocks} of study {config.session.study}; {why}"
            yield CheckFinding(Severity.SOUND, f"{text}, so the plan is not compared")
            return
        planned = config_of(config, plan.sessions[lines.header.session - 1], config.block.number)
    except RecordingError:
        return  # the journal's own check reports it
    except (ConfigError, IndexError) as error:
        yield CheckFinding(Severity.DAMAGE, f"the plan does not fit the block: {error}")
        return
    shortened = replace(planned.block, blocks=config.block.blocks, catch=config.block.catch, trials=config.block.trials)
    if config.session.pilot and config.block.trials <= planned.block.trials:
        planned = replace(planned, block=shortened)
    if config.design == Design():
        planned = replace(planned, design=Design())  # the recording predates factors in blocks
    planned = replace(planned, analysis=config.analysis)  # no part of the plan, nor of the study's digest
    yield from _compare_plan(config, planned)


def plan_in(header: Header, config: Config) -> Plan | None:
    """Reproduce the plan of a journal and verify its digest; None if study or dyad are unknown."""
    number, study = re.search(r"[0-9]+$", header.dyad), _study_of(header)
    if study is None or number is None:
        return None
    hands = (config.session.hand_a, config.session.hand_b)
    plan = plan_of(study, header.seed, int(number[0]), hands)
    # A pilot run may have shortened the plan to the blocks and trials of this block.
    shortened = product((None, config.block.blocks), (None, config.block.trials))
    return plan if header.plan_digest in {digest(plan, *to) for to in shortened} else None


def _study_of(header: Header) -> Study | None:
    """Return the study of a journal: its own text, or the built-in one of an older journal; None if it is unknown."""
    text = header.study_text or (library.text_of(header.study) if header.study in library.names() else "")
    study = parse_study(text, f"the study {header.study} in the journal") if text else None
    return study if study is not None and digest_of_study(study) == header.study_digest else None


def _why_unknown(header: Header) -> str:
    """Return why the plan of a journal cannot be reproduced."""
    if _study_of(header) is None:
        return "its journal, of an older version, has no text of the study, or the study has changed"
    return f'not the plan of a dyad with a number ("{header.dyad}") and the hands of this recording'


def _compare_plan(config: Config, planned: Config) -> Iterator[CheckFinding]:
    """Compare the block's condition with that of the plan for the same rig."""
    problems = [
        f"[{table.name}] {key.name}: found {getattr(has, key.name)!r}, planned {getattr(wants, key.name)!r}"
        for table in fields(config)
        for has, wants in [(getattr(config, table.name), getattr(planned, table.name))]
        for key in fields(has)
        if getattr(has, key.name) != getattr(wants, key.name)
    ]
    study, number = config.session.study, f"{config.block.number} of {config.block.blocks}"
    if problems:
        yield CheckFinding(
            Severity.DAMAGE, f"block {number} of study {study} differs from the plan: {'; '.join(problems)}"
        )
    else:
        yield CheckFinding(
            Severity.SOUND, f"block {number} agrees with the plan of study {study}: {config.block.label}"
        )


def check_journal(
    recording: Recording, config: Config, seen: Walk, verdicts: Sequence[Verdict]
) -> Iterator[CheckFinding]:
    """Check a recording against the journal beside it, if there is one."""
    try:
        lines = journal_of(recording.path, config)
    except RecordingError as error:
        yield CheckFinding(Severity.LOSS, f"cannot be read: {error}")
        return
    if lines is not None:
        run, block = recording.metadata.get("session", ""), config.block.number
        yield from _compare_journal(lines.entries, run, block, seen, verdicts)


def _compare_journal(
    entries: Sequence[Entry], run: str, block: int, seen: Walk, verdicts: Sequence[Verdict]
) -> Iterator[CheckFinding]:
    """Compare the journal's attempts with those of the recording."""
    if not seen.count:
        return
    first, last = int(seen.first["tick"][0]), int(seen.last["tick"][0])
    listed = {
        (entry.trial, entry.attempt): entry
        for entry in entries
        if isinstance(entry, AttemptEnded) and (entry.run, entry.block) == (run, block) and first <= entry.tick <= last
    }
    judged = {(verdict.trial, verdict.attempt): verdict for verdict in verdicts}
    end = _end_of(entries, run)
    unlisted = sorted(judged.keys() - listed.keys())
    omitted = [place for place in unlisted if end is None or judged[place].end <= end]
    both = [(listed[place], judged[place]) for place in sorted(judged.keys() & listed.keys())]
    problems = [
        *(f"trial {n}, attempt {k} is in the recording only" for n, k in omitted),
        *(problem for entry, verdict in both for problem in _differs(entry, verdict, whole=_is_whole(seen, verdict))),
    ]
    if problems:
        yield CheckFinding(Severity.DAMAGE, f"contradicts the recording: {'; '.join(problems)}")
    late = [
        (entry.trial, entry.attempt)
        for entry, verdict in both
        if entry.outcome in _COMPARED and (flags := _flag_difference(entry, verdict)) and flags <= _BY_REPORTS
    ]
    missing = [place for place in listed.keys() - judged.keys() if listed[place].outcome in _COMPARED]
    losses = [
        *_attempts_lost("lists attempts whose ticks are not in the recording", missing),
        *_attempts_lost("ends before these attempts", [place for place in unlisted if place not in omitted]),
        *_attempts_lost("differs in the flag for a frozen display from what the frames reported later give", late),
    ]
    yield from losses
    if not (problems or losses):
        yield CheckFinding(Severity.SOUND, f"agrees on all {plural(len(judged), 'attempt')}")


def _end_of(entries: Sequence[Entry], run: str) -> int | None:
    """Return the last tick that the journal has of a crashed run; None for a run that ended normally."""
    in_run = False
    end = -1
    for entry in entries:
        if isinstance(entry, Opened | Resumed):
            in_run = entry.run == run
        elif isinstance(entry, Ended) and in_run:
            return None
        elif in_run:
            end = max(end, int(getattr(entry, "tick", -1)))
    return end


def _is_whole(seen: Walk, verdict: Verdict) -> bool:
    """Return True if the recording has every tick of an attempt, so that it can be judged again."""
    first = seen.first[0]
    begun = int(first["tick"]) < verdict.release or int(first["run_ticks"]) == 0
    return begun and all(gap.first > verdict.end or gap.first + gap.count < verdict.release for gap in seen.gaps)


def _differs(entry: AttemptEnded, verdict: Verdict, *, whole: bool) -> Iterator[str]:
    """Describe the differences between the journal and the recording for an attempt."""
    where = f"trial {entry.trial}, attempt {entry.attempt}"
    if verdict.outcome not in _COMPARED and entry.outcome not in _COMPARED:
        return
    if entry.outcome != verdict.outcome:
        yield f"{where} is {entry.outcome} in the journal and {verdict.outcome} in the recording"
    elif entry.outcome == "success" and entry.completion != verdict.completion:
        yield f"{where} took {entry.completion} s in the journal and {verdict.completion} s in the recording"
    elif whole and _flag_difference(entry, verdict) - _BY_REPORTS:
        in_journal, in_recording = (", ".join(flags) or "none" for flags in (entry.flags, verdict.flags))
        yield f"{where} has the flags {in_journal} in the journal and {in_recording} in the recording"


def _flag_difference(entry: AttemptEnded, verdict: Verdict) -> set[str]:
    return set(entry.flags) ^ set(verdict.flags)


def _attempts_lost(what: str, places: Sequence[tuple[int, int]]) -> Iterator[CheckFinding]:
    """Yield a loss for a list of attempts, unless it is empty."""
    if places:
        which = ", ".join(f"trial {n}, attempt {k}" for n, k in sorted(places))
        yield CheckFinding(Severity.LOSS, f"{what}: {which}")
