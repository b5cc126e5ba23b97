"""Integrity check of one file: the registry of checks, all findings, and one result.

`complete`: the bytes are as written, no number is missing, times and clocks are plausible, the trials are as planned.
`complete with listed losses`: data are missing, and the file itself lists them. `damaged`: the file has changed, was
not finished, or contradicts itself. A damaged file is recovered into a temporary folder, to report what can be saved.
Nothing is written beside a recording.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from numpy.typing import NDArray

from netboard.base.config import Config, parse
from netboard.base.errors import ConfigError, NetboardError, RecordingError
from netboard.base.plural import plural
from netboard.network.protocol.records import BLOCK_BEGAN
from netboard.recording.files.copies import original_of
from netboard.recording.files.reader import Recording
from netboard.recording.format import older
from netboard.recording.format.channels import FORMAT_VERSION, TICKS
from netboard.recording.format.rig import rig_of
from netboard.recording.integrity.account import parts_of
from netboard.recording.integrity.clock_check import check_clocks
from netboard.recording.integrity.journal_check import check_journal, check_plan
from netboard.recording.integrity.quality_check import Judge, losses_among
from netboard.recording.integrity.severity import CheckFinding, CheckReport, Severity
from netboard.recording.integrity.stream_check import (
    check_end,
    check_numbers,
    check_rendered,
    check_time,
    check_triggers,
    not_exact,
)
from netboard.recording.integrity.trial_check import check_measured, check_trials
from netboard.recording.integrity.verification import why_not_computable
from netboard.recording.integrity.walk import Examined, walk
from netboard.recording.recovery.recover import RecoveryReport
from netboard.recording.recovery.spilled import recover_any
from netboard.stage.stage import Stage, make_stage

TicksRead = Callable[[int], object]
"""Callback for the number of further ticks read [1]."""


@dataclass(frozen=True, slots=True)
class Check:
    """One integrity check."""

    part: str  # its name in reports
    about: str  # what it examines, for the documentation
    findings: Callable[[Examined], Iterable[CheckFinding]]
    needs_config: bool = False  # whether it is left out where the configuration cannot be read


def check(path: Path, replay: bool = False, progress: TicksRead = lambda ticks: None) -> CheckReport:
    """Check one file.

    It is a recording, an unfinished one (``.part``) or a server's spill (``.spill``). A faulty file gives findings,
    never an exception.
    """
    try:
        with Recording(path) as recording:
            return _check(recording, replay, progress)
    except RecordingError as error:
        return _unreadable(path, str(error))


def _check(recording: Recording, replay: bool, progress: TicksRead) -> CheckReport:
    """Run all registered checks on a readable file."""
    recording.check()
    config: Config | None = None
    stage: Stage | None = None
    problems = [CheckFinding(Severity.SOUND, f"{recording.path.stat().st_size} bytes, every checksum is right", "file")]
    try:
        config = parse(recording.config_text, "its configuration")
        if replay and (why := why_not_computable(recording)):
            problems.append(CheckFinding(Severity.LOSS, why, "replay"))
        elif replay:
            stage = make_stage(config)
            stage.warm()
    except (ConfigError, RecordingError) as error:
        problems.append(CheckFinding(Severity.DAMAGE, str(error), "configuration"))
    judge = None if config is None else Judge(recording, config)
    batches = _with_progress(recording.batches(as_sent=True), progress, judge)
    seen = walk(batches, None if config is None else config.block, stage)
    verdicts = () if judge is None else tuple(judge.verdicts)
    evidence = Examined(recording, seen, config, recording.events(), recording.clocks(), recording.remarks(), verdicts)
    found = [
        replace(finding, part=one.part)
        for one in CHECKS
        if config is not None or not one.needs_config
        for finding in one.findings(evidence)
    ]
    excluded = "" if config is None else losses_among(verdicts, config, recording.metadata).text
    return CheckReport(recording.path, (*problems, *found), seen.count, seen.verification, seen.computing, excluded)


def _with_progress(
    portions: Iterable[NDArray[Any]], progress: TicksRead, judge: Judge | None
) -> Iterator[NDArray[Any]]:
    """Pass the ticks on, and let a judge see them on the way."""
    for rows in portions:
        if judge is not None:
            judge.take(rows)
        yield rows
        progress(len(rows))


def _unreadable(path: Path, why: str) -> CheckReport:
    """Report what can be saved of a file that cannot be read completely."""
    findings = [CheckFinding(Severity.DAMAGE, why, "file")]
    ticks = 0
    try:
        with TemporaryDirectory() as folder:
            saved = recover_any(path, Path(folder) / "recovered.mcap")
            others = [other for other in path.parent.glob("*.mcap") if other != path]
            known = [original_of(one.output, others) for one in saved]
    except (NetboardError, OSError) as error:
        # An error of the temporary folder, such as a full disk, says nothing about the file.
        of_file = str(error).startswith(f"{path}:")
        words = "nothing can be recovered" if of_file else "what can be recovered is unknown"
        findings.append(CheckFinding(Severity.DAMAGE, f"{words}: {error}", "file"))
    else:
        ticks = sum(one.messages[TICKS] for one in saved)
        for one, original in zip(saved, known, strict=True):
            text = _recoverable(one, len(saved) > 1) + (f"; {original} has all of these ticks" if original else "")
            findings.append(CheckFinding(Severity.DAMAGE, text, "file"))
    return CheckReport(path, tuple(findings), ticks)


def _recoverable(saved: RecoveryReport, is_one_of_several: bool) -> str:
    ticks = saved.messages[TICKS]
    span = plural(ticks, "tick") + (f", {saved.first_tick} to {saved.last_tick}" if ticks else "")
    text = f"recoverable: {span}, and {sum(saved.messages.values()) - ticks} other records"
    text += f", of {saved.whose}" if is_one_of_several else ""
    text += f"; {saved.lost_bytes} bytes are lost" if saved.lost_bytes else ""
    text += "" if saved.has_config else "; the configuration is lost"
    return text + "".join(f"; left out: {what}" for what in saved.left_out)


# --- the checks of this module -----------------------------------------------------------------------------------


def _clocks(evidence: Examined) -> Iterator[CheckFinding]:
    """Check the clocks of all peers against the bound in the configuration."""
    return check_clocks(evidence.probes, evidence.config.network.clock_bound_ms, evidence.seen.active_ns)


def _trials(evidence: Examined) -> Iterator[CheckFinding]:
    """Check the trials by the rules that they followed."""
    recording, seen = evidence.recording, evidence.seen
    if evidence.is_imported:
        yield from check_measured(seen, recording.attempts())
    elif evidence.is_played:
        yield from check_trials(evidence.config, seen, recording.attempts(), partial(continues, recording))


def continues(recording: Recording) -> bool:
    """Return True if another file continues the same block."""
    metadata = recording.metadata
    for path in parts_of(recording.path):
        if path != recording.path:
            try:
                with Recording(path) as other:
                    same = all(other.metadata.get(key) == metadata.get(key) for key in ("session", "block"))
                    if same and (other.first_record or 0) > (recording.first_record or 0):
                        return True
            except RecordingError:
                continue
    return False


def _configuration(evidence: Examined) -> Iterator[CheckFinding]:
    """Compare the attached configuration with its hash in the metadata and with the server's event."""
    recording, config = evidence.recording, evidence.config
    metadata, session = recording.metadata, config.session
    sent = [
        event.details["config"] for event in evidence.events if event.name == BLOCK_BEGAN and "config" in event.details
    ]
    expected = {"dyad": session.dyad, "name": session.name, "study": session.study, "block": str(config.block.number)}
    problems = [
        f"{key} {metadata[key]!r}, expected {value!r}"
        for key, value in expected.items()
        if metadata.get(key, value) != value
    ]
    # Files of older versions are read with the keys of the current one.
    version = metadata.get("format", FORMAT_VERSION)
    if sent and older.config_of(sent[-1], version) != recording.config_text and version not in ("1", "2"):
        problems.append("the server began the block with another configuration")
    if problems:
        yield CheckFinding(Severity.DAMAGE, f"contradicts the rest of the file: {'; '.join(problems)}")
    else:
        copy = " and the one with which the server began the block" if sent else ""
        yield CheckFinding(Severity.SOUND, f"matches its checksum{copy}")


