"""Recovery after cuts, changed bytes and kills: every complete chunk is saved, the source unchanged."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.data_stream import ReadDataStream
from mcap.reader import make_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import breakup_chunk
from numpy.typing import NDArray
from typer.testing import CliRunner

from netboard.base.errors import ConfigError, RecordingError
from netboard.base.process.stopping import STOP_SIGNALS
from netboard.base.tables.rig import RecordingSettings as Settings
from netboard.base.tick import TICK
from netboard.network.protocol.records import BLOCK_BEGAN, EventRecord
from netboard.recording.export.runs import runs_of
from netboard.recording.files.locate import find_unfinished, recovered_path
from netboard.recording.files.provenance import CONFIG_NAME, MetadataName
from netboard.recording.files.reader import Recording
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.format.partfile import PartFile
from netboard.recording.format.summary import Gap
from netboard.recording.recovery.recover import RecoveryReport, recover
from netboard.services.cli import app
from samples import CONFIG_TEXT, OPENED_NS, fill, metadata, new_writer, random_rows, records, write_recording

ROWS = random_rows(60, seed=2)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("recording") / "whole.mcap", ROWS, Settings(chunk_bytes=4096))


@pytest.fixture
def _without_fsync(monkeypatch: pytest.MonkeyPatch) -> None:
    """Skip fsync: these tests inspect the content of the file only."""
    monkeypatch.setattr(os, "fsync", lambda handle: None)


def range_of(batch: dict[str, int]) -> range:
    """The numbers of the ticks in a batch without holes."""
    return range(batch["first"], batch["first"] + batch["count"])


def chunk_ticks(path: Path) -> list[tuple[int, int, list[int]]]:
    """Start and end of each chunk of a sound file, and the ticks in it, as upstream sees them."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        found = []
        for index in sorted(summary.chunk_indexes, key=lambda index: index.chunk_start_offset):
            start = index.chunk_start_offset
            file.seek(start + 9)
            inside = breakup_chunk(Chunk.read(ReadDataStream(file)), validate_crc=True)
            batches = [r.data for r in inside if isinstance(r, Message) and r.channel_id == 1]
            ticks = [tick for data in batches for tick in range_of(msgpack.unpackb(data))]
            found.append((start, start + index.chunk_length, ticks))
    return found


def recovered_ticks(tmp_path: Path, data: bytes, rows: NDArray[Any] = ROWS) -> tuple[list[int], RecoveryReport]:
    """Recover some bytes; check that the result is sound and that its rows equal the written ones."""
    source, output = tmp_path / "broken.mcap.part", tmp_path / "out.mcap"
    output.unlink(missing_ok=True)
    source.write_bytes(data)
    report = recover(source, output)
    assert source.read_bytes() == data
    with Recording(output) as recording:
        recording.check()
        ticks = recording.ticks()
    numbers = ticks["tick"].tolist()
    assert ticks.tobytes() == rows[numbers].tobytes()
    assert report.messages["/ticks"] == len(numbers)
    return numbers, report


@pytest.mark.usefixtures("_without_fsync")
def test_file_cut_anywhere_gives_every_chunk_before_the_cut(tmp_path: Path, whole: Path) -> None:
    data = whole.read_bytes()
    chunks = chunk_ticks(whole)
    generator = np.random.default_rng(3)
    for cut in (*generator.integers(8, len(data), 60), 8, len(data)):
        numbers, report = recovered_ticks(tmp_path, data[:cut])
        assert numbers == [tick for _, end, ticks in chunks if end <= cut for tick in ticks]
        assert report.missing == ()
        if numbers:
            assert (report.first_tick, report.last_tick) == (0, numbers[-1])


@pytest.mark.usefixtures("_without_fsync")
@pytest.mark.slow
def test_cut_anywhere_in_the_last_chunk_gives_all_chunks_before(tmp_path: Path) -> None:
    rows = np.zeros(8, TICK)
    rows["tick"] = np.arange(8)
    path = write_recording(tmp_path / "short.mcap", rows, Settings(chunk_bytes=2048))
    data = path.read_bytes()
    *before, (start, end, _) = chunk_ticks(path)
    expected = [tick for _, _, ticks in before for tick in ticks]
    for cut in range(start, end):
        numbers, report = recovered_ticks(tmp_path, data[:cut], rows)
        assert numbers == expected
        assert report.lost_bytes == cut - start
        assert not report.finished


