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
from netboard.benchmarks.faults.rigs import Rig, Way
from netboard.network.transport.ports import free_port
from netboard.recording.export.lsl_streams import STREAMS, description, event_text, samples, seconds
from netboard.recording.files.reader import Recording

pylsl = pytest.importorskip("pylsl", reason="needs netboard[lsl]", exc_type=(ImportError, RuntimeError))

pytestmark = [pytest.mark.integration, pytest.mark.slow, pytest.mark.timeout(240)]

AHEAD_NS = 3_600_000_000_000
SOON_LEVEL = ("task.level_time=0.05", "task.level_angle_deg=5.0", "task.level_rate_deg_s=30.0", "block.trials=50")


def alone(folder: Path) -> dict[str, str]:
    """Environment in which the layer stays on this machine, needs no network, and sees no other test."""
    file = folder / "lsl_api.cfg"
    session = "".join(letter for letter in str(folder) if letter.isalnum())
    file.write_text(
        "[ports]\nIPv6 = disable\n[multicast]\nResolveScope = machine\nListenAddress = 127.0.0.1\n"
        f"[lab]\nKnownPeers = {{127.0.0.1}}\nSessionID = {session}\n[log]\nlevel = -2\n"
    )
    return {"LSLAPICFG": str(file)}


class Recorder:
    """A recorder in a process of its own, until so many sessions have ended."""

    def __init__(self, folder: Path, sessions: int) -> None:
        self.file = folder / "taken.npz"
        script = Path(__file__).with_name("lsl_inlet.py")
        self.process = subprocess.Popen(
            [sys.executable, str(script), "netboard", str(self.file), "session_ended", str(sessions), "150"],
            env=os.environ | alone(folder),
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

    def taken(self) -> dict[str, np.ndarray]:
        assert self.process.wait(150) == 0
        with np.load(self.file) as found:
            return dict(found)


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    with Rig(tmp_path, SOON_LEVEL, alone(tmp_path)) as rig:
        yield rig


def held(rig: Rig, ticks: int) -> Path:
    """Let a session go on for so many ticks, and end it; its recording."""
    first = rig.until(lambda status: status.phase == "running" and "listener" in status.peers).tick
    rig.until(lambda status: status.tick > first + ticks)
    return rig.finish()[-1]


def own(taken: dict[str, np.ndarray]) -> list[dict[str, Any]]:
    """What the streams say of themselves."""
    return [told for told in map(json.loads, taken["events"].tolist()) if told["name"].startswith("lsl_")]


def words(element: ElementTree.Element) -> list[str]:
    """The texts of an element, in order, however it is laid out."""
    return [text.strip() for text in element.itertext() if text.strip()]


def check_same(taken: dict[str, np.ndarray], paths: Sequence[Path]) -> None:
    """What was taken is what was recorded: values to the bit, stamps, and events."""
    with ExitStack() as stack:
        recordings = [stack.enter_context(Recording(path)) for path in paths]
        ticks = np.concatenate([recording.ticks(as_sent=True) for recording in recordings])
        events = [event for recording in recordings for event in recording.events()]
        clocks = [clock for recording in recordings for clock in recording.clocks() if clock.peer == "listener"]
    assert np.array_equal(taken["ticks"].view(np.int64), samples(ticks).view(np.int64))
    assert np.array_equal(taken["ticks_stamps"], seconds(ticks["time_ns"]))
    assert taken["markers"].tolist() == [event.name for event in events]
    assert taken["markers_stamps"].tolist() == [event.time_ns / 1e9 for event in events]
    texts = [text for text in taken["events"].tolist() if not json.loads(text)["name"].startswith("lsl_")]
    assert texts == [event_text(event) for event in events]
    assert clocks
    assert all(abs(clock.offset_ns) <= clock.bound_ns for clock in clocks)


@pytest.mark.daily(1, of="whole sessions")
def test_a_recorder_takes_a_whole_session_bit_for_bit(rig: Rig, tmp_path: Path) -> None:
    rig.start("lsl", "lsl")
    with Recorder(tmp_path, 1) as recorder:
        rig.start_all()
        path = held(rig, 4000)
        taken = recorder.taken()
    check_same(taken, [path])
    assert [told["name"] for told in own(taken)] == ["lsl_session", "lsl_clock"]
    assert own(taken)[1]["details"]["one_clock"] == "true"
    for stream in STREAMS:
        desc = ElementTree.fromstring(str(taken[f"{stream.name}_xml"])).find("desc")
        assert desc is not None
        found = {child.tag: words(child) for child in desc if child.tag != "clock"}
        assert found == {child.tag: words(child) for child in description(stream, {})}
        assert desc.find("clock/layer_bound_ns") is not None
    assert rig.stop("lsl", signal.SIGINT) == 0
    assert "0 records lost" in rig.said("lsl")


@pytest.mark.daily(1, of="whole sessions")
def test_a_stop_and_another_session_lose_nothing_and_the_recording_none_the_less(rig: Rig, tmp_path: Path) -> None:
    lsl = rig.start("lsl", "lsl")
    with Recorder(tmp_path, 2) as recorder:
        rig.start_all()
        rig.until(lambda status: status.phase == "running" and "listener" in status.peers)
        rig.send_signal("lsl", signal.SIGSTOP)
        gone = rig.until(lambda status: "listener" not in status.peers)
        rig.until(lambda status: status.tick > gone.tick + 1000)
        rig.send_signal("lsl", signal.SIGCONT)
        first = held(rig, 3000)
        for side in ("left", "right"):
            rig.stop(f"{side} agent")
        rig.start_all()
        second = held(rig, 1000)
        taken = recorder.taken()
    assert lsl.poll() is None
    check_same(taken, [first, second])
    for path in (first, second):
        with Recording(path) as recording:
            assert recording.gaps() == {}
            assert recording.remarks() == ()
    assert [told["name"] for told in own(taken)] == ["lsl_session", "lsl_clock"] * 2
    assert rig.stop("lsl") == 0


@pytest.mark.daily(1, of="whole sessions")
def test_on_a_machine_with_another_clock_stamps_are_right_within_what_is_told(tmp_path: Path) -> None:
    port = free_port()
    script = str(Path(__file__).with_name("skewed.py"))
    ahead = (sys.executable, script, str(tmp_path / "steps"), str(AHEAD_NS), "0", str(now_ns()), "0")
    ways = {"lsl": Way("127.0.0.1", port, ahead)}
    with Rig(tmp_path, (*SOON_LEVEL, f"network.port={port}"), alone(tmp_path), ways) as rig:
        rig.start("lsl", "lsl")
        with Recorder(tmp_path, 1) as recorder:
            rig.start_all()
            path = held(rig, 4000)
            taken = recorder.taken()
    with Recording(path) as recording:
        ticks = recording.ticks(as_sent=True)
    assert np.array_equal(taken["ticks"].view(np.int64), samples(ticks).view(np.int64))
    clocks = [told["details"] for told in own(taken) if told["name"] == "lsl_clock"]
    assert {details["one_clock"] for details in clocks} == {"false"}
    assert all(abs(int(details["offset_ns"]) - AHEAD_NS) <= int(details["bound_ns"]) for details in clocks)
    layer_ns = int(ElementTree.fromstring(str(taken["ticks_xml"])).findtext("desc/clock/layer_minus_machine_ns") or 0)
    layer_bound_ns = int(ElementTree.fromstring(str(taken["ticks_xml"])).findtext("desc/clock/layer_bound_ns") or 0)
    assert abs(layer_ns + AHEAD_NS) <= layer_bound_ns
    error = np.abs(taken["ticks_stamps"] - seconds(ticks["time_ns"]))  # the layer's clock is the server's in truth
    assert error.max() <= (max(int(details["bound_ns"]) for details in clocks) + layer_bound_ns) * 1e-9
