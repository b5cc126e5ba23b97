"""A session on real processes with a simulated partner on the right and a scripted mouse on the left.

The left display runs in this process, off screen. The script reads the views sent to the station, as a player would,
and moves the mouse over the window with Qt events. It is a simple controller of the ball: it tilts the board against
the ball's position error and velocity, and returns the board to the middle.
"""

import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from netboard.base.config import Config
from netboard.base.process.stopping import STOP_WITH_PARENT
from netboard.benchmarks.harness.rig import Rig
from netboard.network.protocol.codec import decode
from netboard.network.protocol.control import Status
from netboard.network.transport import channels, sockets
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording
from netboard.stage.view import View
from netboard.task.trials.state_machine import Phase

pytestmark = [pytest.mark.integration, pytest.mark.quiet, pytest.mark.slow, pytest.mark.timeout(300)]

EASY_TRIALS = (
    "task.level_time=0.05",
    "task.level_angle_deg=5.0",
    "task.level_rate_deg_s=30.0",
    "task.hold_time=0.2",
    "physics.ball_stop=0.3",
    "network.sample_timeout_ms=1000",
)
"""The ball cannot fall off and a busy machine does not pause the trial: the script's skill is not tested."""
TIMEOUT = 240.0
"""Timeout for a game on a busy machine that compiles all kernels first [s]."""
POLL_MS = 8
MAX_TILT = math.radians(2.5)
TILT_GAIN, HEIGHT_GAIN = 5.0, 1.0
"""Gains of the script for tilt and height errors [1/s]."""
VELOCITY_WINDOW = 0.06
"""Window over which the ball's velocity is estimated [s]."""


class MouseScript:
    """Controller of the mouse position from the views."""

    def __init__(self, config: Config) -> None:
        self.height = 0.0
        self._config = config
        self._ball: list[tuple[int, float]] = []

    def poll(self, view: View, dt: float) -> float:
        """Height to point at, after a time with this view [m]."""
        lever = self._config.physics.l
        target_tilt = self._target_tilt(view) if view.phase in ("running", "holding") else 0.0
        if view.phase in ("levelling", "running", "holding"):
            self.height += dt * (TILT_GAIN * lever * (view.theta - target_tilt) - HEIGHT_GAIN * view.z)
            self.height = min(max(self.height, -0.05), 0.05)
        return self.height

    def _target_tilt(self, view: View) -> float:
        """Tilt that brings the ball to rest in the target, + = right end up [rad]."""
        assert view.p is not None
        self._ball = [seen for seen in self._ball if 0 <= view.tick - seen[0] <= VELOCITY_WINDOW * 1e3]
        self._ball.append((view.tick, view.p))
        (first, before), (last, now) = self._ball[0], self._ball[-1]
        speed = (now - before) / max(last - first, 1) * 1e3
        tilt = (2.0 * (view.p - view.target) + 2.2 * speed) / self._config.physics.g
        return min(max(tilt, -MAX_TILT), MAX_TILT)