@pytest.mark.slow
@pytest.mark.usefixtures("_without_fsync")
def test_flipped_bit_costs_at_most_its_chunk(tmp_path: Path, whole: Path) -> None:
    data = whole.read_bytes()
    chunks = chunk_ticks(whole)
    first = chunks[0][0]
    last = chunks[-1][1]
    generator = np.random.default_rng(4)
    lossy = 0
    for offset in generator.integers(first, last, 150):
        broken = bytearray(data)
        broken[offset] ^= 1 << generator.integers(8)
        numbers, report = recovered_ticks(tmp_path, bytes(broken))
        # Some bits of a chunk (its own time range, say) are not needed to read it; then nothing is lost.
        if numbers != ROWS["tick"].tolist():
            assert numbers == [tick for start, end, ticks in chunks if not start <= offset < end for tick in ticks]
            assert any(part.offset <= offset < part.offset + part.length for part in report.damage)
            lossy += 1
    assert lossy > 100


def test_zeroed_range_costs_only_the_chunks_it_touches(tmp_path: Path, whole: Path) -> None:
    data = bytearray(whole.read_bytes())
    chunks = chunk_ticks(whole)
    low, high = chunks[2][0] + 5, chunks[4][0] + 5
    data[low:high] = bytes(high - low)
    numbers, report = recovered_ticks(tmp_path, bytes(data))
    assert numbers == [tick for start, end, ticks in chunks if end <= low or start >= high for tick in ticks]
    (gap,) = report.missing
    assert gap == Gap(chunks[2][2][0], chunks[4][2][-1] - chunks[2][2][0] + 1)
    assert report.finished


@pytest.mark.usefixtures("_without_fsync")
@given(st.data())
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_any_damage_gives_original_rows_or_a_recording_error(tmp_path: Path, whole: Path, data: st.DataObject) -> None:
    broken = bytearray(whole.read_bytes())
    for _ in range(data.draw(st.integers(1, 5))):
        at = data.draw(st.integers(0, len(broken) - 1))
        broken[at : at + data.draw(st.integers(0, 40))] = data.draw(st.binary(max_size=40))
    try:
        recovered_ticks(tmp_path, bytes(broken))
    except RecordingError:
        # Only where even the file's kind and version are gone.
        assert broken[:8] != whole.read_bytes()[:8] or b"format\x01\x00\x00\x003" not in broken


def test_recovery_of_a_sound_file_loses_nothing(tmp_path: Path, whole: Path) -> None:
    report = recover(whole, tmp_path / "out.mcap")
    assert (report.damage, report.missing, report.finished, report.has_config) == ((), (), True, True)
    assert sum(report.messages.values()) == len(records(ROWS))
    with Recording(whole) as old, Recording(tmp_path / "out.mcap") as new:
        assert new.ticks().tobytes() == old.ticks().tobytes()
        assert (new.events(), new.clocks(), new.frames()) == (old.events(), old.clocks(), old.frames())
        assert (new.metadata, new.end, new.config_text) == (old.metadata, old.end, old.config_text)
    others = ["/event", "/clock", "/frame", "/logger", "/plot"]
    with whole.open("rb") as old_file, (tmp_path / "out.mcap").open("rb") as new_file:
        old_messages, new_messages = (
            [(m.channel_id, m.sequence, m.publish_time, m.data) for _, _, m in make_reader(file).iter_messages(others)]
            for file in (old_file, new_file)
        )
        assert sorted(old_messages) == sorted(new_messages)


