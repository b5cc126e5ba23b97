"""A replay server sends a recorded session to real displays, consoles and clients as if it were live."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Side
from netboard.benchmarks.harness.rig import TIMEOUT, Rig
from netboard.network import keys
from netboard.network.protocol.codec import decode
from netboard.network.transport import channels, poller, sockets
from netboard.recording.replay.loaded import LoadedRecording
from netboard.recording.replay.loading import load
from netboard.stage.view import View

pytestmark = [pytest.mark.integration, pytest.mark.slow, pytest.mark.timeout(240)]

QUICK_TRIALS = (
    "task.level_time=0.05",
    "task.level_angle_deg=5.0",
    "task.level_rate_deg_s=30.0",
    "network.sample_timeout_ms=1000",
)


SentViews = dict[Side, list[View]]
"""The views sent to each station."""


def any_views(seen: SentViews) -> bool:
    return all(seen.values())


def enough_views(seen: SentViews) -> bool:
    """Whether there are enough views to compare: about a second, including views of a rolling ball."""
    return min(map(len, seen.values())) > 100 and any(view.phase == "running" for view in seen["left"])


class ViewCollector:
    """The view subscribers of both stations, polled in one loop."""

    def __init__(self, rig: Rig) -> None:
        self._ends = {}
        for side in SIDES:
            where = keys.reach(rig.config.network, f"display.{side}")
            self._ends[side] = sockets.view_subscriber(rig.context, where.reach(channels.VIEW[side]))

    def collect(self, seconds: float, condition: Callable[[SentViews], bool] = any_views) -> SentViews:
        """Views sent from now on, for a duration after the first views of both, and until a condition holds."""
        seen: SentViews = {side: [] for side in SIDES}
        since_ns, until, rounds = now_ns(), time.monotonic() + TIMEOUT, round(seconds * 1000)
        while rounds > 0 or not condition(seen):
            assert time.monotonic() < until, "nothing is sent"
            for side, end in self._ends.items():
                if poller.wait_readable(end, 0.0005) and (frame := sockets.receive(end)) is not None:
                    view = decode(frame)
                    assert isinstance(view, View)
                    seen[side] += [view] if view.sent_ns >= since_ns else []
            rounds -= all(seen.values())
        return seen

    def close(self) -> None:
        for end in self._ends.values():
            end.close(linger=0)


def watch(
    rig: Rig,
    seconds: float,
    begin: Callable[[], None] = lambda: None,
    condition: Callable[[SentViews], bool] = any_views,
) -> SentViews:
    """Views sent to both stations for a duration after a call of `begin`, made once both are connected."""
    collector = ViewCollector(rig)
    collector.collect(0.001)
    begin()
    seen = collector.collect(seconds, condition)
    collector.close()
    return seen


def differing(recording: LoadedRecording, seen: SentViews) -> list[tuple[View, View]]:
    """Views that differ from the recorded view of their tick, each with the recorded one."""
    numbers = recording.ticks["tick"]
    pairs = [
        (view, recording.view(int(np.searchsorted(numbers, view.tick)), side, view.sent_ns, view.seq))
        for side, views in seen.items()
        for view in views
    ]
    return [(view, recorded) for view, recorded in pairs if view != recorded]


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, SentViews]:
    """A recording, and the views sent while it was made."""
    with Rig(tmp_path_factory.mktemp("live"), (*QUICK_TRIALS, "block.trials=50")) as rig:
        rig.start_all()
        rig.until(lambda status: status.phase == "levelling")
        seen = watch(rig, 1.0, condition=enough_views)
        rig.until(lambda status: status.successes >= 1 and status.phase == "running")
        (path,) = rig.finish()
    return path, seen


@pytest.fixture(scope="module")
def recording(live: tuple[Path, SentViews]) -> LoadedRecording:
    return load(live[0])


def serve_recording(folder: Path, path: Path, *settings: str) -> Rig:
    """A rig whose server is a replay."""
    rig = Rig(folder, settings)
    rig.start("server", "replay", str(path), "--serve")
    return rig


@pytest.fixture(scope="module")
def rig(live: tuple[Path, SentViews], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A replay server with keys."""
    folder = tmp_path_factory.mktemp("served")
    keys.init(folder / "keys")
    for role, side in (("display", "left"), ("display", "right"), ("agent", "left"), ("console", "")):
        keys.add(folder / "keys", role, side, folder / "keys")  # type: ignore[arg-type]
    with serve_recording(folder, live[0], "network.curve=on", f"network.keys={folder / 'keys'}") as rig:
        rig.until(lambda status: True)
        yield rig


def run(rig: Rig, *words: str) -> subprocess.CompletedProcess[str]:
    """Run a command from a shell."""
    command = [sys.executable, "-m", "netboard.services.cli", *words, "-c", str(rig.file)]
    return subprocess.run(command, cwd=rig.folder, capture_output=True, text=True, timeout=TIMEOUT, check=False)


def test_recording_reproduces_the_views_sent_live(live: tuple[Path, SentViews], recording: LoadedRecording) -> None:
    _, seen = live
    assert min(map(len, seen.values())) > 100
    assert any(view.phase == "running" for view in seen["left"])
    assert differing(recording, seen) == []


