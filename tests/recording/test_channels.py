"""The channel table agrees with the records that it describes."""

import contextlib
import json
from dataclasses import fields

import jsonschema
import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.errors import RecordingError
from netboard.base.tick import RENDERED, TICK
from netboard.network.protocol.records import BackfillRecord, ClockRecord, EventRecord, FrameRecord, TickRecord
from netboard.recording.format.channels import CHANNELS, IDS, remark, stamped, unpack
from samples import random_rows, records

CLASSES = {
    "/event": EventRecord,
    "/clock": ClockRecord,
    "/frame": FrameRecord,
    "/logger": EventRecord,
    "/backfill": BackfillRecord,
}


def test_channel_table_lists_every_field_in_order() -> None:
    by_topic = {channel.topic: channel for channel in CHANNELS}
    ticks, plot = by_topic.pop("/ticks"), by_topic.pop("/plot")
    assert [(field.name, field.kind) for field in ticks.columns] == [
        (name, "integer" if TICK[name].kind == "i" else "number") for name in TICK.names
    ]
    assert set(plot.fields) < set(ticks.columns)
    for channel in by_topic.values():
        assert [field.name for field in channel.fields] == [field.name for field in fields(CLASSES[channel.topic])]


def test_every_number_has_a_unit() -> None:
    for channel in CHANNELS:
        for field in (*channel.fields, *channel.columns):
            assert bool(field.unit) == (field.kind in ("integer", "number")), field


META = jsonschema.Draft202012Validator(jsonschema.Draft202012Validator.META_SCHEMA)


def test_schemas_are_valid_json_schemas() -> None:
    for channel in CHANNELS:
        schema = json.loads(channel.schema())
        assert META.is_valid(schema), list(META.iter_errors(schema))


@pytest.mark.parametrize("seed", range(3))
def test_messages_follow_their_schemas(seed: int) -> None:
    validators = {c.topic: jsonschema.Draft202012Validator(json.loads(c.schema())) for c in CHANNELS}
    stream = records(random_rows(20, seed))
    messages = [stamped(record) for record in stream if not isinstance(record, TickRecord)]
    messages.append(remark(0, "log_lost", {"first": "3", "count": "2"}, 5))
    messages.append(stamped(BackfillRecord(0, "left", 3, np.ones(2, RENDERED).tobytes())))
    assert {message.topic for message in messages} == set(IDS) - {"/ticks", "/plot"}
    for message in messages:
        validators[message.topic].validate(msgpack.unpackb(message.data))


@given(st.binary(max_size=40))
def test_unpacking_any_bytes_gives_a_map_or_a_recording_error(data: bytes) -> None:
    with contextlib.suppress(RecordingError):
        assert isinstance(unpack(data), dict)


def test_sequence_and_publish_time_come_from_the_source() -> None:
    rows = random_rows(9)
    event, clock, frame = (records(rows)[k] for k in (4, 7, 10))
    backfill = BackfillRecord(4, "right", 3, np.ones(2, RENDERED).tobytes())
    assert (stamped(backfill).sequence, stamped(backfill).publish_time_ns) == (4, 1 - 3)
    for record, stamp in ((event, event.time_ns), (clock, clock.t3_ns), (frame, frame.painted_ns)):
        assert (stamped(record).sequence, stamped(record).publish_time_ns) == (record.seq, stamp)
