"""``netboard bench triggers``: latency of triggers in a session of real processes, from an event's tick to the pulse.

A simulated dyad runs trials; a console adds notes, whose events have a code, so that there are enough pulses. The box
is a stand-in (`netboard.benchmarks.loop.trigger_box`), so no electrical pulse is measured: a real box adds its own
latency, which `netboard doctor` measures in a loop-back.
"""

import random
import time
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from netboard.base.clock import now_ns
from netboard.benchmarks.harness.results import BenchVerdict, Folder, ResultPart
from netboard.benchmarks.harness.rig import ACTIVE, Rig
from netboard.benchmarks.harness.running import Options, Tell, run
from netboard.benchmarks.loop.rig import SETTLE_SECONDS, TRIALS
from netboard.benchmarks.loop.timing import HEADS, Times, draw_histograms, histogram_part, spread_rows
from netboard.benchmarks.loop.trigger_box import PtyBox
from netboard.network.protocol.triggers import TRIGGER, TRIGGER_LOST
from netboard.recording.files.reader import Recording

SECONDS, QUICK_SECONDS = 120.0, 10.0
"""Default duration of the measurement [s]."""

NOTES_HZ = 15.0
"""Mean rate of the notes, below the commands that a server takes from a console [Hz]."""

NOTE_CODE = 200
"""Code of their events [1]."""

SEED = 1

WAITED_NS = 200_000
"""Wait for an earlier pulse above which a pulse does not count for the latency [ns]."""

RECEIVED, WRITTEN, RETURNED = "tick to arrival at the box's process", "tick to written pulse", "tick to returned edge"
ALONE = "written pulse to returned edge"


def main(seconds: float | None, options: Options) -> None:
    """Run the study. ``seconds``: duration of the measurement; None for the default [s]."""
    seconds = seconds or (QUICK_SECONDS if options.quick else SECONDS)
    box = "a pseudo-terminal that returns each code; no electrical pulse"
    run("triggers", partial(study, seconds), options, {"seconds": seconds, "box": box})


def study(seconds: float, folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Run a session with triggers, and read their latencies from its recording."""
    with TemporaryDirectory() as name, PtyBox(Path(name)) as box:
        recording = record(Path(name), box, seconds, tell)
        with Recording(recording) as found:
            events = [(event.name, event.details) for event in found.events()]
    pulses = [details for kind, details in events if kind == TRIGGER]
    lost = [details["reason"] for kind, details in events if kind == TRIGGER_LOST]
    times = latencies(pulses)
    drawn = {name: times[name] for name in (WRITTEN, RETURNED)}
    folder.save("triggers", lambda: draw_histograms([drawn], "Triggers: a pseudo-terminal, no electrical pulse"))
    yield latency_part(times, len(pulses), lost)
    yield histogram_part(drawn)


def record(folder: Path, box: PtyBox, seconds: float, tell: Tell) -> Path:
    """Run a dyad in trials, with notes at random times; return the recording."""
    settings = (
        "triggers.kind=serial",
        f"triggers.address={box.address}",
        "triggers.loopback=true",
        f"triggers.codes.command={NOTE_CODE}",
        f"block.trials={TRIALS}",
    )
    chance = random.Random(SEED)
    with Rig(folder, settings) as rig:
        rig.start("trigger", "trigger")
        rig.start_all()
        rig.until(lambda status: status.phase in ACTIVE)
        time.sleep(SETTLE_SECONDS)
        began_ns = now_ns()
        while (done := (now_ns() - began_ns) * 1e-9) < seconds:
            tell("session with triggers", done / seconds)
            rig.operator.poll(trace=False)
            rig.operator.command("note", "for a pulse")
            rig.require_running()
            time.sleep(chance.expovariate(NOTES_HZ))
        (recording,) = rig.finish()
        return recording


def latencies(pulses: Sequence[Mapping[str, str]]) -> dict[str, Times]:
    """Return the latencies of the pulses that did not wait for an earlier one [ns]."""
    own = [pulse for pulse in pulses if float(pulse["waited_us"]) * 1e3 <= WAITED_NS]
    back = [pulse for pulse in own if pulse["loopback_us"] != "lost"]
    written, alone = (_ns(back, key) for key in ("latency_us", "loopback_us"))
    return {
        RECEIVED: _ns(own, "received_us"),
        WRITTEN: _ns(own, "latency_us"),
        RETURNED: written + alone,
        ALONE: alone,
    }


def latency_part(times: Mapping[str, Times], pulses: int, lost: Sequence[str]) -> ResultPart:
    """Return the percentiles, and what must hold."""
    waited, gone = pulses - times[WRITTEN].size, times[WRITTEN].size - times[RETURNED].size
    found = f"{pulses} pulses, {waited} of them after an earlier one; {gone} edges returned too late or never"
    p50_ms = float(np.median(times[WRITTEN])) * 1e-6
    return ResultPart(
        "latency",
        "Latency of a trigger, of the pulses that did not wait for an earlier one",
        ("from and to", "pulses [1]", *HEADS),
        spread_rows(times),
        [
            BenchVerdict("every event with a code gave a pulse", not lost, found),
            BenchVerdict("half of the pulses are written within 1 ms of their tick", p50_ms < 1, f"{p50_ms:.2f} ms"),
        ],
    )


def _ns(pulses: Sequence[Mapping[str, str]], key: str) -> Times:
    """Return a detail of some pulses, which is in microseconds, in nanoseconds."""
    return np.array([round(float(pulse[key]) * 1e3) for pulse in pulses], np.int64)
