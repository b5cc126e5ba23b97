"""Writing: nothing is overwritten, chunks stay small, records are durable, and upstream MCAP reads all."""

import io
import json
import os
import shutil
import struct
from pathlib import Path

import jsonschema
import msgpack
import pytest
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import StreamReader

from netboard.base.config import Config, parse, require_short_names
from netboard.base.errors import ConfigError, RecordingError
from netboard.base.tables.rig import RecordingSettings
from netboard.base.tick import TICK
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.records import EventRecord, TickRecord
from netboard.recording.files.container import ChunkEntry, Container
from netboard.recording.files.provenance import config_sha256, next_recording, provenance
from netboard.recording.files.reader import Recording as Reader
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.format.channels import PLOTTED_EVERY
from netboard.recording.format.chunks import messages, payloads_of, unpack_chunk
from netboard.recording.format.partfile import PartFile
from samples import (
    CONFIG_TEXT,
    MS,
    OPENED_NS,
    SESSION,
    fill,
    metadata,
    new_writer,
    random_rows,
    records,
    write_recording,
)

ROWS = random_rows(300)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("recording") / "whole.mcap", ROWS)


def test_part_is_renamed_only_when_finished(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = new_writer(path)
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap.part"]
    writer.finish(OPENED_NS)
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap"]
    assert not writer.is_open


@pytest.mark.parametrize("name", ["a.mcap", "a.mcap.part"])
def test_writer_never_overwrites_a_file(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"precious")
    with pytest.raises(ConfigError, match="exists"):
        new_writer(tmp_path / "a.mcap")
    assert (tmp_path / name).read_bytes() == b"precious"


@pytest.mark.parametrize("links", [True, False])
def test_file_created_during_the_recording_is_not_overwritten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    if not links:
        monkeypatch.setattr(os, "link", _no_links)
    path = tmp_path / "a.mcap"
    writer = new_writer(path)
    fill(writer, ROWS[:3])
    path.write_bytes(b"precious")
    with pytest.raises(RecordingError, match=r"already exists; .*; the finished recording stays in a\.mcap\.part"):
        writer.finish(OPENED_NS)
    assert path.read_bytes() == b"precious"
    shutil.copy(tmp_path / "a.mcap.part", tmp_path / "whole.mcap")
    with Reader(tmp_path / "whole.mcap") as reader:
        assert reader.ticks().tobytes() == ROWS[:3].tobytes()


def _no_links(source: Path, target: Path) -> None:
    raise PermissionError(1, "no hard links here")


def test_recording_works_without_hard_links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "link", _no_links)
    write_recording(tmp_path / "a.mcap", ROWS[:3])
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap"]


def test_file_name_must_end_in_mcap(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"ends in \.mcap"):
        new_writer(tmp_path / "a.txt")


def test_only_flushed_records_are_durable(tmp_path: Path) -> None:
    writer = new_writer(tmp_path / "a.mcap", RecordingSettings(flush_ms=200.0))
    assert writer.durable is None
    assert not writer.is_due(OPENED_NS + 10_000 * MS)
    writer.write(TickRecord(ROWS[0].tobytes()), 40, OPENED_NS + MS)
    assert (writer.durable, writer.next_record) == (40, 41)
    assert not writer.is_due(OPENED_NS + 199 * MS)
    assert writer.is_due(OPENED_NS + 200 * MS)
    assert writer.flush(OPENED_NS + 200 * MS) == 41
    assert not writer.is_due(OPENED_NS + 1000 * MS)
    writer.note_lost(41, 5, OPENED_NS + 201 * MS)
    assert (writer.durable, writer.next_record, writer.lost) == (41, 46, 5)
    with pytest.raises(ValueError, match="46 is next"):
        writer.write(TickRecord(ROWS[1].tobytes()), 41, OPENED_NS)
    writer.finish(OPENED_NS + 300 * MS)
    assert writer.durable == 46


@pytest.mark.parametrize("chunk_bytes", [2048, 8192, 65_536])
def test_chunks_stay_within_their_size(tmp_path: Path, chunk_bytes: int) -> None:
    path = write_recording(tmp_path / "a.mcap", ROWS, RecordingSettings(chunk_bytes=chunk_bytes, flush_ms=5000.0))
    with path.open("rb") as file:
        chunks = [r for r in StreamReader(file, emit_chunks=True).records if isinstance(r, Chunk)]
    # The first chunk holds the channels and schemas too.
    assert all(chunk.uncompressed_size <= chunk_bytes for chunk in chunks[1:])
    assert len(chunks) >= len(ROWS) * TICK.itemsize // chunk_bytes


