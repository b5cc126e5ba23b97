"""``netboard bench loop`` and ``netboard bench soak``: how quick and how steady the real thing is, on this machine.

Nothing is simulated but the people: server, agents, loggers and displays are the processes that a lab runs, at their
true cadence. What else the machine was doing shows in the figures; its load is noted.
"""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from netboard.base.config import Config
from netboard.base.errors import ConfigError, NetboardError
from netboard.benchmarks.harness.machine import describe
from netboard.benchmarks.harness.results import Folder, Part, new_folder, show
from netboard.benchmarks.harness.running import Tell
from netboard.benchmarks.loop.loop import measure_loop
from netboard.benchmarks.loop.loop_tables import (
    costs_part,
    latency_part,
    lateness_part,
    loop_series,
    server_verdict,
)
from netboard.benchmarks.loop.scale import measure_scale, measure_waiting, scale_part, waiting_part
from netboard.benchmarks.loop.serving import Crowd
from netboard.benchmarks.loop.skips import measure_skips, skips_part, tick_part
from netboard.benchmarks.loop.soak import measure_soak, memory_part, minutes_part, records_part
from netboard.benchmarks.loop.spreads import draw_histograms, histogram_part
from netboard.benchmarks.loop.usage import Costs, add_costs
from netboard.stage.stage import make_stage

SECONDS, QUICK_SECONDS = 60.0, 8.0
"""Default measurement time of netboard, the echo and the timer, each [s]."""

TURN_SECONDS, QUICK_TURN_SECONDS = 10.0, 4.0
"""Approximate length of a turn [s]."""

MINUTES, QUICK_MINUTES = 30.0, 0.5
"""Default duration of a soak test [min]."""

MOST_DYADS = 256

WIDTH = 140
"""Minimum width of tables [characters]."""

Transport = Literal["tcp", "ipc"]


@dataclass(frozen=True)
class Setting:
    """The setting in which netboard is measured."""

    transport: Transport = "tcp"
    curve: bool = False
    real_time: bool = True
    displays: int = 0
    quick: bool = False

    @property
    def config(self) -> Config:
        """Return the configuration for this setting."""
        plain = Config()
        return replace(
            plain,
            network=replace(plain.network, transport=self.transport, curve="on" if self.curve else "off"),
            realtime=replace(plain.realtime, scheduling=self.real_time),
        )

    def __str__(self) -> str:
        keys, scheduling = "keys" if self.curve else "no keys", "real-time" if self.real_time else "usual"
        return f"{self.transport}, {keys}, {scheduling} scheduling, displays: {self.displays}"


def read_dyads(words: str | None) -> tuple[int, ...]:
    """Parse the numbers of dyads, as in ``1,2,4``."""
    try:
        numbers = tuple(int(word) for word in words.split(",")) if words else ()
    except ValueError:
        numbers = (0,)
    if not all(0 < number <= MOST_DYADS for number in numbers):
        raise ConfigError(f"--dyads: found {words}, expected numbers from 1 to {MOST_DYADS} with commas between")
    return numbers


class Study:
    """A study under way: its results, and where they go.

    Attributes
    ----------
    scratch : Path
        For what the processes record and say; it is removed when all has gone well.
    """

    def __init__(self, name: str, setting: Setting, folder: Folder, console: Console, tell: Tell) -> None:
        self.folder = folder
        self.tell = tell
        self.scratch = folder.path / "processes"
        shutil.rmtree(self.scratch, ignore_errors=True)
        self.scratch.mkdir()
        self._about = {"study": name, **asdict(setting)}
        self._console = console
        self._parts: list[Part] = []

    def add(self, part: Part) -> None:
        """Add one part of the results and print it."""
        self._parts.append(part)
        if part.on_screen:
            show(self._console, part)

    def write(self, about: dict[str, Any], json: Path | None) -> None:
        """Write all results."""
        self.folder.write(self._parts, self._about | about)
        if json is not None:
            shutil.copyfile(self.folder.path / "results.json", json)
        shutil.rmtree(self.scratch)
        self._console.print(f"written to {self.folder.path}")


