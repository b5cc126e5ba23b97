"""Measures the wake-up latency of a 1 kHz loop on this machine, with the services' real-time settings and without.

The loop runs in its own process, which asks for everything exactly as the server does
(`netboard.base.process.realtime.prepare`). The doctor's own load does not disturb it, and its settings end with it.
"""

import json
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.errors import NetboardError
from netboard.base.finding import Colour, Finding, graded
from netboard.base.process.realtime import Priority, cpus_for, prepare, steady_loop
from netboard.base.tables.rig import Realtime
from netboard.base.tick import TICK_NS

TIMER = "timer"
"""Name of the finding on the loop with the server's settings."""

GOOD_US, BEARABLE_US = 300.0, 1000.0
"""Latency of one wake-up in a thousand: limits of green and yellow; a tick is 1000 [us]."""

PROGRESS_INTERVAL_S = 0.1
WARM_UP_TICKS = 200


@dataclass(frozen=True)
class WakeUps:
    """Wake-up latencies of a loop."""

    granted: dict[str, str]
    # Median, 99 % and 99.9 % quantile, and maximum of the latency [us].
    p50_us: float
    p99_us: float
    p999_us: float
    max_us: float
    missed: int  # ticks of which the wake-up came a whole tick late or more
    ticks: int


def measure(wanted: Realtime, seconds: float, progress: Callable[[float], None]) -> WakeUps:
    """Run a loop in a process of its own. ``progress``: called repeatedly with the share that is done, up to 1."""
    request = json.dumps({"wanted": asdict(wanted), "seconds": seconds})
    command = [sys.executable, "-m", "netboard.nodes.doctor.timing", request]
    began = time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as loop:
        while True:
            try:
                output, errors = loop.communicate(timeout=PROGRESS_INTERVAL_S)
                break
            except subprocess.TimeoutExpired:
                progress(min(1.0, (time.monotonic() - began) / seconds))
    if loop.returncode:
        raise NetboardError(f"the timer's loop failed: {(errors.strip().splitlines() or ['no message'])[-1]}")
    return WakeUps(**json.loads(output))


def verdict(wake_ups: WakeUps) -> Finding:
    """Judge a loop that asked for the server's settings."""
    advice = "find what else runs here; see docs/how-to/real-time.md"
    poor: Colour = "yellow" if wake_ups.p999_us <= BEARABLE_US else "red"
    return graded(TIMER, wake_ups.p999_us <= GOOD_US, latency_text(wake_ups), advice, figures_of(wake_ups), else_=poor)


def comparison(wake_ups: WakeUps) -> Finding:
    """Report a loop that asked for no settings."""
    return Finding(f"{TIMER}, no settings", "green", latency_text(wake_ups), figures=figures_of(wake_ups))


def latency_text(wake_ups: WakeUps) -> str:
    """Return the latencies in words."""
    p50, p99, p999, most = wake_ups.p50_us, wake_ups.p99_us, wake_ups.p999_us, wake_ups.max_us
    return f"p50 {p50:.0f}, p99 {p99:.0f}, p99.9 {p999:.0f}, max {most:.0f} us late"


def figures_of(wake_ups: WakeUps) -> dict[str, float]:
    """Return the latencies as numbers."""
    return {name: getattr(wake_ups, name) for name in ("p50_us", "p99_us", "p999_us", "max_us")}


def lateness(ticks: int) -> list[int]:
    """Sleep until each of this many deadlines, 1 ms apart, and return the latency of each wake-up [ns]."""
    late = []
    due = now_ns() + TICK_NS
    for _ in range(ticks):
        time.sleep(max(0, due - now_ns()) * 1e-9)
        late.append(now_ns() - due)
        due += TICK_NS
    return late


def percentiles(late_ns: list[int]) -> dict[str, float]:
    """Return the percentiles of latencies [us]."""
    p50, p99, p999, most = np.percentile(late_ns, [50, 99, 99.9, 100]) / 1000
    return {"p50_us": float(p50), "p99_us": float(p99), "p999_us": float(p999), "max_us": float(most)}


def main(request: dict[str, Any]) -> None:
    """Run the loop in this process."""
    wanted = Realtime(**request["wanted"])
    granted = prepare(wanted, Priority.SERVER, cpus_for("server", wanted))
    steady_loop()
    lateness(WARM_UP_TICKS)
    late = lateness(round(request["seconds"] * 1000))
    missed = sum(late_ns > TICK_NS for late_ns in late)
    sys.stdout.write(json.dumps({"granted": granted, **percentiles(late), "missed": missed, "ticks": len(late)}))


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
