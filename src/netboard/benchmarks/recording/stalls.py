"""Effect of a slow disk on the server: the real processes of a session while the logger is stopped.

A logger whose disk takes half a second for a sync is blocked meanwhile, as is one that is stopped (SIGSTOP) for half a
second. For the server both are the same.
"""

import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.clock import now_ns
from netboard.benchmarks.harness.results import ResultPart
from netboard.benchmarks.harness.rig import ACTIVE, Rig
from netboard.benchmarks.harness.running import Tell
from netboard.recording.files.reader import Recording

STALL_SECONDS = 0.5
STOPPED_SHARES = {"runs": 0.0, "has a disk that stalls for 0.5 s in every second": 0.5, "is stopped": 1.0}
"""Share of the time in which the logger is stopped [1]."""

SETTLE_SECONDS = 3.0
REST_SECONDS = 1.0
ALLOWED_MS = 0.5
"""Largest allowed increase of the 99th percentile of the tick jitter: half a tick [ms]."""


Periods = dict[str, tuple[int, int]]
"""Start and end of each kind of interference with a logger, server time [ns]."""


def record_stalls(folder: Path, seconds: float, tell: Tell) -> tuple[Path, Periods]:
    """Run a session with displays, and stop its logger in some periods; return its recording, and these."""
    periods = {}
    with Rig(folder, ("block.trials=1000",)) as rig:
        tell("starting a session", 0.0)
        rig.start("logger", "logger", "--once")
        rig.start("server", "server", "--autostart")
        rig.start_stations(displays=True)
        rig.until(lambda status: status.phase in ACTIVE)
        time.sleep(SETTLE_SECONDS)
        for name, share in STOPPED_SHARES.items():
            tell(name, 0.1)
            began = now_ns()
            _stop_logger(rig, seconds, share)
            periods[name] = began, now_ns()
            time.sleep(REST_SECONDS)
        (path,) = rig.finish()
    return path, periods


def _stop_logger(rig: Rig, seconds: float, share: float) -> None:
    """Stop the logger for a share of the time."""
    turns, length = (round(seconds * share / STALL_SECONDS), STALL_SECONDS) if 0 < share < 1 else (1, seconds)
    for _ in range(turns):
        if share:
            rig.suspend("logger")
        time.sleep(length)
        if share:
            rig.resume("logger")
            time.sleep(length * (1 / share - 1))


def stalls_part(path: Path, periods: Periods) -> ResultPart:
    """Compare the server's tick jitter."""
    with Recording(path) as recording:
        ticks = recording.columns("tick", "time_ns", "late_ns")
        lost = int(recording.end["lost"]) + sum(gap.count for gap in recording.gaps().get("/ticks", ()))
    late = {name: _between(ticks, *span) for name, span in periods.items()}
    p99 = [float(np.percentile(values, 99)) for values in late.values()]
    part = ResultPart(
        "stalls",
        "How late the server's ticks were, while its logger stood still; negative: before the deadline",
        "the logger | ticks [1] | 50 % [ms] | 99 % [ms] | 99.9 % [ms] | largest [ms]",
        [
            (name, len(values), *(float(value) for value in np.percentile(values, (50, 99, 99.9))), float(values.max()))
            for name, values in late.items()
        ],
    )
    part.claim(
        "the server's loop does not feel the logger's disk: 99 % of the ticks are at most half a tick later",
        max(p99) - p99[0] < ALLOWED_MS,
        ", ".join(f"{value:.3g} ms" for value in p99),
    )
    part.claim("no record is lost over it", lost == 0, f"{lost} lost")
    return part


def _between(ticks: dict[str, NDArray[Any]], start_ns: int, stop_ns: int) -> NDArray[np.float64]:
    """Start of the ticks of a period after their deadlines; negative: before, if all samples had arrived [ms]."""
    inside = (ticks["time_ns"] >= start_ns) & (ticks["time_ns"] < stop_ns)
    late: NDArray[np.float64] = ticks["late_ns"][inside] * 1e-6
    return late