def loop(
    setting: Setting,
    seconds: float | None,
    dyads: Sequence[int],
    output: Path | None,
    json: Path | None,
    *,
    skips: bool,
    force: bool,
) -> int:
    """Run ``netboard bench loop``.

    Parameters
    ----------
    seconds : float or None
        For how long each thing is measured; None for the usual time [s].
    dyads : sequence of int
        Of how many dyads a server is measured; none to leave that out [1].

    Returns
    -------
    int
        Exit code: 0, also if verdicts fail, for that is a result.
    """
    seconds = seconds or (QUICK_SECONDS if setting.quick else SECONDS)
    rounds = max(1, round(seconds / (QUICK_TURN_SECONDS if setting.quick else TURN_SECONDS)))
    with _study("loop", setting, output, force=force) as study:
        found = measure_loop(setting.config, study.scratch, setting.displays, seconds, rounds, study.tell)
        series = loop_series(found)
        study.add(latency_part(found, real_time=setting.real_time))
        study.add(lateness_part(found.played.ticks, found.timer, real_time=setting.real_time))
        verdict = server_verdict(found.costs["server"], found.echo_costs["echo"], setting.displays)
        study.add(costs_part(found.costs | found.echo_costs, verdict))
        study.add(histogram_part(series[0] | series[1]))
        if dyads or skips:
            with Crowd(study.scratch) as crowd:
                _add_crowded(study, crowd, setting.config, dyads, seconds / rounds, skips=skips)
        if find_spec("matplotlib") is not None:
            study.folder.save(draw_histograms(series, f"Stylus to force: {setting}"), "loop")
        study.write({"seconds": seconds, "rounds": rounds, "dyads": list(dyads)}, json)
    return 0


def _add_crowded(
    study: Study, crowd: Crowd, config: Config, dyads: Sequence[int], seconds: float, *, skips: bool
) -> None:
    """Measure with many simulated peers, or with peers that a lab does not have."""
    if dyads:
        found = measure_scale(config, crowd, dyads, seconds, study.tell)
        study.add(scale_part(found))
        most = max(found)
        study.add(waiting_part(most, measure_waiting(config, crowd, most, seconds, study.tell)))
    if skips:
        study.add(skips_part(measure_skips(config, crowd, seconds, study.tell)))
        study.add(tick_part(config))


def soak(
    setting: Setting, minutes: float | None, dyads: int, output: Path | None, json: Path | None, *, force: bool
) -> int:
    """Run ``netboard bench soak``."""
    minutes = minutes or (QUICK_MINUTES if setting.quick else MINUTES)
    with _study("soak", setting, output, force=force) as study:
        found = measure_soak(setting.config, study.scratch, dyads, setting.displays, 60 * minutes, study.tell)
        kept = records_part(found.kept)
        study.add(kept)
        study.add(memory_part(found.samples))
        study.add(minutes_part(found.kept))
        costs: Costs = {}
        add_costs(costs, found.samples[0], found.samples[-1])
        study.add(costs_part(costs))
        study.write({"minutes": minutes, "dyads": dyads}, json)
    return 0 if kept.holds else 1


@contextmanager
def _study(name: str, setting: Setting, output: Path | None, *, force: bool) -> Iterator[Study]:
    """Begin a study: report the machine, and show progress."""
    if not Path("/proc/self/task").exists():
        raise NetboardError("what processes use is read from /proc, which this system does not have")
    folder = Folder(output or new_folder(f"bench-{name}"), force=force)
    console = Console(highlight=False, markup=False)
    console.width = max(console.width, WIDTH)
    for line in (*describe().lines(), str(setting)):
        console.print(line)
    bar = Progress(TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), console=Console(stderr=True))
    with bar:
        task = bar.add_task("getting the kernels ready", total=1.0)
        make_stage(setting.config).warm()
        yield Study(
            name, setting, folder, console, lambda text, share: bar.update(task, description=text, completed=share)
        )
