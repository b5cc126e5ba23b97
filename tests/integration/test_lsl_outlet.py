"""Lab Streaming Layer streams from real processes equal the recording."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from netboard.base.clock import now_ns
from netboard.benchmarks.harness.rig import Rig, Route
from netboard.network.transport.ports import free_port
from netboard.recording.export.lsl_streams import STREAMS, description, event_text, samples, seconds
from netboard.recording.files.reader import Recording

pylsl = pytest.importorskip("pylsl", reason="needs netboard[lsl]", exc_type=(ImportError, RuntimeError))

pytestmark = [pytest.mark.integration, pytest.mark.slow, pytest.mark.timeout(240)]

AHEAD_NS = 3_600_000_000_000
SOON_LEVEL = ("task.level_time=0.05", "task.level_angle_deg=5.0", "task.level_rate_deg_s=30.0", "block.trials=50")


def lsl_environment(folder: Path) -> dict[str, str]:
    """Environment that keeps LSL on this machine, without a network and isolated from other tests."""
    file = folder / "lsl_api.cfg"
    session = "".join(letter for letter in str(folder) if letter.isalnum())
    file.write_text(
        "[ports]\nIPv6 = disable\n[multicast]\nResolveScope = machine\nListenAddress = 127.0.0.1\n"
        f"[lab]\nKnownPeers = {{127.0.0.1}}\nSessionID = {session}\n[log]\nlevel = -2\n"
    )
    return {"LSLAPICFG": str(file)}


class Recorder:
    """A recorder in its own process that ends after a number of sessions."""

    def __init__(self, folder: Path, sessions: int) -> None:
        self.file = folder / "taken.npz"
        script = Path(__file__).with_name("lsl_inlet.py")
        self.process = subprocess.Popen(
            [sys.executable, str(script), "netboard", str(self.file), "session_ended", str(sessions), "150"],
            env=os.environ | lsl_environment(folder),
            stdout=subprocess.PIPE,
            text=True,
        )

    def __enter__(self) -> "Recorder":
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == "ready\n"
        return self

    def __exit__(self, *error: object) -> None:
        self.process.kill()
        self.process.communicate()

    def samples_received(self) -> dict[str, np.ndarray]:
        assert self.process.wait(150) == 0
        with np.load(self.file) as found:
            return dict(found)


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    with Rig(tmp_path, SOON_LEVEL, lsl_environment(tmp_path)) as rig:
        yield rig


def run_session(rig: Rig, ticks: int) -> Path:
    """Run a session for a number of ticks, end it and return its recording."""
    first = rig.until(lambda status: status.phase == "running" and "listener" in status.peers).tick
    rig.until(lambda status: status.tick > first + ticks)
    return rig.finish()[-1]


def outlet_events(received: dict[str, np.ndarray]) -> list[dict[str, Any]]:
    """Events that describe the streams themselves."""
    return [event for event in map(json.loads, received["events"].tolist()) if event["name"].startswith("lsl_")]


def texts_of(element: ElementTree.Element) -> list[str]:
    """The texts of an XML element in order, regardless of white space."""
    return [text.strip() for text in element.itertext() if text.strip()]


def check_received(received: dict[str, np.ndarray], paths: Sequence[Path]) -> None:
    """Check that received and recorded data agree: bit-identical values, time stamps and events."""
    with ExitStack() as stack:
        recordings = [stack.enter_context(Recording(path)) for path in paths]
        ticks = np.concatenate([recording.ticks(as_sent=True) for recording in recordings])
        events = [event for recording in recordings for event in recording.events()]
        clocks = [clock for recording in recordings for clock in recording.clocks() if clock.peer == "listener"]
    assert np.array_equal(received["ticks"].view(np.int64), samples(ticks).view(np.int64))
    assert np.array_equal(received["ticks_stamps"], seconds(ticks["time_ns"]))
    assert received["markers"].tolist() == [event.name for event in events]
    assert received["markers_stamps"].tolist() == [event.time_ns / 1e9 for event in events]
    texts = [text for text in received["events"].tolist() if not json.loads(text)["name"].startswith("lsl_")]
    assert texts == [event_text(event) for event in events]
    assert clocks
    assert all(abs(clock.offset_ns) <= clock.bound_ns for clock in clocks)


@pytest.mark.sampled(1, of="whole sessions")
def test_lsl_recorder_receives_a_whole_session_bit_identically(rig: Rig, tmp_path: Path) -> None:
    rig.start("lsl", "lsl")
    with Recorder(tmp_path, 1) as recorder:
        rig.start_all()
        path = run_session(rig, 4000)
        received = recorder.samples_received()
    check_received(received, [path])
    assert [event["name"] for event in outlet_events(received)] == ["lsl_session", "lsl_clock"]
    assert outlet_events(received)[1]["details"]["one_clock"] == "true"
    for stream in STREAMS:
        desc = ElementTree.fromstring(str(received[f"{stream.name}_xml"])).find("desc")
        assert desc is not None
        found = {child.tag: texts_of(child) for child in desc if child.tag != "clock"}
        assert found == {child.tag: texts_of(child) for child in description(stream, {})}
        assert desc.find("clock/layer_bound_ns") is not None
    assert rig.stop("lsl", signal.SIGINT) == 0
    assert "0 records lost" in rig.output_of("lsl")


@pytest.mark.sampled(1, of="whole sessions")
def test_suspended_outlet_and_second_session_lose_no_data(rig: Rig, tmp_path: Path) -> None:
    lsl = rig.start("lsl", "lsl")
    with Recorder(tmp_path, 2) as recorder:
        rig.start_all()
        rig.until(lambda status: status.phase == "running" and "listener" in status.peers)
        rig.suspend("lsl")
        gone = rig.until(lambda status: "listener" not in status.peers)
        rig.until(lambda status: status.tick > gone.tick + 1000)
        rig.resume("lsl")
        first = run_session(rig, 3000)
        for side in ("left", "right"):
            rig.stop(f"{side} agent")
        rig.start_all()
        second = run_session(rig, 1000)
        received = recorder.samples_received()
    assert lsl.poll() is None
    check_received(received, [first, second])
    for path in (first, second):
        with Recording(path) as recording:
            assert recording.gaps() == {}
            assert recording.remarks() == ()
    assert [event["name"] for event in outlet_events(received)] == ["lsl_session", "lsl_clock"] * 2
    assert rig.stop("lsl") == 0


@pytest.mark.sampled(1, of="whole sessions")
def test_lsl_time_stamps_on_a_skewed_clock_are_within_the_reported_bound(tmp_path: Path) -> None:
    port = free_port()
    script = str(Path(__file__).with_name("skewed.py"))
    ahead = (sys.executable, script, str(tmp_path / "steps"), str(AHEAD_NS), "0", str(now_ns()), "0")
    routes = {"lsl": Route("127.0.0.1", port, ahead)}
    with Rig(tmp_path, (*SOON_LEVEL, f"network.port={port}"), lsl_environment(tmp_path), routes) as rig:
        rig.start("lsl", "lsl")
        with Recorder(tmp_path, 1) as recorder:
            rig.start_all()
            path = run_session(rig, 4000)
            received = recorder.samples_received()
    with Recording(path) as recording:
        ticks = recording.ticks(as_sent=True)
    assert np.array_equal(received["ticks"].view(np.int64), samples(ticks).view(np.int64))
    clocks = [event["details"] for event in outlet_events(received) if event["name"] == "lsl_clock"]
    assert {details["one_clock"] for details in clocks} == {"false"}
    assert all(abs(int(details["offset_ns"]) - AHEAD_NS) <= int(details["bound_ns"]) for details in clocks)
    layer_ns = int(
        ElementTree.fromstring(str(received["ticks_xml"])).findtext("desc/clock/layer_minus_machine_ns") or 0
    )
    layer_bound_ns = int(ElementTree.fromstring(str(received["ticks_xml"])).findtext("desc/clock/layer_bound_ns") or 0)
    assert abs(layer_ns + AHEAD_NS) <= layer_bound_ns
    error = np.abs(received["ticks_stamps"] - seconds(ticks["time_ns"]))  # the LSL clock is actually the server's
    assert error.max() <= (max(int(details["bound_ns"]) for details in clocks) + layer_bound_ns) * 1e-9
