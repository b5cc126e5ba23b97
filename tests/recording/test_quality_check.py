"""Quality flags of a recording's attempts equal those of the server."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from netboard.base.config import Config, resolve
from netboard.base.safeguards import Safeguard
from netboard.base.tables.experiment import Quality
from netboard.base.tables.rig import RecordingSettings
from netboard.base.tick import TICK, TICK_SECONDS
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.records import FrameRecord, TickRecord
from netboard.recording.files.provenance import provenance
from netboard.recording.files.reader import Recording as OpenRecording
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.integrity.quality_check import judged
from netboard.services.cli import app
from netboard.task.trials.quality import Referee, Verdict
from netboard.task.trials.state_machine import Cause, Phase
from samples import MS, OPENED_NS

LENGTH = 2000
CONFIG = Config(quality=Quality(late_ticks=3, clipped_share=0.01))


def session() -> np.ndarray:
    """Three attempts: one is beyond doubt, one late and clipped, and the last is not over."""
    rows = np.zeros(3 * LENGTH, TICK)
    rows["tick"] = np.arange(rows.size)
    rows["time_ns"] = rows["tick"] * MS
    for side in ("left", "right"):
        rows[f"{side}_live"] = 1
        rows[f"{side}_stamp_ns"] = rows["tick"] * MS + 1
        rows[f"{side}_sent_z"] = rows["tick"] * 1e-6
    for number in range(3):
        part = rows[number * LENGTH : (number + 1) * LENGTH]
        part["trial"], part["attempt"], part["target"] = number + 1, 1, 1
        part["phase"][:500], part["phase"][500:], part["phase"][1200:] = Phase.LEVELLING, Phase.RUNNING, Phase.HOLDING
        part["event"][[499, 1199]] = Cause.LEVEL, Cause.ENTERED
        part["run_ticks"][500:] = np.arange(1500)
        part["mark_ticks"][1200:] = 700
        if number < 2:
            part["event"][-1] = Cause.HELD
    rows["late_ns"][LENGTH + 600 : LENGTH + 610] = MS
    rows["left_safeguards"][LENGTH + 600 : LENGTH + 700] = Safeguard.ARMED | Safeguard.CLAMPED
    return rows


def frames() -> list[FrameRecord]:
    """Of two displays; the right one freezes for a while in the second attempt."""
    shown = [(side, tick) for tick in range(0, 3 * LENGTH, 16) for side in ("left", "right")]
    frozen = range(LENGTH + 600, LENGTH + 900)
    kept = [(side, tick) for side, tick in shown if side == "left" or tick not in frozen]
    return [FrameRecord(k, side, tick, tick * MS, tick * MS + 5, 0) for k, (side, tick) in enumerate(kept)]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    welcome = Welcome("a1b2c3d4", 1, 0, resolve(CONFIG))
    metadata = provenance(welcome, CONFIG, 1, OPENED_NS, 0)
    writer = RecordingWriter(tmp_path / "S01.mcap", metadata, welcome.config, RecordingSettings(), OPENED_NS)
    rows, shown = session(), frames()
    records = sorted(
        [(int(row["tick"]), TickRecord(row.tobytes())) for row in rows]
        + [(frame.tick + 500, frame) for frame in shown],
        key=lambda record: record[0],
    )
    for number, (tick, record) in enumerate(records):
        writer.write(record, number, OPENED_NS + tick * MS)
    writer.finish(OPENED_NS + 3 * LENGTH * MS)
    return tmp_path / "S01.mcap"


def live() -> list[Verdict]:
    """Verdicts of the server, which gets ticks in tens and frames half a second after they were painted."""
    rows, waiting = session(), frames()
    referee = Referee(CONFIG, Safeguard.CLAMPED)
    found: list[Verdict] = []
    for first in range(0, rows.size, 10):
        found += referee.watch(rows, first, 10)
        while waiting and waiting[0].tick + 500 < first + 10:
            frame = waiting.pop(0)
            referee.paint(frame.station, frame.tick, frame.painted_ns)
    return found


def test_flags_of_a_recording_equal_those_of_the_live_session(path: Path) -> None:
    with OpenRecording(path) as recording:
        found = judged(recording)
    assert [(verdict.trial, verdict.outcome, verdict.completion, verdict.flags) for verdict in found] == [
        (1, "success", 700 * TICK_SECONDS, ()),
        (2, "success", 700 * TICK_SECONDS, ("late_ticks", "clipped", "frozen_display")),
    ]
    assert list(found) == live()


def test_info_lists_flagged_attempts(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    result = CliRunner().invoke(app, ["info", str(path)])
    assert result.exit_code == 0, result.exception
    assert "a force was at its limit for too large a share of the time" in result.output
    assert "Flagged attempts: 1 of 2" in result.output