def test_damaged_number_in_the_metadata_costs_only_itself(tmp_path: Path, whole: Path) -> None:
    with Recording(whole) as sound:
        numbers = {"opened_log_ns": sound.metadata, "record": {"record": str(sound.first_record)}, "log_ns": sound.end}
        numbers |= dict.fromkeys(("opened_monotonic_ns", "welcome_server_ns"), sound.metadata)
    for key, values in numbers.items():
        head = len(key).to_bytes(4, "little") + key.encode() + len(values[key]).to_bytes(4, "little")
        broken = bytearray(whole.read_bytes())
        broken[broken.index(head) + len(head)] = 0
        (tmp_path / "broken.mcap").write_bytes(broken)
        with pytest.raises(RecordingError, match=rf"{key}: found .* expected a whole number\); run: netboard recover"):
            Recording(tmp_path / "broken.mcap")
        ticks, report = recovered_ticks(tmp_path, bytes(broken))
        assert ticks == ROWS["tick"].tolist()
        assert [part.reason for part in report.damage] == [f"metadata: {key} is not a number"]
        with Recording(report.output) as recovered:
            assert recovered.events()
        if values.get("session"):
            with pytest.raises(RecordingError, match=f"lost its {key} when it was damaged"):
                runs_of([report.output])


def test_lost_configuration_is_reported(tmp_path: Path, whole: Path) -> None:
    data = bytearray(whole.read_bytes())
    at = data.index(CONFIG_TEXT.encode())
    data[at + 3] ^= 1
    (tmp_path / "a.mcap").write_bytes(data)
    report = recover(tmp_path / "a.mcap")
    assert not report.has_config
    with Recording(report.output) as recording:
        assert recording.ticks().tobytes() == ROWS.tobytes()
        with pytest.raises(RecordingError, match="configuration was lost"):
            _ = recording.config_text


@pytest.mark.parametrize("place", ["configuration", "header"])
def test_lost_configuration_comes_from_the_event_that_began_the_block(tmp_path: Path, place: str) -> None:
    writer = new_writer(tmp_path / "a.mcap")
    writer.write(EventRecord(0, 0, 0, BLOCK_BEGAN, {"config": CONFIG_TEXT}), 0, OPENED_NS)
    writer.finish(fill(writer, ROWS, first=1))
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    data[data.index(CONFIG_TEXT.encode()) if place == "configuration" else 8] ^= 1
    (tmp_path / "a.mcap").write_bytes(data)
    report = recover(tmp_path / "a.mcap")
    assert report.has_config
    with Recording(report.output) as recording:
        assert recording.config_text == CONFIG_TEXT
        assert recording.recovery["config"] == "recovered"


@pytest.mark.parametrize("lost", ["", MetadataName.OPENED, CONFIG_NAME, MetadataName.FIRST, MetadataName.END])
def test_damaged_record_outside_chunks_costs_only_itself(tmp_path: Path, whole: Path, lost: str) -> None:
    """The file has no event that begins its block, as the second file of a block."""
    data = bytearray(whole.read_bytes())
    stored = len(lost).to_bytes(4, "little") + lost.encode()
    place = data.index(stored, 40)  # behind the header, whose profile is stored alike
    at = {"": 8, CONFIG_NAME: place - 25}.get(lost, place - 9)
    data[at + 2] ^= 1  # its length
    ticks, report = recovered_ticks(tmp_path, bytes(data))
    assert ticks == ROWS["tick"].tolist()
    assert [part.offset for part in report.damage] == [at]
    assert report.has_config == (lost != CONFIG_NAME)
    with Recording(report.output) as recording:
        assert (recording.metadata["session"] == "unknown") == (lost == MetadataName.OPENED)
        assert (recording.first_record is None) == (lost == MetadataName.FIRST)
        assert (recording.end == {}) == (lost == MetadataName.END)


def test_damaged_configuration_is_not_taken_for_sound_without_its_hash(tmp_path: Path, whole: Path) -> None:
    data = bytearray(whole.read_bytes())
    data[data.index(MetadataName.OPENED.encode(), 40) - 11] ^= 1
    data[data.index(CONFIG_TEXT.encode()) + 3] ^= 1
    assert not recovered_ticks(tmp_path, bytes(data))[1].has_config


