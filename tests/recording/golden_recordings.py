"""Writes the golden recording of the present format, and its JSON twin; run it once, when a format is new.

    PYTHONPATH=tests:tests/recording python tests/recording/golden_recordings.py

The files of older formats were written by this script too, with the netboard of their time. They are never written
again.
"""

import hashlib
import json
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np

from netboard.base.config import parse, resolve
from netboard.base.tick import TICK
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.records import ClockRecord, EventRecord, FrameRecord, TickRecord
from netboard.recording.files.provenance import provenance
from netboard.recording.files.reader import Recording
from netboard.recording.files.writer import RecordingWriter
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import Cause

HERE = Path(__file__).parent.parent / "data" / "recordings"
TICKS = 900
OPENED_NS = 1_790_000_000_000_000_000
MS = 1_000_000


def moved(config):
    """Ticks of a board that two hands level and then tilt, until the ball is in the target."""
    time = np.arange(TICKS) * 1e-3
    rows = np.zeros(TICKS, TICK)
    rows["tick"] = np.arange(TICKS)
    rows["time_ns"] = 10**12 + np.arange(TICKS) * MS
    rows["command"][5] = Cause.START
    for sign, side in ((-1.0, "left"), (1.0, "right")):
        height = 0.002 * np.sin(9.0 * time) + sign * 0.03 * np.clip(time - 0.06, 0.0, None)
        rows[f"{side}_live"] = 1
        rows[f"{side}_seq"] = np.arange(TICKS)
        rows[f"{side}_stamp_ns"] = rows["time_ns"] - 310_000
        rows[f"{side}_sent_z"] = height
        rows[f"{side}_sent_vz"] = np.gradient(height, time)
        rows[f"{side}_loop_ns"] = 370_000 + np.arange(TICKS)
        rows[f"{side}_y"] = sign * 0.3
    stage = make_stage(config)
    stage.advance(stage.initial(), rows, 0, TICKS)
    rows["right_rendered"][7] = np.nan
    return rows


def stream(rows):
    """Records as a server sends them."""
    for k, row in enumerate(rows):
        yield TickRecord(row.tobytes())
        if row["event"]:
            yield EventRecord(k, k, int(row["time_ns"]), Cause(int(row["event"])).name.lower(), {"trial": "1"})
        if k % 100 == 50:
            yield ClockRecord(k // 100, "agent.left", k, k + 2**40, k + 2**40 + 5, k + 300, 2**40, 150, 2.5)
        if k % 16 == 7:
            yield FrameRecord(k // 16, "right", k, 5 * k, 5 * k + 3, k // 100)


def write(path):
    """Write the recording."""
    quick = "[task]\nlevel_time = 0.02\nlevel_angle_deg = 8.0\nhold_time = 0.02\n[geometry]\ntarget_distance = 0.03\n"
    config = parse(quick, "golden")
    text = resolve(config)
    welcome = Welcome("3f2a9c1e00000000", 1, 10**12 - MS, text)
    writer = RecordingWriter(path, provenance(welcome, config, 1, OPENED_NS, 42), text, config.recording, OPENED_NS)
    number = 0
    for number, record in enumerate(stream(moved(config))):
        if number == 300:
            writer.note_lost(300, 0, OPENED_NS + 300 * MS)
        writer.write(record, number, OPENED_NS + number * MS)
        if number % 150 == 149:
            writer.flush(OPENED_NS + number * MS)
    writer.finish(OPENED_NS + number * MS)


def content_of(path):
    """Return the content of the recording."""
    with Recording(path) as recording:
        rows = recording.ticks()
        return {
            "format": recording.metadata["format"],
            "config_sha256": recording.metadata["config_sha256"],
            "ticks": len(rows),
            "columns": {name: hashlib.sha256(rows[name].tobytes()).hexdigest() for name in TICK.names},
            "tilt_of_tick_200": float(rows["theta"][200]),
            "events": [asdict(event) for event in recording.events()],
            "clocks": [asdict(clock) for clock in recording.clocks()],
            "frames": [asdict(frame) for frame in recording.frames()],
            "remarks": [asdict(remark) for remark in recording.remarks()],
            "end": recording.end,
        }


if __name__ == "__main__":
    HERE.mkdir(exist_ok=True)
    made = HERE / f"format-{sys.argv[1]}.mcap"
    write(made)
    made.with_suffix(".json").write_text(json.dumps(content_of(made), indent=1) + "\n", encoding="utf-8")
