"""Recordings of a dyad's session: a dyadic and a bimanual block, random bits, all outcomes, and a gap."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config, resolve
from netboard.base.tables.rig import RecordingSettings
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.records import ClockRecord, EventRecord, TickRecord
from netboard.recording.files.provenance import provenance
from netboard.recording.files.writer import RecordingWriter
from netboard.testing.difficult_recording import START_NS, make_rows

UTC_NS = 1_790_000_000_000_000_000
MINUTE_NS = 60_000_000_000
NAMES = {"dyad": "D-07", "name": "S_2", "participant_b": "P22", "hand_b": "left", "seat_a": "right"}
JOINED = {"side": "left", "name": "vm:1", "model": "Touch", "serial": "123-45"}


def make_session(folder: Path) -> list[Path]:
    """Make the recordings of two blocks."""
    return [dyad(folder / "S_2_D-07_block01.mcap"), solo(folder / "S_2_D-07_block02.mcap", minute=3)]


def dyad(path: Path, *, block: Mapping[str, Any] | None = None, **more: Any) -> Path:
    """Record a dyadic block."""
    return _record(path, {"force": "partner_only", "catch": (2,), "label": "a\tb", **(block or {})}, **more)


def solo(path: Path, **more: Any) -> Path:
    """Record a block of participant B with both hands."""
    block = {"number": 2, "configuration": "bimanual", "performer": "B"}
    return _record(path, block, rows=make_rows(2), **more)


def _record(
    path: Path,
    block: Mapping[str, Any],
    *,
    rows: NDArray[np.void] | None = None,
    names: Mapping[str, str] | None = None,
    session: str = "3f2a9c1e",
    minute: int = 0,
    clocks: Sequence[tuple[str, int, int]] = (),
    events: Sequence[EventRecord] = (),
    opened_monotonic: int = START_NS,
    welcome: int = START_NS,
) -> Path:
    """Write a recording; `clocks` are peer, offset and bound of probes, `events` those after the ticks."""
    default = Config()
    config = replace(
        default,
        session=replace(default.session, **(NAMES | dict(names or {}))),
        block=replace(default.block, blocks=2, **block),
        agents=replace(default.agents, left=replace(default.agents.left, device="openhaptics")),
    )
    text = resolve(config)
    utc_ns = UTC_NS + minute * MINUTE_NS
    metadata = provenance(Welcome(session, 1, welcome, text), config, 1, utc_ns, opened_monotonic)
    writer = RecordingWriter(path, metadata, text, RecordingSettings(), utc_ns)
    records = [
        EventRecord(0, -1, START_NS, "agent_joined", JOINED),
        *(ClockRecord(k, peer, 0, 0, 0, 0, *estimate, 0.0) for k, (peer, *estimate) in enumerate(clocks)),
        *(TickRecord(row.tobytes()) for row in (make_rows(1) if rows is None else rows)),
        *events,
    ]
    for number, record in enumerate(records):
        writer.write(record, number, utc_ns + number * 1_000_000)
    writer.finish(utc_ns + len(records) * 1_000_000)
    return path