@pytest.mark.sampled(1, of="replay served")
def test_replay_sends_the_recorded_views_at_any_speed(rig: Rig, recording: LoadedRecording) -> None:
    for speed in ("1", "0.25", "8"):

        def begin(speed: str = speed) -> None:
            assert rig.operator.do("seek", "trial 1").accepted
            assert rig.operator.do("speed", speed).accepted
            assert rig.operator.do("play").accepted

        seen = watch(rig, 1.0, begin)
        for views in seen.values():
            ticks = np.array([view.tick for view in views])
            assert len(set(ticks)) > 10
            assert np.all(np.diff(ticks) >= 0)
            assert np.all(np.diff([view.seq for view in views]) > 0)
        assert differing(recording, seen) == []


@pytest.mark.sampled(1, of="replay served")
def test_replay_is_controlled_from_a_shell(rig: Rig, recording: LoadedRecording) -> None:
    assert run(rig, "control", "pause").stdout.startswith("pause: paused at ")
    done = run(rig, "control", "seek", "trial", "2", "--json")
    reply = json.loads(done.stdout)
    assert reply["accepted"]
    assert reply["status"]["trial"] == 2
    tick = reply["status"]["tick"]
    began = recording.trial(2)
    assert began is not None
    assert tick == recording.ticks["tick"][recording.at(began[0])] + 1
    stepped = json.loads(run(rig, "control", "step", "back", "7", "--json").stdout)
    assert stepped["status"]["tick"] == tick - 7
    watched = watch(rig, 0.3)
    assert {view.tick for views in watched.values() for view in views} == {tick - 8}, "the replay is paused"
    status = json.loads(run(rig, "status", "--json").stdout)
    assert status["notice"].startswith(f"replay of {recording.name}: paused at ")
    assert not status["armed"]
    rig.start("status", "status", "--watch", "--json")
    rig.until(lambda status: rig.output_of("status").count("\n") >= 2)
    rig.running["status"].send_signal(signal.SIGINT)
    assert rig.wait("status") == 0
    assert {json.loads(line)["tick"] for line in rig.output_of("status").splitlines()} == {status["tick"]}
    refused = run(rig, "control", "arm")
    assert refused.returncode == 1
    assert "cannot arm: this is a replay" in refused.stderr


@pytest.mark.sampled(1, of="replay served")
def test_display_shows_a_replay_and_agent_is_refused(rig: Rig) -> None:
    picture = rig.folder / "left.png"
    rig.start("left display", "display", "--station", "left", "--screenshot", str(picture))
    rig.start_agent("left")
    assert rig.wait("left display") == 0
    assert picture.stat().st_size > 1000
    status = rig.until(lambda status: "it has no forces, so no agent can connect" in rig.output_of("left agent"))
    assert not status.armed
    assert "agent.left" not in status.peers
    assert rig.stop("left agent") == 0


def test_replay_server_exits_when_the_operator_ends_it(rig: Rig) -> None:
    rig.ask_to_end()
    assert rig.wait("server") == 0


@pytest.mark.sampled(1, of="replay served")
def test_foreign_display_shows_a_replay_like_a_live_session(
    live: tuple[Path, SentViews], javascript_clients: Path, tmp_path: Path
) -> None:
    with serve_recording(tmp_path, live[0]) as rig:
        rig.until(lambda status: True)
        with (tmp_path / "foreign.log").open("wb") as log:
            command = ["node", "display.mjs", "left", rig.config.network.host, str(rig.config.network.port)]
            rig.running["foreign"] = subprocess.Popen(command, cwd=javascript_clients, stdout=log, stderr=log)
        rig.until(lambda status: "display.left" in status.peers)
        rig.do("play")

        def display_output() -> list[dict[str, object]]:
            whole, _, _ = rig.output_of("foreign").rpartition("\n")
            return [json.loads(line) for line in whole.splitlines()]

        rig.until(lambda status: any(" running " in str(line.get("picture")) for line in display_output()))
        assert {line["partner_seen"] for line in display_output() if "picture" in line} == {0}
        assert rig.stop("server") == 0


@pytest.mark.sampled(1, of="replay served")
def test_terminal_keys_control_a_replay(live: tuple[Path, SentViews], tmp_path: Path) -> None:
    keyboard, terminal = os.openpty()
    with Rig(tmp_path) as rig:
        command = [
            sys.executable,
            "-m",
            "netboard.services.cli",
            "replay",
            str(live[0]),
            "--serve",
            "-c",
            str(rig.file),
        ]
        rig.running["server"] = subprocess.Popen(command, stdin=terminal, stdout=subprocess.DEVNULL, cwd=rig.folder)
        rig.until(lambda status: "playing" in status.notice)
        os.write(keyboard, b" ")
        before = rig.until(lambda status: "paused" in status.notice)
        os.write(keyboard, b".")
        rig.until(lambda status: status.tick == before.tick + 1)
        os.write(keyboard, b"\x1b[A")
        rig.until(lambda status: "2 times real time" in status.notice)
        os.write(keyboard, b"q")
        assert rig.wait("server") == 0
    for end in (keyboard, terminal):
        os.close(end)
