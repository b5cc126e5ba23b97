"""Account of a session: every tick is in one of its parts, or listed as lost with its cause.

Each block of a session has one or several parts. A part holds records with consecutive numbers and notes the ones that
are missing; together, the parts must cover every number. Numbers that they do not cover, and ticks that are missing
without a note, are unexplained: there must be none. A pause of the trial must have a cause, too.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.errors import RecordingError
from netboard.network.protocol.records import BLOCK_BEGAN, EventRecord
from netboard.recording.files.reader import Recording
from netboard.recording.format.channels import LOG_TOPICS
from netboard.recording.format.summary import find_gaps
from netboard.task.trials.state_machine import STAGE_FAULT, Cause

_PAUSES = (Cause.PAUSE, Cause.FAULT)
_NAME = re.compile(r"(.+?)(?:_\d{8}T\d{6}Z)?_([A-Za-z0-9]{1,8})(?:_block\d+)?(?:_part\d+)?(?:\.recovered)?")


class NumberRange(NamedTuple):
    """A range of consecutive numbers."""

    first: int
    last: int
    cause: str = ""  # why the numbers are missing; empty for present ones, or if the cause is unknown


class PauseRecord(NamedTuple):
    """A pause of the trial."""

    tick: int
    cause: str


class Part(NamedTuple):
    """One file of a session."""

    path: Path
    # Log-channel number of the first record, and of the one after the last.
    first_record: int
    next_record: int
    ended: str  # ``complete``, or why the file ends before its block; empty for a recovered file without an end record
    damage: str


@dataclass(frozen=True, slots=True)
class Account:
    """Account of all ticks of a session."""

    session: str
    parts: tuple[Part, ...]
    present: tuple[NumberRange, ...]
    lost: tuple[NumberRange, ...]
    unexplained: tuple[NumberRange, ...]
    # Records of any kind that no part holds, by their log-channel numbers, with causes.
    lost_records: tuple[NumberRange, ...]
    unexplained_records: tuple[NumberRange, ...]
    pauses: tuple[PauseRecord, ...]
    events: tuple[EventRecord, ...]

    @property
    def complete(self) -> bool:
        """Whether the recording reaches the end of the session."""
        last = max(part.next_record for part in self.parts)
        return any(part.next_record == last and part.ended == "complete" for part in self.parts)

    @property
    def sound(self) -> bool:
        """Whether every tick, record and pause is accounted for."""
        return not (self.unexplained or self.unexplained_records) and all(pause.cause for pause in self.pauses)


def parts_of(path: Path) -> list[Path]:
    """Find the files of a recording's session in its folder, by name."""
    name = _NAME.fullmatch(path.stem)
    if name is None:
        return [path]
    others = ((file, _NAME.fullmatch(file.stem)) for file in path.parent.glob("*.mcap"))
    return sorted(file for file, other in others if other and other.groups() == name.groups())


class _Loss(NamedTuple):
    """A loss noted by the logger: record numbers, the widest possible range of ticks, and the cause."""

    records: NumberRange
    ticks: NumberRange


class _Read(NamedTuple):
    """Data of one part."""

    session: str
    part: Part
    ticks: NDArray[Any]
    events: tuple[EventRecord, ...]
    remarks: tuple[EventRecord, ...]


def account_of(paths: Sequence[Path]) -> Account:
    """Account for every tick of a session.

    Raises `RecordingError` if a part is damaged or unfinished (recover it first), or the parts belong to different
    sessions.
    """
    read = sorted((_read(path) for path in paths), key=lambda found: found.part.first_record)
    sessions = {found.session for found in read}
    if len(sessions) != 1:
        raise RecordingError(f"expected the parts of one session, found {' and '.join(sorted(sessions)) or 'none'}")
    events = {event.seq: event for found in read for event in found.events}
    causes = [event for event in events.values() if event.name == "log_lost"]
    losses = [[*_losses(found, causes)] for found in read]
    ticks = np.concatenate([found.ticks for found in read])
    ticks = ticks[np.unique(ticks["tick"], return_index=True)[1]]
    present, missing = _present(ticks["tick"], _opened(events))
    lost, unexplained = _split(missing, [loss.ticks for part in losses for loss in part] + _damaged_ticks(read))
    parts = tuple(found.part for found in read)
    lost_records, unexplained_records = _split(
        _missing_records(parts, losses), [loss.records for part in losses for loss in part] + _damaged_records(parts)
    )
    return Account(
        session=sessions.pop(),
        parts=parts,
        present=present,
        lost=lost,
        unexplained=unexplained,
        lost_records=lost_records,
        unexplained_records=unexplained_records,
        pauses=tuple(_pauses(ticks, events.values())),
        events=tuple(events[seq] for seq in sorted(events)),
    )


def _read(path: Path) -> _Read:
    with Recording(path) as recording:
        remarks = recording.remarks()
        first = recording.first_record or 0
        written = sum(recording.counts[topic] for topic in LOG_TOPICS)
        lost = sum(int(remark.details["count"]) for remark in remarks if remark.name == "log_lost")
        part = Part(
            path=path,
            first_record=first,
            next_record=int(recording.end.get("next_record", first + written + lost)),
            ended=recording.end.get("ended", ""),
            damage=recording.recovery.get("damage", ""),
        )
        ticks = np.sort(recording.ticks()[["tick", "event", "command"]], order="tick")
        return _Read(recording.metadata["session"], part, ticks, recording.events(), remarks)


