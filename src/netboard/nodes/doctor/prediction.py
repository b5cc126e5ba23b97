"""Predicts the latency of the loop on this machine from a probe of some seconds, and names what limits it.

The exchange over loopback (`netboard.nodes.doctor.exchange`) gives wake-up latencies and transit times. From each
measured millisecond a loop is computed by the rules of a session: its tick begins when both samples have arrived, and
at the latest at its deadline. The work that the exchange leaves out is added as a constant (`WORK_US`), measured on one
machine and scaled by the CPU time of an exchange. Deadline misses are those of the timer. Pure: measurements in,
findings out.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from netboard.base.finding import Finding, graded
from netboard.base.tick import LEAD_NS
from netboard.nodes.doctor.exchange import ExchangeTimes

LOOP = "predicted loop"
"""Name of the finding."""

WORK_US, WORK_EXCHANGE_US = -5.0, 64.0
"""Work of a loop beside its exchange, and the server's CPU time for an exchange, on the machine of latency.md [us].

By one run of `netboard bench loop`: the median loop of 153 without the echo of 157 and the wait for the other sample of
1, so with the contention of a session's processes, and less than 0, because the probe exchanges in Python what a
session exchanges in compiled code; and 12.8 % of a core for 2000 exchanges a second.
"""

MANY = 100_000
GOOD_MS, GOOD_MISSED = 1.0, 100.0
"""Limits of green: 99 % of the loops within a tick [ms], and one tick in a thousand missed, of 100 000 [1]."""

LEVEL = 0.95
"""Level of the confidence interval of the misses."""

LIMITS = (
    *("real-time scheduling", "real-time throttle", "virtual machine", "cores", "kernel preemption", "isolated cores"),
    *("CPU governor", "sleep of cores", "timer slack", "locked memory", "network card", "clock source"),
)
"""Findings that limit a loop, the one that usually matters most first."""


@dataclass(frozen=True)
class Prediction:
    """Predicted loop of a machine."""

    # Median and 99 % quantile of the sample-to-force latency [ms].
    p50_ms: float
    p99_ms: float
    missed: float  # deadline misses of 100 000 ticks, with their exact Poisson interval at `LEVEL` [1]
    missed_low: float
    missed_high: float


def predict(times: ExchangeTimes, missed: int, ticks: int) -> Prediction:
    """Predict the loop. ``missed``, ``ticks``: what a timer missed, of how many [1]."""
    p50, p99 = np.percentile(loops_ns(times), (50, 99)) * 1e-6
    scale = MANY / ticks
    low = chi2.ppf((1 - LEVEL) / 2, 2 * missed) / 2 if missed else 0.0
    high = chi2.ppf((1 + LEVEL) / 2, 2 * (missed + 1)) / 2
    return Prediction(float(p50), float(p99), missed * scale, float(low) * scale, float(high) * scale)


def loops_ns(times: ExchangeTimes) -> NDArray[np.float64]:
    """Return the sample-to-force latencies that follow from the exchanges, of both sides [ns]."""
    arrived = times.woke_ns + times.up_ns
    due = np.median(arrived) + LEAD_NS
    wakes = np.maximum(times.woke_ns[0], times.woke_ns[1])
    begun = np.minimum(arrived.max(axis=0), due + wakes)
    in_time = arrived <= begun  # a sample that misses its tick is overtaken by the next one
    work_ns = 1e3 * WORK_US * times.server_us / WORK_EXCHANGE_US
    took: NDArray[np.float64] = (begun - times.woke_ns + times.down_ns)[in_time] + work_ns
    return took


def finding(found: Prediction) -> Finding:
    """Judge a prediction."""
    good = found.p99_ms <= GOOD_MS and found.missed <= GOOD_MISSED
    sentence = (
        f"sample to force p50 {found.p50_ms:.2f}, p99 {found.p99_ms:.2f} ms; of {MANY} ticks "
        f"{found.missed:.0f} missed ({LEVEL:.0%} CI {found.missed_low:.0f} to {found.missed_high:.0f})"
    )
    return graded(LOOP, good, sentence, "see docs/how-to/real-time.md", asdict(found))


def with_limits(findings: Sequence[Finding]) -> list[Finding]:
    """Return findings in which a prediction that is not green names what limits the loop."""
    flagged = {one.name for one in findings if one.colour != "green"}
    limits = [name for name in LIMITS if name in flagged]
    advice = (
        f"limited by {', '.join(limits)}" if limits else "no known limit applies: check what else runs on this machine"
    )
    return [replace(one, advice=advice) if one.name == LOOP and one.colour != "green" else one for one in findings]
