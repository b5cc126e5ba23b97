"""Soak test: no record is lost, memory does not grow, tick jitter and latency do not increase.

All processes are those that a lab runs. At the end the recordings are verified tick by tick.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Config
from netboard.base.tick import LATE_NS
from netboard.benchmarks.harness.results import BenchVerdict, ResultPart, Value
from netboard.benchmarks.harness.running import Tell
from netboard.benchmarks.loop.rig import Dyads, dyad_configs
from netboard.benchmarks.loop.timing import HEADS, Times, in_milliseconds
from netboard.benchmarks.loop.usage import Usage
from netboard.recording.files.reader import Recording
from netboard.recording.format.summary import closed_loops, spread
from netboard.recording.integrity.verification import verify_recording
from netboard.task.trials.state_machine import Cause

SAMPLE_SECONDS = 1.0

WARM_SHARE, WARM_SECONDS = 0.25, 60.0
"""Memory is judged from this share of the run on, or from this time if earlier, when ring buffers are full [1, s]."""

RING_SECONDS = 5.0
"""Length of the server's ring buffer; shorter than usual, so that it is full soon [s]."""

STRETCHES = 10
"""Number of rows in which a short soak is shown; a longer one is shown minute by minute [1]."""

MAX_LEAK, MIN_SEEN = 4e6 / 3600, 1e6
"""Largest growth of constant memory, per second or in total, in bytes [1/s, 1]."""

INDEX = 100e6 / 3600
"""A logger keeps an entry of the recording's index for every chunk: it may grow by this in a second, in bytes [1/s]."""

MAX_SLOWER = 1.5
"""Largest ratio of the 99th percentile in the last third of the run to that in the first third [1]."""


@dataclass(frozen=True)
class RecordedDyad:
    """What the recording of a dyad shows.

    - `verified`: whether the stage computes the same outputs from the recorded inputs, to the bit.
    - `time_ns`, `late_ns`: deadline of each tick, and its start after the deadline [ns].
    - `loop_at_ns`, `loop_ns`: sample-to-force latencies of both sides: the tick that records each, and its value [ns].
    - `size`: size of the recording [bytes].
    """

    ticks: int
    missing: int
    lost: int
    faults: int
    verified: bool
    time_ns: Times
    late_ns: Times
    loop_at_ns: Times
    loop_ns: Times
    size: int

    @property
    def whole(self) -> bool:
        """Whether no tick is missing and the recording is verified."""
        return self.verified and self.missing == 0 and self.lost == 0


@dataclass(frozen=True)
class Soaked:
    """Results of a soak: the resource use of all processes every second, and each dyad's recording."""

    samples: list[dict[str, Usage]]
    dyads: list[RecordedDyad]


def measure_soak(config: Config, folder: Path, dyads: int, displays: int, seconds: float, tell: Tell) -> Soaked:
    """Run dyads for a long time."""
    small = replace(config, network=replace(config.network, log_ring_s=RING_SECONDS))
    with Dyads(dyad_configs(small, folder, dyads), folder, displays) as processes:
        tell("waiting for trials", 0.0)
        processes.wait_for_trials()
        samples = _watch(processes, seconds, tell)
        tell("ending the sessions", 1.0)
        paths = processes.finish()
    recorded = []
    for path in paths:
        tell(f"verifying {path.name}", 1.0)
        recorded.append(read_dyad(path))
    return Soaked(samples, recorded)


def _watch(processes: Dyads, seconds: float, tell: Callable[[str, float], object]) -> list[dict[str, Usage]]:
    """Read the resource use of all processes every second."""
    samples = [processes.usage()]
    begun = time.monotonic()
    while (done := time.monotonic() - begun) < seconds:
        tell(f"{done / 60:.1f} of {seconds / 60:g} minutes", done / seconds)
        time.sleep(min(SAMPLE_SECONDS, seconds - done))
        processes.poll()
        samples.append(processes.usage())
    return samples


def read_dyad(path: Path) -> RecordedDyad:
    """Read and verify a recording."""
    with Recording(path) as recording:
        ticks = recording.ticks()
        lost = sum(int(remark.details["count"]) for remark in recording.remarks() if remark.name == "log_lost")
        missing = sum(gap.count for gaps in recording.gaps().values() for gap in gaps)
        verdict = verify_recording(recording)
    closed = {side: closed_loops(ticks[f"{side}_loop_ns"]) for side in SIDES}
    return RecordedDyad(
        ticks.size,
        missing,
        lost,
        int(np.count_nonzero(ticks["event"] == Cause.FAULT)),
        verdict.identical,
        ticks["time_ns"].copy(),
        ticks["late_ns"].copy(),
        np.concatenate([ticks["time_ns"][closed[side]] for side in SIDES]),
        np.concatenate([ticks[f"{side}_loop_ns"][closed[side]] for side in SIDES]),
        path.stat().st_size,
    )


