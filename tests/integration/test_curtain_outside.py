"""The curtain, tested from outside: whether anything sent to the left station's display reveals the right hand.

The board follows both hands, so the view of the board reveals much of the partner's hand; docs/explanation/curtain.md
says how much. These tests show that nothing else does: no value of the partner is sent, and no field, timing or size of
a frame predicts the partner's stylus better than the board and the participant's own stylus.
"""

import itertools
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from netboard.base.clock import now_ns
from netboard.base.tables.scene import Physics
from netboard.base.tick import TICK
from netboard.benchmarks.harness.rig import Rig
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Goodbye, Hello, Ping, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.transport import channels, poller, sockets
from netboard.recording.files.reader import Recording
from netboard.stage.view import View

pytestmark = [pytest.mark.integration, pytest.mark.quiet, pytest.mark.slow, pytest.mark.timeout(300)]

QUICK_TRIALS = (
    "task.level_time=0.05",
    "task.level_angle_deg=5.0",
    "task.level_rate_deg_s=30.0",
    "network.sample_timeout_ms=1000",
)
"""The ball rolls soon, and a busy machine does not pause the trial."""
COMPILE_TIMEOUT, COLLECT_TIMEOUT = 180.0, 90.0
"""Timeouts on a busy machine: to compile the kernels and start, and to send the views [s]."""
MIN_VIEWS = 800
"""Views of a moving board that are collected [1]."""
HISTORY = 12
"""Earlier views from which the partner's stylus is predicted, about 100 ms [1]."""
ROUNDING = 1e-9
"""Relative spread below which a feature counts as constant."""
NOISE = 1e-4
"""Relative to the largest singular value: weaker combinations of features are ignored."""
LEAK = 0.55
"""A leak lowers the prediction error below this share [1]."""
SHOWN = ("z", "theta", "p", "left")
"""Moving quantities that the left participant may see."""
STAMPS = ("right_stamp_ns", "right_seen_ns")


@dataclass
class Captured:
    """Frames received by the display, in order, and the recorded ticks."""

    views: list[tuple[int, bytes]]
    control_frames: list[bytes]
    ticks: np.ndarray

    def moving(self) -> list[tuple[int, int, View]]:
        """Arrival time, size and content of the views with a rolling ball."""
        shown = [(arrived, len(frame), decode(frame)) for arrived, frame in self.views]
        return [(arrived, size, view) for arrived, size, view in shown if view.phase in ("running", "holding")]


@pytest.fixture(scope="module")
def captured(tmp_path_factory: pytest.TempPathFactory) -> Captured:
    views: list[tuple[int, bytes]] = []
    control_frames: list[bytes] = []
    with Rig(tmp_path_factory.mktemp("curtain"), (*QUICK_TRIALS, "block.trials=500")) as rig:
        where = channels.addresses(rig.config.network)
        view_socket = sockets.view_subscriber(rig.context, where.reach(channels.VIEW_LEFT))
        control_socket = sockets.control_client(rig.context, where.reach(channels.CONTROL), "display.left@test")
        rig.start_all()
        rig.until(lambda s: s.phase == "running", COMPILE_TIMEOUT)
        assert sockets.send(control_socket, encode(Hello("display", "left", PROTOCOL_VERSION, "test:1", "0", {})))
        moving, end = 0, time.monotonic() + COLLECT_TIMEOUT
        while moving < MIN_VIEWS:
            assert time.monotonic() < end, rig.output_of("server")
            if poller.wait_readable(view_socket, 0.05) and (frame := sockets.receive(view_socket)) is not None:
                views.append((now_ns(), frame))
                moving += decode(frame).phase in ("running", "holding")
            while (frame := sockets.receive(control_socket)) is not None:
                control_frames.append(frame)
        (path,) = rig.finish()
        while (frame := sockets.receive(control_socket)) is not None:
            control_frames.append(frame)
        view_socket.close()
        control_socket.close()
    with Recording(Path(path)) as recording:
        return Captured(views, control_frames, recording.ticks())


def test_display_receives_only_its_own_view_and_control_messages(captured: Captured) -> None:
    for _, frame in captured.views:
        view = decode(frame)
        assert isinstance(view, View)
        assert view.station == "left"
        assert view.left is not None
        assert view.right is None
    kinds: set[type[Message]] = {type(decode(frame)) for frame in captured.control_frames}
    assert {Welcome, Ping} <= kinds <= {Welcome, Ping, Goodbye}


def numbers(ticks: np.ndarray, names: list[str]) -> set[bytes]:
    """The byte strings of these columns, as msgpack writes the numbers."""
    written = b"".join(ticks[name].byteswap().tobytes() for name in names)
    return {written[at : at + 8] for at in range(0, len(written), 8)}


def test_no_frame_contains_a_value_of_the_partner(captured: Captured) -> None:
    of_the_partner = [name for name in TICK.names if name.startswith("right_") and TICK[name].kind == "f"]
    others = [name for name in TICK.names if not name.startswith("right_")]
    secret = numbers(captured.ticks, [*of_the_partner, *STAMPS]) - numbers(captured.ticks, others) - {bytes(8)}
    assert len(secret) > 5_000
    frames = [*(frame for _, frame in captured.views), *captured.control_frames]
    windows = {frame[at : at + 8] for frame in frames for at in range(len(frame) - 7)}
    assert not windows & secret
    known = numbers(captured.ticks, ["left_used_z", "theta"])
    assert len(windows & known) > MIN_VIEWS, "permitted values are found by the same search"


