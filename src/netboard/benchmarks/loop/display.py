"""``netboard bench display``: latency from sending a view to the end of its painting, and the error of the drawn board.

A process sends views of a board that both hands move, as the server does. The display's client runs here, in a window
or offscreen, and every paint is recorded. Both use one clock, so each part of the latency is a difference of two times.
The board as painted is compared with its position at that moment: the error, and the delay that explains it. Compositor
and panel come later and are not measured.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from math import ceil, cos, pi, sin

import numpy as np
from numpy.typing import NDArray

from netboard.base.clock import now_ns
from netboard.base.config import Config
from netboard.benchmarks.harness.processes import fresh_processes
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Options, Tell, run
from netboard.benchmarks.loop.timing import HEADS, Times, spread_rows
from netboard.network.protocol.codec import encode
from netboard.network.transport import channels, sockets
from netboard.stage.view import View
from netboard.windows.participant.client import DisplayClient
from netboard.windows.participant.window import BoardWindow, application, run_events

SECONDS, QUICK_SECONDS = 30.0, 3.0
"""Default measurement time of each case [s]."""

WAVES = ((0.020, 0.7), (0.003, 2.2), (0.0002, 9.0))
"""Hand motion: amplitudes and frequencies of aim, corrections and tremor [m, Hz]."""

ALIVE_TICKS = 50
"""Ticks between views that show nothing new [1]."""

WARM_UP = 0.5
"""Time after the first view before frames are noted [s]."""

Frame = tuple[int, int, int, float]
"""Tick of the view, times of its arrival and painting, and drawn height of the right end [1, ns, ns, m]."""

SPARE = 2.0
"""Time for which views continue after the last measured frame [s]."""

POLL_INTERVAL_S = 0.01
POLL_TIMEOUT_NS = 60_000_000_000
"""Timeout of the view sender for the first subscriber [ns]."""


@dataclass(frozen=True)
class ShownFrames:
    """Views that reached a screen.

    - `sent_to_received`, `received_to_painted`: the two parts of the latency of each frame with a new view [ns].
    - `between`: time from each frame to the next [ns].
    - `painted`: time at which each frame was painted [ns].
    - `heights`: drawn height of the right end of the board [m].
    """

    sent_to_received: Times
    received_to_painted: Times
    between: Times
    painted: Times
    heights: NDArray[np.float64]
    busy: float
    dropped: int


def height_at(time_ns: int) -> tuple[float, float]:
    """Return the height and the velocity of the right hand at a time [m, m/s]."""
    t = time_ns * 1e-9
    z = sum(size * sin(2 * pi * hz * t) for size, hz in WAVES)
    return z, sum(2 * pi * hz * size * cos(2 * pi * hz * t) for size, hz in WAVES)


def send_views(config: Config, seconds: float, moving: bool) -> dict[int, int]:
    """Publish views for a period, from the first subscriber on; return the time at which each tick was sent."""
    ticks = ceil(1000 / config.network.view_rate_hz) if moving else ALIVE_TICKS
    sent: dict[int, int] = {}
    with sockets.open_context() as context:
        publisher = sockets.view_publisher(context, channels.addresses(config.network).listen(channels.VIEW["left"]))
        start = now_ns()
        while not publisher.wanted() and now_ns() - start < POLL_TIMEOUT_NS:
            time.sleep(POLL_INTERVAL_S)
        start = now_ns()
        for seq in range(round(seconds * 1000 / ticks)):
            time.sleep(max(0.0, (start + seq * ticks * 1_000_000 - now_ns()) * 1e-9))
            now = now_ns()
            z = height_at(now)[0] if moving else 0.0
            board = ("left", seq * ticks, now, "running", z / 2, z / (2 * config.physics.l), -0.15, 0.15, -z, None)
            publisher.send(encode(View(*board, 1, 60, 0, None, None, "", seq, 0.0, 1, 1, None)))
            sent[seq * ticks] = now
        publisher.close()
    return sent


def measure(config: Config, seconds: float, *, moving: bool) -> ShownFrames:
    """Run a display for a period, with a process that sends it views."""
    application()
    with fresh_processes(1) as pool:
        sending = pool.submit(send_views, config, seconds + SPARE, moving)
        frames, busy, dropped = _watch(config, seconds, lambda: not sending.done())
        return _shown(frames, sending.result(), busy, dropped)


def _watch(config: Config, seconds: float, served: Callable[[], bool]) -> tuple[list[Frame], float, int]:
    """Run the display; return its frames, its share of a core, and the number of dropped views."""
    frames: list[Frame] = []
    window = BoardWindow("netboard bench display")
    window.present(config.display)
    with sockets.open_context() as context:
        client = DisplayClient("left", config, context, window)
        while not client.linked and served():
            run_events(0.01)
        run_events(WARM_UP)
        window.board.painted.connect(lambda: _note(client, frames))
        client.tally.clear()
        dropped, busy, since = client.tally.dropped, time.process_time(), time.monotonic()
        run_events(seconds)
        busy = (time.process_time() - busy) / (time.monotonic() - since)
        dropped = client.tally.dropped - dropped
        client.close()
    window.close()
    return frames, busy, dropped


def _note(client: DisplayClient, frames: list[Frame]) -> None:
    """Note the frame just painted: tick of its view, arrival, painting, and height of the right end."""
    report, picture = client.tally.report(), client.window.board.picture
    if report is not None and report.shown and picture is not None and picture.handles:
        frames.append((*report.shown[-1], picture.handles[1][1]))
        client.tally.clear()


def _shown(frames: list[Frame], sent: dict[int, int], busy: float, dropped: int) -> ShownFrames:
    """Return the latencies of the frames with a new view."""
    new = [b for a, b in pairwise(frames) if b[0] != a[0] and b[0] in sent]
    painted = np.array([frame[2] for frame in frames], np.int64)
    return ShownFrames(
        sent_to_received=np.array([came - sent[tick] for tick, came, _, _ in new], np.int64),
        received_to_painted=np.array([done - came for _, came, done, _ in new], np.int64),
        between=np.diff(painted),
        painted=painted,
        heights=np.array([frame[3] for frame in frames]),
        busy=busy,
        dropped=dropped,
    )


def lateness(shown: ShownFrames) -> tuple[float, float]:
    """Return the delay that best explains the drawn positions, by least squares, and the RMS residual [s, m]."""
    heights, velocities = np.array([height_at(int(at)) for at in shown.painted]).T
    errors = heights - shown.heights
    return float(errors @ velocities / (velocities @ velocities)), float(np.sqrt(np.mean(errors**2)))


def main(config: Config, seconds: float | None, options: Options) -> None:
    """Run the study.

    - `config`: settings of the window.
    - `seconds`: duration of each measurement; None for the default [s].
    """
    seconds = seconds or (QUICK_SECONDS if options.quick else SECONDS)
    platform = application().platformName()
    settings, lines = {"seconds": seconds, "platform": platform}, [f"drawn by: {platform}"]
    run("display", partial(study, config, seconds), options, settings, lines=lines, bar=False)


def study(config: Config, seconds: float, folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Measure a display that smooths views of a moving board, one that does not, and one at rest."""
    found: dict[str, ShownFrames] = {}
    for name, smooth, moving in (("smooth", True, True), ("views as they are", False, True), ("at rest", True, False)):
        tell(f"{name}: {seconds:g} s", len(found) / 3)
        shown = replace(config, display=replace(config.display, smooth=smooth))
        found[name] = measure(shown, seconds, moving=moving)
    yield _latency_part(found)
    yield _error_part(found, seconds)


def _latency_part(found: dict[str, ShownFrames]) -> ResultPart:
    times = {}
    for name, shown in found.items():
        if shown.sent_to_received.size:
            times[f"{name}: sent to received"] = shown.sent_to_received
            times[f"{name}: received to painted"] = shown.received_to_painted
            times[f"{name}: frame to frame"] = shown.between
    return ResultPart(
        "way",
        "The way of a view, from the server's sending to the end of the painting",
        ("what", "times", *HEADS),
        spread_rows(times),
    )


def _error_part(found: dict[str, ShownFrames], seconds: float) -> ResultPart:
    """Return delay and error of the drawn board and the cost of painting, as a table."""
    part = ResultPart(
        "sight",
        "Where the board was at the end of a painting, and where it was drawn",
        "what | frames [Hz] | seen late by [ms] | off by, RMS [mm] | dropped | of a core [%]",
    )
    for name, shown in found.items():
        delay, error = lateness(shown) if shown.between.size else (float("nan"), float("nan"))
        rate = len(shown.painted) / seconds
        part.add(name, rate, delay * 1e3, error * 1e3, shown.dropped, shown.busy * 100)
    return part
