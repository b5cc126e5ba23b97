"""``netboard bench servo``: duration of the servo callback in Python and in C, in the vendor's servo thread.

A timer in C records the start and the end of each callback, so that waiting for the interpreter lock is included and
the timer itself needs no lock. The baseline is an empty callback. Each variant runs in its own process, which behaves
like an agent: every millisecond its loop takes the newest sample and writes a force. Each is measured again with
a second thread that computes in Python without a pause.
"""

import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import BrokenExecutor
from functools import partial

import numpy as np

from netboard.base.clock import Pacer, now_ns
from netboard.base.errors import DeviceTimeout, NetboardError
from netboard.base.process.realtime import steady_loop
from netboard.base.tick import TICK_NS
from netboard.benchmarks.harness.processes import in_fresh_process
from netboard.benchmarks.harness.results import BenchVerdict, Folder, ResultPart, Value
from netboard.benchmarks.harness.running import Options, Tell, run
from netboard.benchmarks.loop.timing import HEADS, Times, in_milliseconds, ratio_row, spread_rows
from netboard.devices.touch import api
from netboard.devices.touch.find import find
from netboard.devices.touch.library import rig_of
from netboard.devices.touch.servo import PythonServo, Servo
from netboard.devices.touch.shim import ShimServo, Watch, shim
from netboard.recording.format.summary import spread

SECONDS, QUICK_SECONDS = 30.0, 2.0
"""Default measurement time of each of the six variants [s]."""

BARE, PYTHON, C = "bare tick", "python", "c"
KINDS = (BARE, PYTHON, C)
SERVOS: dict[str, type[PythonServo] | type[ShimServo]] = {BARE: ShimServo, PYTHON: PythonServo, C: ShimServo}

TIMEOUT_NS = 20_000_000
WARM_UP_TICKS = 200
ALONE, BUSY = "", ", busy thread"
LOADS = (ALONE, BUSY)
"""Whether a second thread computes, as the end of a variant's name."""


def main(library: str, seconds: float | None, options: Options) -> None:
    """Run the study.

    - `seconds`: duration of each measurement; None for the default [s].
    """
    api.load(library)
    shim()
    seconds = seconds or (QUICK_SECONDS if options.quick else SECONDS)
    run("servo", partial(study, library, seconds), options, {"library": library, "seconds": seconds}, bar=False)


def study(library: str, seconds: float, folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Measure each callback, alone and beside a busy thread."""
    found: dict[str, Times] = {}
    for load in LOADS:
        for kind in KINDS:
            name = kind + load
            tell(f"{name}: {seconds:g} s", len(found) / (len(LOADS) * len(KINDS)))
            found[name] = measure(library, kind, seconds, busy=load == BUSY)
    yield lateness_part(found)
    yield duration_part(found)


def lateness_part(found: Mapping[str, Times]) -> ResultPart:
    """Return the tick jitter of each variant, compared with the bare tick.

    - `found` (shape (n, 2)): start and end of each tick, by variant [ns].
    """
    off = {name: unsteadiness(times) for name, times in found.items()}
    rows: list[tuple[Value, ...]] = list(spread_rows(off))
    for load in LOADS:
        for kind in (PYTHON, C):
            name, *ratios = ratio_row(f"{kind} / {BARE}{load} [1]", off[kind + load], off[BARE + load])
            rows.append((name, "", *ratios))
    return ResultPart(
        "lateness",
        f"How early or late ticks are: how far from {TICK_NS / 1e6:g} ms after the one before",
        ("callback", "ticks [1]", *HEADS),
        rows,
    )


def duration_part(found: Mapping[str, Times]) -> ResultPart:
    """Return the duration of the callbacks.

    - `found` (shape (n, 2)): start and end of each tick, by variant [ns].
    """
    took = {name: times[:, 1] - times[:, 0] for name, times in found.items()}
    rows: list[tuple[Value, ...]] = list(spread_rows(took))
    for load in LOADS:
        name, *ratios = ratio_row(f"{PYTHON} / {C}{load} [1]", took[PYTHON + load], took[C + load])
        rows.append((name, "", *ratios))
    verdicts = []
    for kind in (PYTHON, C):
        p999_ms = in_milliseconds(spread(took[kind + BUSY]))[2]
        claim = f"99.9 % of the callbacks in {kind} take less than a tick beside a busy thread"
        verdicts.append(BenchVerdict(claim, p999_ms < TICK_NS * 1e-6, f"{p999_ms:.3f} ms"))
    return ResultPart(
        "duration",
        "For how long a callback holds the servo thread up, the wait for the interpreter included",
        ("callback", "ticks [1]", *HEADS),
        rows,
        verdicts,
    )


def unsteadiness(times: Times) -> Times:
    """Return the jitter: the deviation of each interval between ticks from a tick [ns]."""
    off: Times = np.abs(np.diff(times[:, 0]) - TICK_NS)
    return off


def measure(library: str, kind: str, seconds: float, *, busy: bool) -> Times:
    """Measure one callback in a process of its own."""
    try:
        return in_fresh_process(work, library, kind, seconds, busy)
    except (NetboardError, BrokenExecutor) as error:
        raise NetboardError(f"measuring the servo callback ({kind}) failed: {error}") from error


def work(library: str, kind: str, seconds: float, busy: bool) -> Times:
    """Run in that process: a timed servo, and an agent's loop."""
    rig = rig_of(library)
    count = round(seconds * 1e9) // TICK_NS
    with rig.paused():
        device = find(rig, "", "")
        servo = SERVOS[kind](rig.library, device.handle, TIMEOUT_NS)
        watch = Watch(None if kind == BARE else servo.entry, count + 2 * WARM_UP_TICKS)
        rig.schedule(device, servo, watch.entry)
    stopping = threading.Event()
    thread = threading.Thread(target=compute, args=(stopping,), daemon=True)
    try:
        _loop(servo, 50)
        if len(watch.times) == 0:
            raise DeviceTimeout("the servo loop of the haptic device does not run")
        steady_loop()
        if busy:
            thread.start()
        _loop(servo, WARM_UP_TICKS)
        first = len(watch.times)
        _loop(servo, count)
        return watch.times[first:]
    finally:
        stopping.set()
        rig.release(device)


def compute(stopping: threading.Event) -> None:
    """Compute in Python without a pause until `stopping` is set."""
    number = 1
    while not stopping.is_set():
        for _ in range(1000):
            number = (number * 6364136223846793005 + 1442695040888963407) % 2**64


def _loop(servo: Servo, count: int) -> None:
    """Do the work of an agent `count` times: take the newest sample, write a force."""
    pacer = Pacer(now_ns())
    for _ in range(count):
        pacer.wait()
        servo.take()
        servo.put((0.0, 0.0, 0.0))
