"""``netboard bench loop`` and ``netboard bench soak``: latency and jitter of real processes on this machine.

Only the participants are simulated: server, agents, loggers and displays are the processes that a lab runs, at their
real rates. Other load on the machine affects the results; it is noted.
"""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal

from netboard.base.config import Config
from netboard.base.errors import NetboardError
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Options, Tell, run
from netboard.benchmarks.loop.loop import (
    costs_part,
    latency_part,
    lateness_part,
    loop_series,
    measure_loop,
    ratios_part,
)
from netboard.benchmarks.loop.soak import measure_soak, memory_part, minutes_part, records_part
from netboard.benchmarks.loop.stand_in import DISCLAIMER, DeviceName, with_device
from netboard.benchmarks.loop.timing import draw_histograms, histogram_part
from netboard.benchmarks.loop.usage import Costs, add_costs
from netboard.stage.stage import make_stage

SECONDS, QUICK_SECONDS = 60.0, 8.0
"""Default measurement time of netboard, the echo and the timer, each [s]."""

TURN_SECONDS, QUICK_TURN_SECONDS = 6.0, 2.0
"""Approximate length of a turn [s]."""

MINUTES, QUICK_MINUTES = 30.0, 0.5
"""Default duration of a soak test [min]."""

Transport = Literal["tcp", "ipc"]


@dataclass(frozen=True)
class Setting:
    """The setting in which netboard is measured."""

    transport: Transport = "tcp"
    curve: bool = False
    real_time: bool = True
    displays: int = 0
    device: DeviceName = "virtual"

    @property
    def config(self) -> Config:
        """Return the configuration for this setting."""
        plain = with_device(Config(), self.device)
        return replace(
            plain,
            network=replace(plain.network, transport=self.transport, curve="on" if self.curve else "off"),
            realtime=replace(plain.realtime, scheduling=self.real_time),
        )

    def __str__(self) -> str:
        keys, scheduling = "keys" if self.curve else "no keys", "real-time" if self.real_time else "usual"
        return f"{self.device}, {self.transport}, {keys}, {scheduling} scheduling, displays: {self.displays}"

    @property
    def lines(self) -> tuple[str, ...]:
        """Return the lines at the head of the results."""
        return (str(self),) if self.device == "virtual" else (str(self), DISCLAIMER)


def loop(setting: Setting, seconds: float | None, options: Options) -> None:
    """Run ``netboard bench loop``.

    - `seconds`: duration of each measurement; None for the default [s].
    """
    seconds = seconds or (QUICK_SECONDS if options.quick else SECONDS)
    rounds = max(1, round(seconds / (QUICK_TURN_SECONDS if options.quick else TURN_SECONDS)))

    def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
        with scratch_folder(setting.config, folder, tell) as scratch:
            found = measure_loop(setting.config, scratch, setting.displays, seconds, rounds, tell)
            series = loop_series(found)
            yield ratios_part(found)
            yield latency_part(found, real_time=setting.real_time)
            yield lateness_part(found)
            yield costs_part(found.costs)
            yield histogram_part(series[0] | series[1])
            folder.save("loop", lambda: draw_histograms(series, f"Stylus to force: {setting}"))

    settings = {**asdict(setting), "seconds": seconds, "rounds": rounds}
    run("loop", study, options, settings, lines=setting.lines)


def soak(setting: Setting, minutes: float | None, dyads: int, options: Options) -> int:
    """Run ``netboard bench soak``; the exit code is 1 if anything is lost."""
    minutes = minutes or (QUICK_MINUTES if options.quick else MINUTES)

    def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
        with scratch_folder(setting.config, folder, tell) as scratch:
            found = measure_soak(setting.config, scratch, dyads, setting.displays, 60 * minutes, tell)
            yield records_part(found.dyads)
            yield memory_part(found.samples)
            yield minutes_part(found.dyads)
            costs: Costs = {}
            add_costs(costs, found.samples[0], found.samples[-1])
            yield costs_part(costs)

    settings = {**asdict(setting), "minutes": minutes, "dyads": dyads}
    nothing_lost, *_ = run("soak", study, options, settings, lines=[str(setting)])
    return 0 if nothing_lost.holds else 1


@contextmanager
def scratch_folder(config: Config, folder: Folder, tell: Tell) -> Iterator[Path]:
    """Compile the kernels; yield a folder for recordings and logs, which is removed if the study succeeds."""
    if not Path("/proc/self/task").exists():
        raise NetboardError("the resource use of processes is read from /proc, which this system does not have")
    scratch = folder.path.resolve() / "processes"
    shutil.rmtree(scratch, ignore_errors=True)
    scratch.mkdir()
    tell("compiling the kernels", 0.0)
    make_stage(config).warm()
    yield scratch
    shutil.rmtree(scratch)
