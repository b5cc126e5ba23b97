"""XDF files as pyxdf reads them: bit-exact values, stamps, stream descriptions, and recovery from damage."""

import json
import tracemalloc
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyxdf
from numpy.typing import NDArray

from netboard.base.config import Config, resolve
from netboard.base.errors import RecordingError
from netboard.base.tables.rig import RecordingSettings
from netboard.base.tick import TICK
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.records import EventRecord, TickRecord
from netboard.recording.export import xdf
from netboard.recording.export.lsl_streams import COLUMNS, EVENTS, MARKERS, STREAMS, TICKS, samples, seconds
from netboard.recording.files.provenance import provenance
from netboard.recording.files.writer import RecordingWriter
from netboard.testing.export_format import Columns, ExportFormatContract

MS = 1_000_000
START_NS = 9_007_199_254_740_993  # no float64 is this number
UTC_NS = 1_790_000_000_000_000_000
ODD = 'a "note", with\nlines, <tags> & ü中🎱 \x00'


def random_rows(count: int, missing: range = range(0)) -> NDArray[Any]:
    """Ticks whose numbers are random bits: any float64, not-a-numbers with payload included."""
    rows = np.frombuffer(bytearray(np.random.default_rng(3).bytes(count * TICK.itemsize)), TICK)
    rows["tick"] = np.arange(count)
    rows["time_ns"] = START_NS + np.arange(count) * MS
    return np.delete(rows, missing)


def write_recording(path: Path, rows: NDArray[Any], event_at: Sequence[int] = ()) -> tuple[EventRecord, ...]:
    """Write a recording with events after some of its rows, and return these."""
    text = resolve(Config())
    welcome = Welcome("3f2a9c1e00000000", 1, 7, text)
    writer = RecordingWriter(path, provenance(welcome, Config(), 1, UTC_NS, 42), text, RecordingSettings(), UTC_NS)
    events = []
    number = 0
    for place, row in enumerate(rows):
        writer.write(TickRecord(row.tobytes()), number, UTC_NS + number * MS)
        number += 1
        if place in event_at:
            time_ns = int(row["time_ns"]) + 300_000
            events.append(EventRecord(len(events), int(row["tick"]), time_ns, "note", {"text": ODD}))
            writer.write(events[-1], number, UTC_NS + number * MS)
            number += 1
    writer.finish(UTC_NS + number * MS)
    return tuple(events)


def export(path: Path, folder: Path) -> Path:
    folder.mkdir()
    xdf.write([path], folder, lambda what, done, total: None)
    return folder / f"{path.stem}.xdf"


def streams_of(file: Path, *, dejitter: bool = False, synchronise: bool = True) -> dict[str, dict[str, Any]]:
    found, _ = pyxdf.load_xdf(file, dejitter_timestamps=dejitter, synchronize_clocks=synchronise)
    return {stream["info"]["name"][0]: stream for stream in found}


class TestXdf(ExportFormatContract):
    name = "xdf"

    def read(self, folder: Path, recording: str) -> Columns:
        values = streams_of(folder / f"{recording}.xdf")["netboard.ticks"]["time_series"]
        return {name: values[:, k] for k, name in enumerate(COLUMNS) if TICK[name].kind == "f"}


@pytest.mark.parametrize("synchronise", [True, False])
@pytest.mark.parametrize("dejitter", [True, False])
def test_pyxdf_reads_identical_values_and_times(tmp_path: Path, dejitter: bool, synchronise: bool) -> None:
    rows = random_rows(12_345)
    events = write_recording(tmp_path / "a.mcap", rows, (0, 10, 4999, 5000, 12_344))
    found = streams_of(export(tmp_path / "a.mcap", tmp_path / "out"), dejitter=dejitter, synchronise=synchronise)
    assert list(found) == ["netboard.ticks", "netboard.markers", "netboard.events"]
    ticks, markers, texts = found.values()
    assert np.array_equal(ticks["time_series"].view(np.int64), samples(rows).view(np.int64))
    for k, name in enumerate(COLUMNS):
        assert np.array_equal(ticks["time_series"][:, k], rows[name].astype(float), equal_nan=True)
    error = np.abs(ticks["time_stamps"] - seconds(rows["time_ns"]))
    assert error.max() <= (1e-8 if dejitter else 0.0)  # 2 ns is as near as a float64 gets to a time so long after zero
    assert markers["time_series"] == [["note"]] * 5
    assert markers["time_stamps"].tolist() == texts["time_stamps"].tolist() == [e.time_ns / 1e9 for e in events]
    read = [json.loads(text) for (text,) in texts["time_series"]]
    assert read == [{"seq": e.seq, "tick": e.tick, "name": "note", "details": {"text": ODD}} for e in events]


def test_gap_separates_two_segments(tmp_path: Path) -> None:
    rows = random_rows(6000, range(2000, 4500))
    write_recording(tmp_path / "a.mcap", rows)
    file = export(tmp_path / "a.mcap", tmp_path / "out")
    assert np.array_equal(streams_of(file)["netboard.ticks"]["time_stamps"], seconds(rows["time_ns"]))
    smoothed = streams_of(file, dejitter=True)["netboard.ticks"]
    assert smoothed["info"]["segments"] == [(0, 1999), (2000, 3499)]
    assert np.abs(smoothed["time_stamps"] - seconds(rows["time_ns"])).max() < 1e-8