# --- tables --------------------------------------------------------------------------------------------------------


def records_part(dyads: Sequence[RecordedDyad]) -> ResultPart:
    """Return the number of recorded ticks and losses."""
    whole = sum(one.whole for one in dyads)
    part = ResultPart(
        "records",
        "Recorded ticks and losses",
        "dyad | ticks [1] | missing numbers [1] | records lost [1] | faults [1] | verified | size [MB]",
        [
            (number, one.ticks, one.missing, one.lost, one.faults, one.verified, one.size / 1e6)
            for number, one in enumerate(dyads, start=1)
        ],
    )
    part.claim(
        "nothing is lost", whole == len(dyads), f"{whole} of {len(dyads)} recordings complete and verified bit for bit"
    )
    return part


def memory_part(samples: Sequence[dict[str, Usage]]) -> ResultPart:
    """Return the memory of all processes and its growth."""
    part = ResultPart(
        "memory", "Memory of each process", " | start [MB] | end [MB] | peak [MB] | growth after warm-up [MB/h]"
    )
    for name in samples[0]:
        at = np.array([sample[name].at_ns for sample in samples]) * 1e-9
        held = np.array([sample[name].resident for sample in samples], np.float64)
        warm = at >= at[0] + min(WARM_SHARE * (at[-1] - at[0]), WARM_SECONDS)
        slope, seconds = growth(at[warm], held[warm]), float(at[-1] - at[warm][0])
        part.add(name, held[0] / 1e6, held[-1] / 1e6, held.max() / 1e6, slope * 3600 / 1e6)
        part.verdicts.append(_flat(name, slope, seconds))
    return part


def _flat(name: str, slope: float, seconds: float) -> BenchVerdict:
    """Return the claim that memory does not grow."""
    logger = name.startswith("logger")
    claim = f"memory of the {name} " + ("grows by no more than its index" if logger else "is flat")
    flat = slope < (INDEX if logger else MAX_LEAK) or slope * seconds < MIN_SEEN
    return BenchVerdict(claim, flat, f"{slope * seconds / 1e6:+.2f} MB in {seconds:.0f} s")


def growth(at: NDArray[np.float64], held: NDArray[np.float64]) -> float:
    """Return the growth rate of memory by least squares, in bytes [1/s]."""
    return float(np.polyfit(at - at[0], held, 1)[0]) if at.size > 1 else 0.0


def minutes_part(dyads: Sequence[RecordedDyad]) -> ResultPart:
    """Return the tick jitter and the sample-to-force latency over the run."""
    start, end = min(one.time_ns[0] for one in dyads), max(one.time_ns[-1] for one in dyads) + 1
    count = max(STRETCHES, int((end - start) * 1e-9 / 60))
    edges = np.linspace(start, end, count + 1).astype(np.int64)
    rows: list[tuple[Value, ...]] = []
    for since, until in pairwise(edges.tolist()):
        late = _between(since, until, [(one.time_ns, one.late_ns) for one in dyads])
        loop = _between(since, until, [(one.loop_at_ns, one.loop_ns) for one in dyads])
        rows.append(
            (
                float(since - start) * 1e-9 / 60,
                *in_milliseconds(spread(late)),
                int(np.count_nonzero(late > LATE_NS)),
                *in_milliseconds(spread(loop)),
            )
        )
    part = ResultPart(
        "minutes",
        "Tick jitter and latency over the run",
        ("from [min]", *(f"tick late, {head}" for head in HEADS), "late [1]", *(f"loop, {head}" for head in HEADS)),
        rows,
    )
    part.verdicts.append(stays_prompt("ticks begin", [float(row[2]) for row in rows]))
    part.verdicts.append(stays_prompt("loops close", [float(row[7]) for row in rows]))
    return part


def _between(since: int, until: int, series: Sequence[tuple[Times, Times]]) -> Times:
    """Return all values with times in a period."""
    return np.concatenate([values[(at >= since) & (at < until)] for at, values in series])


def stays_prompt(what: str, p99: Sequence[float]) -> BenchVerdict:
    """Compare percentiles of the last third of the run with those of the first."""
    third = max(len(p99) // 3, 1)
    first, last = float(np.median(p99[:third])), float(np.median(p99[-third:]))
    claim = f"at the end {what} as promptly as at the start, at 99 %"
    return BenchVerdict(
        claim, last <= max(MAX_SLOWER * first, first + 0.1), f"{last:.3f} ms, at the start {first:.3f} ms"
    )
