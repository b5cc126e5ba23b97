"""Reading: all content is equal to the bit, and invalid files are refused with advice."""

import os
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from netboard.base.errors import RecordingError
from netboard.base.tables.rig import RecordingSettings as Settings
from netboard.base.tick import TICK
from netboard.network.protocol.records import ClockRecord, EventRecord, FrameRecord
from netboard.recording.files.container import Container
from netboard.recording.files.reader import Recording
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.format.summary import Gap
from netboard.recording.recovery.recover import recover, require_finished
from samples import CONFIG_TEXT, MS, OPENED_NS, fill, metadata, new_writer, random_rows, records, write_recording

ROWS = random_rows(200, seed=1)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("recording") / "whole.mcap", ROWS, Settings(chunk_bytes=8192))


def test_recording_round_trip_is_bit_exact(path: Path) -> None:
    stream = records(ROWS)
    with Recording(path) as recording:
        assert recording.ticks().dtype == TICK
        assert recording.ticks().tobytes() == ROWS.tobytes()
        assert recording.events() == tuple(r for r in stream if isinstance(r, EventRecord))
        assert recording.clocks() == tuple(r for r in stream if isinstance(r, ClockRecord))
        assert recording.frames() == tuple(r for r in stream if isinstance(r, FrameRecord))
        assert recording.remarks() == ()
        assert recording.config_text == CONFIG_TEXT
        assert recording.metadata == metadata()
        assert recording.end["ended"] == "complete"
        assert recording.gaps() == {}
        recording.check()


def test_empty_recording_is_readable(tmp_path: Path) -> None:
    with Recording(write_recording(tmp_path / "a.mcap", ROWS[:0])) as recording:
        assert recording.ticks().shape == (0,)
        assert recording.events() == ()
        assert recording.gaps() == {}
        recording.check()


def test_gaps_are_listed_by_stream(tmp_path: Path) -> None:
    writer = new_writer(tmp_path / "a.mcap")
    now = fill(writer, ROWS[:20])
    assert writer.next_record is not None
    writer.note_lost(writer.next_record, 4, now)
    fill(writer, random_rows(60)[40:], first=writer.next_record)
    writer.finish(now + MS)
    with Recording(tmp_path / "a.mcap") as recording:
        assert recording.gaps()["/ticks"] == (Gap(20, 20),)
        (remark,) = recording.remarks()
        assert (remark.name, remark.details) == ("log_lost", {"first": "26", "count": "4", "after_tick": "19"})
        assert recording.end["lost"] == "4"
        assert recording.first_record == 0
        assert recording.counts == {
            "/ticks": 40,
            "/event": 4,
            "/clock": 4,
            "/frame": 4,
            "/logger": 1,
            "/plot": 2,
            "/backfill": 0,
        }


def test_unfinished_part_is_refused_with_the_recover_command(tmp_path: Path) -> None:
    writer = new_writer(tmp_path / "a.mcap")
    fill(writer, ROWS[:20])
    writer.flush(OPENED_NS)
    writer.abandon()
    with pytest.raises(RecordingError, match=r"a\.mcap\.part: is unfinished.*netboard recover .*a\.mcap\.part"):
        Recording(tmp_path / "a.mcap.part")


@pytest.mark.parametrize("missing", [1, 8, 9, 100, 2000])
def test_truncated_file_is_refused_with_the_recover_command(tmp_path: Path, path: Path, missing: int) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:-missing])
    with pytest.raises(RecordingError, match=r"cut\.mcap: .*netboard recover .*cut\.mcap"):
        Recording(cut)


@pytest.mark.parametrize("content", [b"\x89MCAP0\r", b"%PDF-1.4 hello", bytes(100)])
def test_file_that_is_not_mcap_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(RecordingError, match=r"a\.mcap: not an MCAP file"):
        Recording(tmp_path / "a.mcap")


@pytest.mark.skipif(sys.platform == "win32", reason="named pipes are POSIX's here")
def test_pipe_is_refused_without_waiting_for_a_writer(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.mcap")
    for read in (Recording, recover, require_finished):
        with pytest.raises(RecordingError, match=r"a\.mcap: is a pipe or a device"):
            read(tmp_path / "a.mcap")


def test_empty_file_is_refused_as_empty(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").touch()
    with pytest.raises(RecordingError, match=r"a\.mcap: is empty"):
        Recording(tmp_path / "a.mcap")


def test_file_of_mcap_magic_alone_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n" * 2)
    with pytest.raises(RecordingError, match="is damaged"):
        Recording(tmp_path / "a.mcap")


def test_damaged_chunk_is_reported_once(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 64] = bytes(64)
    path.write_bytes(data)
    with Recording(path) as recording, pytest.raises(RecordingError) as raised:
        recording.ticks()
    assert str(raised.value).count("is damaged") == 1


def test_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="No such file"):
        Recording(tmp_path / "a.mcap")


def test_mcap_of_other_software_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        writer.finish()
    with pytest.raises(RecordingError, match="not a recording of netboard"):
        Recording(tmp_path / "a.mcap")


@pytest.mark.parametrize("leaves_out", ["use_statistics", "repeat_channels", "use_chunking"])
def test_copy_with_an_incomplete_index_is_refused_and_never_seems_empty(
    tmp_path: Path, path: Path, leaves_out: str
) -> None:
    """Other MCAP tools can leave out parts of the index."""
    with path.open("rb") as source, (tmp_path / "copy.mcap").open("wb") as copy:
        reader, writer = make_reader(source), Writer(copy, **{leaves_out: False})
        writer.start("netboard", "another tool")
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, record.metadata)
        channels: dict[int, int] = {}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            assert schema is not None
            if channel.id not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, number)
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()
    with pytest.raises(RecordingError, match=r"is damaged \(its index"):
        Recording(tmp_path / "copy.mcap")


def test_unknown_format_version_is_refused(tmp_path: Path) -> None:
    writer = RecordingWriter(
        tmp_path / "a.mcap", metadata() | {"format": "99", "netboard": "7.0"}, CONFIG_TEXT, Settings(), OPENED_NS
    )
    writer.finish(OPENED_NS)
    with pytest.raises(RecordingError, match=r"format version 99.*reads versions 1, 2, 3.*netboard 7\.0"):
        Recording(tmp_path / "a.mcap")


def test_configuration_with_a_wrong_checksum_is_refused(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "a.mcap", metadata(), CONFIG_TEXT + "# other", Settings(), OPENED_NS)
    writer.finish(OPENED_NS)
    with pytest.raises(RecordingError, match="configuration is damaged"):
        Recording(tmp_path / "a.mcap")


def test_every_flipped_bit_is_detected(tmp_path: Path, path: Path) -> None:
    whole = path.read_bytes()
    generator = np.random.default_rng(5)
    for offset in generator.choice(len(whole), 150, replace=False):
        broken = bytearray(whole)
        broken[offset] ^= 1 << generator.integers(8)
        flipped = tmp_path / "flipped.mcap"
        flipped.write_bytes(broken)
        with pytest.raises(RecordingError), Recording(flipped) as recording:
            recording.check()


def test_flipped_bit_in_a_chunk_is_detected_on_reading(tmp_path: Path, path: Path) -> None:
    broken = bytearray(path.read_bytes())
    with closing(Container(path)) as container:
        chunk = container.chunks_with("/ticks")[2]
    broken[chunk + 600] ^= 4
    (tmp_path / "a.mcap").write_bytes(broken)
    with (
        Recording(tmp_path / "a.mcap") as recording,
        pytest.raises(RecordingError, match=r"damaged.*chunk.*netboard recover"),
    ):
        recording.ticks()