def _devices(evidence: Examined) -> Iterator[CheckFinding]:
    """Say what the hands held, and what stood in for the real thing."""
    recording = evidence.recording
    rig = rig_of(recording.config, recording.metadata, evidence.events, recording.attempts())
    for side, held in rig.hands.items():
        yield CheckFinding(Severity.SOUND, f"{side}: {', then '.join(held) or 'not recorded'}")
    for what, said in rig.stand_ins.items():
        yield CheckFinding(Severity.SOUND, f"stand-in: {what} ({said or 'not confirmed'})")


def _replay(evidence: Examined) -> Iterator[CheckFinding]:
    """Report the result of verifying every tick, if it was requested."""
    result = evidence.seen.verification
    if result is None:
        return
    if not result.identical:
        text = f"tick {result.tick}, {result.field}: recorded {result.recorded!r}, computed {result.computed!r}"
        known = not_exact(evidence.remarks)
        yield CheckFinding(Severity.LOSS if known else Severity.DAMAGE, f"not identical: {text}")
    elif not result.checked:
        yield CheckFinding(Severity.LOSS, "contains no ticks to recompute")
    else:
        times = result.checked * 1e-3 / evidence.seen.computing
        text = f"all {result.checked} ticks are identical to the bit, computed {times:.0f} times as fast as real time"
        yield CheckFinding(Severity.SOUND, text)


