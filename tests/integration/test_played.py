"""A played session: real processes, a simulated partner on the right, and a scripted mouse on the left.

The left display lives in this process, without a screen. The script looks at the views that the station is sent, as its
player would, and moves the mouse over the window by Qt's own events. It is a plain controller of the ball: it turns the
board by its own end against the ball's way and speed, and brings the board back to the middle.
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
from netboard.base.process import STOP_WITH_PARENT
from netboard.benchmarks.faults.rigs import Rig
from netboard.network.protocol.codec import decode
from netboard.network.protocol.control import Status
from netboard.network.transport import channels, sockets
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording
from netboard.stage.view import View
from netboard.task.trials.state_machine import Phase

pytestmark = [pytest.mark.integration, pytest.mark.quiet, pytest.mark.slow, pytest.mark.timeout(300)]

PATIENT = (
    "task.level_time=0.05",
    "task.level_angle_deg=5.0",
    "task.level_rate_deg_s=30.0",
    "task.hold_time=0.2",
    "physics.ball_stop=0.3",
    "network.sample_timeout_ms=1000",
)
"""A ball that cannot fall off, and a machine that may be busy: what is tested is the way, not the script's skill."""
TIMEOUT = 240.0
"""On a busy machine, with all kernels to be compiled first, a game is over by then [s]."""
LOOK_MS = 8
MAX_TILT = math.radians(2.5)
TURN, CENTRE = 5.0, 1.0
"""How fast the script takes back an error of the tilt, and of the height [1/s]."""
SEEN = 0.06
"""The ball's speed is judged over this time [s]."""


class Script:
    """Where the mouse goes, by what is seen."""

    def __init__(self, config: Config) -> None:
        self.height = 0.0
        self._config = config
        self._ball: list[tuple[int, float]] = []

    def poll(self, view: View, dt: float) -> float:
        """Height to point at after a while with a view [m]."""
        lever = self._config.physics.l
        wanted = self._wanted_tilt(view) if view.phase in ("running", "holding") else 0.0
        if view.phase in ("levelling", "running", "holding"):
            self.height += dt * (TURN * lever * (view.theta - wanted) - CENTRE * view.z)
            self.height = min(max(self.height, -0.05), 0.05)
        return self.height

    def _wanted_tilt(self, view: View) -> float:
        """Tilt that brings the ball to rest in the target, + = right end up [rad]."""
        assert view.p is not None
        self._ball = [seen for seen in self._ball if 0 <= view.tick - seen[0] <= SEEN * 1e3]
        self._ball.append((view.tick, view.p))
        (first, before), (last, now) = self._ball[0], self._ball[-1]
        speed = (now - before) / max(last - first, 1) * 1e3
        tilt = (2.0 * (view.p - view.target) + 2.2 * speed) / self._config.physics.g
        return min(max(tilt, -MAX_TILT), MAX_TILT)


class Game:
    """The left display of a rig, and the script that plays in it."""

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
        self.eye = sockets.view_subscriber(rig.context, where.reach(channels.VIEW_LEFT))
        self.script = Script(rig.config)
        self.seen: View | None = None
        self.labels: set[str] = set()

    def play(self) -> Status:
        """Play until the block is over; the last status."""
        end, asked = time.monotonic() + TIMEOUT, 0.0
        while time.monotonic() < end:
            self._turn()
            if time.monotonic() - asked > 0.5:
                asked = time.monotonic()
                status = self.rig.operator.ask(0.005)
                if status is not None and status.phase == "finished":
                    return status
        raise AssertionError(f"{self.rig.operator.status}; {self.seen}")

    def _turn(self) -> None:
        """Let Qt work for a moment, then look and move the mouse."""
        from PySide6.QtCore import QEventLoop, QTimer

        loop = QEventLoop()
        QTimer.singleShot(LOOK_MS, loop.quit)
        loop.exec()
        frame = sockets.receive(self.eye)
        if frame is None:
            return
        view = decode(frame)
        assert isinstance(view, View)
        assert view.right is None
        dt = 0.0 if self.seen is None else min(max(view.tick - self.seen.tick, 0), 50) * 1e-3
        self.seen = view
        self._point(self.script.poll(view, dt))
        grip = self.window.board.picture.grip
        self.labels |= {grip.label} if grip.label else set()

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
        self.eye.close()


@pytest.mark.daily(3, of="sessions in real time")
def test_a_script_with_a_mouse_plays_two_trials_with_a_simulated_partner(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("PySide6.QtWidgets", reason="Qt's libraries cannot be loaded here", exc_type=ImportError)
    monkeypatch.setenv("QT_QPA_PLATFORM", os.environ.get("QT_QPA_PLATFORM", "offscreen"))
    with Rig(tmp_path, (*PATIENT, "agents.left.device=mouse", "block.trials=2")) as rig:
        rig.start_all()
        game = Game(rig)
        status = game.play()
        game.close()
        (path,) = rig.finish()
    assert status.successes == 2
    assert game.labels, "the player has seen what the hand feels"
    with Recording(path) as recording:
        ticks = recording.ticks()
        assert verify_recording(recording).identical
        assert {frame.station for frame in recording.frames()} == {"left"}
    played = ticks[(ticks["phase"] == Phase.RUNNING) & (ticks["left_live"] == 1)]
    assert np.ptp(played["left_used_z"]) > 1e-3
    assert np.nanmax(np.abs(played["left_rendered"])) > 0.1
    assert np.abs(ticks["left_sent_vz"]).max() < 0.8 * (1 + 1e-6)
    assert not played["left_x"].any()


@pytest.mark.daily(3, of="sessions in real time")
def test_whoever_plays_may_leave_with_ctrl_c_and_the_recording_is_whole(tmp_path: Path) -> None:
    environment = os.environ | {"QT_QPA_PLATFORM": "offscreen", "NO_COLOR": "1", STOP_WITH_PARENT: "1"}
    command = [sys.executable, "-m", "netboard.services.cli", "demo", "--play", "left", "--directory", str(tmp_path)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment
    ) as demo:
        end = time.monotonic() + TIMEOUT
        said = ""
        while not ("agent_joined side=left" in said and "logger_joined" in said):
            assert demo.poll() is None
            assert time.monotonic() < end
            time.sleep(0.1)
            said = "".join(log.read_text() for log in tmp_path.glob("demo_*/server.log"))
        demo.send_signal(signal.SIGINT)
        said, _ = demo.communicate(timeout=TIMEOUT)
    assert demo.returncode == 0, said
    assert "identical to the bit" in said
    (path,) = tmp_path.glob("*.mcap")
    with Recording(path) as recording:
        assert [event.name for event in recording.events()][-1] == "session_ended"
        assert {frame.station for frame in recording.frames()} <= {"left"}