def test_destroyed_first_bytes_cost_no_tick(tmp_path: Path, whole: Path) -> None:
    ticks, report = recovered_ticks(tmp_path, bytes(8) + whole.read_bytes()[8:])
    assert ticks == ROWS["tick"].tolist()
    assert [(part.offset, part.length) for part in report.damage] == [(0, 8)]
    assert report.has_config


def test_recovery_of_a_recovered_file_keeps_the_account_of_its_losses(tmp_path: Path, whole: Path) -> None:
    data = bytearray(whole.read_bytes())
    data[chunk_ticks(whole)[1][1] - 9] ^= 1
    (tmp_path / "a.mcap").write_bytes(data)
    once = recover(tmp_path / "a.mcap")
    twice = recover(once.output)
    assert twice.missing == once.missing != ()
    with Recording(once.output) as first, Recording(twice.output) as second:
        assert second.recovery["damage"] == first.recovery["damage"] != ""


def test_recovery_never_overwrites_a_file(tmp_path: Path, whole: Path) -> None:
    source = tmp_path / "a.mcap"
    source.write_bytes(whole.read_bytes())
    assert recover(source).output.name == "a.recovered.mcap"
    before = (tmp_path / "a.recovered.mcap").read_bytes()
    for output in (None, source):
        with pytest.raises(ConfigError, match="already exists"):
            recover(source, output)
    assert (tmp_path / "a.recovered.mcap").read_bytes() == before
    assert source.read_bytes() == whole.read_bytes()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.mcap", "a.recovered.mcap"]


def unfinished(path: Path) -> None:
    """Leave an unfinished recording, as a killed logger does."""
    writer = new_writer(path)
    fill(writer, ROWS)
    writer.abandon()


def test_leftover_of_a_killed_recovery_neither_blocks_the_next_one_nor_is_recovered(tmp_path: Path) -> None:
    unfinished(tmp_path / "a.mcap")
    target = tmp_path / "a.recovered.mcap"
    killed = RecordingWriter(target, metadata(), CONFIG_TEXT, Settings(), OPENED_NS, repeatable=True)
    fill(killed, ROWS)
    left = killed.part.read_bytes()
    killed.abandon()
    assert not killed.part.exists()
    killed.part.write_bytes(left)
    assert find_unfinished([tmp_path]) == (tmp_path / "a.mcap.part",)
    assert CliRunner().invoke(app, ["recover", str(tmp_path)]).exit_code == 0
    assert {path.name for path in tmp_path.glob("*.mcap*")} - {killed.part.name} == {"a.mcap.part", target.name}


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("number", STOP_SIGNALS)
def test_interrupted_recovery_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    unfinished(tmp_path / "a.mcap")
    finish = PartFile.finish

    def interrupted(out: PartFile) -> None:
        os.kill(os.getpid(), number)
        finish(out)

    monkeypatch.setattr(PartFile, "finish", interrupted)
    outside = signal.signal(number, signal.SIG_DFL)  # a test run in the background may ignore Ctrl-C
    try:
        assert "interrupted" in CliRunner().invoke(app, ["recover", str(tmp_path)]).output
    finally:
        signal.signal(number, outside)
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap.part"]


def test_file_that_appears_during_the_recovery_is_not_overwritten(
    tmp_path: Path, whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target, finish = tmp_path / "out.mcap", PartFile.finish

    def finish_later(out: PartFile) -> None:
        target.write_bytes(b"theirs")
        finish(out)

    monkeypatch.setattr(PartFile, "finish", finish_later)
    with pytest.raises(ConfigError, match=r"out\.mcap: already exists; name another output$"):
        recover(whole, target)
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("out.mcap", b"theirs")]


@pytest.mark.skipif(sys.platform == "win32", reason="there are no advisory locks on Windows")
def test_recording_that_is_being_written_is_not_recovered(tmp_path: Path) -> None:
    writer = new_writer(tmp_path / "a.mcap")
    fill(writer, ROWS)
    refused = CliRunner().invoke(app, ["recover", str(tmp_path)])
    assert refused.exit_code == 1
    assert "a.mcap.part: is still being written; recover it after its session has ended" in refused.stderr
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap.part"]
    writer.abandon()
    assert CliRunner().invoke(app, ["recover", str(tmp_path)]).exit_code == 0


