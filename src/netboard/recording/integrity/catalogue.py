"""The catalogue of a folder: what each recording, unfinished file, spill and journal is, without reading it whole.

An entry is made of what a file says at its ends: metadata, configuration, end record. Trials are counted in the
attempts. Its verdict is a quick one, of what the file says of itself, unless `netboard.recording.integrity.checking` is
asked. Nothing here raises because of what is in a file: what is wrong with it is in its entry.
"""

import mmap
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from datetime import date
from pathlib import Path

from mcap.records import Attachment, Chunk, ChunkIndex, Metadata
from mcap.stream_reader import StreamReader

from netboard.base.config import Config, parse
from netboard.base.errors import NetboardError
from netboard.network.protocol.joining import Welcome
from netboard.recording.files.provenance import CONFIG_NAME, METADATA
from netboard.recording.files.reader import Recording
from netboard.recording.format.chunks import UNSOUND
from netboard.recording.integrity.checking import check
from netboard.recording.integrity.severity import VERDICTS, Grade
from netboard.recording.recovery.spill import read_spill
from netboard.task.journal.entries import AttemptEnded, BlockEnded, Lines, read_lines
from netboard.task.studies.factors import factors_of, role_of

JOURNAL = ".journal.jsonl"
"""What the name of a journal ends with."""

_UNREADABLE = (*UNSOUND, NetboardError, OSError, ValueError, EOFError, IndexError)


@dataclass(frozen=True, slots=True)
class Entry:
    """One file.

    Attributes
    ----------
    dyad, session, study : str
        Pseudonymous id of the dyad, label of the session, name of the study; empty where it is not known.
    opened : str
        When it was begun, UTC, in ISO 8601; empty where it is not known.
    block, blocks : int
        Which block of the plan, of how many; 0 for none [1].
    role : str
        What its trials are for; empty for what is no recording.
    factors : dict of str
        Level of each factor of its study, with value and unit.
    done, trials : int
        Trials done, and planned in the block or, for a journal, done only [1].
    duration : float or None
        From its beginning to its end; None where one of them is not known [s].
    """

    path: Path
    kind: str
    size: int = 0
    dyad: str = ""
    session: str = ""
    study: str = ""
    pilot: bool = False
    opened: str = ""
    block: int = 0
    blocks: int = 0
    role: str = ""
    factors: dict[str, str] = field(default_factory=dict)
    condition: str = ""
    done: int = 0
    trials: int = 0
    duration: float | None = None
    lost: int = 0
    verdict: str = VERDICTS[Grade.SOUND]
    why: str = ""


@dataclass(frozen=True, slots=True)
class Filter:
    """What is wanted of a catalogue; None for anything."""

    dyad: str | None = None
    study: str | None = None
    verdict: str | None = None
    since: date | None = None
    pilot: bool | None = None

    def takes(self, entry: Entry) -> bool:
        """Tell whether a file is wanted, as far as its ends can tell: whatever its verdict."""
        return (
            self.dyad in (None, entry.dyad)
            and self.study in (None, entry.study)
            and self.pilot in (None, entry.pilot)
            and (self.since is None or entry.opened[:10] >= self.since.isoformat())
        )

    def likes(self, entry: Entry) -> bool:
        """Tell whether a file has the verdict that is wanted."""
        if self.verdict is None:
            return True
        return entry.verdict == self.verdict if self.verdict in VERDICTS else entry.verdict.startswith(self.verdict)


def files_in(folder: Path) -> list[Path]:
    """List the files that a catalogue is of, below a folder."""
    endings = (".mcap", ".mcap.part", ".spill", JOURNAL)
    return sorted(path for path in folder.rglob("*") if path.name.endswith(endings) and path.is_file())


def entry_of(path: Path) -> Entry:
    """Say what a file is, from its ends."""
    try:
        size = path.stat().st_size
        if path.name.endswith(JOURNAL):
            return _journal(path, size, read_lines(path.read_bytes(), path.name))
        if path.suffix == ".spill":
            return _spill(path, size)
        if path.suffix == ".part":
            return _begun(Entry(path, "unfinished", size, verdict=VERDICTS[Grade.DAMAGE], why="not finished"))
        return _recording(path, size)
    except _UNREADABLE as error:
        kind = "unfinished" if path.suffix == ".part" else path.suffix.removeprefix(".").replace("mcap", "recording")
        damaged = Entry(path, kind, verdict=VERDICTS[Grade.DAMAGE], why=str(error) or type(error).__name__)
        return _begun(damaged) if kind == "recording" else damaged


