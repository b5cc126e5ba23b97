"""Streams of the Lab Streaming Layer from real processes: what a recorder takes is what the recording has."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from netboard.faults.rigs import Rig
from netboard.recording.reader import Recording
from netboard.recording.streams import COLUMNS, STREAMS, description, event_text, samples, seconds

pylsl = pytest.importorskip("pylsl", reason="needs netboard[lsl]", exc_type=(ImportError, RuntimeError))

pytestmark = [pytest.mark.integration, pytest.mark.slow, pytest.mark.timeout(240)]

SOON_LEVEL = ("task.level_time=0.05", "task.level_angle_deg=5.0", "task.level_rate_deg_s=30.0", "block.trials=50")


def alone(folder: Path) -> dict[str, str]:
    """Environment in which the layer stays on this machine, needs no network, and sees no other test."""
    file = folder / "lsl_api.cfg"
    session = f"netboard-{folder.name}-{hash(str(folder)) & 0xFFFFFF:x}"
    file.write_text(
        "[ports]\nIPv6 = disable\n[multicast]\nResolveScope = machine\nListenAddress = 127.0.0.1\n"
        f"[lab]\nKnownPeers = {{127.0.0.1}}\nSessionID = {session}\n[log]\nlevel = -2\n"
    )
    return {"LSLAPICFG": str(file)}


class Recorder:
    """A recorder in a process of its own."""

    def __init__(self, folder: Path, environment: dict[str, str], last: str) -> None:
        self.file = folder / "taken.npz"
        script = Path(__file__).with_name("lsl_inlet.py")
        self.process = subprocess.Popen(
            [sys.executable, str(script), "netboard", str(self.file), last, "120"],
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == "ready\n"

    def taken(self) -> dict[str, np.ndarray]:
        assert self.process.wait(120) == 0
        with np.load(self.file) as found:
            return dict(found)


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    with Rig(tmp_path, SOON_LEVEL, alone(tmp_path)) as rig:
        yield rig


def test_a_recorder_takes_a_whole_session_bit_for_bit(rig: Rig, tmp_path: Path) -> None:
    lsl = rig.start("lsl", "lsl")
    recorder = Recorder(tmp_path, rig._environment, "session_ended")
    rig.start_all(displays=False)
    rig.until(lambda status: status.phase == "running" and "listener" in status.peers)
    tick = rig.until(lambda status: status.tick > 0).tick
    rig.until(lambda status: status.tick > tick + 4000)
    (path,) = rig.finish()
    taken = recorder.taken()
    assert lsl.poll() is None
    assert rig.stop("lsl") == 0
    with Recording(path) as recording:
        ticks, events = recording.ticks(), recording.events()
        clocks = [clock for clock in recording.clocks() if clock.peer == "listener"]
    assert np.array_equal(taken["ticks"].view(np.int64), samples(ticks).view(np.int64))
    assert np.array_equal(taken["ticks_stamps"], seconds(ticks["time_ns"]))
    assert taken["markers"].tolist() == [event.name for event in events]
    told = [text for text in taken["events"].tolist() if not json.loads(text)["name"].startswith("lsl_")]
    assert told == [event_text(event) for event in events]
    own = [json.loads(text)["name"] for text in taken["events"].tolist() if text not in told]
    assert own == ["lsl_session", "lsl_clock"]
    assert clocks
    assert all(abs(clock.offset_ns) <= clock.bound_ns for clock in clocks)
    print("ticks", len(ticks))
    late = (taken["arrivals"] - taken["ticks_stamps"])[2000:] * 1e3
    print("latency ms p50 p99 max", *np.percentile(late, (50, 99, 100)))
    for stream in STREAMS:
        info = ElementTree.fromstring(str(taken[f"{stream.name}_xml"]))
        found = {child.tag: ElementTree.tostring(child) for child in info.find("desc") or () if child.tag != "clock"}
        wanted = {child.tag: ElementTree.tostring(child) for child in description(stream, {})}
        assert {tag: b"".join(text.split()) for tag, text in found.items()} == {
            tag: b"".join(text.split()) for tag, text in wanted.items()
        }
        assert int(info.findtext("channel_count") or 0) == len(stream.channels)
    assert len(COLUMNS) == taken["ticks"].shape[1]
