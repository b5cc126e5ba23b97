"""Valid sessions in memory: simulated participants, a server, and an operator who sends allowed commands.

A session is the trial machine, the attempts with its journal, and the log channel's records in the order in which a
server makes them. The records become files as a logger writes them: whole, or in parts where a logger was restarted.
"""

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rehearsed
from netboard.base.config import Config, resolve
from netboard.base.tables.simulated import Participant
from netboard.base.tick import TICK_NS
from netboard.network.protocol.records import BLOCK_BEGAN, ClockRecord, EventRecord, FrameRecord, TickRecord
from netboard.nodes.server.attempts import Attempts
from netboard.participants.seat.block import START_TICK, Rehearsal
from netboard.recording.files.offline_writer import event_of
from netboard.recording.recovery.journal_file import journal_path
from netboard.task.journal.entries import Entry, Header, line_of
from netboard.task.trials.state_machine import Cause, Phase

Record = TickRecord | EventRecord | ClockRecord | FrameRecord

WISHES = (Cause.PAUSE, Cause.FAULT, Cause.ABORT, Cause.SKIP, Cause.REPEAT, Cause.VETO)
PEOPLE = {"A": Participant(), "B": Participant()}

HEADER = Header(
    format=1,
    study="own",
    study_digest="",
    plan_digest="",
    seed=1,
    dyad="D01",
    name="S01",
    session=1,
    participants=("A", "B"),
    pilot=True,
    consent=False,
    netboard="0",
    config_digest="",
)


class Operated(Rehearsal):
    """A rehearsed block in which an operator gives commands: those `given` by tick, and random ones from `chance`."""

    def __init__(self, config: Config, chance: random.Random | None, given: Mapping[int, Cause]) -> None:
        super().__init__(config, PEOPLE)
        self._chance, self._given, self._trials = chance, given, config.block.trials

    def rows(self) -> NDArray[Any]:
        """Return each tick once."""
        return np.concatenate([rows.copy() for rows in self.pieces(200)])

    def _command(self, commands: NDArray[np.int64]) -> None:
        super()._command(commands)
        first = self._ticks
        if self._chance is not None and first > START_TICK:
            commands[self._chance.randrange(20)] = self._wish(self._chance)
        for tick, cause in self._given.items():
            if first <= tick < first + len(commands):
                commands[tick - first] = cause

    def _wish(self, chance: random.Random) -> Cause:
        state = self._state[0]
        if int(state["phase"]) == Phase.PAUSED:
            return chance.choice((Cause.RESUME, Cause.RESUME, Cause.NONE, Cause.SKIP))
        wish = chance.choice(WISHES) if chance.random() < 0.03 else Cause.NONE
        to_come = int(state["extra"]) > max(int(state["trial"]) - self._trials, 0)
        return Cause.NONE if wish == Cause.VETO and not to_come else wish


@dataclass
class Session:
    """A block as a server records it: its ticks, the records of the log channel, and the entries of the journal.

    It replaces the server's journal, with `append`, `close`, and `trouble`, the reason if it cannot be written.
    """

    config: Config
    rows: NDArray[Any]
    records: list[Record] = field(default_factory=list)
    entries: list[Entry] = field(default_factory=list)
    trouble: str = ""

    def append(self, entry: Entry) -> None:
        """Take a line of the journal."""
        self.entries.append(entry)

    def close(self) -> None:
        """End the journal."""


def session_of(config: Config, rows: NDArray[Any], reported_ticks: int = 500, stood_still: int = 0) -> Session:
    """Let a server follow a block's ticks.

    The left display reports its frames every `reported_ticks`. Before the tick `stood_still`, if it is not 0, the
    server stalls for 30 ms.
    """
    made = Session(config, rows)
    if stood_still:
        rows["time_ns"][stood_still:] += 30 * TICK_NS
    attempts = Attempts(journal=made)  # type: ignore[arg-type]
    attempts.open(config, rehearsed.SESSION)
    attempts.begin(config, 0)
    _note(made, 0, BLOCK_BEGAN, {"config": resolve(config)})
    frames = 0
    for number, row in enumerate(rows):
        if number == stood_still and stood_still:
            _note(made, number, "stood_still", {"milliseconds": "30"})
        made.records.append(TickRecord(row.tobytes()))
        if row["event"]:
            after = rows[number + 1] if number + 1 < len(rows) else _over(row)
            _note(made, number, *event_of(row))
            attempts.record_decision(rows, number, after)
        if number % 10 == 0:
            attempts.poll(rows, number + 1)
        if number and number % reported_ticks == 0:
            for tick in range(number - reported_ticks, number, 17):
                frame = FrameRecord(frames, "left", tick, tick * TICK_NS, tick * TICK_NS, 0)
                made.records.append(frame)
                attempts.painted(frame)
                frames += 1
    _note(made, len(rows), "session_ended", {})
    attempts.close()
    return made


def _over(row: Any) -> Any:
    """Return the state after the last tick: that of the tick, with the block finished."""
    after = row.copy()
    after["phase"] = Phase.FINISHED
    return after


def _note(made: Session, tick: int, name: str, details: dict[str, str]) -> None:
    seq = sum(isinstance(record, EventRecord) for record in made.records)
    time_ns = int(made.rows["time_ns"][min(tick, len(made.rows) - 1)])
    made.records.append(EventRecord(seq, tick, time_ns, name, details))


def write(folder: Path, made: Session, cuts: Sequence[int] = ()) -> list[Path]:
    """Write the records and the journal as files; at the records `cuts` another logger continues."""
    lines = [line_of(entry, "now") for entry in (HEADER, *made.entries)]
    journal_path(folder, made.config).write_bytes(b"".join(lines))
    paths = []
    bounds = [0, *cuts, len(made.records)]
    for part, (first, stop) in enumerate(pairwise(bounds), start=1):
        path = folder / f"S01_D01_{rehearsed.SESSION[:8]}_block01_part{part}.mcap"
        writer = rehearsed.writer_of(path, made.config, {"part": str(part), "block": "1"})
        now = rehearsed.UTC_NS
        for number in range(first, stop):
            now = rehearsed.UTC_NS + number * rehearsed.MS // 2
            writer.write(made.records[number], number, now)
            if writer.is_due(now):
                writer.flush(now)
        writer.finish(now, "complete" if stop == len(made.records) else "the logger was stopped")
        paths.append(path)
    return paths
