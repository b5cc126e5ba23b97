"""A spill of several blocks becomes one recording for each, as a logger would write them."""

from pathlib import Path

import numpy as np
import pytest

from netboard.base.errors import ConfigError, RecordingError
from netboard.base.tick import TICK
from netboard.network.protocol.codec import encode
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.protocol.records import BLOCK_BEGAN, EventRecord, LogBatch, TickRecord
from netboard.recording.files.reader import Recording
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.integrity.account import account_of
from netboard.recording.recovery.spill import Spill
from netboard.recording.recovery.spilled import recover_any

SESSION = "c0ffee1234567890"


def config(block: int) -> str:
    return f'[session]\nname = "S07"\ndyad = "D03"\n[block]\nnumber = {block}\nblocks = 3\n'


def frames(*blocks: tuple[int, int, int]) -> list[bytes]:
    """The log of some blocks: number, first tick, and the tick after the last."""
    log = []
    for block, first, stop in blocks:
        log.append(encode(EventRecord(block, first, first, BLOCK_BEGAN, {"config": config(block)})))
        for tick in range(first, stop):
            row = np.zeros(1, TICK)
            row["tick"], row["time_ns"], row["z"] = tick, tick * 1_000_000, tick * 1e-6
            log.append(encode(TickRecord(row.tobytes())))
    return log


def spilled(path: Path, log: list[bytes]) -> Path:
    """A server's spill of these records, which number from 0."""
    spill = Spill(path, Welcome(SESSION, PROTOCOL_VERSION, 0, config(1)), 10**8)
    batches = [LogBatch(first, 0, tuple(log[first : first + 50])) for first in range(0, len(log), 50)]
    spill.close(iter(batches))
    assert spill._thread is not None
    spill._thread.join(30)
    return path


@pytest.fixture
def three(tmp_path: Path) -> Path:
    return spilled(tmp_path / "S07.spill", frames((1, 0, 120), (2, 120, 130), (3, 130, 300)))


def test_each_spilled_block_becomes_a_recording_with_its_configuration(three: Path) -> None:
    before = three.read_bytes()
    reports = recover_any(three)
    assert three.read_bytes() == before
    assert [report.output.name for report in reports] == [f"S07_block0{block}.recovered.mcap" for block in (1, 2, 3)]
    assert [(report.first_tick, report.last_tick) for report in reports] == [(0, 119), (120, 129), (130, 299)]
    following = 0
    for block, report in enumerate(reports, start=1):
        with Recording(report.output) as recording:
            recording.check()
            assert recording.config_text == config(block)
            assert recording.metadata["block"] == str(block)
            assert [event.details["config"] for event in recording.events()] == [config(block)]
            assert recording.ticks()["z"].tolist() == [tick * 1e-6 for tick in recording.ticks()["tick"].tolist()]
            assert recording.first_record == following
            following = int(recording.end["next_record"])
    account = account_of([report.output for report in reports])
    assert (account.sound, account.present[0].first, account.present[-1].last) == (True, 0, 299)


def test_given_output_name_is_used_for_the_first_block(three: Path, tmp_path: Path) -> None:
    reports = recover_any(three, tmp_path / "out.mcap")
    assert [report.output.name for report in reports] == ["out.mcap", "out_block02.mcap", "out_block03.mcap"]


def test_existing_output_stops_the_recovery_before_any_file_is_left(three: Path, tmp_path: Path) -> None:
    (tmp_path / "S07_block03.recovered.mcap").write_bytes(b"mine")
    with pytest.raises(ConfigError, match=r"S07_block03\.recovered\.mcap: already exists"):
        recover_any(three)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["S07.spill", "S07_block03.recovered.mcap"]
    assert (tmp_path / "S07_block03.recovered.mcap").read_bytes() == b"mine"


def test_file_that_appears_under_the_output_name_is_not_deleted(
    three: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another process may finish its recovery of the same spill first."""
    theirs, finish = tmp_path / "S07_block02.recovered.mcap", RecordingWriter.finish

    def finish_later(writer: RecordingWriter, now_ns: int, ended: str) -> None:
        if writer.path == theirs:
            theirs.write_bytes(b"theirs")
        finish(writer, now_ns, ended)

    monkeypatch.setattr(RecordingWriter, "finish", finish_later)
    with pytest.raises(ConfigError, match="already exists"):
        recover_any(three)
    assert {path.name for path in tmp_path.iterdir()} == {three.name, theirs.name}
    assert theirs.read_bytes() == b"theirs"


def test_unfinished_recording_goes_to_the_mcap_recovery(tmp_path: Path) -> None:
    (tmp_path / "a.mcap.part").write_bytes(b"hello")
    with pytest.raises(RecordingError, match="not an MCAP file"):
        recover_any(tmp_path / "a.mcap.part")
