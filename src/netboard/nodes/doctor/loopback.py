"""Loop-back test of the trigger box: pulses that come back to its input, how long they take, and how many are lost.

The time counts from just before the write of a code to the arrival of the edge at the input, as this process sees it.
It includes the box and the way back, so it bounds the latency of the pulse itself from above.
"""

import select
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.errors import ConfigError, DeviceError
from netboard.base.finding import Colour, Finding, graded
from netboard.base.tables.triggers import MAX_CODE, Triggers
from netboard.devices.triggers import registry
from netboard.devices.triggers.box import NO_FILE, TriggerBox

NAME = "trigger box"

BINS_MS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
"""Upper ends of the histogram's bins [ms]."""

GOOD_MS = 2.0
"""Loop-back time that 99 % of the pulses should keep: the sampling interval of an amplifier at 500 Hz [ms]."""

EDGE_NS = 200_000_000
"""Time after which a pulse that has not come back is lost [ns]."""

MOST_LOST = 20
"""Pulses lost one after the other after which the test ends: the wire is missing [1]."""

BAR = 40
"""Length of the longest bar of a histogram [1]."""

_BIN = "up to {:g} ms"


@dataclass
class LoopbackTimes:
    """What a test has measured: one entry for each pulse, NaN where no edge came."""

    write_ms: list[float] = field(default_factory=list)
    edge_ms: list[float] = field(default_factory=list)

    @property
    def lost(self) -> int:
        """Number of pulses that did not come back [1]."""
        return sum(np.isnan(self.edge_ms))

    @property
    def came_back(self) -> list[float]:
        """Loop-back times of the pulses that came back [ms]."""
        return [one for one in self.edge_ms if not np.isnan(one)]


def measure(box: TriggerBox, pulses: int, progress: Callable[[float], None]) -> LoopbackTimes:
    """Make pulses with all lines high, through an open box, and wait for each at the input if that is wired."""
    triggers, found = box.settings, LoopbackTimes()
    for number in range(pulses):
        if triggers.loopback and len(found.edge_ms) >= MOST_LOST and all(np.isnan(found.edge_ms[-MOST_LOST:])):
            break
        box.read()  # a late edge of the pulse before
        before_ns = now_ns()
        box.write(MAX_CODE)
        found.write_ms.append((now_ns() - before_ns) * 1e-6)
        edge_ns = _edge_ns(box, before_ns + EDGE_NS) if triggers.loopback else 0
        found.edge_ms.append((edge_ns - before_ns) * 1e-6 if edge_ns else float("nan"))
        _sleep_until(before_ns + int(triggers.width * 1e9))
        if triggers.reset:
            box.write(0)
        time.sleep(triggers.gap)
        progress((number + 1) / pulses)
    return found


def _edge_ns(box: TriggerBox, until_ns: int) -> int:
    """Return when the next edge arrives at the input; 0 if none does in time [ns]."""
    while (left_ns := until_ns - now_ns()) > 0:
        if box.file != NO_FILE:
            select.select([box.file], (), (), left_ns * 1e-9)
        if box.read():
            return now_ns()
    return 0


def _sleep_until(until_ns: int) -> None:
    time.sleep(max(until_ns - now_ns(), 0) * 1e-9)


def examine(triggers: Triggers, pulses: int, absent: Colour, progress: Callable[[float], None]) -> Iterator[Finding]:
    """Yield the finding of the declared box, if there is one. ``absent``: colour if it is not at this machine."""
    if not triggers.declared:
        return
    try:
        with registry.make(triggers) as box:
            text, simulated, found = box.text, box.simulated, measure(box, pulses, progress)
    except (ConfigError, DeviceError) as error:
        yield Finding(NAME, absent, str(error), "see [triggers]; while netboard trigger runs, it has the box")
        return
    yield verdict(text, found, loopback=triggers.loopback, simulated=simulated)


def verdict(text: str, found: LoopbackTimes, *, loopback: bool, simulated: bool) -> Finding:
    """Judge what was measured."""
    write = f"{text}: {len(found.write_ms)} pulses, a write takes {_percentiles(found.write_ms)}"
    if not loopback:
        advice = "wire an output to its input, and set [triggers] loopback = true: then the pulses are measured"
        return Finding(NAME, "yellow", write, advice)
    times, lost = found.came_back, found.lost
    said = f"{write}; back after {_percentiles(times)}, {lost} lost" if times else f"{write}; none came back"
    if lost:
        advice = "check the wire from an output to the input, and [triggers] width and address"
        return Finding(NAME, "red", said, advice, figures(times, lost))
    if simulated:
        return Finding(NAME, "yellow", said, "no pulse reaches an amplifier", figures(times, lost))
    late = float(np.percentile(times, 99)) > GOOD_MS
    return graded(NAME, not late, said, "of a USB serial chip, lower the latency timer to 1 ms", figures(times, lost))


def _percentiles(times: Sequence[float]) -> str:
    p50, p99 = np.percentile(times, [50, 99])
    return f"{p50:.2f} ms (median), {p99:.2f} ms (99 %), {max(times):.2f} ms (longest)"


def figures(times: Sequence[float], lost: int) -> dict[str, float]:
    """Return the figures of a finding: percentiles, and the histogram as counts."""
    counts, _ = np.histogram(times, (0.0, *BINS_MS))
    p50, p99 = np.percentile(times, [50, 99]) if times else (float("nan"), float("nan"))
    bins = {_BIN.format(end): float(count) for end, count in zip(BINS_MS, counts, strict=True)}
    return {"p50_ms": float(p50), "p99_ms": float(p99), **bins, "lost": float(lost)}


def histogram(finding: Finding) -> list[str]:
    """Return the histogram of a finding as lines of text below a title; none if it has no loop-back times."""
    bins = {name: finding.figures[name] for end in BINS_MS if (name := _BIN.format(end)) in finding.figures}
    if not bins:
        return []
    bins["lost"] = finding.figures["lost"]
    most = max(bins.values()) or 1.0
    bars = (f"{name:>12}  {count:5.0f}  {'#' * round(BAR * count / most)}".rstrip() for name, count in bins.items())
    return ["loop-back times of the trigger box", *bars]
