"""Finds the reference of a recording: the journal of its session beside it, and the plan named there.

The plan is reproduced from study and seed in the journal. A study that is not built in is not available here; its
blocks are checked only against the journal.
"""

import hashlib
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from netboard.base.config import Config
from netboard.base.errors import ConfigError, RecordingError
from netboard.base.tables.experiment import Design
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.journal_check import check_journal
from netboard.recording.integrity.quality_check import judged
from netboard.recording.integrity.severity import Finding, Grade
from netboard.recording.integrity.trial_check import check_plan
from netboard.recording.integrity.walk import Walk
from netboard.recording.recovery.journal_file import journal_path
from netboard.task.journal.entries import Header, Lines, read_lines
from netboard.task.plans.plan import Plan, config_of, digest, plan_of
from netboard.task.studies import library
from netboard.task.studies.study import parse_study, resolve_study


def journal_of(path: Path, config: Config) -> Lines | None:
    """Read the journal beside a recording; None if there is none."""
    beside = journal_path(path.parent, config)
    return read_lines(beside.read_bytes(), beside.name) if beside.is_file() else None


def plan_findings(path: Path, config: Config) -> Iterator[Finding]:
    """Check a block of a study against its plan."""
    if not config.session.study:
        return
    try:
        lines = journal_of(path, config)
        plan = None if lines is None else plan_in(lines.header, config)
        if lines is None or plan is None:
            why = "no journal beside it" if lines is None else "not a plan of a built-in study for a numbered dyad"
            text = f"block {config.block.number} of {config.block.blocks} of study {config.session.study}; {why}"
            yield Finding("plan", Grade.SOUND, f"{text}, so the plan is not made again")
            return
        planned = config_of(config, plan.sessions[lines.header.session - 1], config.block.number)
    except RecordingError:
        return  # the journal's own check reports it
    except (ConfigError, IndexError) as error:
        yield Finding("plan", Grade.DAMAGE, f"the plan does not go with the block: {error}")
        return
    shortened = replace(planned.block, blocks=config.block.blocks, catch=config.block.catch, trials=config.block.trials)
    if config.session.pilot and config.block.trials <= planned.block.trials:
        planned = replace(planned, block=shortened)
    if config.design == Design():
        planned = replace(planned, design=Design())  # the recording predates factors in blocks
    yield from check_plan(config, planned)


def plan_in(header: Header, config: Config) -> Plan | None:
    """Reproduce the plan of a journal and verify its digest; None if study or dyad are unknown."""
    number = re.search(r"\d+$", header.dyad)
    if header.study not in library.NAMES or number is None:
        return None
    study = parse_study(library.text_of(header.study), header.study)
    if hashlib.sha256(resolve_study(study).encode()).hexdigest() != header.study_digest:
        return None
    hands = (config.session.hand_a, config.session.hand_b)
    plan = plan_of(study, header.seed, int(number[0]), hands)
    return plan if header.plan_digest in {digest(plan), *_shortened(plan, config)} else None


def _shortened(plan: Plan, config: Config) -> Iterator[str]:
    """Yield the digests of the shortened plans that a pilot run of this block may have used."""
    for blocks in (None, config.block.blocks):
        for trials in (None, config.block.trials):
            yield hashlib.sha256(f"{digest(plan)} {blocks} {trials}".encode()).hexdigest()


def journal_findings(recording: Recording, config: Config, seen: Walk) -> Iterator[Finding]:
    """Check a recording against the journal beside it."""
    try:
        lines = journal_of(recording.path, config)
    except RecordingError as error:
        yield Finding("journal", Grade.LOSS, f"cannot be read: {error}")
        return
    if lines is not None:
        run, block = recording.metadata.get("session", ""), config.block.number
        yield from check_journal(lines.entries, run, block, seen, judged(recording))
