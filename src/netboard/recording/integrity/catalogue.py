"""Catalogue of a folder: recordings, unfinished files, spills and journals, without reading them completely.

An entry comes from the beginning and the end of a file: metadata, configuration, end record. Trials are counted in the
list of attempts. The result is a quick one, from what the file states, unless `netboard.recording.integrity.checking`
runs a full check. No content of a file raises an exception here; problems are listed in its entry.
"""

import mmap
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from datetime import date
from functools import partial
from pathlib import Path

from mcap.records import Attachment, Chunk, ChunkIndex, Metadata
from mcap.stream_reader import StreamReader

from netboard.base.config import Config, parse
from netboard.base.errors import NetboardError, RecordingError
from netboard.base.plural import plural
from netboard.base.tick import TICK_SECONDS
from netboard.network.protocol.joining import Welcome
from netboard.recording.files.copies import CopiesFound
from netboard.recording.files.locate import EMPTY, files_below, recovery_advice
from netboard.recording.files.provenance import CONFIG_NAME, MetadataName
from netboard.recording.files.reader import Recording
from netboard.recording.format.channels import TICKS
from netboard.recording.format.chunks import UNSOUND
from netboard.recording.format.rig import rig_of
from netboard.recording.integrity.checking import check, continues
from netboard.recording.integrity.quality_check import losses_stated
from netboard.recording.integrity.severity import RESULTS, CheckFinding, Severity
from netboard.recording.integrity.stream_check import check_end
from netboard.recording.integrity.trial_check import NO_TICKS, check_done
from netboard.recording.integrity.walk import is_played
from netboard.recording.recovery.spill import read_spill
from netboard.task.journal.entries import AttemptEnded, BlockEnded, JournalContent, read_lines
from netboard.task.studies.factors import factors_of, role_of

JOURNAL = ".journal.jsonl"
"""File name ending of journals."""

_UNREADABLE = (*UNSOUND, NetboardError, OSError, ValueError, EOFError, IndexError)


@dataclass(frozen=True, slots=True)
class CatalogueEntry:
    """Catalogue entry of one file."""

    path: Path
    kind: str
    size: int = 0
    # Pseudonymous id of the dyad, label of the session, name of the study; empty if unknown.
    dyad: str = ""
    session: str = ""
    study: str = ""
    pilot: bool = False
    opened: str = ""  # start time, UTC, in ISO 8601; empty if unknown
    # Number of the block and number of blocks in the plan; 0 for none.
    block: int = 0
    blocks: int = 0
    role: str = ""  # purpose of its trials; empty for other files than recordings
    factors: dict[str, str] = field(default_factory=dict)  # level of each factor of the study, with value and unit
    condition: str = ""
    stand_ins: tuple[str, ...] = ()  # what stood in for a haptic device or a screen; known once trials are counted
    # Trials done, and trials planned in the block or requested as repeats; a journal has only the former.
    done: int = 0
    trials: int = 0
    duration: float | None = None  # time of all its ticks; None for other files than recordings [s]
    lost: int = 0
    verdict: str = RESULTS[Severity.SOUND]
    why: str = ""
    excluded: str = ""  # how many trials the analysis will exclude, and why; empty for none
    copy_of: str = ""  # the recording that has the same ticks and counts instead; empty for none


@dataclass(frozen=True, slots=True)
class Filter:
    """Filter for a catalogue; None matches everything."""

    dyad: str | None = None
    study: str | None = None
    verdict: str | None = None
    since: date | None = None
    pilot: bool | None = None

    def matches(self, entry: CatalogueEntry) -> bool:
        """Return True if a file matches in all but its result, by its beginning and end."""
        return (
            self.dyad in (None, entry.dyad)
            and self.study in (None, entry.study)
            and self.pilot in (None, entry.pilot)
            and (self.since is None or entry.opened[:10] >= self.since.isoformat())
        )

    def matches_result(self, entry: CatalogueEntry) -> bool:
        """Return True if the result of a file matches, or begins with the given words."""
        if self.verdict is None:
            return True
        # "complete" is also the beginning of "complete with listed losses".
        return entry.verdict == self.verdict if self.verdict in RESULTS else entry.verdict.startswith(self.verdict)