def _recording(path: Path, size: int) -> Entry:
    """Say what a finished recording is."""
    with Recording(path) as recording:
        said, end = recording.metadata, recording.end
        lost = int(end.get("lost", 0))
        why = [] if end.get("ended", "") == "complete" else [f"ends early: {end.get('ended', 'it was recovered')}"]
        why += [f"{lost} records lost"] if lost else []
        why += [f"recovered, lost: {recording.recovery['damage']}"] if recording.recovery.get("damage") else []
        why += ["computed, not recorded"] if "what_if" in said else []
        entry = _about(Entry(path, "recording", size), said, recording.config_text)
        return replace(
            entry,
            duration=_duration(said, end),
            lost=lost,
            verdict=VERDICTS[Grade.LOSS if why else Grade.SOUND],
            why="; ".join(why),
        )


def _duration(said: dict[str, str], end: dict[str, str]) -> float | None:
    """Return how long a recording took, if it says when it began and ended [s]."""
    if "opened_log_ns" not in said or "log_ns" not in end:
        return None
    return max(int(end["log_ns"]) - int(said["opened_log_ns"]), 0) * 1e-9


def _about(entry: Entry, said: dict[str, str], config_text: str) -> Entry:
    """Enter what metadata and configuration say."""
    config = parse(config_text, "its configuration")
    return replace(
        _named(entry, config),
        block=int(said.get("block", 0)),
        blocks=int(said.get("blocks", 0)),
        opened=said.get("opened_utc", ""),
    )


def _named(entry: Entry, config: Config) -> Entry:
    """Enter what a configuration says."""
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


def _begun(entry: Entry) -> Entry:
    """Enter what an unfinished or damaged file says at its beginning, as far as that can be read."""
    said: dict[str, str] = {}
    try:
        with entry.path.open("rb") as file:
            for record in StreamReader(file, emit_chunks=True).records:
                if isinstance(record, Metadata) and record.name == METADATA:
                    said = dict(record.metadata)
                elif isinstance(record, Attachment) and record.name == CONFIG_NAME:
                    return replace(_about(entry, said, record.data.decode()), size=entry.path.stat().st_size)
                elif isinstance(record, Chunk | ChunkIndex):
                    break
    except _UNREADABLE:
        pass  # which its verdict tells already
    return replace(entry, dyad=said.get("dyad", ""), session=said.get("name", ""), study=said.get("study", ""))


def _spill(path: Path, size: int) -> Entry:
    """Say what a server wrote down because no logger took it."""
    entry = Entry(path, "spill", size, verdict=VERDICTS[Grade.DAMAGE], why="no logger took it: netboard recover")
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        welcome = next((message for _, _, message in read_spill(data) if isinstance(message, Welcome)), None)
    return entry if welcome is None else _named(entry, parse(welcome.config, "its configuration"))


def _journal(path: Path, size: int, lines: Lines) -> Entry:
    """Say what the journal of a session tells."""
    header, entries = lines.header, lines.entries
    done = {(e.block, e.trial) for e in entries if isinstance(e, AttemptEnded) and e.outcome in ("success", "skipped")}
    over = {e.block for e in entries if isinstance(e, BlockEnded) and e.how != "stopped"}
    return Entry(
        path,
        "journal",
        size,
        dyad=header.dyad,
        session=header.name,
        study=header.study,
        pilot=header.pilot,
        condition=f"session {header.session}, {len(over)} blocks over",
        done=len(done),
        verdict=VERDICTS[Grade.LOSS if lines.torn else Grade.SOUND],
        why="its last line was torn" if lines.torn else "",
    )


def with_trials(entry: Entry) -> Entry:
    """Count the trials of a finished recording; one that has less than planned is complete with a loss."""
    if entry.kind != "recording" or entry.verdict == VERDICTS[Grade.DAMAGE]:
        return entry
    try:
        with Recording(entry.path) as recording:
            attempts = recording.attempts()
    except NetboardError as error:
        return replace(entry, verdict=VERDICTS[Grade.DAMAGE], why=str(error))
    # Trials of the parts before are not in this file, but their numbers are known.
    done = {attempt.trial for attempt in attempts if attempt.outcome in ("success", "skip")}
    before = min((attempt.trial for attempt in attempts), default=1) - 1
    return replace(entry, done=len(done) + before)


def with_check(entry: Entry) -> Entry:
    """Give a file the verdict of a full check."""
    if entry.kind == "journal":
        return entry
    report = check(entry.path)
    why = [finding.text for finding in report.findings if finding.grade != Grade.SOUND]
    return replace(entry, verdict=report.verdict, why="; ".join(why))


def in_order(entries: Iterable[Entry]) -> Iterator[tuple[tuple[str, str], list[Entry]]]:
    """Group files by dyad and session, in order of blocks and of time; a journal comes first."""
    groups: dict[tuple[str, str], list[Entry]] = {}
    for entry in entries:
        groups.setdefault((entry.dyad, entry.session), []).append(entry)
    for name in sorted(groups):
        yield name, sorted(groups[name], key=lambda e: (e.kind != "journal", e.opened, e.block, e.path.name))
