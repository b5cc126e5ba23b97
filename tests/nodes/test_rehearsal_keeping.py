"""A rehearsed block is a valid recording: it verifies, has its events, and is marked as rehearsed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.tables.simulated import Participant
from netboard.participants.seat.block import Rehearsal
from netboard.recording.files.offline_writer import BlockWriter
from netboard.recording.files.reader import Recording
from netboard.recording.format.summary import find_attempts
from netboard.recording.integrity.verification import verify_recording

SESSION = "0123456789abcdef"
UTC_NS = 1_700_000_000_000_000_000


def config() -> Config:
    default = Config()
    return replace(default, block=replace(default.block, trials=2, number=4, blocks=18))


@pytest.mark.slow
def test_rehearsed_block_is_a_complete_recording(tmp_path: Path) -> None:
    keeper = BlockWriter(tmp_path, config(), SESSION, UTC_NS)
    rehearsal = Rehearsal(config(), {"A": Participant(), "B": Participant()})
    for rows in rehearsal.pieces():
        keeper.take(rows)
    keeper.finish()
    assert keeper.path.name == "S01_D01_block04_01234567.mcap"
    summary = rehearsal.summary()
    with Recording(keeper.path) as recording:
        assert verify_recording(recording).identical
        ticks, events = recording.ticks(), recording.events()
    assert (ticks["tick"] == np.arange(summary.ticks)).all()
    names = [event.name for event in events]
    assert (names[0], names[1], names[-2], names[-1]) == ("session_started", "start", "last", "session_ended")
    assert events[0].details["rehearsed"] == "true"
    assert [event.seq for event in events] == list(range(len(events)))
    held = [event for event in events if event.name == "held"]
    assert [float(event.details["completion"]) for event in held] == list(summary.completions)
    assert [event.details["to"] for event in held] == ["succeeded"] * 2
    assert [a.completion for a in find_attempts(ticks) if a.outcome == "success"] == list(summary.completions)


def test_existing_recording_is_not_overwritten(tmp_path: Path) -> None:
    keeper = BlockWriter(tmp_path, config(), SESSION, UTC_NS)
    keeper.finish()
    with pytest.raises(ConfigError, match="block04"):
        BlockWriter(tmp_path, config(), SESSION, UTC_NS)