def _opened(events: dict[int, EventRecord]) -> int:
    """Return the tick at which the session was opened; earlier ticks are not recorded."""
    first = events.get(0)
    return first.tick if first is not None and first.name == BLOCK_BEGAN else 0


def _present(ticks: NDArray[np.int64], opened: int) -> tuple[tuple[NumberRange, ...], list[NumberRange]]:
    """Return the ranges of present ticks, and those of missing ones between and before them."""
    if not ticks.size:
        return (), []
    gaps = find_gaps(np.concatenate([[opened - 1], ticks]))
    missing = [NumberRange(gap.first, gap.first + gap.count - 1) for gap in gaps]
    _, present = _split([NumberRange(opened, int(ticks[-1]))], missing)
    return present, missing


def _losses(found: _Read, causes: Sequence[EventRecord]) -> Iterator[_Loss]:
    """Yield the losses that a part's logger noted."""
    unreadable = {int(r.details["number"]): r.details["reason"] for r in found.remarks if r.name == "log_unreadable"}
    for remark in found.remarks:
        if remark.name != "log_lost":
            continue
        first, count = int(remark.details["first"]), int(remark.details["count"])
        records = NumberRange(first, first + count - 1)
        cause = cause_of_loss(records, causes) or found.part.damage or "the server no longer had them"
        if first in unreadable:
            cause = f"could not be read: {unreadable[first]}"
        # Ticks are numbered without gaps, so lost ones directly precede the next one present.
        after = int(remark.details.get("after_tick", -1))
        place = int(np.searchsorted(found.ticks["tick"], after, "right"))
        last = int(found.ticks["tick"][place]) - 1 if place < found.ticks.size else after + count
        yield _Loss(records._replace(cause=cause), NumberRange(last - count + 1, last, cause))


def cause_of_loss(records: NumberRange, causes: Sequence[EventRecord]) -> str:
    """Return the cause that the server gave for a loss of records, or an empty string."""
    for event in causes:
        first, count = int(event.details["first"]), int(event.details["count"])
        if first <= records.last and records.first < first + count and event.details["cause"]:
            return event.details["cause"]
    return ""


def _damaged_ticks(read: Sequence[_Read]) -> list[NumberRange]:
    """Return the ticks that may have been in the unrecoverable data of a part."""
    ranges = []
    for place, found in enumerate(read):
        if found.part.damage and found.ticks.size:
            following = next((later.ticks for later in read[place + 1 :] if later.ticks.size), found.ticks[-1:])
            ranges.append(NumberRange(int(found.ticks["tick"][0]), int(following["tick"][0]), found.part.damage))
    return ranges


def _damaged_records(parts: Sequence[Part]) -> list[NumberRange]:
    """Return the records that may have been in the unrecoverable data of a part."""
    return [
        NumberRange(part.first_record, later.first_record - 1, part.damage)
        for part, later in pairwise(parts)
        if part.damage
    ]


def _missing_records(parts: Sequence[Part], losses: Sequence[Sequence[_Loss]]) -> tuple[NumberRange, ...]:
    """Return the records that no part holds."""
    held: list[NumberRange] = []
    for part, lost in zip(parts, losses, strict=True):
        _, kept = _split([NumberRange(part.first_record, part.next_record - 1)], [loss.records for loss in lost])
        held.extend(kept)
    _, missing = _split([NumberRange(0, max((part.next_record - 1 for part in parts), default=-1))], held)
    return missing


def _split(
    ranges: Iterable[NumberRange], by: Iterable[NumberRange]
) -> tuple[tuple[NumberRange, ...], tuple[NumberRange, ...]]:
    """Split ranges into the parts that lie in one of other ranges, each with the cause of the first, and the rest."""
    inside: list[NumberRange] = []
    rest = [whole for whole in ranges if whole.first <= whole.last]
    for known in by:
        uncut, rest = rest, []
        for whole in uncut:
            first, last = max(whole.first, known.first), min(whole.last, known.last)
            if first > last:
                rest.append(whole)
                continue
            inside.append(NumberRange(first, last, known.cause))
            sides = (NumberRange(whole.first, first - 1), NumberRange(last + 1, whole.last))
            rest.extend(side for side in sides if side.first <= side.last)
    return tuple(sorted(inside)), tuple(sorted(rest))


def _pauses(ticks: NDArray[Any], events: Iterable[EventRecord]) -> Iterator[PauseRecord]:
    """Yield every pause with its cause from the server's events."""
    reported = {(event.name, event.tick): event for event in events if event.name in ("pause", "fault")}
    for row in ticks[np.isin(ticks["event"], _PAUSES)]:
        tick, name = int(row["tick"]), Cause(int(row["event"])).name.lower()
        # The event is written after the tick, so the server may assign it to the next one.
        event = reported.get((name, tick)) or reported.get((name, tick + 1))
        if event is None:
            yield PauseRecord(tick, "")
        elif row["command"] != row["event"]:
            yield PauseRecord(tick, STAGE_FAULT)
        else:
            yield PauseRecord(tick, event.details.get("notice", "").removeprefix("paused: ") or "the operator")
