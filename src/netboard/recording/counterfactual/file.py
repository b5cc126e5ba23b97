"""Saves a counterfactual replay as a recording: the attempts only, with the changed configuration, marked as such.

The session id is derived from the source's id and the changes, so that the account of a session never mixes the two.
There are gaps between the attempts, so that the file verifies by itself: after a gap, verification continues from the
recorded state.
"""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path

from netboard.base.config import Config, resolve
from netboard.network.protocol.records import EventRecord, TickRecord
from netboard.recording.counterfactual.what_if import WhatIf, attempts_of
from netboard.recording.files.offline_writer import event_of
from netboard.recording.files.provenance import config_sha256
from netboard.recording.files.writer import RecordingWriter


def keep(
    path: Path, found: WhatIf, config: Config, source: Mapping[str, str], name: str, changes: Sequence[str]
) -> int:
    """Write the attempts."""
    text, said = resolve(config), "; ".join(changes)
    session = hashlib.sha256(f"{source['session']} {said}".encode()).hexdigest()[:32]
    metadata = {
        **source,
        "session": session,
        "name": config.session.name,
        "dyad": config.session.dyad,
        "study": config.session.study,
        "block": str(config.block.number),
        "config_sha256": config_sha256(text.encode()),
        "what_if": said,
        "source": name,
        "source_session": source["session"],
    }
    opened_ns = int(source["opened_log_ns"])
    writer = RecordingWriter(path, metadata, text, config.recording, opened_ns)
    rows = attempts_of(found)
    number = events = 0
    now_ns = opened_ns
    try:
        for row in rows:
            now_ns = opened_ns + int(row["time_ns"] - rows["time_ns"][0])
            writer.write(TickRecord(row.tobytes()), number, now_ns)
            number += 1
            if row["event"]:
                event = EventRecord(events, int(row["tick"]), int(row["time_ns"]), *event_of(row))
                writer.write(event, number, now_ns)
                number, events = number + 1, events + 1
            if writer.is_due(now_ns):
                writer.flush(now_ns)
        writer.finish(now_ns)
    except BaseException:
        writer.abandon()
        raise
    return len(rows)
