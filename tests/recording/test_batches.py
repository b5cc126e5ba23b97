"""Ticks in batches of columns: equal to the bit for any content, and their index."""

import json
from contextlib import closing
from pathlib import Path

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from netboard.base.config import Config, parse
from netboard.base.errors import RecordingError
from netboard.base.tables.rig import RecordingSettings as Settings
from netboard.base.tick import TICK, TICK_NS
from netboard.benchmarks.recording.movement import FIRST_MOVEMENT, record
from netboard.network.protocol.records import TickRecord
from netboard.recording.files.container import Container
from netboard.recording.files.reader import Recording
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.format.batches import PLACES, PLACES_NAME, BatchLayout, attempt_values, attempts_of, pack
from netboard.recording.format.channels import CHANNELS, PLOTTED_EVERY
from netboard.recording.format.decoding import MOST
from netboard.recording.format.predictions import CONSTANTS, UNKNOWN, constants_of
from netboard.recording.format.summary import find_attempts
from samples import CONFIG_TEXT, OPENED_NS, SPECIAL, metadata, random_rows

SCHEMA = CHANNELS[0].schema()
DEFAULT = constants_of(Config())
GOLDEN = Path(__file__).parent.parent / "data" / "recordings" / "format-2.mcap"


def message(rows: np.ndarray, constants: dict[str, float] = DEFAULT, **other: object) -> bytes:
    numbers = [constants[name] for name in CONSTANTS]
    values = {"first": 0, "time_ns": 0, "count": len(rows), "constants": numbers, "columns": pack(rows, constants)}
    return bytes(msgpack.packb(values | other))


def read(layout: BatchLayout, *messages: bytes) -> np.ndarray:
    columns = layout.decode(messages, TICK.names)
    rows = np.zeros(len(columns["tick"]), TICK)
    for name, column in columns.items():
        rows[name] = column
    return rows


ODD = (0, 1, -1, 2**62, -(2**63), *SPECIAL.view(np.int64).tolist())
WORDS = st.sampled_from(ODD) | st.integers(-(2**63), 2**63 - 1)
ROW = st.lists(WORDS, min_size=len(TICK.names), max_size=len(TICK.names))


@given(st.lists(ROW, min_size=1, max_size=5), st.sampled_from((UNKNOWN, DEFAULT)))
def test_batch_round_trip_preserves_any_bits(words: list[list[int]], constants: dict[str, float]) -> None:
    rows = np.array(words, np.int64).view(TICK)[:, 0]
    assert read(BatchLayout(SCHEMA), message(rows, constants)).tobytes() == rows.tobytes()


def test_batches_decoded_together_equal_batches_decoded_alone() -> None:
    rows = random_rows(17)
    other = DEFAULT | {"left_k": 7.0, "moves": 0.0}
    messages = [message(rows[:5]), message(rows[5:6], other), message(rows[6:], UNKNOWN)]
    assert read(BatchLayout(SCHEMA), *messages).tobytes() == rows.tobytes()
    found = BatchLayout(SCHEMA).decode(messages, ("left_rendered",))
    assert list(found) == ["left_rendered"]
    assert found["left_rendered"].tobytes() == rows["left_rendered"].tobytes()


@pytest.mark.parametrize("setting", ["", "physics.hold=cv", "block.force_scale=2.0"])
@pytest.mark.parametrize("names", [TICK.names, ("left_rendered",), ("late_ns", "omega"), ("right_az", "tick")])
def test_compiled_decoder_equals_that_of_files_with_other_predictions(setting: str, names: tuple[str, ...]) -> None:
    config = parse("", overrides=[setting] if setting else [])
    rows = record(config, FIRST_MOVEMENT, 300)
    parts = (rows[:1], rows[1:3], rows[3:], random_rows(50))
    messages = [message(part, constants_of(config)) for part in parts]
    schema = json.loads(SCHEMA)
    schema["predictions"]["spare"] = schema["predictions"]["zz"]  # which numpy evaluates, as all of that file
    found = [BatchLayout(one).decode(messages, names) for one in (SCHEMA, json.dumps(schema).encode())]
    for name in names:
        assert found[0][name].tobytes() == found[1][name].tobytes() == np.concatenate(parts)[name].tobytes(), name


@pytest.mark.parametrize("count", [1, MOST, MOST + 1, 3 * MOST])
def test_batch_of_any_length_keeps_its_bits(count: int) -> None:
    rows = random_rows(count)
    assert (
        read(BatchLayout(SCHEMA), message(rows), message(rows[:1])).tobytes()
        == np.concatenate([rows, rows[:1]]).tobytes()
    )


