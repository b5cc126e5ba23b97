"""The curtain from outside: everything that comes to the left station's display while two people play, and whether the
right one's hand is in it.

The board follows both hands, so who sees the board sees much of the partner's hand; docs/explanation/curtain.md says
how much. What is shown here is that nothing else helps: no number of the partner's comes, and no field, nor the time or
the size of a frame, tells more of the partner's stylus than the board and the own stylus do.
"""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from netboard.base.clock import now_ns
from netboard.base.tables.scene import Physics
from netboard.base.tick import TICK
from netboard.benchmarks.faults.rigs import Rig
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Goodbye, Hello, Ping, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.transport import channels, poller, sockets
from netboard.recording.files.reader import Recording
from netboard.stage.view import View

pytestmark = [pytest.mark.integration, pytest.mark.quiet, pytest.mark.slow, pytest.mark.timeout(300)]

PATIENT = (
    "task.level_time=0.05",
    "task.level_angle_deg=5.0",
    "task.level_rate_deg_s=30.0",
    "network.sample_timeout_ms=1000",
)
"""The ball rolls soon, and a machine that is busy does not stop it."""
TO_COMPILE, TO_COLLECT = 180.0, 90.0
"""On a busy machine a server that has to compile its kernels first is there by then, and has shown so much [s]."""
ENOUGH = 800
"""Views of a moving board that are collected [1]."""
HISTORY = 12
"""Views of the past by which the partner's stylus is guessed, some 100 ms [1]."""
ROUNDING = 1e-9
"""Relative: what moves by less does not move."""
NOISE = 1e-4
"""Relative to the strongest: weaker combinations of what was seen are not guessed from."""
LEAK = 0.55
"""What tells something of the stylus lowers the error of a guess below this share. What is constant in a trial lowers
it too, to some 0.7, when the trials are few: a guess is then made for each trial by itself."""
SHOWN = ("z", "theta", "p", "left")
"""What the left participant is meant to see move."""
STAMPS = ("right_stamp_ns", "right_seen_ns")


@dataclass
class Seen:
    """What came to the display, in order, and the ticks as they were."""

    views: list[tuple[int, bytes]]
    words: list[bytes]
    ticks: np.ndarray

    def moving(self) -> list[tuple[int, int, View]]:
        """Arrival time, size and content of the views of a ball that rolls."""
        shown = [(came, len(frame), decode(frame)) for came, frame in self.views]
        return [(came, size, view) for came, size, view in shown if view.phase in ("running", "holding")]


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Seen:
    views: list[tuple[int, bytes]] = []
    words: list[bytes] = []
    with Rig(tmp_path_factory.mktemp("curtain"), (*PATIENT, "block.trials=500")) as rig:
        where = channels.addresses(rig.config.network)
        eye = sockets.view_subscriber(rig.context, where.reach(channels.VIEW_LEFT))
        ear = sockets.control_client(rig.context, where.reach(channels.CONTROL), "display.left@test")
        rig.start_all()
        rig.until(lambda s: s.phase == "running", TO_COMPILE)
        assert sockets.send(ear, encode(Hello("display", "left", PROTOCOL_VERSION, "test:1", "0", {})))
        moving, end = 0, time.monotonic() + TO_COLLECT
        while moving < ENOUGH:
            assert time.monotonic() < end, rig.said("server")
            if poller.wait_readable(eye, 0.05) and (frame := sockets.receive(eye)) is not None:
                views.append((now_ns(), frame))
                moving += decode(frame).phase in ("running", "holding")
            while (frame := sockets.receive(ear)) is not None:
                words.append(frame)
        (path,) = rig.finish()
        while (frame := sockets.receive(ear)) is not None:
            words.append(frame)
        eye.close()
        ear.close()
    with Recording(Path(path)) as recording:
        return Seen(views, words, recording.ticks())


def test_what_comes_is_one_s_own_view_and_a_few_words(seen: Seen) -> None:
    for _, frame in seen.views:
        view = decode(frame)
        assert isinstance(view, View)
        assert view.station == "left"
        assert view.left is not None
        assert view.right is None
    kinds: set[type[Message]] = {type(decode(frame)) for frame in seen.words}
    assert {Welcome, Ping} <= kinds <= {Welcome, Ping, Goodbye}


