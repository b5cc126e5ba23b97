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

import proofs
from netboard.base.config import Config, resolve
from netboard.base.tables.simulated import Participant
from netboard.base.tick import TICK_NS
from netboard.network.protocol.records import BLOCK_BEGAN, ClockRecord, EventRecord, FrameRecord, TickRecord
from netboard.nodes.rehearsal.block import START_TICK, Rehearsal
from netboard.nodes.server.attempts import Attempts
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
    """A rehearsed block in which an operator gives commands: at given ticks, and at random ones.

    Parameters
    ----------
    config : Config
        Rig and experiment.
    chance : random.Random or None
        Chooses what is wished; None for nothing.
    given : mapping of int to Cause
        Commands by their tick.
    """

    def __init__(self, config: Config, chance: random.Random | None, given: Mapping[int, Cause]) -> None:
        super().__init__(config, PEOPLE)
        self._chance, self._given, self._trials = chance, given, config.block.trials

    def rows(self) -> NDArray[Any]:
        """All ticks, once."""
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
    """What a server has made of a block.

    Attributes
    ----------
    config : Config
        Rig and experiment.
    rows : ndarray of TICK
        The ticks.
    records : list of Record
        The records of the log channel, in order.
    entries : list of Entry
        What the journal says.
    trouble : str
        Nothing: the journal can be written.
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

    Parameters
    ----------
    config : Config
        Rig and experiment.
    rows : ndarray of TICK, shape (n,)
        The ticks.
    reported_ticks : int
        The left display reports its frames so many ticks later at most [1].
    stood_still : int
        Tick before which the server stood still for 30 ms; 0 for none [1].
    """
    made = Session(config, rows)
    if stood_still:
        rows["time_ns"][stood_still:] += 30 * TICK_NS
    attempts = Attempts(journal=made)  # type: ignore[arg-type]
    attempts.open(config, proofs.SESSION)
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
            attempts.record_decision(Cause(int(row["event"])), row, after, rows, number)
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
    """State after the last tick: as it was, and the block is over."""
    after = row.copy()
    after["phase"] = Phase.FINISHED
    return after


def _note(made: Session, tick: int, name: str, details: dict[str, str]) -> None:
    seq = sum(isinstance(record, EventRecord) for record in made.records)
    time_ns = int(made.rows["time_ns"][min(tick, len(made.rows) - 1)])
    made.records.append(EventRecord(seq, tick, time_ns, name, details))


def write(folder: Path, made: Session, cuts: Sequence[int] = ()) -> list[Path]:
    """Write the records and the journal as files.

    Parameters
    ----------
    folder : Path
        Where.
    made : Session
        The session.
    cuts : sequence of int
        Numbers of records at which another logger goes on [1].
    """
    lines = [line_of(entry, "now") for entry in (HEADER, *made.entries)]
    journal_path(folder, made.config).write_bytes(b"".join(lines))
    paths = []
    bounds = [0, *cuts, len(made.records)]
    for part, (first, stop) in enumerate(pairwise(bounds), start=1):
        path = folder / f"S01_D01_{proofs.SESSION[:8]}_block01_part{part}.mcap"
        writer = proofs.writer_of(path, made.config, {"part": str(part), "block": "1"})
        now = proofs.UTC_NS
        for number in range(first, stop):
            now = proofs.UTC_NS + number * proofs.MS // 2
            writer.write(made.records[number], number, now)
            if writer.is_due(now):
                writer.flush(now)
        writer.finish(now, "complete" if stop == len(made.records) else "the logger was stopped")
        paths.append(path)
    return paths