def test_full_chunk_is_written_at_once(tmp_path: Path) -> None:
    writer = new_writer(tmp_path / "a.mcap", RecordingSettings(chunk_bytes=4096, flush_ms=5000.0))
    sizes = []
    for number, row in enumerate(ROWS[:20]):
        writer.write(TickRecord(row.tobytes()), number, OPENED_NS)
        sizes.append((tmp_path / "a.mcap.part").stat().st_size)
    assert len(set(sizes)) >= 20 * TICK.itemsize // 4096
    writer.abandon()


def test_mcap_library_reads_everything_with_and_without_seeking(recording: Path) -> None:
    data = recording.read_bytes()
    for reader in (
        make_reader(io.BytesIO(data), validate_crcs=True),
        NonSeekingReader(io.BytesIO(data), validate_crcs=True),
    ):
        sequences: dict[str, list[int]] = {}
        ticks = 0
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            encoding = "json" if channel.topic == "/plot" else "msgpack"
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", encoding)
            values = json.loads(message.data) if encoding == "json" else msgpack.unpackb(message.data)
            jsonschema.Draft202012Validator(json.loads(schema.data)).validate(values)
            ticks += values.get("count", 0)
            sequences.setdefault(channel.topic, []).append(message.sequence)
        assert ticks == len(ROWS)
        assert sequences["/ticks"][0] == 0
        assert sequences["/plot"] == list(range(0, len(ROWS), PLOTTED_EVERY))
        for topic in ("/event", "/clock", "/frame"):
            assert sequences[topic] == list(range(len(ROWS) // 10))


def test_publish_time_is_the_sources_and_log_time_the_loggers(recording: Path) -> None:
    with recording.open("rb") as file:
        times = [
            (message.publish_time, message.log_time)
            for _, _, message in make_reader(file).iter_messages(topics="/ticks", log_time_order=False)
        ]
    assert len(times) > 1
    assert {publish for publish, _ in times} < set(ROWS["time_ns"].tolist())
    logged = [log for _, log in times]
    assert logged == sorted(logged)
    came = [number for number, record in enumerate(records(ROWS), start=1) if isinstance(record, TickRecord)]
    firsts = [ROWS["time_ns"].tolist().index(publish) for publish, _ in times]
    assert logged == [OPENED_NS + MS * came[first - 1] for first in (*firsts[1:], len(ROWS))]  # with its last row


def test_mcap_library_finds_metadata_configuration_and_statistics(recording: Path) -> None:
    with recording.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        found = {record.name: record.metadata for record in reader.iter_metadata()}
        attachment, *others = reader.iter_attachments()
        assert reader.get_header().profile == "netboard"
    assert summary is not None
    assert summary.statistics is not None
    counted = summary.statistics.channel_message_counts
    assert sum(counted[number] for number in (2, 3, 4)) == sum(not isinstance(r, TickRecord) for r in records(ROWS))
    assert found["netboard"] == metadata()
    assert found["netboard.first"] == {"record": "0"}
    assert found["netboard.end"]["ended"] == "complete"
    assert int(found["netboard.end"]["records"]) == len(records(ROWS)) == int(found["netboard.end"]["next_record"])
    assert (attachment.name, attachment.data) == ("netboard.toml", CONFIG_TEXT.encode())
    assert [other.name for other in others] == ["netboard.attempts.json", "netboard.places"]


def test_metadata_give_the_provenance() -> None:
    found = metadata()
    assert found["session"] == SESSION
    assert found["config_sha256"] == config_sha256(CONFIG_TEXT.encode())
    assert found["opened_utc"] == "2026-09-21T14:13:20+00:00"
    assert all(found[name] for name in ("format", "netboard", "python", "platform", "numpy", "numba", "pyzmq", "mcap"))
    assert found["pilot"] == "false"
    assert all(isinstance(value, str) for value in found.values())


def test_chunk_decoder_agrees_with_the_mcap_library(recording: Path) -> None:
    with recording.open("rb") as file:
        theirs = [r for r in StreamReader(file).records if isinstance(r, Message)]
    with recording.open("rb") as file:
        chunks = [r for r in StreamReader(file, emit_chunks=True).records if isinstance(r, Chunk)]
    ours = []
    for chunk in chunks:
        body = _body(chunk)
        data = unpack_chunk(body)
        entries = list(messages(data))
        expected = tuple([entry.data for entry in entries if entry.channel_id == number] for number in (1, 2, 77))
        assert payloads_of(data, (1, 2, 77)) == expected
        ours += entries
    assert [(m.channel_id, m.sequence, m.log_time, m.publish_time, m.data) for m in theirs] == ours


@pytest.mark.parametrize("cut", [1, 8, 30])
def test_chunk_with_a_wrong_length_is_refused(cut: int) -> None:
    message = struct.pack("<BQHIQQ", 5, 22 + 3, 1, 0, 0, 0) + b"abc"
    assert payloads_of(2 * message, (1,)) == ([b"abc", b"abc"],)
    for data in (message + message[:cut], struct.pack("<BQ", 5, 2**64 - 1) + bytes(30), struct.pack("<BQ21x", 5, 21)):
        with pytest.raises(RecordingError, match="length of a record"):
            payloads_of(data, (1,))


def test_entries_of_the_index_agree_with_the_mcap_library(recording: Path) -> None:
    with recording.open("rb") as file:
        theirs = sorted(make_reader(file).get_summary().chunk_indexes, key=lambda one: one.chunk_start_offset)
    container = Container(recording)
    ours = container.chunk_indexes
    container.close()
    assert len(ours) == len(theirs) > 1
    for one, other in zip(ours, theirs, strict=True):
        assert one.channels == tuple(other.message_index_offsets)
        for name in set(ChunkEntry._fields) - {"channels"}:
            assert getattr(one, name) == getattr(other, name)


def _body(chunk: Chunk) -> bytes:
    from mcap.data_stream import RecordBuilder

    builder = RecordBuilder()
    chunk.write(builder)
    return builder.end()[9:]


def test_stamps_beyond_the_mcap_range_are_clipped_but_not_the_row(tmp_path: Path) -> None:
    row = random_rows(1)
    row["tick"], row["time_ns"] = 2**32 + 5, -7
    with Reader(write_recording(tmp_path / "a.mcap", row)) as reader:
        assert reader.ticks().tobytes() == row.tobytes()
    with (tmp_path / "a.mcap").open("rb") as file:
        (_, _, message), *_ = make_reader(file).iter_messages()
    assert (message.sequence, message.publish_time) == (5, 0)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_full_disk_stops_the_writer_with_a_clear_message(tmp_path: Path) -> None:
    writer = new_writer(tmp_path / "a.mcap")
    written = (tmp_path / "a.mcap.part").stat().st_size
    # From here on the file's descriptor leads to the device that is always full.
    with Path("/dev/full").open("wb") as full:
        os.dup2(full.fileno(), writer._file._file.fileno())
    with pytest.raises(RecordingError, match=r"a\.mcap\.part: cannot be written: No space left"):
        writer.write(TickRecord(ROWS[0].tobytes()), 0, OPENED_NS)
    assert not writer.is_open
    assert (tmp_path / "a.mcap.part").stat().st_size == written


@pytest.mark.skipif(os.name == "nt", reason="an open file cannot be deleted there")
@pytest.mark.parametrize("folder_too", [False, True])
def test_deleted_file_is_noticed_and_restored(tmp_path: Path, folder_too: bool) -> None:
    path = tmp_path / "folder" / "a.mcap"
    path.parent.mkdir()
    writer = new_writer(path)
    now = fill(writer, ROWS[:200])
    (tmp_path / "folder" / "a.mcap.part").unlink()
    if folder_too:
        path.parent.rmdir()
    with pytest.raises(RecordingError, match="was deleted"):
        writer.flush(now)
    assert writer.is_open
    writer.finish(now, "the file was deleted")
    assert [file.name for file in path.parent.iterdir()] == ["a.mcap"]
    with Reader(path) as reader:
        reader.check()
        assert reader.ticks().tobytes() == ROWS[:200].tobytes()
        assert reader.end["ended"] == "the file was deleted"
    assert writer.durable == writer.next_record


@pytest.mark.skipif(os.name == "nt", reason="an open file cannot be deleted there")
def test_deleted_file_is_not_restored_over_another_file(tmp_path: Path) -> None:
    writer = new_writer(tmp_path / "a.mcap")
    now = fill(writer, ROWS[:20])
    (tmp_path / "a.mcap.part").unlink()
    (tmp_path / "a.mcap.part").write_bytes(b"precious")
    with pytest.raises(RecordingError, match="File exists"):
        writer.finish(now)
    assert (tmp_path / "a.mcap.part").read_bytes() == b"precious"


@pytest.mark.skipif(os.name == "nt", reason="an open file cannot be moved there")
def test_moved_file_is_noticed_and_finished_in_its_new_place(tmp_path: Path) -> None:
    writer = new_writer(tmp_path / "a.mcap")
    now = fill(writer, ROWS[:20])
    (tmp_path / "a.mcap.part").rename(tmp_path / "b.mcap")
    (tmp_path / "a.mcap.part").write_bytes(b"another")
    with pytest.raises(RecordingError, match="was moved away"):
        writer.flush(now)
    with pytest.raises(RecordingError, match="is complete at its new place"):
        writer.finish(now)
    with Reader(tmp_path / "b.mcap") as reader:
        assert reader.ticks().tobytes() == ROWS[:20].tobytes()
    assert (tmp_path / "a.mcap.part").read_bytes() == b"another"
    assert not (tmp_path / "a.mcap").exists()


def test_missing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be written: there is no folder"):
        new_writer(tmp_path / "nowhere" / "a.mcap")


def test_parts_of_a_session_are_numbered(tmp_path: Path) -> None:
    config = Config()
    first, part = next_recording(tmp_path, config, SESSION, OPENED_NS)
    assert (first.name, part) == ("S01_D01_20260921T141320Z_3f2a9c1e.mcap", 1)
    first.with_name(first.name + ".part").touch()
    second, part = next_recording(tmp_path, config, SESSION, OPENED_NS + 3600 * 1000 * MS)
    assert (second.name, part) == ("S01_D01_20260921T151320Z_3f2a9c1e_part2.mcap", 2)
    second.touch()
    (tmp_path / "S01_D01_20260921T141320Z_3f2a9c1e.recovered.mcap").touch()
    assert next_recording(tmp_path, config, SESSION, OPENED_NS)[1] == 3
    assert next_recording(tmp_path, config, "another0", OPENED_NS)[1] == 1


def test_session_id_cannot_escape_the_folder(tmp_path: Path) -> None:
    path, _ = next_recording(tmp_path, Config(), "../../etc/passwd", OPENED_NS)
    assert path.parent == tmp_path
    assert path.name.endswith("_etcpassw.mcap")


def test_writer_reports_free_space(tmp_path: Path) -> None:
    writer = new_writer(tmp_path / "a.mcap")
    space = writer.space(OPENED_NS)
    assert 0 < space.free <= shutil.disk_usage(tmp_path).total
    assert space.seconds == float("inf")
    writer.abandon()


def test_losses_are_noted_with_the_preceding_tick(tmp_path: Path) -> None:
    writer = new_writer(tmp_path / "a.mcap")
    writer.note_lost(0, 7, OPENED_NS)
    fill(writer, ROWS[:20], first=7)
    assert writer.next_record is not None
    writer.note_unreadable(b"\x00junk", writer.next_record, "no message of kind 106", OPENED_NS + MS)
    writer.finish(OPENED_NS + 2 * MS)
    with Reader(tmp_path / "a.mcap") as reader:
        first, unreadable, second = reader.remarks()
        number = str(7 + len(records(ROWS[:20])))
    assert first.details == {"first": "0", "count": "7", "after_tick": "-1"}
    assert unreadable.details == {"number": number, "reason": "no message of kind 106", "hex": "006a756e6b"}
    assert second.details == {"first": number, "count": "1", "after_tick": "19"}


def test_longest_labels_fit_the_name_of_a_recording(tmp_path: Path) -> None:
    longest = ("session.name=" + "n" * 80, "session.dyad=" + "d" * 80, "block.number=1000", "block.blocks=1000")
    path, _ = next_recording(tmp_path, parse("", "test", longest), SESSION, OPENED_NS)
    recovered = path.with_name(f"{path.stem}_part100.recovered.mcap")
    part = PartFile(recovered, "test", 1000, repeatable=True)
    part.finish()
    assert recovered.exists()
    for key in ("name", "dyad", "participant_a", "participant_b"):
        config = parse("", "test", (f"session.{key}=" + "n" * 81,))
        with pytest.raises(ConfigError, match=rf"test: \[session\] {key}: found 81 characters, expected at most 80"):
            require_short_names(config.session, "test")


@pytest.mark.parametrize("opened_ns", [-1, -86_400 * 10**9, 2**63, 253_402_300_800 * 10**9])
def test_wall_clock_before_1970_or_after_2262_is_refused_in_words(tmp_path: Path, opened_ns: int) -> None:
    with pytest.raises(RecordingError, match="expected a time from 1970 to 2262"):
        provenance(Welcome(SESSION, 1, 7, CONFIG_TEXT), Config(), 1, opened_ns, 42)
    with pytest.raises(RecordingError, match=r"a\.mcap: cannot store a log time of .*, expected a time from 1970"):
        RecordingWriter(tmp_path / "a.mcap", metadata(), CONFIG_TEXT, RecordingSettings(), opened_ns, repeatable=True)
    assert not list(tmp_path.iterdir())


def test_log_time_of_a_record_before_1970_is_refused_in_words(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "a.mcap", metadata(), CONFIG_TEXT, RecordingSettings(), OPENED_NS)
    with pytest.raises(RecordingError, match="cannot store a log time of -1e-09 s after 1970"):
        writer.write(EventRecord(0, -1, -1, "early", {}), 0, -1)
    writer.abandon()
    writer = RecordingWriter(tmp_path / "b.mcap", metadata(), CONFIG_TEXT, RecordingSettings(), OPENED_NS)
    writer.write(EventRecord(0, -1, -(2**63), "early", {}), 0, OPENED_NS)  # its own time may be any
    writer.finish(OPENED_NS)
    with Reader(tmp_path / "b.mcap") as recording:
        assert recording.events()[0].time_ns == -(2**63)
