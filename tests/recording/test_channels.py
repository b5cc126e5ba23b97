"""The channel table against what it describes, and ticks to the bit."""

import contextlib
import json
from dataclasses import fields

import jsonschema
import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from samples import random_rows, records

from netboard.errors import RecordingError
from netboard.recording.channels import CHANNELS, IDS, decode_ticks, encode_tick, remark, stamped, unpack
from netboard.tick import TICK
from netboard.wire.messages import ClockRecord, EventRecord, FrameRecord

CLASSES = {"/event": EventRecord, "/clock": ClockRecord, "/frame": FrameRecord, "/logger": EventRecord}


def test_the_table_has_every_field_in_order() -> None:
    assert [field.name for field in CHANNELS[0].fields] == list(TICK.names)
    for channel in CHANNELS[1:]:
        assert [field.name for field in channel.fields] == [field.name for field in fields(CLASSES[channel.topic])]


def test_every_number_has_a_unit() -> None:
    for channel in CHANNELS:
        for field in channel.fields:
            assert bool(field.unit) == (field.kind in ("integer", "number")), field


def test_schemas_are_valid_json_schemas() -> None:
    for channel in CHANNELS:
        jsonschema.Draft202012Validator.check_schema(json.loads(channel.schema()))


@pytest.mark.parametrize("seed", range(3))
def test_messages_follow_their_schemas(seed: int) -> None:
    validators = {c.topic: jsonschema.Draft202012Validator(json.loads(c.schema())) for c in CHANNELS}
    messages = [stamped(record) for record in records(random_rows(20, seed))]
    messages.append(remark(0, "log_lost", {"first": "3", "count": "2"}, 5))
    assert {message.topic for message in messages} == set(IDS)
    for message in messages:
        validators[message.topic].validate(msgpack.unpackb(message.data))


@given(st.binary(min_size=TICK.itemsize, max_size=TICK.itemsize))
def test_any_bits_of_a_tick_survive(row: bytes) -> None:
    message = encode_tick(row)
    assert decode_ticks([message, message]).tobytes() == row + row


def test_any_msgpack_decoder_reads_a_tick() -> None:
    row = random_rows(1)[0]
    values = msgpack.unpackb(encode_tick(row.tobytes()))
    assert list(values) == list(TICK.names)
    for name in TICK.names:
        assert np.array(values[name], TICK[name]).tobytes() == row[name].tobytes(), name


def test_a_tick_written_anew_by_another_tool_is_read_by_name() -> None:
    row = random_rows(1)[0]
    values = msgpack.unpackb(encode_tick(row.tobytes()))
    shuffled = msgpack.packb(dict(sorted(values.items(), reverse=True)))
    assert decode_ticks([shuffled])[0].tobytes() == row.tobytes()


def test_a_tick_of_another_version_is_refused() -> None:
    with pytest.raises(RecordingError, match="different versions"):
        encode_tick(bytes(TICK.itemsize + 8))
    with pytest.raises(RecordingError, match="without the field"):
        decode_ticks([msgpack.packb({"tick": 1})])


def test_no_ticks_are_an_empty_array() -> None:
    assert decode_ticks([]).dtype == TICK
    assert decode_ticks([]).shape == (0,)


@given(st.binary(max_size=40))
def test_nonsense_is_a_map_or_a_recording_error(data: bytes) -> None:
    with contextlib.suppress(RecordingError):
        assert isinstance(unpack(data), dict)


def test_stamps_come_from_the_source() -> None:
    rows = random_rows(9)
    tick, event, clock, frame = (records(rows)[k] for k in (0, 4, 7, 10))
    assert (stamped(tick).sequence, stamped(tick).publish_time_ns) == (0, rows[0]["time_ns"])
    for record, stamp in ((event, event.time_ns), (clock, clock.t3_ns), (frame, frame.painted_ns)):
        assert (stamped(record).sequence, stamped(record).publish_time_ns) == (record.seq, stamp)