def test_streams_describe_their_channels_units_and_recording(tmp_path: Path) -> None:
    rows = random_rows(700)
    events = write_recording(tmp_path / "a.mcap", rows, (5,))
    found = streams_of(export(tmp_path / "a.mcap", tmp_path / "out"))
    for stream in STREAMS:
        info, footer = found[f"netboard.{stream.name}"]["info"], found[f"netboard.{stream.name}"]["footer"]["info"]
        channels = info["desc"][0]["channels"][0]["channel"]
        assert [channel["label"] for channel in channels] == [[field.name] for field in stream.channels]
        assert [channel.get("unit", [""]) for channel in channels] == [[field.unit] for field in stream.channels]
        assert all(channel["type"] and channel["description"] for channel in channels)
        assert info["channel_count"] == [str(len(channels))]
        assert info["channel_format"] == [stream.format]
        assert info["desc"][0]["recording"][0]["dyad"] == ["D01"]
        assert footer["sample_count"] == [str(700 if stream is TICKS else len(events))]
        assert float(footer["first_timestamp"][0]) == found[f"netboard.{stream.name}"]["time_stamps"][0]
        assert float(footer["last_timestamp"][0]) == found[f"netboard.{stream.name}"]["time_stamps"][-1]
        assert {offset["value"][0] for offset in footer["clock_offsets"][0]["offset"]} == {"0"}
    assert found["netboard.ticks"]["info"]["nominal_srate"] == ["1000.000000000000"]
    assert {stream["info"]["type"][0] for stream in found.values()} == {TICKS.type, MARKERS.type, EVENTS.type}


def test_intact_chunks_of_a_truncated_or_damaged_file_are_readable(tmp_path: Path) -> None:
    rows = random_rows(25_000)
    write_recording(tmp_path / "a.mcap", rows)
    file = export(tmp_path / "a.mcap", tmp_path / "out")
    whole = bytearray(file.read_bytes())
    assert whole.count(xdf.BOUNDARY_MARK) >= 3
    file.write_bytes(whole[: len(whole) // 2])
    cut = streams_of(file)["netboard.ticks"]["time_series"]
    assert len(rows) // 2 - 2 * xdf.CHUNK < len(cut) <= len(rows) // 2 + xdf.CHUNK
    assert np.array_equal(cut.view(np.int64), samples(rows[: len(cut)]).view(np.int64))
    whole[len(whole) // 5 : len(whole) // 5 + 100_000] = bytes(100_000)
    file.write_bytes(whole)
    found = streams_of(file)["netboard.ticks"]["time_series"][:, 0]
    kept = found[np.isin(found, np.arange(len(rows)))]  # pyxdf may take damaged bytes for a few samples
    assert len(found) - len(kept) < xdf.CHUNK
    assert len(rows) * 0.5 < len(kept) < len(rows)
    assert kept[-1] == len(rows) - 1


def test_empty_recording_gives_a_valid_file(tmp_path: Path) -> None:
    write_recording(tmp_path / "a.mcap", random_rows(0))
    found = streams_of(export(tmp_path / "a.mcap", tmp_path / "out"))
    assert [len(stream["time_series"]) for stream in found.values()] == [0, 0, 0]


@pytest.mark.slow
def test_peak_memory_is_independent_of_the_recording_length(tmp_path: Path) -> None:
    peaks = []
    for count in (20_000, 80_000):
        write_recording(tmp_path / f"{count}.mcap", random_rows(count))
        tracemalloc.start()
        export(tmp_path / f"{count}.mcap", tmp_path / str(count))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.6 * peaks[0]  # four times the ticks; whether two threads decode at the same time is chance


def test_every_recording_has_a_file_and_progress_is_reported(tmp_path: Path) -> None:
    paths = [tmp_path / "a.mcap", tmp_path / "b.mcap"]
    for path in paths:
        write_recording(path, random_rows(6000))
    reported: list[tuple[str, int, int]] = []
    (tmp_path / "out").mkdir()
    xdf.write(paths, tmp_path / "out", lambda *what: reported.append(what))
    assert {file.name for file in (tmp_path / "out").iterdir()} == {"a.xdf", "b.xdf"}
    for name in ("a.mcap", "b.mcap"):
        steps = [(done, total) for what, done, total in reported if what == name]
        assert steps == sorted(steps)
        assert steps[-1] == (6000, 6000)


def test_file_that_is_not_a_recording_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"nothing")
    (tmp_path / "out").mkdir()
    with pytest.raises(RecordingError, match="not an MCAP file"):
        xdf.write([tmp_path / "a.mcap"], tmp_path / "out", lambda *what: None)
    assert list((tmp_path / "out").iterdir()) == []


def test_existing_file_is_not_overwritten(tmp_path: Path) -> None:
    write_recording(tmp_path / "a.mcap", random_rows(10))
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "a.xdf").write_text("mine")
    with pytest.raises(FileExistsError):
        xdf.write([tmp_path / "a.mcap"], tmp_path / "out", lambda *what: None)
    assert (tmp_path / "out" / "a.xdf").read_text() == "mine"