def files_in(folder: Path) -> list[Path]:
    """List the files below a folder that belong in a catalogue."""
    return files_below(folder, (".mcap", ".mcap.part", ".spill", JOURNAL))


def entry_of(path: Path) -> CatalogueEntry:
    """Make the entry of a file from its beginning and end."""
    try:
        size = path.stat().st_size
        if path.name.endswith(JOURNAL):
            return _journal(path, size, read_lines(path.read_bytes(), path.name))
        if not size:
            raise RecordingError(EMPTY)
        if path.suffix == ".spill":
            return _spill(path, size)
        if path.suffix == ".part":
            why = f"not finished; {recovery_advice(path)}"
            return _begun(CatalogueEntry(path, "unfinished", size, verdict=RESULTS[Severity.DAMAGE], why=why))
        return _recording(path, size)
    except _UNREADABLE as error:
        kind = "unfinished" if path.suffix == ".part" else path.suffix.removeprefix(".").replace("mcap", "recording")
        unread = f"cannot be read: {error.strerror}" if isinstance(error, OSError) and error.strerror else ""
        why = unread or str(error) or type(error).__name__
        damaged = CatalogueEntry(path, kind, verdict=RESULTS[Severity.DAMAGE], why=why)
        return _begun(damaged) if kind == "recording" else damaged


def _recording(path: Path, size: int) -> CatalogueEntry:
    with Recording(path) as recording:
        metadata, end = recording.metadata, recording.end
        lost = int(end.get("lost", 0))
        why = [finding.text for finding in check_end(recording)] + [f"{lost} records were lost"] * bool(lost)
        entry = _about(CatalogueEntry(path, "recording", size), metadata, recording.config_text)
        return replace(
            entry,
            duration=recording.counts[TICKS] * TICK_SECONDS,
            lost=lost,
            verdict=RESULTS[Severity.LOSS if why else Severity.SOUND],
            why="; ".join(why),
        )


def _about(entry: CatalogueEntry, metadata: dict[str, str], config_text: str) -> CatalogueEntry:
    """Add metadata and configuration to an entry."""
    config = parse(config_text, "its configuration")
    return replace(
        _named(entry, config),
        block=int(metadata.get("block", 0)),
        blocks=int(metadata.get("blocks", 0)),
        opened=metadata.get("opened_utc", ""),
    )


def _named(entry: CatalogueEntry, config: Config) -> CatalogueEntry:
    """Add the values of a configuration to an entry."""
    session, block, role = config.session, config.block, role_of(config)
    declared = factors_of(config)
    factors = {one.name: one.summary for one in declared}
    named = block.label or f"{block.configuration}, force {block.force}"
    if declared and block.label:
        of_block = (one.text() for one in declared if one.scope != "trial")
        named = ", ".join((block.label.partition(", ")[0], *of_block))
    return replace(
        entry,
        dyad=session.dyad,
        session=session.name,
        study=session.study,
        pilot=session.pilot,
        role=role,
        factors=factors,
        condition=named if role == "test" or named.startswith(role) else f"{named} ({role})",
        trials=block.trials,
    )


def _begun(entry: CatalogueEntry) -> CatalogueEntry:
    """Add the readable metadata from the start of an unfinished or damaged file."""
    metadata: dict[str, str] = {}
    try:
        with entry.path.open("rb") as file:
            for record in StreamReader(file, emit_chunks=True).records:
                if isinstance(record, Metadata) and record.name == MetadataName.OPENED:
                    metadata = dict(record.metadata)
                elif isinstance(record, Attachment) and record.name == CONFIG_NAME:
                    return replace(_about(entry, metadata, record.data.decode()), size=entry.path.stat().st_size)
                elif isinstance(record, Chunk | ChunkIndex):
                    break
    except _UNREADABLE:
        pass  # the result already says so
    dyad, session, study = (metadata.get(key, "") for key in ("dyad", "name", "study"))
    return replace(entry, dyad=dyad, session=session, study=study)


def _spill(path: Path, size: int) -> CatalogueEntry:
    why = f"no logger received it; {recovery_advice(path)}"
    entry = CatalogueEntry(path, "spill", size, verdict=RESULTS[Severity.DAMAGE], why=why)
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        welcome = next((message for _, _, message in read_spill(data) if isinstance(message, Welcome)), None)
    return entry if welcome is None else _named(entry, parse(welcome.config, "its configuration"))