class Game:
    """The left display of a rig and the script that plays on it."""

    def __init__(self, rig: Rig) -> None:
        from netboard.windows.participant.client import DisplayClient
        from netboard.windows.participant.playing import Playing
        from netboard.windows.participant.window import BoardWindow, application

        self.app = application()
        self.rig = rig
        self.window = BoardWindow("netboard: left station")
        self.window.present(rig.config.display)
        player = Playing("left", rig.config, rig.context, self.window)
        self.client = DisplayClient("left", rig.config, rig.context, self.window, player)
        where = channels.addresses(rig.config.network)
        self.view_socket = sockets.view_subscriber(rig.context, where.reach(channels.VIEW_LEFT))
        self.script = MouseScript(rig.config)
        self.view: View | None = None
        self.labels: set[str] = set()

    def play(self) -> Status:
        """Play until the block is over, and return the last status."""
        end, last_request = time.monotonic() + TIMEOUT, 0.0
        while time.monotonic() < end:
            self._step()
            if time.monotonic() - last_request > 0.5:
                last_request = time.monotonic()
                status = self.rig.operator.ask(0.005)
                if status is not None and status.phase == "finished":
                    return status
        raise AssertionError(f"{self.rig.operator.status}; {self.view}")

    def _step(self) -> None:
        """Run Qt's event loop briefly, then read the view and move the mouse."""
        from PySide6.QtCore import QEventLoop, QTimer

        loop = QEventLoop()
        QTimer.singleShot(POLL_MS, loop.quit)
        loop.exec()
        frame = sockets.receive(self.view_socket)
        if frame is None:
            return
        view = decode(frame)
        assert isinstance(view, View)
        assert view.right is None
        dt = 0.0 if self.view is None else min(max(view.tick - self.view.tick, 0), 50) * 1e-3
        self.view = view
        self._point(self.script.poll(view, dt))
        grip = self.window.board.picture.grip
        self.labels |= {grip.label} if grip is not None and grip.label else set()  # None: nothing is painted yet

    def _point(self, height: float) -> None:
        """Move the mouse over the window."""
        from PySide6.QtCore import QEvent, Qt
        from PySide6.QtGui import QMouseEvent

        surface, place = self.window.board, self.window.board.pixel_at((0.0, height))
        none = Qt.MouseButton.NoButton
        where = (place, surface.mapToGlobal(place))
        self.app.sendEvent(
            surface, QMouseEvent(QEvent.Type.MouseMove, *where, none, none, Qt.KeyboardModifier.NoModifier)
        )

    def close(self) -> None:
        self.client.close()
        self.window.close()
        self.view_socket.close()


@pytest.mark.sampled(2, of="sessions in real time")
def test_scripted_mouse_completes_two_trials_with_a_simulated_partner(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("PySide6.QtWidgets", reason="Qt's libraries cannot be loaded here", exc_type=ImportError)
    monkeypatch.setenv("QT_QPA_PLATFORM", os.environ.get("QT_QPA_PLATFORM", "offscreen"))
    with Rig(tmp_path, (*EASY_TRIALS, "agents.left.device=mouse", "block.trials=2")) as rig:
        rig.start_all()
        game = Game(rig)
        status = game.play()
        game.close()
        (path,) = rig.finish()
    assert status.successes == 2
    assert game.labels, "the display has shown the force on the hand"
    with Recording(path) as recording:
        ticks = recording.ticks()
        assert verify_recording(recording).identical
        assert {frame.station for frame in recording.frames()} == {"left"}
    played = ticks[(ticks["phase"] == Phase.RUNNING) & (ticks["left_live"] == 1)]
    assert np.ptp(played["left_used_z"]) > 1e-3
    assert np.nanmax(np.abs(played["left_rendered"])) > 0.1
    assert np.abs(ticks["left_sent_vz"]).max() < 0.8 * (1 + 1e-6)
    assert not played["left_x"].any()


@pytest.mark.sampled(2, of="sessions in real time")
def test_ctrl_c_in_a_played_demo_leaves_a_complete_recording(tmp_path: Path) -> None:
    environment = os.environ | {"QT_QPA_PLATFORM": "offscreen", "NO_COLOR": "1", STOP_WITH_PARENT: "1"}
    command = [sys.executable, "-m", "netboard.services.cli", "demo", "--play", "left", "--directory", str(tmp_path)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment
    ) as demo:
        end = time.monotonic() + TIMEOUT
        output = ""
        while not ("agent_joined side=left" in output and "logger_joined" in output):
            assert demo.poll() is None
            assert time.monotonic() < end
            time.sleep(0.1)
            output = "".join(log.read_text() for log in tmp_path.glob("demo_*/server.log"))
        demo.send_signal(signal.SIGINT)
        output, _ = demo.communicate(timeout=TIMEOUT)
    assert demo.returncode == 0, output
    assert "identical to the bit" in output
    (path,) = tmp_path.glob("*.mcap")
    with Recording(path) as recording:
        assert [event.name for event in recording.events()][-1] == "session_ended"
        assert {frame.station for frame in recording.frames()} <= {"left"}
