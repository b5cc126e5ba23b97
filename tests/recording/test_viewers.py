"""The requirements of PlotJuggler's and Foxglove's loaders, and reading with the upstream library."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import msgpack
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

from netboard.base.tick import TICK
from netboard.recording.format.channels import CHANNELS, IDS
from samples import random_rows, write_recording

ROWS = random_rows(300, seed=9)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    rows = ROWS.copy()
    for name in TICK.names:
        if TICK[name].kind == "f":
            rows[name] = rows["tick"] / 7
    return write_recording(tmp_path_factory.mktemp("viewers") / "a.mcap", rows)


@pytest.fixture(scope="module")
def schemas(recording: Path) -> dict[str, dict[str, Any]]:
    """Schema of each channel, by topic, from the summary: loaders read nothing else before they list the channels."""
    with recording.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert set(summary.channels) == set(IDS.values())
    for channel in summary.channels.values():
        assert channel.schema_id != 0, "PlotJuggler skips a channel without a schema record"
        assert channel.message_encoding == ("json" if channel.topic == "/plot" else "msgpack")
        assert summary.schemas[channel.schema_id].encoding == "jsonschema"
    return {c.topic: json.loads(summary.schemas[c.schema_id].data) for c in summary.channels.values()}


def test_every_schema_is_a_self_contained_object(schemas: dict[str, dict[str, Any]]) -> None:
    for schema in schemas.values():
        jsonschema.Draft202012Validator.check_schema(schema)
        assert schema["type"] == "object"
        assert all(value.startswith("#") for value in _references(schema))


def _references(schema: Any) -> list[str]:
    if isinstance(schema, dict):
        own = [schema["$ref"]] if "$ref" in schema else []
        return own + [found for value in schema.values() for found in _references(value)]
    return [found for value in schema for found in _references(value)] if isinstance(schema, list) else []


def test_every_plotted_field_is_a_number(recording: Path, schemas: dict[str, dict[str, Any]]) -> None:
    properties = schemas["/plot"]["properties"]
    assert {field["type"] for field in properties.values()} == {"integer", "number"}
    with recording.open("rb") as file:
        plotted = [json.loads(m.data) for _, _, m in make_reader(file).iter_messages(topics=["/plot"])]
    assert len(plotted) == 15
    for values in plotted:
        assert list(values) == list(properties)
        assert all(type(value) in (int, float) for value in values.values())
        row = ROWS[values["tick"]]
        assert values["phase"] == row["phase"]
        assert values["theta"] == pytest.approx(values["tick"] / 7, rel=1e-6)


@pytest.mark.parametrize("unknown", [np.nan, np.inf, -np.inf])
def test_number_that_is_not_finite_is_left_out_of_the_plotted_ones(tmp_path: Path, unknown: float) -> None:
    """JSON has no text for it, and both viewers refuse the whole message."""
    rows = random_rows(60, seed=9)
    rows["left_rendered"], rows["right_rendered"] = unknown, 1e300
    with write_recording(tmp_path / "a.mcap", rows).open("rb") as file:
        found = list(make_reader(file).iter_messages(topics=["/plot"]))
    for schema, _, message in found:
        assert schema is not None
        values = json.loads(message.data, parse_constant=lambda text: pytest.fail(f"{text} is not JSON"))
        jsonschema.Draft202012Validator(json.loads(schema.data)).validate(values)
        assert "left_rendered" not in values
        assert values["right_rendered"] == 1e300
    assert len(found) == 3


def test_mcap_library_reads_the_file_seeking_and_as_a_stream(recording: Path) -> None:
    counts = dict.fromkeys(IDS, 0)
    with recording.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert schema is not None
            decode = json.loads if channel.message_encoding == "json" else msgpack.unpackb
            jsonschema.Draft202012Validator(json.loads(schema.data)).validate(decode(message.data))
            counts[channel.topic] += 1
    assert all(counts[channel.topic] for channel in CHANNELS if channel.topic not in ("/logger", "/backfill"))
    with recording.open("rb") as file:
        kinds = [type(record).__name__ for record in StreamReader(file, validate_crcs=True).records]
    assert (kinds[0], kinds[-1]) == ("Header", "Footer")


def test_mcap_summary_agrees_with_the_contents(recording: Path) -> None:
    """What the `mcap` command's doctor looks at: counts, times, and chunks in the order of their times."""
    with recording.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        messages = [message for _, _, message in reader.iter_messages(log_time_order=False)]
    assert summary is not None
    statistics = summary.statistics
    assert statistics is not None
    assert statistics.message_count == len(messages)
    assert statistics.chunk_count == len(summary.chunk_indexes)
    assert statistics.channel_count == statistics.schema_count == len(CHANNELS)
    assert statistics.message_start_time == min(message.log_time for message in messages)
    assert statistics.message_end_time == max(message.log_time for message in messages)
    for index in summary.chunk_indexes:
        assert index.message_start_time <= index.message_end_time
        assert set(index.message_index_offsets) <= set(summary.channels)