CHECKS = (
    Check(
        "numbers",
        "Ticks, events, clock probes and log messages are in order, and the file notes every missing one. Their counts "
        "equal those that the file states. The log channel has every number from the first record to the last. Missing "
        "frame reports are a loss, because displays send them on a channel that may lose messages.",
        check_numbers,
    ),
    Check(
        "file",
        "The checksums of the whole file, of its index and of every chunk are right. It is a loss if the file was "
        "recovered, ends before its block, was computed instead of recorded, or was imported from rounded numbers.",
        lambda evidence: check_end(evidence.recording),
    ),
    Check(
        "forces",
        "The rendered force of every device is known at every tick after its first sample ([when it is "
        "not](../../src/netboard/recording/format/FORMAT.md#8-accounting-for-every-tick)). An unknown force in a trial "
        "is a loss.",
        lambda evidence: check_rendered(evidence.recording),
    ),
    Check(
        "time",
        "Ticks are 1 ms apart, except where the server reported a stall of the same duration. Events and log times "
        "never decrease. Where records were lost, the report of a stall may be lost, too.",
        check_time,
    ),
    Check(
        "triggers",
        "Each event with a code had a pulse of the trigger box. One without is a loss: a recording of EEG or video "
        "lacks its mark.",
        check_triggers,
    ),
    Check("clocks", "The clock offsets of all peers are plausible: see below.", _clocks, needs_config=True),
    Check(
        "configuration",
        "The configuration matches its SHA-256, the metadata, and the copy in the server's own event `block_began`.",
        _configuration,
        needs_config=True,
    ),
    Check(
        "devices",
        "The check lists what each hand held, which displays nobody saw, and every stand-in for a haptic device or a "
        "screen, with the words that confirmed it. None of this is a fault of the file.",
        _devices,
        needs_config=True,
    ),
    Check(
        "trials",
        "Targets change side from trial to trial. A success is followed by the next trial, a failure by the same one. "
        "The counts of the trial state machine are right, and the block has as many trials as planned. There is no "
        "force where the condition has none, in catch trials, or between trials. The list of attempts at the end of "
        "the file agrees with the ticks.",
        _trials,
        needs_config=True,
    ),
    Check(
        "plan",
        "The block agrees, key by key, with the plan of its study. The study is in the session's journal, which must "
        "be beside the recording.",
        lambda evidence: check_plan(evidence.recording.path, evidence.config) if evidence.is_played else (),
        needs_config=True,
    ),
    Check(
        "journal",
        "Outcome, completion time and flags of each attempt are judged again from the ticks, and equal those in the "
        "journal. If only a part of an attempt is in this file, only its outcome is compared. Two differences are "
        "losses, not damage: the journal of a killed server may end before its recording, and a display that reported "
        "its frames too late may have the flag `frozen_display` only in the journal.",
        lambda evidence: (
            check_journal(evidence.recording, evidence.config, evidence.seen, evidence.verdicts)
            if evidence.is_played
            else ()
        ),
        needs_config=True,
    ),
    Check(
        "replay",
        "With `--verify`: every tick, computed from its inputs, is bit-identical to the recorded one.",
        _replay,
    ),
)
"""Registry of the integrity checks, in the order of a report.

A new check is one entry: reports, documentation and tests follow.
"""