def test_columns_are_found_wherever_they_are_in_a_message() -> None:
    rows = random_rows(5)
    values = msgpack.unpackb(message(rows))
    first = msgpack.packb({"columns": values.pop("columns")} | values)
    assert read(BatchLayout(SCHEMA), first).tobytes() == rows.tobytes()
    mark = "a" * 20 + "\xa7columns\xc6"
    noted = msgpack.packb({"note": mark, "mark": b"\xa7columns\xc6\0\0\0\1"} | msgpack.unpackb(message(rows)))
    assert read(BatchLayout(SCHEMA), noted).tobytes() == rows.tobytes()
    cut = message(rows)[:-1]
    with pytest.raises(RecordingError, match="not msgpack"):
        BatchLayout(SCHEMA).decode([cut], ("tick",))


@pytest.mark.parametrize(
    "setting", ["", "physics.hold=zoh", "physics.hold=cv", "physics.coupling=left", "block.force_scale=2.0"]
)
def test_predictable_columns_are_stored_as_zeros(setting: str) -> None:
    config = parse("", overrides=[setting] if setting else [])
    rows = record(config, FIRST_MOVEMENT, 300)
    planes = np.frombuffer(pack(rows, constants_of(config)), np.uint8).reshape(len(TICK.names), 8, 300)
    for name in ("used_z", "used_vz", "used_az", "coupling", "force", "z", "az", "seen_ns", "seen_vz"):
        for side in ("left", "right"):
            wrong = planes[TICK.names.index(f"{side}_{name}"), :, 30:].any(axis=0)
            assert not wrong.any(), f"{side}_{name} of {wrong.sum()} ticks"


def test_unknown_prediction_formula_is_refused() -> None:
    schema = json.loads(SCHEMA)
    schema["predictions"]["left_z"] = "__import__('os').abort()"
    with pytest.raises(RecordingError, match="left_z is predicted as"):
        BatchLayout(json.dumps(schema).encode())


def test_reordered_missing_and_extra_columns_are_read_by_name() -> None:
    rows = random_rows(5)
    schema = json.loads(SCHEMA)
    kept = [column for column in reversed(schema["columns"]) if column["name"] != "completion"]
    places = [TICK.names.index(column["name"]) for column in kept]
    planes = np.frombuffer(pack(rows, DEFAULT), np.uint8).reshape(len(TICK.names), 8, 5)[places]
    extra = {"name": "grip", "type": "<f8", "differences": 3, "unit": "N", "description": "of a later version"}
    layout = BatchLayout(json.dumps(schema | {"columns": [*kept, extra]}).encode())
    data = message(rows, columns=planes.tobytes() + bytes(8 * 5))
    found = read(layout, data)
    assert not found["completion"].any()
    for name in set(TICK.names) - {"completion"}:
        assert found[name].tobytes() == rows[name].tobytes(), name


@pytest.mark.parametrize("wrong", [{"count": 6}, {"count": "5"}, {"columns": b"12"}, {"columns": None}])
def test_inconsistent_batch_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(RecordingError, match="contradicts"):
        BatchLayout(SCHEMA).decode([message(random_rows(5), **wrong)], ("tick",))


@pytest.mark.parametrize("wrong", [1, [1.0], ["1"] * len(CONSTANTS), []])
def test_batch_with_invalid_constants_is_refused(wrong: object) -> None:
    values = msgpack.unpackb(message(random_rows(5))) | {"constants": wrong}
    with pytest.raises(RecordingError, match="contradict the schema"):
        BatchLayout(SCHEMA).decode([msgpack.packb(values)], ("tick",))


@pytest.mark.parametrize("schema", [b"", b"{}", b'{"columns": [1]}', b'{"columns": [{"name": "z", "type": "<i8"}]}'])
def test_schema_without_valid_columns_is_refused(schema: bytes) -> None:
    with pytest.raises(RecordingError, match="column"):
        BatchLayout(schema)


@pytest.fixture
def rows() -> np.ndarray:
    """True ticks: those of the second format's golden recording."""
    with Recording(GOLDEN) as recording:
        return recording.ticks()


def written(path: Path, rows: np.ndarray, chunk_bytes: int, flush_every: int) -> Path:
    writer = RecordingWriter(path, metadata(), CONFIG_TEXT, Settings(chunk_bytes=chunk_bytes), OPENED_NS)
    for number, row in enumerate(rows):
        writer.write(TickRecord(row.tobytes()), number, OPENED_NS + number)
        if number % flush_every == flush_every - 1:
            writer.flush(OPENED_NS + number)
    writer.finish(OPENED_NS + len(rows))
    return path