def prediction_error(features: np.ndarray, stylus: np.ndarray) -> float:
    """RMS error of a linear prediction of a stylus, fitted on the first half of the time, tested on the second [m]."""
    half = len(stylus) // 2
    mean, spread = features[:half].mean(axis=0), features[:half].std(axis=0)
    moves = spread > ROUNDING * (1 + abs(mean))  # a column that is constant in the first half cannot be fitted
    columns = np.column_stack((np.ones(len(stylus)), (features - mean)[:, moves] / spread[moves]))
    weights = np.linalg.lstsq(columns[:half], stylus[:half], rcond=NOISE)[0]
    return float(np.sqrt(np.mean((stylus[half:] - columns[half:] @ weights) ** 2)))


@dataclass
class Stretches:
    """Views in rows, and where a trial, an attempt or a phase begins.

    A feature that is constant from there to the next one cannot follow a hand, but would give each of these few
    stretches a prediction of its own. Therefore the mean of each stretch is subtracted, and rows whose history began in
    another one are left out.
    """

    numbers: np.ndarray
    whole: np.ndarray

    @classmethod
    def of_views(cls, views: list[View]) -> "Stretches":
        states = [(view.phase, view.trial, view.failures) for view in views]
        begins = np.array([True, *(one != before for before, one in itertools.pairwise(states))])
        rows = np.arange(len(views))
        age = rows - np.maximum.accumulate(np.where(begins, rows, 0))
        return cls(np.cumsum(begins), age >= HISTORY - 1)

    def newest(self, values: np.ndarray) -> np.ndarray:
        """The values of the rows with a whole history."""
        return self._centred(values[self.whole, None])[:, 0]

    def with_history(self, values: np.ndarray) -> np.ndarray:
        """Each of these rows joined with the `HISTORY` rows that end with it."""
        windows = np.lib.stride_tricks.sliding_window_view(values, HISTORY, axis=0)
        return self._centred(windows[self.whole[HISTORY - 1 :]].reshape(self.whole.sum(), -1))

    def _centred(self, rows: np.ndarray) -> np.ndarray:
        centred, numbers = rows.astype(float), self.numbers[self.whole]
        for number in np.unique(numbers):
            centred[numbers == number] -= centred[numbers == number].mean(axis=0)
        return centred


def test_no_field_timing_or_size_predicts_the_partner_better_than_the_board(captured: Captured) -> None:
    moving = captured.moving()
    views = [view for *_, view in moving]
    ticks = captured.ticks[[view.tick for view in views]]
    stretches = Stretches.of_views(views)
    stylus = stretches.newest(ticks["right_used_z"])
    board = stretches.with_history(np.array([[getattr(view, name) for name in SHOWN] for view in views]))
    board_error = prediction_error(board, stylus)
    assert board_error < 0.1 * stylus.std()
    arrived = np.array([arrived for arrived, *_ in moving])
    sent = np.array([view.sent_ns for view in views])
    extra_features = {
        "size": np.array([size for _, size, _ in moving]),
        "time of sending in the tick": sent - ticks["time_ns"],
        "time on the way": arrived - sent,
        "time between views": np.diff(sent, prepend=sent[0]),
        "time between arrivals": np.diff(arrived, prepend=arrived[0]),
        "ticks between views": np.diff([view.tick for view in views], prepend=views[0].tick),
        "tick": np.array([view.tick for view in views]),
    }
    for name in ("target", "completion", "best", "share"):
        extra_features[name] = np.array([getattr(view, name) or 0.0 for view in views])
    for name, values in extra_features.items():
        more = np.column_stack((board, stretches.with_history(values.astype(float)[:, None])))
        assert prediction_error(more, stylus) > LEAK * board_error, f"the {name} reveals the partner's stylus"
    leak = np.round(ticks["right_used_z"], 5)
    leaky = np.column_stack((board, stretches.with_history(leak[:, None])))
    assert prediction_error(leaky, stylus) < LEAK * board_error, "a leak is detected by the same method"


def test_the_size_of_a_view_follows_from_the_state_of_the_trial(captured: Captured) -> None:
    """Among views of one state, whatever the hands do, all have the same size."""
    sizes: dict[tuple[object, ...], set[int]] = {}
    for _, size, view in captured.moving():
        state = (view.phase, view.trial, view.failures, view.completion, view.best, view.notice)
        sizes.setdefault(state, set()).add(size)
    assert [state for state, found in sizes.items() if len(found) > 1] == []


def test_board_reveals_the_partner_as_its_equations_predict(captured: Captured) -> None:
    """The partner's end of the board plus the stretch of the coupling spring; see docs/explanation/curtain.md."""
    views = [view for *_, view in captured.moving()]
    stylus = captured.ticks["right_used_z"][[view.tick for view in views]]
    z, theta, p = np.array([(view.z, view.theta, view.p) for view in views]).T
    physics = Physics()
    end = z + physics.l * np.sin(theta)
    load = (physics.M * physics.g + physics.k_s * z + physics.m * physics.g * (1 + p / physics.l)) / 2
    assert np.sqrt(np.mean((stylus - end - load / physics.k_h) ** 2)) < 0.05 * stylus.std()
    assert np.std(stylus - end) < 0.5 * stylus.std()