def _journal(path: Path, size: int, lines: JournalContent) -> CatalogueEntry:
    header, entries = lines.header, lines.entries
    done = {(e.block, e.trial) for e in entries if isinstance(e, AttemptEnded) and e.outcome in ("success", "skipped")}
    over = {e.block for e in entries if isinstance(e, BlockEnded) and e.how != "stopped"}
    return CatalogueEntry(
        path,
        "journal",
        size,
        dyad=header.dyad,
        session=header.name,
        study=header.study,
        pilot=header.pilot,
        condition=f"session {header.session}, {plural(len(over), 'block')} over",
        done=len(done),
        verdict=RESULTS[Severity.LOSS if lines.torn else Severity.SOUND],
        why="its last line is incomplete" if lines.torn else "",
    )


def with_repeats(entries: Iterable[CatalogueEntry], repeats: CopiesFound) -> list[CatalogueEntry]:
    """Mark the copies among files, and as damaged those that claim to be the same recording and are not."""
    copies = {copy.path: copy for copy in repeats.copies}
    marked = []
    for entry in entries:
        if copy := copies.get(entry.path):
            why = "; ".join(filter(None, (entry.why, copy.about(copy.of.name))))
            marked.append(replace(entry, copy_of=str(copy.of), why=why))
            continue
        found = [str(one) for one in repeats.conflicts if entry.path in (one.one, one.other)]
        marked.append(_worse(entry, CheckFinding(Severity.DAMAGE, "; ".join(found))) if found else entry)
    return marked


def with_trials(entry: CatalogueEntry) -> CatalogueEntry:
    """Count the trials of a finished recording; fewer than planned, or than requested as repeats, are a listed loss."""
    if entry.kind != "recording" or entry.verdict == RESULTS[Severity.DAMAGE]:
        return entry
    try:
        with Recording(entry.path) as recording:
            attempts = recording.attempts()
            rig = rig_of(recording.config, recording.metadata, recording.events(), attempts)
            entry = replace(entry, stand_ins=tuple(rig.stand_ins))
            if not is_played(recording):
                return replace(entry, done=len({one.trial for one in attempts if one.outcome in ("success", "skip")}))
            rows = recording.ticks(attempts[-1].stop - 1 if attempts else None)
            if not len(rows):
                return _worse(entry, NO_TICKS)
            tally, finding = check_done(recording.config, rows, partial(continues, recording))
            excluded = losses_stated(recording).text
    except NetboardError as error:
        return replace(entry, verdict=RESULTS[Severity.DAMAGE], why=str(error))
    return _worse(replace(entry, done=tally.done, trials=tally.wanted, excluded=excluded), finding)


def _worse(entry: CatalogueEntry, finding: CheckFinding) -> CatalogueEntry:
    """Add a finding to the result of a file, unless it is as expected."""
    if finding.severity == Severity.SOUND:
        return entry
    severity = max(finding.severity, Severity(RESULTS.index(entry.verdict)))
    return replace(entry, verdict=RESULTS[severity], why="; ".join(filter(None, (entry.why, finding.text))))


def with_check(entry: CatalogueEntry) -> CatalogueEntry:
    """Replace the quick result of a file by that of a full check."""
    if entry.kind == "journal":
        return entry
    report = check(entry.path)
    why = [finding.text for finding in report.findings if finding.severity != Severity.SOUND]
    return replace(entry, verdict=report.result, why="; ".join(why), excluded=report.excluded)


def in_order(entries: Iterable[CatalogueEntry]) -> Iterator[tuple[tuple[str, str], list[CatalogueEntry]]]:
    """Group files by dyad and session, sorted by block and time, with the journal first."""
    groups: dict[tuple[str, str], list[CatalogueEntry]] = {}
    for entry in entries:
        groups.setdefault((entry.dyad, entry.session), []).append(entry)
    for name in sorted(groups):
        yield name, sorted(groups[name], key=lambda e: (e.kind != "journal", e.block, e.opened, e.path.name))