def test_recovered_file_name_follows_from_the_source() -> None:
    for name in ("a_b.mcap", "a_b.mcap.part"):
        assert recovered_path(Path("x") / name) == Path("x/a_b.recovered.mcap")


@pytest.mark.parametrize("content", [b"hello", b"\x89MCAP0\r"])
def test_recovery_of_a_file_that_is_not_mcap_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.mcap.part").write_bytes(content)
    with pytest.raises(RecordingError, match="not an MCAP file"):
        recover(tmp_path / "a.mcap.part")
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap.part"]


def test_recovery_of_an_empty_file_says_that_it_is_empty(tmp_path: Path) -> None:
    (tmp_path / "a.mcap.part").touch()
    with pytest.raises(RecordingError, match=r"a\.mcap\.part: is empty"):
        recover(tmp_path / "a.mcap.part")
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap.part"]


@pytest.mark.skipif(sys.platform in {"win32", "darwin"}, reason="all names are valid Unicode there")
def test_recording_whose_name_is_not_valid_utf8_is_recovered(tmp_path: Path, whole: Path) -> None:
    source, output = tmp_path / os.fsdecode(b"b\xff.mcap.part"), tmp_path / "out.mcap"
    source.write_bytes(whole.read_bytes())
    recover(source, output)
    with Recording(output) as recording:
        assert recording.recovery["source"] == r"b\xff.mcap.part"


def test_recovery_of_an_unknown_format_version_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    RecordingWriter(path, metadata() | {"format": "99"}, CONFIG_TEXT, Settings(), OPENED_NS).finish(OPENED_NS)
    with pytest.raises(RecordingError, match="format version 99"):
        recover(path)
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap"]


def test_part_holds_everything_up_to_the_last_flush(tmp_path: Path) -> None:
    writer = new_writer(tmp_path / "a.mcap", Settings(flush_ms=5000.0))
    fill(writer, ROWS[:25])
    writer.flush(OPENED_NS)
    fill(writer, ROWS[25:30], first=writer.durable or 0)
    writer.abandon()
    report = recover(tmp_path / "a.mcap.part")
    assert (report.first_tick, report.last_tick, report.damage, report.finished) == (0, 24, (), False)
    with Recording(report.output) as recording:
        assert recording.ticks().tobytes() == ROWS[:25].tobytes()
        assert recording.end == {}


KILLED = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from samples import MS, OPENED_NS, new_writer, random_rows
from netboard.base.tables.rig import RecordingSettings
from netboard.network.protocol.messages import TickRecord
rows = random_rows(400, seed=6)
writer = new_writer(Path(sys.argv[1]), RecordingSettings(chunk_bytes=8192, flush_ms=20.0))
number = 0
while True:
    now = OPENED_NS + number * MS
    row = rows[number % 400 : number % 400 + 1].copy()
    row["tick"] = number
    writer.write(TickRecord(row.tobytes()), number, now)
    number += 1
    if writer.is_due(now):
        print(writer.flush(now), flush=True)
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="needs SIGKILL")
@pytest.mark.parametrize("flushes", [1, 7, 30])
def test_kill_9_leaves_everything_up_to_the_last_flush(tmp_path: Path, flushes: int) -> None:
    path = tmp_path / "a.mcap"
    arguments = [sys.executable, "-c", KILLED, str(path), str(Path(__file__).parents[1])]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for _ in range(flushes):
            durable = int(process.stdout.readline())
        process.send_signal(signal.SIGKILL)
    report = recover(tmp_path / "a.mcap.part")
    with Recording(report.output) as recording:
        ticks = recording.ticks()
    assert len(ticks) >= durable
    expected = random_rows(400, seed=6)[np.arange(len(ticks)) % 400]
    expected["tick"] = np.arange(len(ticks))
    assert ticks.tobytes() == expected.tobytes()
    assert report.lost_bytes < 8192 + 1024