@pytest.mark.slow
@pytest.mark.parametrize(("chunk_bytes", "flush_every"), [(1024, 7), (20_000, 60), (262_144, 200), (262_144, 10_000)])
def test_stored_attempts_and_index_match_those_of_all_ticks(
    tmp_path: Path, rows: np.ndarray, chunk_bytes: int, flush_every: int
) -> None:
    path = written(tmp_path / "a.mcap", rows, chunk_bytes, flush_every)
    with Recording(path) as recording:
        assert repr(recording.attempts()) == repr(find_attempts(rows))
        assert recording.ticks().tobytes() == rows.tobytes()
        assert recording.ticks(123, 517).tobytes() == rows[123:517].tobytes()
        assert recording.columns("theta", first=600)["theta"].tobytes() == rows["theta"][600:].tobytes()
        assert b"".join(part.tobytes() for part in recording.batches(100)) == rows.tobytes()
    with closing(Container(path)) as container:
        places = np.frombuffer(container.attachment(PLACES_NAME), PLACES)
    assert len(set(places["chunk"].tolist())) == len(places)
    assert places["count"].sum() == len(rows)


def test_ticks_of_a_flush_interval_are_one_batch_by_default(tmp_path: Path, rows: np.ndarray) -> None:
    settings = Settings()
    path = written(tmp_path / "a.mcap", rows[:800], settings.chunk_bytes, round(settings.flush_ms * 1e6 / TICK_NS))
    with path.open("rb") as file:
        messages = make_reader(file).iter_messages(topics=["/ticks"])
        assert [msgpack.unpackb(message.data)["count"] for _, _, message in messages] == [400, 400]


@pytest.mark.parametrize("chunk_bytes", [20_000, 262_144])
@pytest.mark.parametrize("piece", [1, 77, 1000])
def test_ticks_written_together_make_the_same_file(
    tmp_path: Path, rows: np.ndarray, chunk_bytes: int, piece: int
) -> None:
    one_by_one = written(tmp_path / "a.mcap", rows, chunk_bytes, 10**6)
    writer = RecordingWriter(tmp_path / "b.mcap", metadata(), CONFIG_TEXT, Settings(chunk_bytes=chunk_bytes), OPENED_NS)
    log_times_ns = OPENED_NS + np.arange(len(rows))
    for first in range(0, len(rows), piece):
        writer.write_ticks(rows[first : first + piece], first, log_times_ns[first : first + piece])
    writer.finish(OPENED_NS + len(rows))
    assert writer.path.read_bytes() == one_by_one.read_bytes()


def test_plot_channel_holds_every_nth_tick(tmp_path: Path, rows: np.ndarray) -> None:
    path = written(tmp_path / "a.mcap", rows, 262_144, 200)
    with path.open("rb") as file:
        messages = make_reader(file).iter_messages(topics=["/plot"], log_time_order=False)
        found = [json.loads(message.data) for _, _, message in messages]
    assert [values["tick"] for values in found] == list(range(0, len(rows), PLOTTED_EVERY))
    assert [values["theta"] for values in found] == pytest.approx(rows["theta"][::PLOTTED_EVERY].tolist(), rel=1e-6)


def test_server_stall_puts_no_log_time_into_the_future(tmp_path: Path, rows: np.ndarray) -> None:
    stalled = rows.copy()
    stalled["time_ns"][50:] += 10_000_000_000
    path = written(tmp_path / "a.mcap", stalled, 262_144, 10_000)
    with path.open("rb") as file:
        times = [(c.topic, m.log_time) for _, c, m in make_reader(file).iter_messages(log_time_order=False)]
    written_at = times[0][1]
    assert {topic for topic, _ in times} >= {"/ticks", "/plot"}
    assert all(0 <= written_at - at < len(rows) * TICK_NS for topic, at in times if topic == "/plot")


def test_attempt_survives_a_json_round_trip(rows: np.ndarray) -> None:
    attempts = find_attempts(rows)
    assert attempts
    again = attempts_of(json.dumps([attempt_values(attempt) for attempt in attempts], allow_nan=False).encode())
    assert repr(tuple(again)) == repr(attempts)


def test_recording_without_its_index_attachments_is_readable(tmp_path: Path, rows: np.ndarray) -> None:
    path = written(tmp_path / "a.mcap", rows, 20_000, 60)
    with Recording(path) as whole:
        data = path.read_bytes()
        for name in (b"netboard.places", b"netboard.attempts.json"):
            data = data.replace(name, b"x" * len(name))
        # Their names in the index count too, so its checksum is set to none.
        data = data[:-12] + bytes(4) + data[-8:]
        (tmp_path / "b.mcap").write_bytes(data)
        with Recording(tmp_path / "b.mcap") as bare:
            assert bare.ticks().tobytes() == whole.ticks().tobytes()
            assert repr(bare.attempts()) == repr(whole.attempts())
            assert bare.counts == whole.counts