def numbers(ticks: np.ndarray, names: list[str]) -> set[bytes]:
    """The bytes of numbers, as msgpack writes them."""
    written = b"".join(ticks[name].byteswap().tobytes() for name in names)
    return {written[at : at + 8] for at in range(0, len(written), 8)}


def test_no_number_of_the_partner_s_comes_in_any_frame(seen: Seen) -> None:
    of_the_partner = [name for name in TICK.names if name.startswith("right_") and TICK[name].kind == "f"]
    others = [name for name in TICK.names if not name.startswith("right_")]
    secret = numbers(seen.ticks, [*of_the_partner, *STAMPS]) - numbers(seen.ticks, others) - {bytes(8)}
    assert len(secret) > 5_000
    frames = [*(frame for _, frame in seen.views), *seen.words]
    windows = {frame[at : at + 8] for frame in frames for at in range(len(frame) - 7)}
    assert not windows & secret
    known = numbers(seen.ticks, ["left_used_z", "theta"])
    assert len(windows & known) > ENOUGH, "what may be seen is found in this way"


def guess_error(features: np.ndarray, stylus: np.ndarray) -> float:
    """RMS error of the best linear guess at a stylus, made on one half of the time and tried on the other [m]."""
    half = len(stylus) // 2
    mean, spread = features[:half].mean(axis=0), features[:half].std(axis=0)
    moves = spread > ROUNDING * (1 + abs(mean))  # a column that only begins to move later tells nothing
    columns = np.column_stack((np.ones(len(stylus)), (features - mean)[:, moves] / spread[moves]))
    weights = np.linalg.lstsq(columns[:half], stylus[:half], rcond=NOISE)[0]
    return float(np.sqrt(np.mean((stylus[half:] - columns[half:] @ weights) ** 2)))


def with_history(values: np.ndarray) -> np.ndarray:
    """Each row with those before it, as far as they go back in all rows."""
    return np.column_stack([values[HISTORY - back : len(values) - back] for back in range(HISTORY)])


def test_nothing_beside_the_board_tells_of_the_partner_s_stylus(seen: Seen) -> None:
    moving = seen.moving()
    views = [view for *_, view in moving]
    ticks = seen.ticks[[view.tick for view in views]]
    stylus = ticks["right_used_z"][HISTORY:]
    board = with_history(np.array([[getattr(view, name) for name in SHOWN] for view in views]))
    alone = guess_error(board, stylus)
    assert alone < 0.1 * stylus.std()
    came = np.array([came for came, *_ in moving])
    sent = np.array([view.sent_ns for view in views])
    beside = {
        "size": np.array([size for _, size, _ in moving]),
        "time of sending in the tick": sent - ticks["time_ns"],
        "time on the way": came - sent,
        "time between views": np.diff(sent, prepend=sent[0]),
        "time between arrivals": np.diff(came, prepend=came[0]),
        "ticks between views": np.diff([view.tick for view in views], prepend=views[0].tick),
        "tick": np.array([view.tick for view in views]),
        "phase": np.array([view.phase == "holding" for view in views]),
    }
    for name in ("target", "trial", "failures", "completion", "best"):
        beside[name] = np.array([getattr(view, name) or 0.0 for view in views])
    for name, values in beside.items():
        more = np.column_stack((board, with_history(values.astype(float)[:, None])))
        assert guess_error(more, stylus) > LEAK * alone, f"the {name} tells of the partner's stylus"
    leak = np.round(ticks["right_used_z"], 5)
    leaky = np.column_stack((board, with_history(leak[:, None])))
    assert guess_error(leaky, stylus) < LEAK * alone, "a leak would be found in this way"


def test_the_board_alone_tells_of_it_as_its_equations_say(seen: Seen) -> None:
    """Docs/curtain.md: the partner's end of the board, and how far the spring from there to the stylus is stretched."""
    views = [view for *_, view in seen.moving()]
    stylus = seen.ticks["right_used_z"][[view.tick for view in views]]
    z, theta, p = np.array([(view.z, view.theta, view.p) for view in views]).T
    is_ = Physics()
    end = z + is_.l * np.sin(theta)
    pull = (is_.M * is_.g + is_.k_s * z + is_.m * is_.g * (1 + p / is_.l)) / 2
    assert np.sqrt(np.mean((stylus - end - pull / is_.k_h) ** 2)) < 0.05 * stylus.std()
    assert np.std(stylus - end) < 0.5 * stylus.std()
